"""Self-locking over the workspace of a finger, and the tension of its slow motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from finger_pin.analysis.locking import directions_of_motion
from finger_pin.analysis.locking_loop import FrictionLoop
from finger_pin.analysis.printing import BriefRepr
from finger_pin.description.coupling import PassiveCoupling
from finger_pin.description.validation import expand
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import FingerLike, as_finger, one_finger, refuse_without_tendons
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array


@dataclass(frozen=True, eq=False, repr=False)
class SelfLockingMap(BriefRepr):
    """Critical coefficients over the angles of two joints, or of the only free one.

    Attributes:
        joints: Names of the joints.
        angles: Of every one of them, shape (a,) and (b,), rad.
        coefficient: M_crit, shape (a, b), m. With one tendon more than joints it varies only where the friction of a
            passive tendon does, so for passive tendons whose canals no joint bends it is the same everywhere.
        tension: Largest tension that the controller commands while the finger moves slowly, under its own friction
            and weight, in the direction that needs most, shape (a, b), N; infinite where it locks.
        tip: Fingertip position, shape (a, b, 3), of several (a, b, t, 3), m, base frame. Of one joint all these
            lack the second dimension.
        actual: The finger's largest stiction coefficient M^c, m.
    """

    joints: tuple[str, ...]
    angles: tuple[Array, ...]
    coefficient: Array
    tension: Array
    tip: Array
    actual: float

    @property
    def uniform(self) -> bool:
        """Whether the critical coefficient is the same at every posture."""
        return bool(np.max(self.coefficient) <= (1.0 + 1e-6) * np.min(self.coefficient))


def self_locking_map(
    finger: FingerLike,
    joints: tuple[str, ...] | None = None,
    *,
    fixed: Mapping[str, float] | None = None,
    minimum_tension: float | tuple[float, ...] = 1.0,
    samples: int = 21,
) -> SelfLockingMap:
    """Return the critical coefficient over the ranges of two joints, all joints moving in their worst directions.

    Joints that passive tendons drive both ways follow the others as inextensible tendons demand, (4).

    Args:
        finger: A finger with force closure.
        joints: Names of two joints or one; by default the last two that no passive tendon drives, if there are two.
        fixed: Angles of the others, rad; the angle of their range nearest to zero by default.
        minimum_tension: f0, N, one number or one per tendon, for the tensions of the map.
        samples: Angles along either axis.
    """
    finger = as_finger(finger)
    one_finger(finger.description)
    refuse_without_tendons(finger.description)
    routing, limiter = finger.routing, finger.stroke_limiter
    coupling = PassiveCoupling.from_routing(routing, finger.tendons.slack, bands=False)
    free = [routing.joints[index] for index in coupling.free]
    map_joints = tuple(free[-2:]) if joints is None else tuple(joints)
    if len(map_joints) not in (1, 2) or len(set(map_joints)) < len(map_joints):
        raise InputError("joints", "must be one joint or two different ones", list(map_joints))
    for name in (*map_joints, *(fixed or {})):
        if name not in free:
            raise InputError("joints", f"must be among {', '.join(free)}", name)
    base = np.clip(np.zeros(len(routing.joints)), limiter.lower, limiter.upper)
    for name, angle in (fixed or {}).items():
        base[routing.joints.index(name)] = angle
    columns = [routing.joints.index(name) for name in map_joints]
    axes = tuple(np.linspace(limiter.lower[j], limiter.upper[j], samples) for j in columns)
    shape = (samples,) * len(axes)
    postures = np.tile(base, (*shape, 1))
    postures[..., columns] = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    flat = coupling.posture(postures[..., coupling.free]).reshape(-1, len(base))
    tip = np.array([finger.rigid_body.tip_position(theta) for theta in flat])
    coefficient, tension = _worst_directions(finger, flat, expand(minimum_tension, len(routing.tendons)))
    return SelfLockingMap(
        joints=map_joints,
        angles=axes,
        coefficient=coefficient.reshape(shape),
        tension=tension.reshape(shape),
        tip=tip.reshape(*shape, *tip.shape[1:]),
        actual=float(np.max(finger.joint_friction.static)),
    )


def _worst_directions(finger: Finger, positions: Array, minimum: Array) -> tuple[Array, Array]:
    """Return critical coefficient and greatest tension at m postures, shape (m,) each, in the worst directions."""
    routing, (count, size) = finger.routing, positions.shape
    signs, sliding = directions_of_motion(finger.tendons, np.ones(size, dtype=bool))
    weight = np.array([finger.static_torque(theta) for theta in positions])
    loop, pins = FrictionLoop.from_tendons(finger.tendons, None), finger.joint_friction
    static = pins.static
    coefficient, tension = np.full(count, np.inf), np.zeros(count)
    one_extra_tendon = len(routing.tendons) == size + 1 and not loop.tendons.several
    relevant = slice(None)
    if one_extra_tendon:
        # The friction of actuated tendons scales columns of the balance in f, and leaves where f_i = 0 as it was. With
        # more tendons not every f is commanded, and what is commanded it shifts.
        relevant = slice(routing.actuated, None)
    relevant_sliding = np.zeros_like(sliding)
    relevant_sliding[:, relevant] = sliding[:, relevant]
    locking = np.unique(np.hstack([signs, relevant_sliding]), axis=0)
    bends = routing.curvature_matrix[relevant]
    # Of tendons that rub at several places, each of them counts.
    bend = np.abs(positions) @ (np.diag(bends.any(axis=0)) if loop.tendons.several else bends.T)
    _, first_indices, case_of = np.unique(bend.round(12), axis=0, return_index=True, return_inverse=True)
    least_coefficient = np.zeros(len(locking))
    for index, case in enumerate(locking):
        sign = np.broadcast_to(case[:size], positions.shape)
        case_sliding = np.broadcast_to(case[size:], (count, len(routing.tendons)))
        kappa = loop.critical(positions[first_indices], sign[first_indices], case_sliding[first_indices])[0]
        coefficient, least_coefficient[index] = np.minimum(coefficient, kappa[case_of.reshape(-1)]), kappa.min()
    if one_extra_tendon:
        for case in locking:
            ways = sliding[np.all(np.hstack([signs, relevant_sliding]) == case, axis=1)]
            demand = weight + case[:size] * pins.break_away_drag(case[:size])
            command = loop.greatest_command(positions, case[:size] * static, ways, minimum, demand)
            tension = np.maximum(tension, command)
    else:
        # Where it locks in one direction no other one needs more: first that which locks first.
        for case in locking[np.argsort(least_coefficient)]:
            unlocked = np.flatnonzero(np.isfinite(tension))
            if not len(unlocked):
                break
            cases = np.broadcast_to(case[size:], (len(unlocked), len(routing.tendons)))
            weights = np.broadcast_to(case[:size] * static, (len(unlocked), size))
            demand = weight[unlocked] + case[:size] * pins.break_away_drag(case[:size])
            command = loop.command_to_move(positions[unlocked], weights, cases, minimum, demand)
            tension[unlocked] = np.maximum(tension[unlocked], command[:, : routing.actuated].max(axis=1))
    return coefficient, tension
