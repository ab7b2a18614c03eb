"""Inputs and starts of recorded motions: their entries in a scenario, and what their columns start with."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.commands import BY_NAME, WINDINGS
from finger_pin.description.recordings.bench import IMPOSED
from finger_pin.description.scenario import Scenario
from finger_pin.description.tables import Series
from finger_pin.exceptions import InputError
from finger_pin.identification.parameters.keys import Corrections, corrections
from finger_pin.identification.residuals.recordings import Recording, check_tension_sign

# Number of samples at a window's start for the line that gives its position and velocity.
_START_SAMPLES = 9
# Distance of a start from the recorded one above which to warn, part of the joint's range.
_FAR_START_SHARE = 0.1
# Section and entry of a scenario for every input of a motion, by variable.
_SCENARIO_ENTRIES = {
    "tendon_command": ("controller", "tensions"),
    "spool_angle": ("controller", "spool_angle"),
    "tendon_winding": ("controller", "tendon_winding"),
    "motor_voltage": ("controller", "motor_voltage"),
    "supply_voltage": ("controller", "supply_voltage"),
    "actuator_input": ("controller", "inputs"),
    "joint_reference": ("reference", "joints"),
    "fingertip_force": ("environment", "fingertip_force_signal"),
}
# Inputs that pull or push, by their table of a controller; a supply only limits what a loop asks for.
_COMMANDS = {
    group: variable
    for variable, (section, group) in _SCENARIO_ENTRIES.items()
    if section == "controller" and variable != "supply_voltage"
}
# Inputs of motors, of which each may have one.
_MOTOR_INPUTS = ("spool_angle", "motor_voltage")


@dataclass(frozen=True, eq=False)
class RecordedStart:
    """Line through the first samples of a joint's column.

    Attributes:
        column: Its name.
        angle: At the first sample, rad.
        speed: rad/s.
        delay: Known delay of the column, s.
    """

    column: str
    angle: float
    speed: float
    delay: float

    def corrected(self, recording: str, nuisance: Mapping[str, float]) -> tuple[float, float]:
        """Return angle, rad, and speed, rad/s, of the joint with a scale, offset and delay that are being found."""
        scale, offset, delay = corrections(recording, self.column, nuisance)
        return scale * (self.angle + self.speed * (self.delay + delay)) + offset, scale * self.speed


def recorded_starts(recording: Recording, rows: NDArray[np.intp], joints: Collection[str]) -> dict[str, RecordedStart]:
    """Return the starts of rows of a recording, by joint, without joints that are not read there."""
    starts = {}
    for name, values in recording.outputs.items():
        variable, _, joint = name.partition(".")
        samples = rows[:_START_SAMPLES][np.isfinite(values[rows[:_START_SAMPLES]])]
        if variable != "joint_position" or joint not in joints or not len(samples):
            continue
        degree = 1 if len(samples) > 3 else 0
        line = np.polyfit(recording.time[samples] - recording.time[rows[0]], values[samples], degree)
        delay = recording.settings.outputs[name].delay
        starts[joint] = RecordedStart(name, float(line[-1]), float(line[0]) if degree else 0.0, delay)
    return starts


def far_start_warning(
    recording: Recording, starts: Mapping[str, RecordedStart], position: Mapping[str, float], scenario: Scenario
) -> str:
    """Return a warning about a joint whose motion starts far from its recording's start; empty without any."""
    for joint, start in starts.items():
        low, high = scenario.finger.joints[joint].range
        angle = start.corrected(recording.name, {})[0]
        if abs(angle - position[joint]) > _FAR_START_SHARE * (high - low):
            return (
                f"identify.recordings.{recording.name}: {joint} begins at {angle:.3g} rad, and the scenario starts at "
                f'{position[joint]:.3g} rad; with start = "recorded" it starts where the recording does'
            )
    return ""


def put_inputs(table: dict[str, Any], recording: Recording, scenario: Scenario) -> None:
    """Put the inputs of a motion into the table of a scenario."""
    entry = f"identify.recordings.{recording.name}"
    for name, values in recording.inputs.items():
        variable, _, label = name.partition(".")
        if variable == IMPOSED:
            continue
        if variable not in _SCENARIO_ENTRIES:
            raise InputError(f"{entry}.inputs.{name}", f"a motion is given {', '.join([*_SCENARIO_ENTRIES, IMPOSED])}")
        rivals = [f"{other}.{label}" for other in _MOTOR_INPUTS if variable in _MOTOR_INPUTS and other != variable]
        rival = next((each for each in rivals if each in recording.inputs), None)
        if rival is not None:
            raise InputError(f"{entry}.inputs.{name}", f"is of the same motor as {rival}: leave one out")
        section, group = _SCENARIO_ENTRIES[variable]
        entries = table.setdefault(section, {})
        if variable == "tendon_command" and entries.get("kind") != "tensions":
            inherited = {key: entries[key] for key in ("minimum_tension", *BY_NAME[1:]) if key in entries}
            entries = table[section] = {"kind": "tensions", **inherited}
        if variable == "tendon_command":
            check_tension_sign(f"{entry}.inputs.{name}", values)
            values = np.maximum(values, 0.0)
        column = recording.settings.inputs[name]
        times = (recording.time - column.delay + scenario.simulation.start_time).tolist()
        samples = {"kind": column.signal_kind, "times": times, "values": values.tolist()}
        finger, is_of_hand, finger_label = label.partition(".")
        signals = entries.setdefault(group, {})
        if variable in _MOTOR_INPUTS:
            # The recorded input replaces the scenario's own of that motor.
            for other in WINDINGS:
                if other != group:
                    entries.get(other, {}).pop(label, None)
        if is_of_hand:
            signals.setdefault(finger, {})[finger_label] = samples
        else:
            signals[label] = samples
    controller = table.get("controller", {})
    if controller.get("kind") == "tensions" and {*scenario.finger.actuated_names} <= {*controller.get("tensions", {})}:
        # No tendon is left without a recorded tension.
        controller.pop("minimum_tension", None)


