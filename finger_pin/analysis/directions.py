"""Directions of motion of joints and, with them, tendons."""

from __future__ import annotations

from functools import lru_cache
from itertools import product

import numpy as np
import scipy
from numpy.typing import NDArray

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
