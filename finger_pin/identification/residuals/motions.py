"""Recorded motions: a scenario under recorded inputs, and its signals at the recorded times."""

from __future__ import annotations

import copy
from collections.abc import Collection, Mapping
from contextlib import suppress
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from finger_pin.control import ClosedLoop
from finger_pin.core.steps.trajectory import Trajectory
from finger_pin.description.loading import read_scenario
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError, IntegrationError
from finger_pin.identification.parameters.keys import Corrections, corrections
from finger_pin.identification.parameters.parameters import NuisanceParameter, ScenarioMap
from finger_pin.identification.residuals.recorded_inputs import (
    check_references,
    far_start_warning,
    put_inputs,
    recorded_starts,
    with_corrected_inputs,
)
from finger_pin.identification.residuals.recordings import RANGE_MARGIN, Recording, RecordingModel, wraparound_warning
from finger_pin.mechanism.coerce import with_parameters_of
from finger_pin.mechanism.finger import Finger
from finger_pin.simulation.recording import RunArrays
from finger_pin.simulation.sensitivity import make_variations, repeat_steps, with_exact_encoders
from finger_pin.simulation.setup import Setup
from finger_pin.threads import in_threads
from finger_pin.typing import Array

# Tolerances of runs for slopes over the scenario's: slopes err by about 1e-2, and a search needs no more, as residuals
# and slopes are nearly orthogonal at its end.
_SLOPE_TOLERANCE = 10.0
# Least and greatest tolerance, unless the scenario's is beyond. Beyond the greatest, slopes of `to_and_fro` and
# `winding` err by as much as themselves; up to it, by a tenth.
_LEAST_TOLERANCE, GREATEST_TOLERANCE = 1e-10, 1e-4
# Slope, in ranges of the signal over the range of the parameter, above which it is computed by runs with their own time
# steps, and the change of the parameter for that, part of its range.
_STEEP_SLOPE, _LARGE_CHANGE = 30.0, 1e-3
# Half range of an estimated start about the recorded one, rad.
_START_MARGIN = 0.3
# Steps per row of a recording from which on a run is slow.
_SLOW_STEPS_PER_ROW = 4


