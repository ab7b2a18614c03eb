"""Ranges of a finger's inputs, for those who choose them: policies, and sliders."""

from __future__ import annotations

import numpy as np

from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array

# Greatest tension by default, also that of stretched tendons on spools, N.
_DEFAULT_MAXIMUM = 20.0


def input_ranges(finger: Finger) -> tuple[Array, Array]:
    """Return least and largest inputs: tensions or, of winches, lengths, and what the actuators of a tree take."""
    description, winched, cords = finger.description, finger.routing.winched, finger.description.drive_cords
    excursion = finger.excursion(_corners(finger)).T if winched.any() else np.zeros((len(winched), 1))
    ranges = [
        (0.0, each.maximum_tension or _DEFAULT_MAXIMUM)
        if each.winch is None
        else (lengths.min(), lengths.max() + (each.maximum_tension or _DEFAULT_MAXIMUM) / cords[name].stiffness)
        for (name, each), lengths in zip(description.tendons.items(), excursion, strict=False)
    ]
    for name, actuator in description.tree.actuators.items():
        limits = actuator.reach(description.joints)
        if limits is None:
            raise InputError(
                f"{description.entry('tree.actuators', name)}.input_range",
                "is missing: actions and sliders need a least and a largest",
            )
        ranges.append(limits)
    low, high = np.array(ranges, dtype=float).reshape(-1, 2).T
    return low, high


def _corners(finger: Finger) -> Array:
    """Return the postures at the corners of the joints' ranges, shape (2^n, n), rad."""
    limiter = finger.stroke_limiter
    return np.array(np.meshgrid(*zip(limiter.lower, limiter.upper, strict=True))).reshape(len(limiter.lower), -1).T


def spool_ranges(finger: Finger) -> tuple[Array, Array]:
    """Return the least and the largest spool angles that postures need, and some stretch, shape (m,), rad."""
    actuators, corners = finger.actuators, _corners(finger)
    excursion = finger.excursion(corners)
    taut = actuators.angle(corners, None, excursion)
    stretched = actuators.angle(corners, np.full(excursion.shape, _DEFAULT_MAXIMUM), excursion)
    lowest, highest = taut.min(axis=0), stretched.max(axis=0)
    # Of tendons that are wound in together the one that needs most decides, not all on average.
    for motor in np.flatnonzero(np.sum(actuators.spools > 0.0, axis=0) > 1):
        cords = np.flatnonzero(actuators.spools[:, motor] > 0.0)
        angles = (excursion[:, actuators.tendons[cords]] - actuators.slack[cords]) / actuators.spools[cords, motor]
        stretch = _DEFAULT_MAXIMUM / actuators.stiffness[cords] / actuators.spools[cords, motor]
        lowest[motor], highest[motor] = angles.min(), (angles + stretch).max()
    return lowest, highest