def without_commands(scenario: Scenario, recording: Recording) -> tuple[Scenario, list[str]]:
    """Return a scenario with zero in place of its own commands, and the names of those that a recording does not give.

    What pulled while efforts were recorded is among the recording's inputs or `values`. A controller stays where it
    reads recorded goals of joints.
    """
    controller = scenario.controller
    given = (*recording.inputs, *recording.settings.values)
    dropped: list[str] = []
    if controller.kind == "proportional" and not any(name.startswith("joint_reference.") for name in given):
        controller = type(controller)(kind="tensions")
        dropped = [f"tendon_command.{tendon}" for tendon in scenario.finger.actuated_names]

    def without(settings: Any, path: str) -> Any:
        entries: dict[str, Any] = {}
        for group, variable in _COMMANDS.items():
            signals = getattr(settings, group) or {}
            kept = {
                label: each
                for label, each in signals.items()
                if any(f"{key}.".startswith(f"{path}.{group}.{label}.") for key in given)
            }
            if len(kept) < len(signals):
                entries[group] = kept
                dropped.extend(f"{variable}.{label}" for label in signals if label not in kept)
        if settings.kind == "tensions" and f"{path}.minimum_tension" not in given:
            entries["minimum_tension"] = 0.0
            if "minimum_tension" in settings.model_fields_set and np.any(settings.minimum_tension):
                dropped.append(f"{path}.minimum_tension")
        return settings.updated(**entries) if entries else settings

    fingers = {name: without(each, f"controller.fingers.{name}") for name, each in (controller.fingers or {}).items()}
    controller = without(controller, "controller").updated(**({"fingers": fingers} if fingers else {}))
    return scenario.updated(controller=controller), [name for name in dropped if name not in recording.inputs]


def check_references(recording: Recording, scenario: Scenario) -> None:
    """Refuse recorded goals of joints without a controller that reads them."""
    parts = scenario.parts()
    for name in recording.inputs:
        variable, _, label = name.partition(".")
        part = parts.get(label.partition(".")[0]) or next(iter(parts.values()))
        controller, motors = part.controller, part.finger.actuators
        prescribed = {
            **(controller.spool_angle or {}),
            **(controller.motor_voltage or {}),
            **(controller.tendon_winding or {}),
        }
        follows_reference = any(
            each.drive == "position" and not {motor, *each.tendons} & {*prescribed} for motor, each in motors.items()
        )
        if variable == "joint_reference" and controller.kind == "tensions" and not follows_reference:
            allowed = 'is read by nobody: the controller is of kind "tensions", and no motor follows a reference'
            raise InputError(f"identify.recordings.{recording.name}.inputs.{name}", allowed)


def with_corrected_inputs(scenario: Scenario, recording: Recording, nuisance: Mapping[str, float]) -> Scenario:
    """Return a scenario with the scales, offsets and delays of a motion's inputs that are being found."""
    for name, values in recording.inputs.items():
        if name.startswith(f"{IMPOSED}."):
            continue
        correction = corrections(recording.name, name, nuisance)
        if correction == Corrections():
            continue
        (section, group), label = _SCENARIO_ENTRIES[name.partition(".")[0]], name.partition(".")[2]
        signals = dict(getattr(getattr(scenario, section), group) or {})
        if label not in signals:
            allowed = "has no scale, offset or delay to be found: it is of one finger of a hand"
            raise InputError(f"identify.recordings.{recording.name}.inputs.{name}", allowed)
        corrected = correction.quantity(values)
        if name.startswith("tendon_command."):
            # A tendon only pulls: a tension below zero by a wrong zero is that of a slack one.
            corrected = np.maximum(corrected, 0.0)
        times = np.asarray(signals[label].times) - correction.delay
        signals[label] = signals[label].updated(times=Series(times), values=Series(corrected))
        scenario = scenario.updated(**{section: {group: signals}})
    return scenario
