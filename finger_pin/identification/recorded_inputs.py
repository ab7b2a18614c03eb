"""Inputs of recorded motions: their entries in a scenario, and checks that something reads them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from finger_pin.description.recordings.bench import IMPOSED
from finger_pin.description.scenario import Scenario
from finger_pin.description.tables import Series
from finger_pin.description.winding import BY_NAME, WINDINGS
from finger_pin.exceptions import InputError
from finger_pin.identification.recordings import Recording, check_pulling
from finger_pin.identification.scenario_parameters import nuisance_value

# Where the inputs of a motion go in a scenario, by variable.
_INPUTS = {
    "tendon_command": ("controller", "tensions"),
    "spool_angle": ("controller", "spool_angle"),
    "tendon_winding": ("controller", "tendon_winding"),
    "motor_voltage": ("controller", "motor_voltage"),
    "supply_voltage": ("controller", "supply_voltage"),
    "actuator_input": ("controller", "inputs"),
    "joint_reference": ("reference", "joints"),
    "fingertip_force": ("environment", "fingertip_force_signal"),
}
# Those of which a motor is given one.
_OF_MOTORS = ("spool_angle", "motor_voltage")


def put_inputs(table: dict[str, Any], recording: Recording, scenario: Scenario) -> None:
    """Put the inputs of a motion into the table of a scenario.

    Raises:
        InputError: If one names nothing that a motion is given, two are of one motor, or a tension pushes.
    """
    entry = f"identify.recordings.{recording.name}"
    for name, values in recording.inputs.items():
        variable, _, label = name.partition(".")
        if variable == IMPOSED:
            continue
        if variable not in _INPUTS:
            raise InputError(f"{entry}.inputs.{name}", f"a motion is given {', '.join([*_INPUTS, IMPOSED])}")
        rivals = [f"{other}.{label}" for other in _OF_MOTORS if variable in _OF_MOTORS and other != variable]
        rival = next((each for each in rivals if each in recording.inputs), None)
        if rival is not None:
            raise InputError(f"{entry}.inputs.{name}", f"is of the same motor as {rival}: leave one out")
        section, group = _INPUTS[variable]
        entries = table.setdefault(section, {})
        if variable == "tendon_command" and entries.get("kind") != "tensions":
            kept = {key: entries[key] for key in ("minimum_tension", "inputs", *BY_NAME[1:]) if key in entries}
            entries = table[section] = {"kind": "tensions", **kept}
        if variable == "tendon_command":
            check_pulling(f"{entry}.inputs.{name}", values)
            values = np.maximum(values, 0.0)
        delay = recording.settings.inputs[name].delay
        times = (recording.time - delay + scenario.simulation.start_time).tolist()
        samples = {"kind": "samples", "times": times, "values": values.tolist()}
        finger, dot, local_label = label.partition(".")
        into = entries.setdefault(group, {})
        if variable in _OF_MOTORS:
            # What the scenario itself tells that motor is not what was recorded.
            for other in WINDINGS:
                if other != group:
                    entries.get(other, {}).pop(label, None)
        if dot:
            into.setdefault(finger, {})[local_label] = samples
        else:
            into[label] = samples
    controller = table.get("controller", {})
    if controller.get("kind") == "tensions" and {*scenario.finger.actuated_names} <= {*controller.get("tensions", {})}:
        # No tendon is left for it.
        controller.pop("minimum_tension", None)


def check_references(recording: Recording, scenario: Scenario) -> None:
    """Refuse recorded goals of joints without a controller that reads them.

    Raises:
        InputError: Naming the column.
    """
    parts = scenario.parts()
    for name in recording.inputs:
        variable, _, label = name.partition(".")
        part = parts.get(label.partition(".")[0]) or next(iter(parts.values()))
        controller, motors = part.controller, part.finger.actuators
        wound = {
            **(controller.spool_angle or {}),
            **(controller.motor_voltage or {}),
            **(controller.tendon_winding or {}),
        }
        follows = any(
            each.drive == "position" and not {motor, *each.tendons} & {*wound} for motor, each in motors.items()
        )
        if variable == "joint_reference" and controller.kind == "tensions" and not follows:
            allowed = 'is read by nobody: the controller is of kind "tensions", and no motor follows a reference'
            raise InputError(f"identify.recordings.{recording.name}.inputs.{name}", allowed)


class Corrections(NamedTuple):
    """Scale, offset and delay, s, of a column that are being found."""

    scale: float = 1.0
    offset: float = 0.0
    delay: float = 0.0


def corrections(recording: str, column: str, nuisance: Mapping[str, float]) -> Corrections:
    """Return the corrections of a column of a recording."""
    neutral = Corrections()._asdict().items()
    return Corrections(*(nuisance_value(nuisance, recording, column, what, default) for what, default in neutral))


def with_corrected_inputs(scenario: Scenario, recording: Recording, nuisance: Mapping[str, float]) -> Scenario:
    """Return a scenario with the scales, offsets and delays of a motion's inputs that are being found.

    Raises:
        InputError: If an input is of one finger of a hand.
    """
    for name, values in recording.inputs.items():
        if name.startswith(f"{IMPOSED}."):
            continue
        numbers = corrections(recording.name, name, nuisance)
        if numbers == Corrections():
            continue
        (section, group), label = _INPUTS[name.partition(".")[0]], name.partition(".")[2]
        signals = dict(getattr(getattr(scenario, section), group) or {})
        if label not in signals:
            allowed = "has no scale, offset or delay to be found: it is of one finger of a hand"
            raise InputError(f"identify.recordings.{recording.name}.inputs.{name}", allowed)
        corrected = numbers.scale * values + numbers.offset
        if name.startswith("tendon_command."):
            # A tendon only pulls: what a wrong zero takes below it is a slack one.
            corrected = np.maximum(corrected, 0.0)
        times = np.asarray(signals[label].times) - numbers.delay
        signals[label] = signals[label].updated(times=Series(times), values=Series(corrected))
        scenario = scenario.updated(**{section: {group: signals}})
    return scenario
