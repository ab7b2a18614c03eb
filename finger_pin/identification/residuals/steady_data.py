"""Steady readings: closed forms of a scenario's tendons and servos, or the posture at rest, for every row."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from finger_pin.analysis import rubbing_cords, settled_posture, steady_state
from finger_pin.analysis.equilibrium import unsettled
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.loading import read_scenario
from finger_pin.description.parameters import Winch
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.identification.parameters.keys import corrections
from finger_pin.identification.parameters.parameters import ScenarioMap
from finger_pin.identification.residuals.recordings import Recording, RecordingModel, check_tension_sign
from finger_pin.mechanism.coerce import FingerLike, with_parameters_of
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array

# Change of a parameter for differences, part of its size or range.
_DIFFERENCE_SHARE = 1e-5
_POSTURE, _TENSIONS, _GOALS = "joint_position", ("tendon_command", "spool_tension"), ("spool_angle", "tendon_winding")
_OUTPUTS = ("tendon_tension", "tendon_friction", "motor_current", _POSTURE)


class SteadyReadings(RecordingModel):
    """Recording of steady states compared with a scenario.

    Attributes:
        recording: The recording.
        load: The pull at the entrance of the canals, N, or of wound tendons the angle or length, shape (m, a).
        wound_tendons: Tendons that a winch or a motor winds, by input.
        scenario: Whose states they are.
    """

    def __init__(self, recording: Recording, scenario: Scenario, replacement: Finger | None = None) -> None:
        """Find the inputs; a finger may replace the one that the scenario describes."""
        self.recording, self._entry = recording, f"identify.recordings.{recording.name}"
        goals = [name for name in recording.inputs if name.partition(".")[0] in _GOALS]
        actuators = scenario.finger.actuators.items()
        self._motor_of_tendon = {tendon: motor for motor, each in actuators for tendon in each.tendons}
        self.wound_tendons = {name: self._wound_tendon(scenario.finger, name) for name in goals}
        without_motor = [each for each in self.wound_tendons.values() if each not in self._motor_of_tendon]
        self.scenario = _with_windings(scenario, without_motor)
        finger, self._replacement = self.scenario.finger, replacement
        rows = len(recording.speed)
        joints, tendons = list(finger.joints), list(finger.actuated_names)
        self._inputs: list[tuple[str, Array, int]] = []
        self.load, self._position = np.zeros((rows, len(tendons))), np.zeros((rows, len(joints)))
        if scenario.simulation.initial is not None:
            for joint, angle in scenario.simulation.initial.position.items():
                self._position[:, joints.index(joint)] = angle
        self._read_inputs(joints, tendons)
        places = {"motor_current": list(finger.actuators), _POSTURE: joints}
        self._outputs = []
        for name in recording.outputs:
            variable, _, label = name.partition(".")
            if variable not in _OUTPUTS:
                raise InputError(f"{self._entry}.outputs.{name}", f"a steady state has {', '.join(_OUTPUTS)}")
            index = self._index(f"outputs.{name}", label, places.get(variable, tendons))
            self._outputs.append((variable, index))
            if variable == _POSTURE:
                recorded = recording.outputs[name]
                self._position[:, index] = np.where(np.isfinite(recorded), recorded, self._position[:, index])
        only_postures = {each for each, _ in self._outputs} == {_POSTURE}
        if self.wound_tendons and (recording.settings.speed is not None or not only_postures):
            allowed = "tells postures without friction: joint_position is compared, without a speed"
            raise InputError(f"{self._entry}.inputs.{goals[0]}", allowed)
        self._compares_posture = any(variable == _POSTURE for variable, _ in self._outputs)
        if self._compares_posture:
            self._check_rest()
            self.check({})

    def _read_inputs(self, joints: Sequence[str], tendons: Sequence[str]) -> None:
        """Put every input in its column of loads or angles."""
        for name, values in self.recording.inputs.items():
            variable, _, label = name.partition(".")
            if variable not in (*_TENSIONS, *_GOALS, _POSTURE):
                allowed = f"a steady state is given {', '.join([*_TENSIONS, *_GOALS])} and {_POSTURE}"
                raise InputError(f"{self._entry}.inputs.{name}", allowed)
            if variable in _TENSIONS:
                check_tension_sign(f"{self._entry}.inputs.{name}", values)
            group, labels = (self._position, joints) if variable == _POSTURE else (self.load, tendons)
            index = self._index(f"inputs.{name}", self.wound_tendons.get(name, label), labels)
            other = next((each for each, known, k in self._inputs if known is group and k == index), None)
            if other is not None:
                raise InputError(f"{self._entry}.inputs.{name}", f"is of the same cord as {other}: leave one out")
            group[:, index] = values
            self._inputs.append((name, group, index))

    def compute(self, scenario: Scenario, nuisance: Mapping[str, float]) -> list[Array]:
        """Return the computed values of every output, shape (m,) each."""
        settings = self.recording.settings
        load, position = self._corrected(nuisance)
        if self._compares_posture:
            position = self._settled_postures(scenario, load)
        at_rest = settings.at_rest or self._compares_posture
        by_name = {_POSTURE: position}
        if any(variable != _POSTURE for variable, _ in self._outputs):
            steady = steady_state(self._driven(scenario), load, self.recording.speed, position, at_rest)
            by_name |= {
                "tendon_tension": steady.tension,
                "tendon_friction": steady.friction,
                "motor_current": steady.current,
            }
        name = self.recording.name
        return [
            corrections(name, output, nuisance).column(by_name[variable][:, index])
            for output, (variable, index) in zip(self.recording.outputs, self._outputs, strict=True)
        ]

    def slopes(self, scenario_map: ScenarioMap, values: Array, sizes: Array) -> list[Array]:
        """Return the derivatives of the outputs by the values, shape (m, p) each; by differences."""
        columns, current = [], scenario_map(values)
        computed = self.compute(*current)

        def one_sided(k: int, change: float) -> tuple[float, list[Array]]:
            changed_values = values.copy()
            changed_values[k] += change
            try:
                changed = scenario_map(changed_values)
                # A parameter of another recording changes nothing.
                return changed_values[k], computed if changed == current else self.compute(*changed)
            except InputError:
                # At the edge of the allowed values there is one side only.
                return values[k], computed

        for k, size in enumerate(_DIFFERENCE_SHARE * sizes):
            ends = [one_sided(k, change) for change in (size, -size)]
            (right, up), (left, down) = ends
            columns.append([(u - d) / (right - left) for u, d in zip(up, down, strict=True)])
        return [np.stack(each, axis=1) for each in zip(*columns, strict=True)]

    def check(self, nuisance: Mapping[str, float]) -> None:
        """Raise an error for goals beyond the range of a motor's encoder."""
        load, _ = self._corrected(nuisance)
        for name, tendon in self.wound_tendons.items():
            if tendon not in self._motor_of_tendon:
                continue
            motor, index = self._motor_of_tendon[tendon], self.scenario.finger.actuated_names.index(tendon)
            actuator = self.scenario.finger.actuators[motor]
            angle, encoder = load[:, index], actuator.motor.encoder
            angle = angle if name.startswith("spool_angle.") else angle / actuator.radii[0]
            if encoder is not None and not encoder.range[0] <= angle.min() <= angle.max() <= encoder.range[1]:
                allowed = f"{self._entry}.inputs.{name} takes the spool from {angle.min():.4g} to {angle.max():.4g} rad"
                raise InputError(f"finger.actuators.{motor}.motor.encoder.range", allowed, list(encoder.range))

    def _corrected(self, nuisance: Mapping[str, float]) -> tuple[Array, Array]:
        """Return tensions, shape (m, a), N, and angles, (m, n), rad, with scales and offsets that are being found."""
        load, position = self.load.copy(), self._position.copy()
        for name, group, index in self._inputs:
            values = corrections(self.recording.name, name, nuisance).quantity(group[:, index])
            if group is self.load and name not in self.wound_tendons:
                # A tendon only pulls: a tension below zero by a wrong zero is that of a slack one.
                load[:, index] = np.maximum(values, 0.0)
            else:
                (load if group is self.load else position)[:, index] = values
        return load, position

    def _driven(self, scenario: Scenario) -> FingerLike:
        """Return the scenario's finger with its motors, or what replaces it, with the scenario's numbers."""
        if self._replacement is None:
            return scenario.finger
        return with_parameters_of(self._replacement, self.scenario, scenario)

    def _finger(self, scenario: Scenario) -> Finger:
        """Return the finger at rest, with sources and winches in place of motors."""
        finger, objects, driven = scenario.finger, scenario.environment.objects, self._driven(scenario)
        resting = _resting_finger(finger, self.wound_tendons.values()) if finger.actuators else finger
        if isinstance(driven, Finger):
            return driven.changed(resting, objects) if finger.actuators else driven
        return Finger(resting, objects=objects)

    def _settled_postures(self, scenario: Scenario, load: Array) -> Array:
        """Return the posture at rest of every row nearest to the recorded one, shape (m, n), rad."""
        finger, forces = self._finger(scenario), [each.fingertip_force for each in scenario.environments().values()]
        force, load = np.array(forces if len(forces) > 1 else forces[0]), load.copy()
        for name, tendon in self.wound_tendons.items():
            if tendon in self._motor_of_tendon:
                index, angle = scenario.finger.actuated_names.index(tendon), name.startswith("spool_angle.")
                load[:, index] = _wound_length(scenario.finger, self._motor_of_tendon[tendon], load[:, index], angle)
        speeds = [None] * len(load) if self.recording.settings.speed is None else self.recording.speed.tolist()
        rows = zip(load, speeds, self._position, strict=True)
        return np.array([settled_posture(finger, each, speed, guess, force) for each, speed, guess in rows])

    def _check_rest(self) -> None:
        """Refuse joints that are input and output, and directions and position drives that leave the rest open.

        Of many postures at rest, a direction of sliding tells one where a single tendon rubs and the joints do not.
        """
        posture = next((name for name in self.recording.inputs if name.startswith(_POSTURE)), None)
        if posture is not None:
            raise InputError(f"{self._entry}.inputs.{posture}", "is an output too: a posture is given or compared")
        finger = self._finger(self.scenario)
        pins = finger.joint_friction
        joints_rub = bool(np.any(pins.bearing & ((pins.kinetic > 0.0) | (pins.static > 0.0) | (pins.drag > 0.0))))
        cords = rubbing_cords(finger)
        several_tendons_rub = bool(np.any(cords)) and len(cords) > 1
        if self.recording.settings.speed is not None and (joints_rub or several_tendons_rub):
            rubbing = "joints rub" if joints_rub else "several tendons rub"
            allowed = (
                f"does not tell where the finger rests, as its {rubbing}: leave speed out for postures without "
                f"friction (shaken, or the mean of drawn in and let out), or set that friction to 0"
            )
            raise InputError(f"{self._entry}.speed", allowed)
        tensions = {each.partition(".")[2] for each in self.recording.inputs if each.startswith("spool_tension.")}
        for motor, entry, allowed in unsettled("tension", self.scenario.finger):
            tendons = self.scenario.finger.actuators[motor].tendons
            if not {*tendons} <= {*self.wound_tendons.values()} | tensions:
                inputs = f"spool_angle.{motor}, or spool_tension.{tendons[0]}"
                raise InputError(f"{self._entry}.inputs", f"lack what {motor} rests at: {inputs}, or {entry} {allowed}")

    def _wound_tendon(self, finger: FingerDescription, name: str) -> str:
        """Return the tendon that an input winds; refuse a motor whose goal does not tell where it rests."""
        variable, _, label = name.partition(".")
        if variable == "spool_angle":
            self._index(f"inputs.{name}", label, list(finger.actuators))
        motor = label if variable == "spool_angle" else self._motor_of_tendon.get(label)
        if motor is None:
            return label
        reasons = [f"{entry} {allowed}" for each, entry, allowed in unsettled("goal", finger) if each == motor]
        if reasons:
            raise InputError(f"{self._entry}.inputs.{name}", f"tells no rest: {', and '.join(reasons)}")
        return finger.actuators[motor].tendons[0]

    def _index(self, where: str, label: str, names: Sequence[str]) -> int:
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


