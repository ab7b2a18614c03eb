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
from finger_pin.mechanism.groups import TIES
from finger_pin.mechanism.path_elements import path_kinematics
from finger_pin.typing import Array

# Distance within which a fingertip has reached a point, m.
_REACHED_DISTANCE = 1e-6
# Weight of the distance to the preferred posture, m/rad: it decides between postures that all reach.
_POSTURE_WEIGHT = 1e-9
# Weight of couplings and loops against the distance, m/rad, and Newton steps that project the posture onto them.
_CONSTRAINT_WEIGHT, _PROJECTION_STEPS = 1e3, 3
# Half range of joints that are moved along paths, about their place, rad or m.
_PATH_MARGIN = 1e-9
# Shares of the joints' ranges at which searches start, and greatest number of their combinations.
_START_SHARES, _MAX_STARTS = (0.1, 0.5, 0.9), 27


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
        return self.distance < _REACHED_DISTANCE


def _constraints(finger: Finger) -> Callable[[Array], tuple[Array, Array]]:
    """Return a function of theta: residuals of couplings and loops, shape (k,), and their slopes, (k, n)."""
    joints = len(finger.routing.joints)
    is_free = ~finger.led_joints
    tables = [table for table in finger.mechanism.rows if table.group in ("coupling", TIES, "loop")]
    if not tables:
        return lambda theta: (np.zeros(0), np.zeros((0, joints)))
    arm = np.concatenate([table.arm[:, :joints] for table in tables])
    paths = [legs for table in tables for legs in table.paths]
    rest = np.concatenate([table.parameters[table.law.parameters.index("rest")] for table in tables])

    def residuals(theta: Array) -> tuple[Array, Array]:
        kinematics = path_kinematics(finger.rigid_body, theta, paths, joints)
        return arm @ theta + kinematics.length - rest, (arm + kinematics.arm) * is_free

    return residuals


def inverse_kinematics(
    finger: FingerLike,
    point: Sequence[float] | Array,
    *,
    near: Sequence[float] | Array | None = None,
    tip: str | None = None,
) -> TipPosture:
    """Return the posture, within the joints' ranges, whose fingertip is nearest to a point.

    Joints that passive tendons drive both ways follow the others as (4) has it, H_c theta = -l_0 in their rows: tendons
    that carry nothing. Couplings and loops of a tree are kept to. Of several postures that reach the point it is one
    near the wanted posture.

    Args:
        finger: One finger.
        point: Of the fingertip, shape (3,), m, base frame.
        near: theta that is preferred, shape (n,), rad; by default the angles of the ranges nearest to zero.
        tip: Name of the fingertip, where a tree has several.
    """
    finger = at_tip(as_finger(finger), tip)
    one_finger(finger.description)
    target = np.array(finite_vector("point", point, 3))
    low, high = (np.clip(each, -np.pi, np.pi) for each in (finger.stroke_limiter.lower, finger.stroke_limiter.upper))
    preferred = np.clip(0.0, low, high) if near is None else np.array(finite_vector("near", near, len(low)))
    # What is moved along paths stays.
    low = np.where(finger.led_joints, preferred - _PATH_MARGIN, low)
    high = np.where(finger.led_joints, preferred + _PATH_MARGIN, high)
    coupling = PassiveCoupling.from_routing(finger.routing, finger.tendons.slack, bands=False)
    free = coupling.free
    followers, free_matrix = list(coupling.followers), coupling.matrix[:, free]
    body, constraints = finger.rigid_body, _constraints(finger)

    def residuals(angles: Array) -> Array:
        theta = coupling.posture(angles)
        # A driven joint has a range as well: what is beyond it counts as if the tip were as far away, m/rad.
        beyond = np.maximum(0.0, low - theta)[followers] + np.maximum(0.0, theta - high)[followers]
        misfit = _CONSTRAINT_WEIGHT * constraints(theta)[0]
        distance = _POSTURE_WEIGHT * (theta - preferred)
        return np.concatenate([body.tip_position(theta) - target, beyond, misfit, distance])

    def slopes(angles: Array) -> Array:
        theta = coupling.posture(angles)
        side = (theta > high).astype(float) - (theta < low)
        misfit = _CONSTRAINT_WEIGHT * constraints(theta)[1] @ free_matrix
        beyond = (side[:, None] * free_matrix)[followers]
        return np.concatenate([body.jacobian(theta) @ free_matrix, beyond, misfit, _POSTURE_WEIGHT * free_matrix])

    span = high[free] - low[free]
    starts = [np.clip(preferred[free], low[free], high[free])]
    combinations = islice(product(_START_SHARES, repeat=len(free)), _MAX_STARTS)
    starts += [low[free] + np.array(shares) * span for shares in combinations]
    solutions: list[tuple[float, Array]] = []
    for start in starts:
        # Strictly inside, as bounded least squares want it.
        inside = np.clip(start, low[free] + 1e-6 * span, high[free] - 1e-6 * span)
        best = scipy.optimize.least_squares(
            residuals, inside, slopes, (low[free], high[free]), xtol=1e-15, ftol=1e-15, gtol=1e-15
        )
        solutions.append((float(best.cost), coupling.posture(best.x)))
        tip_reached = np.linalg.norm(residuals(best.x)[: 3 + len(followers)]) < 0.01 * _REACHED_DISTANCE
        if tip_reached and np.linalg.norm(constraints(solutions[-1][1])[0]) < 0.01 * _REACHED_DISTANCE:
            break
    theta = _project_onto_couplings(min(solutions, key=lambda solution: solution[0])[1], constraints, low, high)
    tip_position = np.asarray(body.tip_position(theta))
    return TipPosture(theta, tip_position, float(np.linalg.norm(tip_position - target)))


def _project_onto_couplings(
    theta: Array, constraints: Callable[[Array], tuple[Array, Array]], low: Array, high: Array
) -> Array:
    """Return the nearest posture within the ranges that satisfies a tree's couplings and loops."""
    for _ in range(_PROJECTION_STEPS):
        residual, by_theta = constraints(theta)
        if residual.size:
            theta = np.clip(theta - np.linalg.pinv(by_theta) @ residual, low, high)
    if constraints(theta)[0].size and np.linalg.norm(constraints(theta)[0]) > _REACHED_DISTANCE:
        raise InputError("finger.tree", "no posture within the joints' ranges keeps to its couplings and loops")
    return theta
