"""A scenario for a hand that is given as a tree: every actuator to and fro, one after the other."""

from __future__ import annotations

import math
from typing import Any

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.tree_actuators import TreeActuator

# Of the motion, Hz, and of the tensions of tendons that only pull, N.
_FREQUENCY = 0.5
_TENSION = 2.0
# Shares of an input's range: that a servo moves through, and that a motor exerts.
_SERVO, _MOTOR = 0.8, 0.1


def demo_motion(description: FingerDescription, duration: float = 4.0) -> dict[str, Any]:
    """Return the table of a scenario that moves a tree through its joints' ranges, for `read_scenario`.

    Servos go to and fro through most of their inputs' range, motors exert a small part of theirs. Phases differ from
    one actuator to the next, as in a wave.

    Args:
        description: With a tree, or a hand of trees.
        duration: s.
    """
    tree, kind = description.tree, "hand" if description.hand is not None else "finger"
    count = len(tree.actuators) + len(description.actuated_names)
    phases = iter(range(count))

    def swing(middle: float, half: float) -> dict[str, float]:
        phase = 2.0 * math.pi * next(phases) / count
        return {"offset": middle, "amplitude": half, "frequency": _FREQUENCY, "phase": phase}

    return {
        "name": description.name,
        "title": f"{description.name}: {'every actuator to and fro' if count else 'it falls, as nothing drives it'}",
        kind: (description.hand or description).model_dump(mode="python", exclude_none=True),
        "controller": {
            "kind": "tensions",
            "tensions": {name: swing(_TENSION, 0.5 * _TENSION) for name in description.actuated_names},
            "inputs": {name: swing(*_range(description, each)) for name, each in tree.actuators.items()},
        },
        "simulation": {"duration": duration, "initial": {"position": start_position(description)}},
    }


def start_position(description: FingerDescription) -> dict[str, float]:
    """Return where joints start if nothing else is said, rad: amid their ranges, or where a tree does.

    That is its first keyframe, or its references, within the ranges.
    """
    tree, position = description.tree, {}
    first = next(iter(tree.keyframes.values())).position if tree.keyframes else {}
    for name, joint in description.joints.items():
        lower, upper = joint.range
        start = 0.5 * (lower + upper)
        if name in tree.joints:
            reference = tree.joints[name].reference
            start = min(max(reference, lower), upper) if joint.limited else reference
        position[name] = first.get(name, start)
    return position


def idle_inputs(description: FingerDescription) -> list[str]:
    """Return the names of the actuators that the motion holds at zero, as their input has no range."""
    return [name for name, each in description.tree.actuators.items() if each.reach(description.joints) is None]


def _range(description: FingerDescription, actuator: TreeActuator) -> tuple[float, float]:
    """Return middle and half of the swing of an actuator's input."""
    servo = actuator.by_length * actuator.gain < 0.0
    lower, upper = actuator.reach(description.joints) or (0.0, 0.0)
    share = _SERVO if servo else _MOTOR
    middle = 0.5 * (lower + upper) if servo else 0.5 * share * (lower + upper)
    return middle, 0.5 * share * (upper - lower)
