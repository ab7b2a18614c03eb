"""Steady readings: closed forms of a scenario's tendons and servos, or the posture at rest, for every row."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from finger_pin.analysis import steady_state
from finger_pin.description.loading import read_scenario
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.identification.recordings import At, Recording, check_pulling
from finger_pin.identification.scenario_parameters import NuisanceParameter, nuisance_value
from finger_pin.identification.settled import settled_posture
from finger_pin.mechanism.coerce import with_parameters_of
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array

# Change of a number that slopes are taken by, of its size or its range.
_CHANGE = 1e-5
_POSTURE, _WINDING = "joint_position", "tendon_winding"
_OUTPUTS = ("tendon_tension", "tendon_friction", "motor_current", _POSTURE)


class SteadyReadings:
    """Recording of steady states compared with a scenario.

    Attributes:
        recording: The recording.
        load: The pull at the entrance of the canals, N, or of wound tendons the length, m, shape (m, a).
        wound: Names of the tendons that a winch winds.
        scenario: Whose states they are.
        nuisance_parameters: Nothing is to be found for them alone.
    """

    def __init__(self, recording: Recording, scenario: Scenario, replacing: Finger | None = None) -> None:
        """Find the inputs; a finger may replace the one that the scenario describes.

        Raises:
            InputError: If one names nothing that the scenario has, if the tension of a tendon is missing, if all of
                one are negative, or if no one direction of sliding tells where joints come to rest.
        """
        self.wound = tuple(name.partition(".")[2] for name in recording.inputs if name.startswith(f"{_WINDING}."))
        scenario = _with_windings(scenario, self.wound)
        self.recording, self.scenario, finger = recording, scenario, scenario.finger
        self._replacing = replacing
        self.nuisance_parameters: tuple[NuisanceParameter, ...] = ()
        self._entry = f"identify.recordings.{recording.name}"
        rows = len(recording.speed)
        joints, tendons = list(finger.joints), list(finger.actuated_names)
        self._inputs: list[tuple[str, Array, int]] = []
        self.load, self._position = np.zeros((rows, len(tendons))), np.zeros((rows, len(joints)))
        if scenario.simulation.initial is not None:
            for joint, angle in scenario.simulation.initial.position.items():
                self._position[:, joints.index(joint)] = angle
        for name, values in recording.inputs.items():
            variable, _, label = name.partition(".")
            if variable in ("tendon_command", "spool_tension", _WINDING):
                if variable != _WINDING:
                    check_pulling(f"{self._entry}.inputs.{name}", values)
                place = self._place(f"inputs.{name}", label, tendons)
                self.load[:, place] = values
                self._inputs.append((name, self.load, place))
            elif variable == "joint_position":
                place = self._place(f"inputs.{name}", label, joints)
                self._position[:, place] = values
                self._inputs.append((name, self._position, place))
            else:
                allowed = "a steady state is given tendon_command, spool_tension, tendon_winding and joint_position"
                raise InputError(f"{self._entry}.inputs.{name}", allowed)
        places = {"motor_current": list(finger.actuators), _POSTURE: joints}
        self._outputs = []
        for name in recording.outputs:
            variable, _, label = name.partition(".")
            if variable not in _OUTPUTS:
                raise InputError(f"{self._entry}.outputs.{name}", f"a steady state has {', '.join(_OUTPUTS)}")
            place = self._place(f"outputs.{name}", label, places.get(variable, tendons))
            self._outputs.append((variable, place))
            if variable == _POSTURE:
                recorded = recording.outputs[name]
                self._position[:, place] = np.where(np.isfinite(recorded), recorded, self._position[:, place])
        if self.wound and (recording.settings.speed is not None or {each for each, _ in self._outputs} != {_POSTURE}):
            allowed = "tells postures without friction: joint_position is compared, without a speed"
            raise InputError(f"{self._entry}.inputs.{_WINDING}.{self.wound[0]}", allowed)
        self._settles = any(variable == _POSTURE for variable, _ in self._outputs)
        if self._settles:
            self._check_direction()

    def compute(self, scenario: Scenario, nuisance: Mapping[str, float]) -> list[Array]:
        """Return the computed values of every output, shape (m,) each."""
        settings = self.recording.settings
        load, position = self._corrected(nuisance)
        if self._settles:
            position = self._settled(scenario, load)
        at_rest = settings.at_rest or self._settles
        steady = steady_state(scenario.finger, load, self.recording.speed, position, at_rest)
        by_name = {
            "tendon_tension": steady.tension,
            "tendon_friction": steady.friction,
            "motor_current": steady.current,
        }
        by_name[_POSTURE] = position
        name = self.recording.name
        return [
            nuisance_value(nuisance, name, output, "scale", 1.0) * by_name[variable][:, place]
            + nuisance_value(nuisance, name, output, "offset")
            for output, (variable, place) in zip(self.recording.outputs, self._outputs, strict=True)
        ]

    def slopes(self, at: At, values: Array, sizes: Array) -> list[Array]:
        """Return the derivatives of the outputs by the values, shape (m, p) each; by differences."""
        columns, here = [], at(values)
        computed = self.compute(*here)

        def end(k: int, change: float) -> tuple[float, list[Array]]:
            moved = values.copy()
            moved[k] += change
            try:
                there = at(moved)
                # What is of another recording changes nothing.
                return moved[k], computed if there == here else self.compute(*there)
            except InputError:
                # At the edge of what is allowed there is one side only.
                return values[k], computed

        for k, size in enumerate(_CHANGE * sizes):
            ends = [end(k, change) for change in (size, -size)]
            (right, up), (left, down) = ends
            columns.append([(u - d) / (right - left) for u, d in zip(up, down, strict=True)])
        return [np.stack(each, axis=1) for each in zip(*columns, strict=True)]

    def doubt(self, sought: Collection[str]) -> str:
        """Return an empty text: readings have no start."""
        return ""

    def check(self, nuisance: Mapping[str, float]) -> None:
        """Do nothing: readings are computed with any offsets and scales."""

    def tune(self, factor: float) -> None:
        """Do nothing: a closed form has no errors."""

    def _corrected(self, nuisance: Mapping[str, float]) -> tuple[Array, Array]:
        """Return tensions, shape (m, a), N, and angles, (m, n), rad, with scales and offsets that are being found."""
        load, position = self.load.copy(), self._position.copy()
        for name, group, place in self._inputs:
            scale = nuisance_value(nuisance, self.recording.name, name, "scale", 1.0)
            values = scale * group[:, place] + nuisance_value(nuisance, self.recording.name, name, "offset")
            if group is self.load and not name.startswith(f"{_WINDING}."):
                # A tendon only pulls: what a wrong zero takes below it is a slack one.
                load[:, place] = np.maximum(values, 0.0)
            else:
                (load if group is self.load else position)[:, place] = values
        return load, position

    def _finger(self, scenario: Scenario) -> Finger:
        if self._replacing is not None:
            return with_parameters_of(self._replacing, self.scenario, scenario)
        return Finger(scenario.finger, objects=scenario.environment.objects)

    def _settled(self, scenario: Scenario, load: Array) -> Array:
        """Return the posture at rest of every row nearest to the recorded one, shape (m, n), rad."""
        finger, forces = self._finger(scenario), [each.fingertip_force for each in scenario.environments().values()]
        force = np.array(forces if len(forces) > 1 else forces[0])
        speeds = [None] * len(load) if self.recording.settings.speed is None else self.recording.speed.tolist()
        rows = zip(load, speeds, self._position, strict=True)
        return np.array([settled_posture(finger, each, speed, near, force) for each, speed, near in rows])

    def _check_direction(self) -> None:
        """Refuse joints that are both input and output, and a direction that leaves the friction open.

        Of many postures at rest, a direction of sliding tells one where a single tendon rubs and the joints do not.
        """
        posture = next((name for name in self.recording.inputs if name.startswith(_POSTURE)), None)
        if posture is not None:
            raise InputError(f"{self._entry}.inputs.{posture}", "is an output too: a posture is given or compared")
        finger = self._finger(self.scenario)
        pins = finger.joint_friction
        joints_rub = bool(np.any(pins.bearing & ((pins.kinetic > 0.0) | (pins.static > 0.0) | (pins.drag > 0.0))))
        tendons_rub = bool(np.any((finger.tendons.surface > 0.0) | (finger.tendons.drag > 0.0)))
        several = tendons_rub and len(finger.tendons.surface) > 1
        if self.recording.settings.speed is not None and (joints_rub or several):
            rubbing = "joints rub" if joints_rub else "several tendons rub"
            allowed = (
                f"does not tell where the finger rests, as its {rubbing}: leave speed out for postures without "
                f"friction (shaken, or the mean of drawn in and let out), or set that friction to 0"
            )
            raise InputError(f"{self._entry}.speed", allowed)

    def _place(self, where: str, label: str, names: Sequence[str]) -> int:
        if label not in names:
            raise InputError(f"{self._entry}.{where}", f"there is no {label}; there are {', '.join(names) or 'none'}")
        return names.index(label)


def _with_windings(scenario: Scenario, tendons: Sequence[str]) -> Scenario:
    """Return a scenario with winches at some tendons; what they wind is given by the readings."""
    if not tendons:
        return scenario
    table = scenario.model_dump(mode="python", exclude_unset=True, exclude_none=True)
    controller = table.setdefault("controller", {})
    for name in tendons:
        controller.get("tensions", {}).pop(name, None)
        controller.setdefault("tendon_winding", {})[name] = {"offset": 0.0}
    return read_scenario(table)
