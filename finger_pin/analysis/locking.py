"""The joint friction at which a finger locks itself, at a posture or at any, and the directions of its motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
import scipy
from numpy.typing import NDArray

from finger_pin.analysis.locking_loop import FrictionLoop
from finger_pin.analysis.printing import BriefRepr
from finger_pin.description.validation import expand, finite_vector
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import FingerLike, description_of, one_finger
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.tendons import Tendons
from finger_pin.typing import Array

# Distance within which a mean is at the origin: rows of length one cancel but for rounding.
_ORIGIN_TOLERANCE = 1e-7


def sliding_velocity(tendons: Tendons, velocity: Array) -> Array:
    """Return the velocities of all tendons, shape (..., t), that go with theta', shape (..., n)."""
    return np.concatenate([velocity @ tendons.routing.actuated_coupling.T, tendons.rest_position(velocity)], axis=-1)


def directions_of_motion(tendons: Tendons, moving: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return all possible signs of motion of joints, shape (m, n), and with them of tendons, shape (m, t)."""
    columns = sliding_velocity(tendons, np.eye(len(moving))).T
    return _motion_signs(columns.tobytes(), columns.shape, tuple(moving.tolist()))


# Most postures of one finger have the same columns.
@lru_cache(maxsize=16)
def _motion_signs(columns: bytes, shape: tuple[int, int], moving: tuple[bool, ...]) -> tuple[Array, Array]:
    speeds, moving_joints = np.frombuffer(columns).reshape(shape), np.array(moving)
    signs, sliding = [], []
    for joint_signs in product((1.0, -1.0), repeat=int(moving_joints.sum())):
        sign = np.zeros(len(moving_joints))
        sign[moving_joints] = joint_signs
        speeds_by_joint = speeds * sign
        options = [
            [side for side in (1.0, -1.0) if (side * tendon_speeds > 0.0).any()] or [0.0]
            for tendon_speeds in speeds_by_joint
        ]
        ambiguous = np.array([len(option) > 1 for option in options])
        rows = speeds_by_joint[ambiguous][:, moving_joints]
        rows = rows / np.linalg.norm(rows, axis=1, keepdims=True)
        patterns: list[tuple[float, ...]] = [()]
        # A pattern that is impossible for some tendons is so for all.
        for count in range(1, len(rows) + 1):
            extended = ((*pattern, side) for pattern in patterns for side in (1.0, -1.0))
            patterns = [pattern for pattern in extended if _is_possible(np.array(pattern)[:, None] * rows[:count])]
        tendon_signs = np.array([option[0] for option in options])
        for pattern in patterns:
            tendon_signs[ambiguous] = pattern
            signs.append(sign)
            sliding.append(tendon_signs.copy())
    return np.array(signs), np.array(sliding)


def _is_possible(turns: Array) -> bool:
    """Return whether positive speeds x exist with turns @ x > 0, rows of length one.

    They do if and only if no y >= 0 but zero has turns^T y_1 + y_2 = 0 (Gordan, Mathematische Annalen 6, 1873): if the
    origin is at a distance from all means of these rows and of the unit vectors.
    """
    if not len(turns):
        return True
    rows = np.concatenate([turns, np.eye(turns.shape[1])])
    means = np.concatenate([rows.T, np.ones((1, len(rows)))])
    return float(scipy.optimize.nnls(means, np.eye(len(means))[-1])[1]) > _ORIGIN_TOLERANCE


@dataclass(frozen=True, eq=False, repr=False)
class CriticalFriction(BriefRepr):
    """The least joint friction at which a finger locks, over the directions that were asked about.

    Attributes:
        coefficient: M_crit, m: friction coefficient times pin radius, alike at all joints that move; infinite where
            no friction locks the finger.
        joints: Names of the joints that move.
        directions: Direction of every joint in the worst case, -1, 0 (at rest) or 1, shape (n,).
        torque: Demand tau^d that runs away, shape (n,), N m, largest entry 1; zero where nothing locks.
        tension: Command f_hat that runs away with it, shape (t,), N.
    """

    coefficient: float
    joints: tuple[str, ...]
    directions: Array
    torque: Array
    tension: Array


def critical_friction(
    finger: FingerLike,
    position: Sequence[float] | Array | None = None,
    *,
    joints: Sequence[str] | None = None,
    velocity: Sequence[float] | Array | None = None,
    gain: float | tuple[float, ...] | None = None,
) -> CriticalFriction:
    """Return the joint friction at which a finger locks.

    Args:
        finger: A finger, or the description of one, with force closure.
        position: theta, shape (n,), rad; it matters to the friction of the tendons, which is left out without it.
        joints: The joints that move; all by default. The others count as free of friction.
        velocity: theta', shape (n,), whose signs and ratios say which way joints and tendons move; joints not in
            ``joints`` count as at rest. By default the worst of all directions in which all ``joints`` move.
        gain: K_P, N m/rad. With it passive tendons are elastic, and the finger lags behind its reference by
            tau / K_P; by default they carry what the controller plans.
    """
    description = description_of(finger)
    one_finger(description)
    tendons = finger.tendons if isinstance(finger, Finger) else Tendons.from_description(description)
    routing = tendons.routing
    for name in joints or ():
        if name not in routing.joints:
            raise InputError("joints", f"must be among {', '.join(routing.joints)}", name)
    moving = np.array([joints is None or name in joints for name in routing.joints])
    size = len(moving)
    if velocity is None and position is None:
        signs = np.array(
            [sign for sign in product((-1.0, 0.0, 1.0), repeat=size) if ((np.array(sign) != 0) == moving).all()]
        )
        sliding = np.zeros((len(signs), len(routing.tendons)))
    elif velocity is None:
        signs, sliding = directions_of_motion(tendons, moving)
    else:
        moving_velocity = np.where(moving, finite_vector("velocity", velocity, size), 0.0)
        signs, sliding = np.sign(moving_velocity)[None], np.sign(sliding_velocity(tendons, moving_velocity))[None]
    if position is None:
        theta, sliding = np.zeros(size), np.zeros_like(sliding)
    else:
        theta = finite_vector("position", position, size)
    stiffness = None if gain is None else finite_vector("gain", expand(gain, size), size)
    cases = np.broadcast_to(theta, (len(signs), size))
    kappa, torque, command = FrictionLoop.from_tendons(tendons, stiffness).critical(cases, signs, sliding)
    worst = int(np.argmin(kappa))
    return CriticalFriction(
        coefficient=float(kappa[worst]),
        joints=tuple(name for name, moves in zip(routing.joints, moving, strict=True) if moves),
        directions=signs[worst],
        torque=torque[worst],
        tension=command[worst],
    )
