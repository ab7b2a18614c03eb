"""Ranges of a finger's inputs, for those who choose them: policies, and sliders."""

from __future__ import annotations

import numpy as np

from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array

# Tension that may be asked for by default, and by which a tendon on a spool may be stretched, N.
_STRONGEST = 20.0


def input_ranges(finger: Finger) -> tuple[Array, Array]:
    """Return least and largest inputs: tensions or, of winches, lengths, and what the actuators of a tree take.

    Raises:
        InputError: If an actuator's input has no range, and it holds no joint whose range would say.
    """
    description, winched = finger.description, finger.routing.winched
    drawn = finger.excursion(_corners(finger)).T if winched.any() else np.zeros((len(winched), 1))
    ends = [
        (0.0, each.maximum_tension or _STRONGEST)
        if each.winch is None
        else (lengths.min(), lengths.max() + (each.maximum_tension or _STRONGEST) / each.winch.stiffness)
        for each, lengths in zip(description.tendons.values(), drawn, strict=False)
    ]
    for name, actuator in description.tree.actuators.items():
        reach = actuator.reach(description.joints[actuator.joint].range if actuator.joint else None)
        if reach is None:
            raise InputError(
                f"finger.tree.actuators.{name}.input_range",
                "is missing: actions and sliders need a least and a largest",
            )
        ends.append(reach)
    low, high = np.array(ends, dtype=float).reshape(-1, 2).T
    return low, high


def _corners(finger: Finger) -> Array:
    """Return the postures at the corners of the joints' ranges, shape (2^n, n), rad."""
    limiter = finger.stroke_limiter
    return np.array(np.meshgrid(*zip(limiter.lower, limiter.upper, strict=True))).reshape(len(limiter.lower), -1).T


def spool_ranges(finger: Finger) -> tuple[Array, Array]:
    """Return the least and the largest spool angles that postures need, and some stretch, shape (m,), rad."""
    actuators, corners = finger.actuators, _corners(finger)
    drawn = finger.excursion(corners)
    taut = actuators.angle(corners, None, drawn)
    stretched = actuators.angle(corners, np.full(drawn.shape, _STRONGEST), drawn)
    least, most = taut.min(axis=0), stretched.max(axis=0)
    # Of tendons that are wound in together the one that needs most decides, not all on average.
    for motor in np.flatnonzero(np.sum(actuators.spools > 0.0, axis=0) > 1):
        wound = np.flatnonzero(actuators.spools[:, motor] > 0.0)
        angles = (drawn[:, actuators.tendons[wound]] - actuators.slack[wound]) / actuators.spools[wound, motor]
        stretch = _STRONGEST / actuators.stiffness[wound] / actuators.spools[wound, motor]
        least[motor], most[motor] = angles.min(), (angles + stretch).max()
    return least, most
