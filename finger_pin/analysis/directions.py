"""The ways in which joints and, with them, tendons can move."""

from __future__ import annotations

from functools import lru_cache
from itertools import product

import numpy as np
import scipy
from numpy.typing import NDArray

from finger_pin.mechanism.tendons import Tendons
from finger_pin.typing import Array

# A mean nearer to the origin than this is there: rows of length one cancel but for rounding.
_TOUCHING = 1e-7


def sliding_velocity(tendons: Tendons, velocity: Array) -> Array:
    """Return the velocities of all tendons, shape (..., t), that go with theta', shape (..., n)."""
    return np.concatenate([velocity @ tendons.routing.actuated_coupling.T, tendons.rest_position(velocity)], axis=-1)


def directions_of_motion(tendons: Tendons, moving: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return every way in which the given joints can move: signs of joints, shape (m, n), and tendons, shape (m, t)."""
    columns = sliding_velocity(tendons, np.eye(len(moving))).T
    return _ways(columns.tobytes(), columns.shape, tuple(moving.tolist()))


# Of the postures of one finger, most have the same.
@lru_cache(maxsize=16)
def _ways(columns: bytes, shape: tuple[int, int], moving: tuple[bool, ...]) -> tuple[Array, Array]:
    speeds, moves = np.frombuffer(columns).reshape(shape), np.array(moving)
    signs, sliding = [], []
    for chosen in product((1.0, -1.0), repeat=int(moves.sum())):
        sign = np.zeros(len(moves))
        sign[moves] = chosen
        turns = speeds * sign
        options = [
            [side for side, any_such in ((1.0, (row > 0.0).any()), (-1.0, (row < 0.0).any())) if any_such] or [0.0]
            for row in turns
        ]
        unsure = np.array([len(option) > 1 for option in options])
        undecided = turns[unsure][:, moves]
        undecided = undecided / np.linalg.norm(undecided, axis=1, keepdims=True)
        ways: list[tuple[float, ...]] = [()]
        # What some tendons cannot do together, all of them cannot.
        for count in range(1, len(undecided) + 1):
            further = ((*way, side) for way in ways for side in (1.0, -1.0))
            ways = [way for way in further if _possible(np.array(way)[:, None] * undecided[:count])]
        slide = np.array([option[0] for option in options])
        for way in ways:
            slide[unsure] = way
            signs.append(sign)
            sliding.append(slide.copy())
    return np.array(signs), np.array(sliding)


def _possible(turns: Array) -> bool:
    """Return whether positive speeds x exist with turns @ x > 0, rows of length one.

    They do if and only if no y >= 0 but zero has turns^T y_1 + y_2 = 0 (Gordan, Mathematische Annalen 6, 1873): if the
    origin is at a distance from all means of these rows and of the unit vectors.
    """
    if not len(turns):
        return True
    rows = np.concatenate([turns, np.eye(turns.shape[1])])
    means = np.concatenate([rows.T, np.ones((1, len(rows)))])
    return float(scipy.optimize.nnls(means, np.eye(len(means))[-1])[1]) > _TOUCHING
