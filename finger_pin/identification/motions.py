"""Recorded motions: a scenario under recorded inputs, and its signals at the recorded times."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.core.stepping.trajectory import Trajectory
from finger_pin.core.threads import in_threads
from finger_pin.description.loading import read_scenario
from finger_pin.description.recordings.series import Series
from finger_pin.description.scenario import Scenario
from finger_pin.description.winding import WINDINGS
from finger_pin.exceptions import InputError, IntegrationError
from finger_pin.identification.recordings import At, Recording, check_pulling
from finger_pin.identification.scenario_parameters import NuisanceParameter, own_number
from finger_pin.mechanism.coerce import with_parameters_of
from finger_pin.mechanism.finger import Finger
from finger_pin.simulation.recording import RunArrays, recorded
from finger_pin.simulation.sampled_trajectory import SampledTrajectory
from finger_pin.simulation.sensitivity import changed, nearby, with_exact_encoders
from finger_pin.simulation.setup import Setup
from finger_pin.simulation.variables import coordinates
from finger_pin.typing import Array

# Where the inputs of a motion go in a scenario, by variable.
_INPUTS = {
    "tendon_command": ("controller", "tensions"),
    "spool_angle": ("controller", "spool_angle"),
    "tendon_winding": ("controller", "tendon_winding"),
    "motor_voltage": ("controller", "motor_voltage"),
    "actuator_input": ("controller", "inputs"),
    "joint_reference": ("reference", "joints"),
    "fingertip_force": ("environment", "fingertip_force_signal"),
}
# How far a start that is to be found may be from where it was recorded, rad.
_NEAR = 0.3
# Samples at a window's start that its position and velocity are read from.
_FIRST = 9
# Slopes are those of runs at so much larger tolerances, with errors of about 1e-2: a search needs no more, and at its
# end residuals and slopes are nearly orthogonal.
_SLOPES = 10.0
# Between which tolerances are, unless a scenario asks for others.
_FINEST, _ROUGHEST = 1e-10, 1e-4
# Where slopes are wilder than so many ranges of the signal, a larger change and steps of their own serve.
_WILD, _COARSE = 30.0, 1e-3


class RecordedMotion:
    """Recorded motion, or a window of one, compared with a scenario.

    Attributes:
        recording: The recording.
        rows: Which of its rows, shape (m,).
        scenario: Moved by the recorded inputs; its position drives read exact angles.
        own: Numbers of its own that are to be found: where its joints start.
    """

    def __init__(
        self,
        recording: Recording,
        scenario: Scenario,
        rows: NDArray[np.intp],
        window: int = 0,
        finger: Finger | None = None,
    ) -> None:
        """Put the inputs into the scenario; a finger may replace the one that it describes.

        Raises:
            InputError: If an input names nothing that the scenario has, or a start cannot be reached.
        """
        self.recording, self.rows = recording, rows
        self._entry = f"identify.recordings.{recording.name}"
        self._times = recording.time[rows] - recording.time[rows[0]]
        self.own: tuple[NuisanceParameter, ...] = ()
        table = copy.deepcopy(scenario.model_dump(mode="python", exclude_unset=True, exclude_none=True))
        self._put_inputs(table, scenario)
        first = float(recording.time[rows[0]])
        settings = {"duration": float(self._times[-1]), "sample_rate": 1.0 / float(self._times[-1])}
        table["simulation"] = {**table.get("simulation", {}), **settings}
        table["simulation"]["start_time"] = scenario.simulation.start_time + first
        self._put_start(table, scenario, window)
        # The steps of an encoder would make the likelihood as rough as what ends an interval.
        self.scenario = with_exact_encoders(read_scenario(table))
        self._finger = finger
        self._factor = 1.0

    def compute(self, scenario: Scenario, own: Mapping[str, float]) -> list[Array]:
        """Return the outputs at the recorded times, shape (m,) each; not a number if the run fails."""
        return self._made(scenario, own, self._factor)[0]

    def tune(self, factor: float) -> None:
        """Multiply the scenario's tolerances by a factor from now on."""
        self._factor = factor

    def slopes(self, at: At, values: Array, sizes: Array) -> list[Array]:
        """Return the derivatives of the outputs by the values, shape (m, p) each.

        Args:
            at: Maps values to a scenario and the numbers of this motion.
            values: Values of the parameters, shape (p,).
            sizes: Sizes of changes of the values, shape (p,).
        """
        here = at(values)
        factor = max(self._factor, _SLOPES)
        computed, motion = self._made(*here, factor)
        if motion is None:
            return [np.zeros((len(self.rows), len(values))) for _ in self.recording.outputs]
        there, changes = changed(values.tolist(), sizes.tolist(), lambda moved: at(np.array(moved)))
        feeling = [k for k, (scenario, own) in enumerate(there) if self._with_own(scenario, own) != motion[0].scenario]
        others = {k: self._setup(*there[k]) for k in feeling}
        # The unchanged one too, so that what a parameter does not touch differs by nothing, not by rounding.
        same = self._setup(*here)
        base, *near_by = nearby(motion[1], [same, *others.values()])
        near = dict(zip(feeling, near_by, strict=True))
        computed = self._outputs(same, base, here[1])
        ranges = [float(np.ptp(each)) for each in computed]

        def column(k: int) -> list[Array]:
            if there[k] == here:
                return [np.zeros(len(each)) for each in computed]
            found = self._outputs(others.get(k, same), near.get(k, base), there[k][1])
            slopes = [(f - c) / changes[k] for f, c in zip(found, computed, strict=True)]
            wild = any(
                not np.max(np.abs(each)) * float(sizes[k]) <= _WILD * size
                for each, size in zip(slopes, ranges, strict=True)
            )
            if wild:
                # Of a motion that hunts, what counts is the mean trend.
                moved = values.copy()
                moved[k] += np.sign(changes[k]) * _COARSE * float(sizes[k])
                # At the edge of what goes together there is no such change.
                with suppress(InputError):
                    found, _ = self._made(*at(moved), factor)
                    slopes = [(f - c) / (moved[k] - values[k]) for f, c in zip(found, computed, strict=True)]
            return [np.nan_to_num(each, nan=0.0) for each in slopes]

        columns = in_threads(column, range(len(values)))
        return [np.stack(each, axis=1) for each in zip(*columns, strict=True)]

    def _with_own(self, scenario: Scenario, own: Mapping[str, float]) -> Scenario:
        """Return a scenario with the starts of joints and the corrections of inputs that are being found."""
        for name, values in self.recording.inputs.items():
            numbers = [
                own_number(own, self.recording.name, name, what, default)
                for what, default in (("scale", 1.0), ("offset", 0.0), ("delay", 0.0))
            ]
            if numbers == [1.0, 0.0, 0.0]:
                continue
            (section, group), label = _INPUTS[name.partition(".")[0]], name.partition(".")[2]
            signals = dict(getattr(getattr(scenario, section), group) or {})
            if label not in signals:
                allowed = "has no scale, offset or delay to be found: it is of one finger of a hand"
                raise InputError(f"{self._entry}.inputs.{name}", allowed)
            corrected = numbers[0] * values + numbers[1]
            if name.startswith("tendon_command."):
                # A tendon only pulls: what a wrong zero takes below it is a slack one.
                corrected = np.maximum(corrected, 0.0)
            times = np.asarray(signals[label].times) - numbers[2]
            signals[label] = signals[label].updated(times=Series(times), values=Series(corrected))
            scenario = scenario.updated(**{section: {group: signals}})
        starts = {key.rpartition(".")[2]: value for key, value in own.items() if key in {o.key for o in self.own}}
        if not starts:
            return scenario
        initial = scenario.simulation.initial
        assert initial is not None
        return scenario.updated(simulation={"initial": {"position": {**initial.position, **starts}}})

    def _setup(self, scenario: Scenario, own: Mapping[str, float]) -> Setup:
        moved = self._with_own(scenario, own)
        finger = None if self._finger is None else with_parameters_of(self._finger, self.scenario, moved)
        return Setup.of(moved, ClosedLoop.from_scenario(moved, finger=finger), estimate_error=False)

    def _made(
        self, scenario: Scenario, own: Mapping[str, float], factor: float
    ) -> tuple[list[Array], tuple[Setup, Trajectory] | None]:
        """Return the outputs, not numbers if the motion fails, and the motion, at so much larger tolerances."""
        try:
            setup = self._setup(scenario, own)
            trajectory = setup.integrate(scenario=_tuned(setup.scenario, factor))
            failed = bool(trajectory.failure)
        except IntegrationError:
            failed = True
        if failed:
            return [np.full(len(self.rows), np.nan) for _ in self.recording.outputs], None
        return self._outputs(setup, trajectory, own), (setup, trajectory)

    def _outputs(self, setup: Setup, trajectory: Trajectory, own: Mapping[str, float]) -> list[Array]:
        """Return the outputs at the recorded times, with their own offsets, scales and delays."""
        name, settings, found = self.recording.name, self.recording.settings.outputs, []
        delays = {key: each.delay + own_number(own, name, key, "delay") for key, each in settings.items()}
        seen = {delay: self._seen(setup, trajectory, delay, delays) for delay in dict.fromkeys(delays.values())}
        for key, delay in delays.items():
            scale, offset = own_number(own, name, key, "scale", 1.0), own_number(own, name, key, "offset")
            found.append(np.asarray(scale * self._one(seen[delay], key) + offset))
        return found

    def _seen(self, setup: Setup, trajectory: Trajectory, delay: float, delays: Mapping[str, float]) -> RunArrays:
        """Return the variables of the outputs with a delay, at the instants that they are of."""
        names = dict.fromkeys(key.partition(".")[0] for key, own in delays.items() if own == delay)
        times = np.clip(self._times - delay, 0.0, float(trajectory.breakpoints[-1]))
        motions = SampledTrajectory(setup.loop, trajectory, times, tuple(names))
        found = recorded(motions, tuple(names), f"{self._entry}.outputs")
        return RunArrays(found, coordinates(setup.scenario, setup.loop, times), {})

    def _one(self, found: RunArrays, name: str) -> Array:
        """Return one column of a variable, by its labels."""
        variable, _, label = name.partition(".")
        values, (dims, *_) = found[variable], found.variables[variable]
        for axis, dim in reversed(list(enumerate(dims))[1:]):
            labels = [str(each) for each in found[dim]]
            if label not in labels:
                allowed = f"there is no {label}; there are {', '.join(labels)}"
                raise InputError(f"{self._entry}.outputs.{name}", allowed)
            values = np.take(values, labels.index(label), axis=axis)
        return values

    def _put_inputs(self, table: dict[str, Any], scenario: Scenario) -> None:
        for name, values in self.recording.inputs.items():
            variable, _, label = name.partition(".")
            if variable not in _INPUTS:
                raise InputError(f"{self._entry}.inputs.{name}", f"a motion is given {', '.join(_INPUTS)}")
            section, group = _INPUTS[variable]
            entries = table.setdefault(section, {})
            if variable == "tendon_command" and entries.get("kind") != "tensions":
                kept = {key: entries[key] for key in ("minimum_tension", "inputs", *WINDINGS) if key in entries}
                entries = table[section] = {"kind": "tensions", **kept}
            if variable == "tendon_command":
                check_pulling(f"{self._entry}.inputs.{name}", values)
                values = np.maximum(values, 0.0)
            delay = self.recording.settings.inputs[name].delay
            times = (self.recording.time - delay + scenario.simulation.start_time).tolist()
            samples = {"kind": "samples", "times": times, "values": values.tolist()}
            finger, dot, own = label.partition(".")
            into = entries.setdefault(group, {})
            if variable in ("spool_angle", "motor_voltage"):
                # What the scenario itself tells that motor is not what was recorded.
                for other in WINDINGS:
                    if other != group:
                        entries.get(other, {}).pop(label, None)
            if dot:
                into.setdefault(finger, {})[own] = samples
            else:
                into[label] = samples
        given = table.get("controller", {})
        if given.get("kind") == "tensions" and {*scenario.finger.actuated_names} <= {*given.get("tensions", {})}:
            # No tendon is left for it.
            given.pop("minimum_tension", None)

    def _put_start(self, table: dict[str, Any], scenario: Scenario, window: int) -> None:
        kind = self.recording.settings.start
        if kind == "rest":
            return
        positions, velocities = {}, {}
        for name, values in self.recording.outputs.items():
            variable, _, joint = name.partition(".")
            if variable == "joint_position" and joint in scenario.finger.joints:
                there = self.rows[:_FIRST][np.isfinite(values[self.rows[:_FIRST]])]
                if not len(there):
                    continue
                degree = 1 if len(there) > 3 else 0
                line = np.polyfit(self.recording.time[there] - self.recording.time[self.rows[0]], values[there], degree)
                positions[joint], velocities[joint] = float(line[-1]), float(line[0]) if degree else 0.0
        if not positions:
            raise InputError(f"{self._entry}.start", "needs joint_position among the outputs", kind)
        for joint, angle in positions.items():
            low, high = scenario.finger.joints[joint].range
            if not low - 0.2 <= angle <= high + 0.2:
                allowed = (
                    f"cannot be reached: {joint} begins at {angle:.3g} rad, and its range is {low:.3g} to {high:.3g}"
                )
                raise InputError(f"{self._entry}.start", allowed)
        initial = table["simulation"].setdefault("initial", {})
        initial["position"] = {**initial.get("position", {}), **positions}
        initial["velocity"] = {**initial.get("velocity", {}), **velocities}
        if kind == "found":
            prefix = f"recordings.{self.recording.name}.start.{window}"
            self.own = tuple(
                NuisanceParameter(f"{prefix}.{joint}", angle - _NEAR, angle + _NEAR, angle)
                for joint, angle in positions.items()
            )


def _tuned(scenario: Scenario, factor: float) -> Scenario:
    """Return a scenario with tolerances multiplied by a factor."""
    own = scenario.simulation
    rtol, atol = (
        min(max(factor * each, min(each, _FINEST)), max(each, _ROUGHEST)) for each in (own.rtol, own.atol_scale)
    )
    return scenario.updated(simulation={"rtol": rtol, "atol_scale": atol})
