"""Wrenches of actuators on bodies of a tree, as legs of a path."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from finger_pin.description.tree_actuators import Wrench
from finger_pin.mechanism.body_places import Placed
from finger_pin.mechanism.path_elements import PathElement, PathTerm, Place
from finger_pin.mechanism.spans import COUPLE, RISE, THRUST
from finger_pin.typing import Array


def wrench_legs(placed: Mapping[str | None, Placed], wrench: Wrench, gear: float) -> tuple[PathTerm, ...]:
    """Return the legs whose arms are those of a wrench, times a gear.

    Along the axes of another body its force is that of a rise there, and its torque t that of three couples of forces
    t x r / 2 across the body's unit vectors r, whose moments r x (t x r) / 2 sum up to t, whichever way these turn.
    With the body's own axes it is two forces that turn with it: F - f at its point p and f at p + a, with f = t x a for
    a unit vector a across t.
    """
    body, point, force, torque = (
        placed[wrench.body],
        *(np.array(each) for each in (wrench.position, wrench.force, wrench.torque)),
    )
    if wrench.axes == "body":
        lever = _across(torque)
        pair = np.cross(torque, lever)
        pushes = [(point, force - pair), (point + lever, pair)]
        turned = [(body.place(tuple(at - push)), body.place(tuple(at))) for at, push in pushes if np.any(push)]
        return tuple(_leg(PathElement(THRUST, np.zeros(0), each), gear) for each in turned)
    other, legs = placed[wrench.other], list[PathTerm]()
    if size := float(np.linalg.norm(force)):
        upright = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), force / size).matrix()
        frame, rise = other.frame * pin.SE3(upright, np.zeros(3)), np.eye(len(RISE.parameters))[1]
        between = other.place(wrench.other_position), body.place(wrench.position)
        legs.append(_leg(PathElement(RISE, rise, between, other.joint, frame), gear * size))
    if np.any(torque):
        start = body.place((0.0, 0.0, 0.0))
        for unit in np.eye(3):
            ends = start, Place(body.joint, start.point + unit)
            legs.append(_leg(PathElement(COUPLE, 0.5 * torque, ends, other.joint, other.frame), gear))
    return tuple(legs)


def _leg(piece: PathElement, arm: float) -> PathTerm:
    return PathTerm(piece, arm=arm, bends=False)


def _across(vector: Array) -> Array:
    """Return a unit vector across another one, any for zero."""
    across = np.cross(np.eye(3)[int(np.argmin(np.abs(vector)))], vector)
    size = float(np.linalg.norm(across))
    return across / size if size else np.eye(3)[0]