class RecordedMotion(RecordingModel):
    """Recorded motion, or a window of one, compared with a scenario.

    Attributes:
        recording: The recording.
        rows: Which of its rows, shape (m,).
        scenario: Moved by the recorded inputs; its position drives read exact angles.
        nuisance_parameters: Numbers of this motion alone that are to be found: where its joints start.
    """

    def __init__(
        self,
        recording: Recording,
        scenario: Scenario,
        rows: NDArray[np.intp],
        window: int = 0,
        finger: Finger | None = None,
    ) -> None:
        """Put the inputs into the scenario; a finger may replace the one that it describes."""
        self.recording, self.rows = recording, rows
        self._entry = f"identify.recordings.{recording.name}"
        self._start_time = float(recording.time[rows[0]])
        self._times = recording.time[rows] - self._start_time
        self._read_imposed_motion(scenario)
        table = copy.deepcopy(scenario.model_dump(mode="python", exclude_unset=True, exclude_none=True))
        put_inputs(table, recording, scenario)
        settings = {"duration": float(self._times[-1]), "sample_rate": 1.0 / float(self._times[-1])}
        table["simulation"] = {**table.get("simulation", {}), **settings}
        table["simulation"]["start_time"] = scenario.simulation.start_time + self._start_time
        self._set_start(table, scenario, window)
        # The steps of an encoder would make the likelihood as rough as what ends an interval.
        self.scenario = with_exact_encoders(read_scenario(table))
        check_references(recording, self.scenario)
        self._finger = finger
        self._tolerance_factor = 1.0

    def warnings(self, searched_keys: Collection[str]) -> list[str]:
        """Return warnings about angles that wrap around, or a start far from the recorded one.

        Nothing is said of a start whose columns' zeros are sought.
        """
        jumps = wraparound_warning(self.recording)
        if jumps:
            return [jumps]
        starts = {} if self.recording.settings.start != "rest" else self._starts
        prefix = f"recordings.{self.recording.name}."
        starts = {joint: each for joint, each in starts.items() if f"{prefix}{each.column}.offset" not in searched_keys}
        if not starts:
            return []
        loop = self._setup(self.scenario, {}).loop
        position = loop.finger.layout.unpack(loop.initial_state()).position
        positions = dict(zip(loop.finger.routing.joints, position, strict=True))
        return [*filter(None, [far_start_warning(self.recording, starts, positions, self.scenario)])]

    def check(self, nuisance: Mapping[str, float]) -> None:
        """Raise the error of offsets and scales of inputs with which the motion cannot be computed."""
        corrected = self._with_nuisance(self.scenario, nuisance)
        # Searches move checked scenarios without another check.
        read_scenario(corrected.model_dump(mode="python", exclude_unset=True, exclude_none=True))
        self._setup(self.scenario, nuisance)

    def compute(self, scenario: Scenario, nuisance: Mapping[str, float]) -> list[Array]:
        """Return the outputs at the recorded times, shape (m,) each; not a number if the run fails."""
        return self._run(scenario, nuisance, self._tolerance_factor)[0]

    def ringing(self, scenario: Scenario, nuisance: Mapping[str, float]) -> str:
        """Return a warning about what rings almost undamped and makes the run slow; empty without any."""
        run = self._run(scenario, nuisance, self._tolerance_factor)[1]
        return "" if run is None else run[0].ringing(run[1], _SLOW_STEPS_PER_ROW * len(self.rows))

    def with_tolerances(self, factor: float) -> Self:
        """Return the model with the scenario's tolerances multiplied by a factor."""
        twin = copy.copy(self)
        twin._tolerance_factor = factor
        return twin

    def slopes(self, scenario_map: ScenarioMap, values: Array, sizes: Array) -> list[Array]:
        """Return the derivatives of the outputs by the values, shape (m, p) each, along the steps of one run."""
        current = scenario_map(values)
        factor = max(self._tolerance_factor, _SLOPE_TOLERANCE)
        base_outputs, motion = self._run(*current, factor)
        if motion is None:
            return [np.zeros((len(self.rows), len(values))) for _ in self.recording.outputs]
        changed_points, changes = make_variations(
            values.tolist(), sizes.tolist(), lambda point: scenario_map(np.array(point))
        )
        affected = [
            k
            for k, (scenario, nuisance) in enumerate(changed_points)
            if self._with_nuisance(scenario, nuisance) != motion[0].scenario
            or self._imposed_corrections(nuisance) != self._imposed_corrections(current[1])
        ]
        setups = {k: self._setup(*changed_points[k]) for k in affected}
        # Repeat the unchanged run too, so that outputs that a parameter does not affect differ by exactly zero.
        base_setup = self._setup(*current)
        base_run, *neighbours = repeat_steps(motion[1], [base_setup, *setups.values()])
        runs = dict(zip(affected, neighbours, strict=True))
        computed = base_outputs if base_run.failure else self._outputs(base_setup, base_run, current[1])
        ranges = [float(np.ptp(each)) for each in base_outputs]

        def column(k: int) -> list[Array]:
            if changed_points[k] == current:
                return [np.zeros(len(each)) for each in computed]
            if not (base_run.failure or runs.get(k, base_run).failure):
                outputs = self._outputs(setups.get(k, base_setup), runs.get(k, base_run), changed_points[k][1])
                slopes = [(f - c) / changes[k] for f, c in zip(outputs, computed, strict=True)]
                pairs = zip(slopes, ranges, strict=True)
                if all(np.max(np.abs(each)) * float(sizes[k]) <= _STEEP_SLOPE * size for each, size in pairs):
                    return slopes
            # Of a hunting motion the mean trend matters, and a sticking one may fail with the steps of another.
            offset = np.where(np.arange(len(values)) == k, np.sign(changes[k]) * _LARGE_CHANGE * float(sizes[k]), 0.0)
            for point in (values + offset, values - offset):
                # At the edge of the allowed values there is no such change.
                with suppress(InputError):
                    outputs, run = self._run(*scenario_map(point), factor)
                    if run is not None:
                        return [(f - c) / (point[k] - values[k]) for f, c in zip(outputs, base_outputs, strict=True)]
            # Without slopes the parameter's interval is that of its bounds.
            return [np.zeros(len(each)) for each in computed]

        columns = in_threads(column, range(len(values)))
        return [np.stack(each, axis=1) for each in zip(*columns, strict=True)]

    def _with_nuisance(self, scenario: Scenario, nuisance: Mapping[str, float]) -> Scenario:
        """Return a scenario with the starts of joints and the corrections of inputs that are being found."""
        scenario = with_corrected_inputs(scenario, self.recording, nuisance)
        if self.recording.settings.start == "rest":
            return scenario
        recorded = {joint: each.corrected(self.recording.name, nuisance) for joint, each in self._starts.items()}
        starts = {joint: angle for joint, (angle, _) in recorded.items()}
        starts |= {
            joint: nuisance[each.key]
            for joint, each in zip(starts, self.nuisance_parameters, strict=False)
            if each.key in nuisance
        }
        speeds, initial = {joint: speed for joint, (_, speed) in recorded.items()}, scenario.simulation.initial
        assert initial is not None
        if starts.items() <= initial.position.items() and speeds.items() <= initial.velocity.items():
            return scenario
        initial_state = {"position": {**initial.position, **starts}, "velocity": {**initial.velocity, **speeds}}
        return scenario.updated(simulation={"initial": initial_state})

    def _setup(self, scenario: Scenario, nuisance: Mapping[str, float]) -> Setup:
        corrected = self._with_nuisance(scenario, nuisance)
        return Setup.from_scenario(corrected, self._loop(corrected, nuisance))

    def _loop(self, scenario: Scenario, nuisance: Mapping[str, float]) -> ClosedLoop:
        finger = None if self._finger is None else with_parameters_of(self._finger, self.scenario, scenario)
        return ClosedLoop.from_scenario(scenario, finger=finger)

    def _read_imposed_motion(self, scenario: Scenario) -> None:
        """Read the imposed motion of joints: none here."""

    def _imposed_corrections(self, nuisance: Mapping[str, float]) -> dict[str, Corrections]:
        """Return the corrections of joints with imposed motion, by column: none here."""
        return {}

    def _run(
        self, scenario: Scenario, nuisance: Mapping[str, float], factor: float
    ) -> tuple[list[Array], tuple[Setup, Trajectory] | None]:
        """Return the outputs, not numbers if the run fails, and the run, with tolerances multiplied by a factor."""
        try:
            setup = self._setup(scenario, nuisance)
            trajectory = setup.integrate(scenario=_with_scaled_tolerances(setup.scenario, factor))
            failed = bool(trajectory.failure)
        except IntegrationError:
            failed = True
        if failed:
            return [np.full(len(self.rows), np.nan) for _ in self.recording.outputs], None
        return self._outputs(setup, trajectory, nuisance), (setup, trajectory)

    def _outputs(self, setup: Setup, trajectory: Trajectory, nuisance: Mapping[str, float]) -> list[Array]:
        """Return the outputs at the recorded times, with their offsets, scales and delays."""
        settings = self.recording.settings.outputs
        corrected = {key: corrections(self.recording.name, key, nuisance) for key in settings}
        delays = {key: each.delay + corrected[key].delay for key, each in settings.items()}
        by_delay = {delay: self._at_delay(setup, trajectory, delay, delays) for delay in dict.fromkeys(delays.values())}
        return [
            corrected[key].column(labelled(by_delay[delay], key, f"{self._entry}.outputs"))
            for key, delay in delays.items()
        ]

    def _at_delay(self, setup: Setup, trajectory: Trajectory, delay: float, delays: Mapping[str, float]) -> RunArrays:
        """Return the variables of the outputs with a delay, at the instants before it."""
        names = dict.fromkeys(key.partition(".")[0] for key, lag in delays.items() if lag == delay)
        times = np.clip(self._times - delay, 0.0, float(trajectory.breakpoints[-1]))
        return setup.record(trajectory, times, tuple(names), f"{self._entry}.outputs")

    def _set_start(self, table: dict[str, Any], scenario: Scenario, window: int) -> None:
        kind, entry = self.recording.settings.start, f"{self._entry}.start"
        self._starts = recorded_starts(self.recording, self.rows, scenario.finger.joints)
        if kind == "rest":
            return
        if not self._starts:
            raise InputError(entry, "needs joint_position among the outputs", kind)
        name = self.recording.name
        starts = {joint: each.corrected(name, {}) for joint, each in self._starts.items()}
        for joint, (angle, _) in starts.items():
            low, high = scenario.finger.joints[joint].range
            if not low - RANGE_MARGIN <= angle <= high + RANGE_MARGIN:
                allowed = f"{joint} begins at {angle:.3g} rad, and its range is {low:.3g} to {high:.3g}"
                raise InputError(entry, f"cannot be reached: {allowed}")
        initial = table["simulation"].setdefault("initial", {})
        for k, what in enumerate(("position", "velocity")):
            initial[what] = {**initial.get(what, {}), **{joint: start[k] for joint, start in starts.items()}}
        if kind == "found":
            self.nuisance_parameters = [
                NuisanceParameter(f"recordings.{name}.start.{window}.{joint}", q - _START_MARGIN, q + _START_MARGIN, q)
                for joint, (q, _) in starts.items()
            ]