def _resting_finger(finger: FingerDescription, wound_tendons: Collection[str]) -> FingerDescription:
    """Return a finger with ideal sources and winches in place of its motors, as they are at rest without friction.

    A position drive holds by its error e: its torque K_t V k_p e / R makes it a spring in series with its cord, T / K +
    r^2 T / (K_t V k_p / R). With an integral it stands at its goal. No motor holds more than K_t min(V / R, I_max).

    Args:
        finger: Whose motors wind one cord each where they are given goals.
        wound_tendons: Names of the tendons that these pull; of all others the tension is known.
    """
    tendons, cords = dict(finger.tendons), finger.drive_cords
    for actuator in finger.actuators.values():
        tendon, motor, radius = actuator.tendons[0], actuator.motor, float(actuator.radii[0])
        constant, resistance, _ = motor.constants
        maximum_tension = constant * min(motor.voltage / resistance, motor.maximum_current) / radius
        if tendon in wound_tendons:
            stiffness, loop = cords[tendon].stiffness, actuator.position_loop
            torque_per_error = constant * motor.voltage / resistance * loop.proportional
            if not loop.integral:
                stiffness *= torque_per_error / (torque_per_error + stiffness * radius**2)
            winch = Winch().updated(stiffness=stiffness)
            tendons[tendon] = tendons[tendon].updated(winch=winch, maximum_tension=maximum_tension)
        elif actuator.drive == "tension":
            tendons[tendon] = tendons[tendon].updated(maximum_tension=maximum_tension)
    return finger.updated(actuators={}, tendons=tendons)


def _wound_length(finger: FingerDescription, motor: str, goal: Array, is_angle: bool) -> Array:
    """Return the winding of the winch in place of a motor, m, for goals of its spool, rad, or of its cord, m."""
    actuator = finger.actuators[motor]
    slack = finger.drive_cords[actuator.tendons[0]].slack
    return np.asarray((actuator.radii[0] if is_angle else 1.0) * goal + slack)
