"""One fingertip force: its largest size along a direction, and the tensions that it needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from finger_pin.analysis.printing import BriefRepr
from finger_pin.analysis.tip_statics import (
    INFEASIBLE,
    UNBOUNDED,
    Friction,
    Slip,
    TipStatics,
    command_bounds,
    posture,
    slips,
)
from finger_pin.description.validation import finite_vector
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import FingerLike, as_finger, at_tip
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array


@dataclass(frozen=True, eq=False, repr=False)
class RequiredTension(BriefRepr):
    """The tensions that a fingertip force needs, those with the least maximum.

    Attributes:
        largest: The largest command, N.
        command: f^a, shape (a,), N.
        strands: Delivered tensions f, shape (s,), N.
        by_radius: Derivative of ``largest`` with respect to every winding radius, shape (t, n), N/m; zero where a
            tendon does not cross. One-sided where the solution is degenerate.
    """

    largest: float
    command: Array
    strands: Array
    by_radius: Array


def largest_force(
    finger: FingerLike,
    position: Sequence[float] | Array,
    direction: Sequence[float] | Array,
    maximum_tension: float | tuple[float, ...],
    *,
    minimum_tension: float | tuple[float, ...] = 0.0,
    friction: Friction = Friction.NONE,
    tip: str | None = None,
) -> float:
    """Return the largest force that the fingertip can exert straight along a direction, N; negative if only backwards.

    Args:
        finger: A finger with force closure.
        position: theta, shape (n,), rad.
        direction: Of E, shape (3,), base frame; its length does not matter.
        maximum_tension: Greatest f^a, N, one number or one per actuated tendon.
        minimum_tension: Least f^a, N, likewise.
        friction: Of any kind.
        tip: Name of the fingertip, where a tree has several.

    Returns:
        The force; infinite where the structure carries it, not a number where no force along this line can be held.
    """
    finger = at_tip(as_finger(finger), tip)
    theta, bounds = posture(finger, position), command_bounds(finger, minimum_tension, maximum_tension)
    vector = finite_vector("direction", direction, 3)
    length = float(np.linalg.norm(vector))
    if not length > 0.0:
        raise InputError("direction", "must not be zero", vector.tolist())
    unit = vector / length
    worst = np.inf
    for choices in slips(finger, finger.rigid_body.jacobian(theta), unit, friction):
        best = max(_largest(finger, theta, unit, friction, slip, bounds) for slip in choices)
        if best == -np.inf:
            return float("nan")
        worst = min(worst, best)
    return worst


def _largest(finger: Finger, theta: Array, unit: Array, friction: Friction, slip: Slip | None, bounds: Any) -> float:
    """Return the largest force along a direction for one pattern of slip, N; minus infinity if there is none."""
    statics = TipStatics.from_finger(finger, theta, friction, slip)
    extra = (statics.jacobian.T @ unit)[:, None]
    if slip is not None:
        extra = extra + (slip.joints * finger.joint_friction.kinetic)[:, None]
    cost = np.append(-1.0, np.zeros(sum(statics.sizes)))
    solution = statics.solve(cost, extra, [(None, None), *bounds], np.zeros(len(theta)))
    if solution.status == INFEASIBLE:
        return -np.inf
    return np.inf if solution.status == UNBOUNDED else float(solution.x[0])


def tension_for_force(
    finger: FingerLike,
    position: Sequence[float] | Array,
    force: Sequence[float] | Array,
    *,
    minimum_tension: float | tuple[float, ...] = 0.0,
    friction: Friction = Friction.NONE,
    tip: str | None = None,
) -> RequiredTension:
    """Return the tensions with the least maximum at which the fingertip exerts a force.

    Args:
        finger: A finger with force closure.
        position: theta, shape (n,), rad.
        force: E = -F, shape (3,), N, base frame; zero holds the finger against its weight.
        minimum_tension: Least f^a, N, one number or one per actuated tendon.
        friction: Of any kind; HELPING gives what holds at least, HINDERING what surely pushes.
        tip: Name of the fingertip, where a tree has several.
    """
    finger = at_tip(as_finger(finger), tip)
    theta, bounds = posture(finger, position), command_bounds(finger, minimum_tension, np.inf)
    tip_force = finite_vector("force", force, 3)
    jacobian = finger.rigid_body.jacobian(theta)
    required_tensions: list[RequiredTension] = []
    for choices in slips(finger, jacobian, tip_force, friction):
        solutions = [_least_tension(finger, theta, tip_force, friction, slip, bounds) for slip in choices]
        candidates = [each for each in solutions if each is not None]
        if not candidates:
            raise InputError("force", "no tensions, however large, exert it", tip_force.tolist())
        required_tensions.append(min(candidates, key=lambda required: required.largest))
    return max(required_tensions, key=lambda required: required.largest)


def _least_tension(
    finger: Finger, theta: Array, tip_force: Array, friction: Friction, slip: Slip | None, bounds: Any
) -> RequiredTension | None:
    """Return the tensions with the least maximum for one pattern of slip, or None."""
    statics = TipStatics.from_finger(finger, theta, friction, slip)
    demand = statics.jacobian.T @ tip_force
    if slip is not None:
        demand = demand + slip.joints * finger.joint_friction.kinetic * np.linalg.norm(tip_force)
    a, s, n = statics.sizes
    cost, largest = np.append(1.0, np.zeros(a + s + n)), [(0.0, None)]
    # z is the largest command: an inequality for each.
    below_largest = np.hstack([-np.ones((a, 1)), np.eye(a)])
    solution = statics.solve(cost, np.zeros((n, 1)), [*largest, *bounds], demand, below_largest)
    if solution.status != 0:
        return None
    tensions, segments = solution.x[1 + a : 1 + a + s], statics.segments
    # A radius r of a strand enters its joint's row as r f: d(value) = -(multiplier) f dr.
    by_segment = -np.asarray(solution.eqlin.marginals)[:n, None] * tensions * (segments.loads > 0.0)
    by_radius = np.zeros((len(finger.routing.tendons), n))
    np.add.at(by_radius, segments.tendon, by_segment.T)
    return RequiredTension(float(solution.x[0]), solution.x[1 : 1 + a], tensions[segments.strands], by_radius)