def labelled(run: RunArrays, name: str, entry: str, values: Array | None = None) -> Array:
    """Return a signal of a run by its labels, shape (m,), or the difference of two, as in ``spool_tension.A-B``.

    Args:
        run: The run.
        name: The signal.
        entry: Which an error names.
        values: In place of those of the variable, shape (m, labels of its dimensions, ...).
    """
    variable, _, label = name.partition(".")
    values, (dims, *_) = run[variable] if values is None else values, run.variables[variable]
    parts = label.split(".") if len(dims) > 2 else [label]
    if len(parts) != max(len(dims) - 1, 1):
        raise InputError(f"{entry}.{name}", f"must be {'.'.join((variable, *map(str.upper, dims[1:])))}")
    for axis, dim in reversed(list(enumerate(dims))[1:]):
        labels, label = [str(each) for each in run[dim]], parts[axis - 1]
        # A pair of bodies in contact has a name with a hyphen.
        columns = [label] if label in labels else label.split("-")
        missing = next((each for each in columns if each not in labels), None)
        if missing is not None or len(columns) > 2:
            allowed = f"there is no {missing or label}; there are {', '.join(labels)}, and A-B for a difference"
            raise InputError(f"{entry}.{name}", allowed)
        first, *rest = (np.take(values, labels.index(each), axis=axis) for each in columns)
        values = first - rest[0] if rest else first
    return values


def _with_scaled_tolerances(scenario: Scenario, factor: float) -> Scenario:
    """Return a scenario with tolerances multiplied by a factor."""
    settings = scenario.simulation
    rtol, atol = (
        min(max(factor * each, min(each, _LEAST_TOLERANCE)), max(each, GREATEST_TOLERANCE))
        for each in (settings.rtol, settings.atol_scale)
    )
    return scenario.updated(simulation={"rtol": rtol, "atol_scale": atol})
