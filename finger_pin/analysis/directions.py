"""The ways in which joints and, with them, tendons can move."""

from __future__ import annotations

from itertools import product

import numpy as np
import scipy
from numpy.typing import NDArray

from finger_pin.description.routing import Array
from finger_pin.mechanism.tendons import Tendons


def sliding_velocity(tendons: Tendons, velocity: Array) -> Array:
    """Return the velocities of all tendons, shape (..., t), that go with theta', shape (..., n)."""
    return np.concatenate([velocity @ tendons.routing.actuated_coupling.T, tendons.rest_position(velocity)], axis=-1)


def directions_of_motion(tendons: Tendons, moving: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return every way in which the given joints can move: signs of joints, shape (m, n), and tendons, shape (m, t)."""
    columns = sliding_velocity(tendons, np.eye(len(moving))).T
    signs, sliding = [], []
    for chosen in product((1.0, -1.0), repeat=int(moving.sum())):
        sign = np.zeros(len(moving))
        sign[moving] = chosen
        turns = columns * sign
        options = [
            [side for side, any_such in ((1.0, (row > 0.0).any()), (-1.0, (row < 0.0).any())) if any_such] or [0.0]
            for row in turns
        ]
        unsure = np.array([len(option) > 1 for option in options])
        for slide in product(*options):
            # Speeds x >= 1 exist at which the tendons whose direction the joints leave open slide these ways.
            rows = -(np.array(slide)[:, None] * turns)[unsure]
            bounds = [(1.0, None) if moves else (0.0, 0.0) for moves in moving]
            if unsure.any():
                # Any positive slack will do, since the speeds may be scaled.
                lengths = np.abs(rows).sum(axis=1)
                found = scipy.optimize.linprog(np.ones(len(moving)), rows, -lengths * 1e-6, bounds=bounds)
                if found.status != 0:
                    continue
            signs.append(sign)
            sliding.append(slide)
    return np.array(signs), np.array(sliding)
