"""Blocks: the coupled parts of a step's linear systems, found again at every step, and their factors.

Without contacts a mechanism falls into atoms, such as the fingers of a hand and what lies around. Contacts that are
closed join atoms to blocks. One that is open is held open during the step: it exerts nothing, whatever moves, and
each of its states decays on its own.
"""

from __future__ import annotations

from finger_pin.core.addresses.law_code import ROW, TOUCH_SLOPE
from finger_pin.core.jit import Indices, Matrix, Vector, njit_always_inline, njit_inline
from finger_pin.core.tables.buffers import Work
from finger_pin.core.tables.linear_systems import Blocks
from finger_pin.core.tables.structure import Structure


@njit_inline
def extent(blocks: Blocks, b: int) -> tuple[int, int]:
    """Return the numbers of a block's coordinates and columns: r of positions, velocities and states, and time."""
    width = blocks.coordinate_start[b + 1] - blocks.coordinate_start[b]
    return width, 2 * width + blocks.state_start[b + 1] - blocks.state_start[b] + 1


@njit_inline
def add_contact_gain(
    structure: Structure, blocks: Blocks, k: int, factor: float, gain: Vector, width: int, out: Vector
) -> None:
    """Add a multiple of a gain of the contact to which a row belongs, in columns of a block."""
    first = k - k % structure.contact_arms
    for c in range(2 * width):
        out[c] += factor * gain[c]
    for j in range(structure.contact_arms - 1):
        out[2 * width + blocks.state_place[structure.state[first + 1 + j]]] += factor * gain[2 * width + j]


@njit_always_inline
def _join(structure: Structure, work: Work, blocks: Blocks) -> None:
    """Fill the block of every atom."""
    paths, label = structure.paths, blocks.label
    for a in range(label.size):
        label[a] = a
    for index in range(work.paths.closed_count[0]):
        e = work.paths.closed[index]
        if work.rows[ROW.side, paths.row[e]] < 0.0:
            continue
        for s in range(paths.start[e], paths.start[e + 1]):
            first, second = label[blocks.atom[paths.at[paths.start[e]]]], label[blocks.atom[paths.at[s]]]
            if first != second:
                for a in range(label.size):
                    if label[a] == max(first, second):
                        label[a] = min(first, second)
    # Labels are the least atom of each block: number them.
    count = 0
    for a in range(label.size):
        if label[a] == a:
            label[a] = count
            count += 1
        else:
            # An earlier atom, which has its number.
            label[a] = label[label[a]]
    blocks.number[0] = count


@njit_always_inline
def partition(structure: Structure, work: Work, blocks: Blocks, gain: Matrix) -> None:
    """Find the blocks of a step, after the slopes of all laws; of contacts that have opened, clear the rows' gains."""
    paths = structure.paths
    for index in range(blocks.touch_start[blocks.number[0]]):
        for k in range(blocks.touches[index], blocks.touches[index] + structure.contact_arms):
            for c in range(gain.shape[1]):
                gain[k, c] = 0.0
    _join(structure, work, blocks)
    coordinates = rows = touches = states = active = 0
    for index in range(work.paths.active_pair_count[0]):
        k = paths.row[work.paths.active_pairs[index]]
        for m in range(1, structure.contact_arms):
            blocks.active_states[active] = structure.state[k + m]
            blocks.loose[structure.state[k + m]] = -work.slopes[TOUCH_SLOPE.rate_by_state_1 + m - 1, k + m]
            active += 1
    blocks.active_state_count[0] = active
    for b in range(blocks.number[0]):
        for j in range(blocks.atom.size):
            if blocks.label[blocks.atom[j]] == b:
                blocks.coordinates[coordinates] = j
                blocks.place[j] = coordinates - blocks.coordinate_start[b]
                coordinates += 1
        for index in range(work.paths.closed_count[0]):
            e = work.paths.closed[index]
            k = paths.row[e]
            if work.rows[ROW.side, k] < 0.0 or blocks.label[blocks.atom[paths.at[paths.start[e]]]] != b:
                continue
            blocks.touches[touches] = k
            touches += 1
            for m in range(1, structure.contact_arms):
                state = structure.state[k + m]
                blocks.states[states], blocks.loose[state] = state, 0.0
                blocks.state_place[state] = states - blocks.state_start[b]
                states += 1
        for k in range(structure.contact_rows, blocks.row_atom.size):
            if blocks.label[blocks.row_atom[k]] != b:
                continue
            blocks.rows[rows] = k
            rows += 1
            state = structure.state[k]
            if state >= 0:
                blocks.states[states] = state
                blocks.state_place[state] = states - blocks.state_start[b]
                states += 1
        blocks.coordinate_start[b + 1], blocks.row_start[b + 1] = coordinates, rows
        blocks.touch_start[b + 1], blocks.state_start[b + 1] = touches, states


@njit_always_inline
def factorise(matrix: Matrix, size: int, pivots: Indices) -> bool:
    """Factorise the first rows and columns of a matrix in place with row exchanges; false if that is singular.

    On the diagonal stands the inverse of the upper factor's.
    """
    for c in range(size):
        best = c
        for r in range(c + 1, size):
            if abs(matrix[r, c]) > abs(matrix[best, c]):
                best = r
        pivots[c] = best
        if not abs(matrix[best, c]) > 0.0:
            return False
        if best != c:
            for k in range(size):
                matrix[c, k], matrix[best, k] = matrix[best, k], matrix[c, k]
        inverse = 1.0 / matrix[c, c]
        matrix[c, c] = inverse
        for r in range(c + 1, size):
            factor = matrix[r, c] * inverse
            matrix[r, c] = factor
            # Slices, whose indices are not negative, let the compiler use vector instructions.
            row, above = matrix[r, c + 1 :], matrix[c, c + 1 :]
            for k in range(size - c - 1):
                row[k] -= factor * above[k]
    return True


@njit_inline
def substitute(matrix: Matrix, size: int, pivots: Indices, right: Vector) -> None:
    """Replace a right-hand side by the solution, after `factorise`."""
    for r in range(size):
        best = pivots[r]
        if best != r:
            right[r], right[best] = right[best], right[r]
    for r in range(size):
        value = right[r]
        for k in range(r):
            value -= matrix[r, k] * right[k]
        right[r] = value
    for r in range(size - 1, -1, -1):
        value = right[r]
        for k in range(r + 1, size):
            value -= matrix[r, k] * right[k]
        right[r] = value * matrix[r, r]
