"""The posture whose fingertip is at a point."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import islice, product

import numpy as np
import scipy

from finger_pin.analysis.printing import BriefRepr
from finger_pin.description.coupling import PassiveCoupling
from finger_pin.description.validation import finite_vector
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import FingerLike, as_finger, at_tip, one_finger
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.path_elements import path_kinematics
from finger_pin.typing import Array

# A fingertip this close, m, is there.
_THERE = 1e-6
# Weight of a posture near the wanted one against the distance, m/rad: it decides between postures that all reach.
_NEAR = 1e-9
# Weight of couplings and loops against the distance, m/rad, and steps that bring the posture found onto them.
_CONSTRAINT_WEIGHT, _LAST_STEPS = 1e3, 3
# How far what is moved along paths may be from its place, rad or m.
_STAYS = 1e-9
# Shares of the joints' ranges from which a search begins, and most of their combinations.
_STARTS, _MOST = (0.1, 0.5, 0.9), 27


@dataclass(frozen=True, eq=False, repr=False)
class TipPosture(BriefRepr):
    """The posture whose fingertip is nearest to a point.

    Attributes:
        position: theta, shape (n,), rad.
        tip: Position of the fingertip, shape (3,), m, base frame.
        distance: From the point, m.
    """

    position: Array
    tip: Array
    distance: float

    @property
    def reached(self) -> bool:
        """Whether the fingertip is at the point, to a micrometre."""
        return self.distance < _THERE


def _constraints(finger: Finger) -> Callable[[Array], tuple[Array, Array]]:
    """Return a function of theta: by how much couplings and loops are missed, shape (k,), and its slopes, (k, n)."""
    joints = len(finger.routing.joints)
    moves = ~finger.led_joints
    tables = [table for table in finger.mechanism.rows if table.group in ("coupling", "loop")]
    if not tables:
        return lambda theta: (np.zeros(0), np.zeros((0, joints)))
    arm = np.concatenate([table.arm[:, :joints] for table in tables])
    paths = [legs for table in tables for legs in table.paths]
    rest = np.concatenate([table.parameters[table.law.parameters.index("rest")] for table in tables])

    def missed(theta: Array) -> tuple[Array, Array]:
        kinematics = path_kinematics(finger.rigid_body, theta, paths, joints)
        return arm @ theta + kinematics.length - rest, (arm + kinematics.arm) * moves

    return missed


def inverse_kinematics(
    finger: FingerLike,
    point: Sequence[float] | Array,
    *,
    near: Sequence[float] | Array | None = None,
    tip: str | None = None,
) -> TipPosture:
    """Return the posture, within the joints' ranges, whose fingertip is nearest to a point.

    Joints that passive tendons drive follow the others as (4) has it, H_c theta = 0 in their rows: tendons that carry
    nothing. Couplings and loops of a tree are kept to. Of several postures that reach the point it is one near the
    wanted posture.

    Args:
        finger: One finger.
        point: Of the fingertip, shape (3,), m, base frame.
        near: theta that is preferred, shape (n,), rad; by default the angles of the ranges nearest to zero.
        tip: Name of the fingertip, where a tree has several.

    Raises:
        InputError: If the point or the preferred posture has a wrong size, it is a hand, there is no such fingertip, or
            no posture keeps to the couplings of a tree.
    """
    finger = at_tip(as_finger(finger), tip)
    one_finger(finger.description)
    target = np.array(finite_vector("point", point, 3))
    low, high = (np.clip(each, -np.pi, np.pi) for each in (finger.stroke_limiter.lower, finger.stroke_limiter.upper))
    wanted = np.clip(0.0, low, high) if near is None else np.array(finite_vector("near", near, len(low)))
    # What is moved along paths stays.
    low, high = (np.where(finger.led_joints, wanted + half, each) for half, each in ((-_STAYS, low), (_STAYS, high)))
    coupling = PassiveCoupling.inextensible(finger.routing)
    free = coupling.free
    followers, moved = list(coupling.followers), coupling.matrix[:, free]
    body, constraints = finger.rigid_body, _constraints(finger)

    def misses(angles: Array) -> Array:
        theta = moved @ angles
        # A driven joint has a range as well: what is beyond it counts as if the tip were as far away, m/rad.
        beyond = np.maximum(0.0, low - theta)[followers] + np.maximum(0.0, theta - high)[followers]
        off = _CONSTRAINT_WEIGHT * constraints(theta)[0]
        return np.concatenate([body.tip_position(theta) - target, beyond, off, _NEAR * (theta - wanted)])

    def slopes(angles: Array) -> Array:
        theta = moved @ angles
        side = (theta > high).astype(float) - (theta < low)
        off = _CONSTRAINT_WEIGHT * constraints(theta)[1] @ moved
        return np.concatenate([body.jacobian(theta) @ moved, (side[:, None] * moved)[followers], off, _NEAR * moved])

    span = high[free] - low[free]
    starts = [np.clip(wanted[free], low[free], high[free])]
    starts += [low[free] + np.array(shares) * span for shares in islice(product(_STARTS, repeat=len(free)), _MOST)]
    solutions: list[tuple[float, Array]] = []
    for start in starts:
        # Strictly inside, as bounded least squares want it.
        inside = np.clip(start, low[free] + 1e-6 * span, high[free] - 1e-6 * span)
        best = scipy.optimize.least_squares(
            misses, inside, slopes, (low[free], high[free]), xtol=1e-15, ftol=1e-15, gtol=1e-15
        )
        solutions.append((float(best.cost), moved @ best.x))
        near_enough = np.linalg.norm(misses(best.x)[: 3 + len(followers)]) < 0.01 * _THERE
        if near_enough and np.linalg.norm(constraints(moved @ best.x)[0]) < 0.01 * _THERE:
            break
    theta = _onto_couplings(min(solutions, key=lambda solution: solution[0])[1], constraints, low, high)
    reached = np.asarray(body.tip_position(theta))
    return TipPosture(theta, reached, float(np.linalg.norm(reached - target)))


def _onto_couplings(
    theta: Array, constraints: Callable[[Array], tuple[Array, Array]], low: Array, high: Array
) -> Array:
    """Return the nearest posture within the ranges that satisfies a tree's couplings and loops.

    Raises:
        InputError: If there is none.
    """
    for _ in range(_LAST_STEPS):
        off, by_theta = constraints(theta)
        if off.size:
            theta = np.clip(theta - np.linalg.pinv(by_theta) @ off, low, high)
    if constraints(theta)[0].size and np.linalg.norm(constraints(theta)[0]) > _THERE:
        raise InputError("finger.tree", "no posture within the joints' ranges keeps to its couplings and loops")
    return theta
