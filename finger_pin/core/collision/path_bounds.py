"""Bounds of motion within a step: paths of coordinates, and of two bodies against each other.

Within a step the path of two bodies' relative motion is at most the sum, over the coordinates that move them against
each other, of how far each goes to and fro times its lever. A polynomial goes no farther than its Bernstein
coefficients do.
"""

from __future__ import annotations

import numpy as np

from finger_pin.core.jit import Matrix, Vector, njit_always_inline, njit_inline
from finger_pin.core.tables.mechanism_parameters import Parameters
from finger_pin.core.tables.path_movers import PIECE
from finger_pin.core.tables.path_tables import PathParameters, PathWork
from finger_pin.core.tables.structure import Structure


@njit_inline
def distance(geometry: PathParameters, e: int, pieces: PathWork) -> float:
    """Return the largest distance of the core of a gap's first body from the origin of its frame, m."""
    total = 0.0
    for c in range(3):
        middle = 0.5 * (pieces.local_points[e, c] + pieces.local_points[e, 3 + c])
        total += middle * middle
    return np.sqrt(total) + geometry.cores[e]


@njit_always_inline
def bound_step_motion(dense: Matrix, k: Matrix, x: Vector, end: Vector, size: int, pieces: PathWork) -> None:
    """Bound the motion of a step: fill its interpolant's Bernstein coefficients and the path of each coordinate."""
    last, control = k.shape[0] - 1, pieces.control
    for j in range(size):
        # (1 - s) x + s end + s (1 - s) (first + s second + s^2 third)
        first, second, step = dense[0, j], dense[1, j], end[j] - x[j]
        third = dense[2, j] if dense.shape[0] > 2 else 0.0
        control[j, 0], control[j, 4] = x[j], end[j]
        control[j, 1] = x[j] + 0.25 * (step + first)
        control[j, 2] = x[j] + 0.5 * step + (first + 0.5 * second) / 3.0
        control[j, 3] = end[j] - 0.25 * (step - first - second - third)
        # The last stage is beside the end by the last increment.
        pieces.travel[j] = abs(k[last, j])
        for i in range(4):
            pieces.travel[j] += abs(control[j, i + 1] - control[j, i])


@njit_always_inline
def bound_linear_motion(x: Vector, end: Vector, size: int, pieces: PathWork) -> None:
    """Bound a motion along a straight line: fill its Bernstein coefficients and the path of each coordinate."""
    for j in range(size):
        for i in range(5):
            pieces.control[j, i] = x[j] + 0.25 * i * (end[j] - x[j])
        pieces.travel[j] = abs(end[j] - x[j])


@njit_inline
def bound_relative_path(structure: Structure, parameters: Parameters, e: int, pieces: PathWork) -> float:
    """Return a bound of the relative path of a contact's bodies in the bounded motion, m."""
    return _bound(structure, parameters.paths, e, parameters.paths.motion_bounds, pieces.far[e], pieces)


@njit_inline
def bound_pair_path(structure: Structure, parameters: Parameters, p: int, pieces: PathWork) -> float:
    """Return a bound of the relative path of all parts of a pair of solids in the bounded motion, m."""
    first, far = structure.paths.pair_start[p], pieces.pair_far[p] + pieces.pair_moved[p]
    return _bound(structure, parameters.paths, first, parameters.paths.pair_bounds, far, pieces)


@njit_inline
def _bound(
    structure: Structure, geometry: PathParameters, e: int, levers: Vector, far: float, pieces: PathWork
) -> float:
    """Return a bound of a relative path of a contact's bodies in the bounded motion by some levers, m."""
    paths, control = structure.paths, pieces.control
    endless = np.isinf(geometry.extents[e])
    total, turned = 0.0, 0.0
    for s in range(paths.start[e], paths.start[e + 1]):
        j, other, lever = paths.at[s], paths.opposing_coordinate[s], levers[s]
        path = pieces.travel[j]
        if other >= 0:
            # Beside what the last stage is off: what both have in common moves neither.
            for i in range(4):
                one, two = control[j, i + 1] - control[j, i], control[other, i + 1] - control[other, i]
                path += abs(one - two) - abs(one) - abs(two)
            path += pieces.travel[other]
        total += lever * path
        if endless and paths.moves[s, PIECE.frame] > paths.moves[s, PIECE.first] and structure.kinds[j] == 0:
            turned += path
    return add_turning(total, turned, far)


@njit_inline
def add_turning(path: float, turned: float, far: float) -> float:
    """Return the longest path of a point that moves by a path and turns at a distance, m."""
    if turned == 0.0:
        return path
    return (path + turned * far) / (1.0 - turned) if turned < 1.0 else np.inf
