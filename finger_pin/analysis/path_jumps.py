"""Places where the length of a path jumps: where a wrap changes sides, or comes and goes at once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from finger_pin.description.caching import memoised
from finger_pin.description.validation import finite_vector
from finger_pin.mechanism.coerce import FingerLike, as_finger
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.path_elements import PathElement, PathTerm, path_kinematics
from finger_pin.typing import Array

# Postures of a joint that are compared, steps of bisection between two of them, the smallest jump, m, and the part of
# a joint's range beside a posture that counts, too.
_POSTURES, _HALVINGS, _LEAST, _BESIDE = 61, 36, 1e-5, 0.02


class PathJump(NamedTuple):
    """A jump of a cord's length as one joint turns.

    Attributes:
        cord: Name of the tendon.
        wrap: Name of the waypoint over which its path jumps.
        joint: Name of the joint.
        position: Of the joint, rad or m.
        size: How much longer the cord is beyond, m.
    """

    cord: str
    wrap: str
    joint: str
    position: float
    size: float

    def __str__(self) -> str:
        """Return the jump in one clause."""
        return f"{self.cord} over {self.wrap} by {1e3 * self.size:.3g} mm at {self.joint} {self.position:.4g}"


def path_jumps(finger: FingerLike, position: Sequence[float] | Array) -> tuple[PathJump, ...]:
    """Return the jumps of wrapped paths over the range of every joint and about a posture, the others as there.

    A length that is smooth changes by its arm: where it does not between two postures, and neither does in ever
    smaller parts of that way, it jumps. Of every wrap and joint the largest is found, of at least 0.01 mm.

    Args:
        finger: A finger.
        position: theta, shape (n,), rad.
    """
    finger = as_finger(finger)
    return _jumps(finger, finite_vector("position", position, len(finger.routing.joints)))


# Runs of a study share paths and start.
@memoised(lambda finger, theta: (finger.paths, theta.tobytes()))
def _jumps(finger: Finger, theta: Array) -> tuple[PathJump, ...]:
    wraps = _wraps(finger)
    if not wraps:
        return ()
    legs = [(PathTerm(piece),) for _, _, piece in wraps]
    jumps = []
    for index, (name, joint) in enumerate(finger.description.joints.items()):

        def along(angle: float, index: int = index) -> Array:
            q = theta.copy()
            q[index] = angle
            kinematics = path_kinematics(finger.rigid_body, q, legs, len(q))
            return np.stack([kinematics.length, kinematics.arm[:, index]], axis=-1)

        # A joint may lie beyond its range, and stop a little before a jump there.
        beside = theta[index] + _BESIDE * np.ptp(joint.range) * np.array([-1.0, 1.0])
        angles = np.linspace(min(*joint.range, *beside), max(*joint.range, *beside), _POSTURES)
        if not np.any([along(angle)[:, 1] for angle in (angles[0], theta[index], angles[-1])]):
            continue
        curves = np.array([along(angle) for angle in angles])
        missing = np.abs(_unexplained(curves[:-1], curves[1:], np.diff(angles)[:, None]))
        for row in np.flatnonzero(missing.max(axis=0) > _LEAST):
            first = int(missing[:, row].argmax())
            low, high = ((angles[k], curves[k, row]) for k in (first, first + 1))
            for _ in range(_HALVINGS):
                middle = 0.5 * (low[0] + high[0])
                between = middle, along(middle)[row]
                before, after = (
                    abs(_unexplained(one[1], other[1], other[0] - one[0]))
                    for one, other in ((low, between), (between, high))
                )
                low, high = (low, between) if before > after else (between, high)
            size = float(high[1][0] - low[1][0])
            if abs(size) > _LEAST:
                cord, wrap, _ = wraps[row]
                jumps.append(PathJump(cord, wrap, name, float(low[0]), size))
    return tuple(jumps)


def path_jump_advice(finger: Finger, position: Array, near: float = math.inf) -> str:
    """Return where paths jump, in one line; empty where none does.

    Args:
        finger: The finger.
        position: theta, shape (n,), rad.
        near: Parts of a joint's range from the posture within which jumps count.
    """
    joints = finger.description.joints
    shares = {name: (at, np.ptp(joint.range)) for (name, joint), at in zip(joints.items(), position, strict=False)}
    found = [
        str(jump)
        for jump in path_jumps(finger, position)
        # The range of a joint without limits says nothing of where it goes.
        if abs(jump.position - shares[jump.joint][0]) <= near * shares[jump.joint][1]
        and (near < math.inf or joints[jump.joint].limited)
    ]
    return f"the length of a cord jumps: {', '.join(found)}; put side points across the paths" if found else ""


def _unexplained(first: Array, second: Array, step: Array | float) -> Array:
    """Return the change of lengths that arms do not explain; pairs (length, arm) stand in the last axis."""
    return np.asarray(second[..., 0] - first[..., 0] - 0.5 * step * (first[..., 1] + second[..., 1]))


def _wraps(finger: Finger) -> list[tuple[str, str, PathElement]]:
    """Return the pieces of cords over wraps, with the names of cord and wrap."""
    return [
        (name, leg.wrap[0], finger.paths.pieces[leg])
        for name, cord in finger.paths.cords.items()
        for part in cord.parts
        for leg in part.elements
        if leg.wrap is not None
    ]
