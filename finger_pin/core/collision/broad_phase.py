"""Conservative culling of contact pairs that are open, at rest and cannot close within the next steps.

Within a step the path of two bodies' relative motion is at most the sum, over the coordinates that move them against
each other, of how far each goes to and fro times its lever. A polynomial goes no farther than its Bernstein
coefficients do. A culled pair keeps a lower bound of its gap, from which such paths are subtracted.
"""

from __future__ import annotations

import numpy as np

from finger_pin.core.addresses.law_code import ROW
from finger_pin.core.evaluation.dynamics import contact_states
from finger_pin.core.jit import Indices, Matrix, Vector, njit_always_inline, njit_inline
from finger_pin.core.tables.buffers import Work
from finger_pin.core.tables.mechanism_parameters import Parameters
from finger_pin.core.tables.path_movers import PIECE
from finger_pin.core.tables.path_tables import PathParameters, PathWork
from finger_pin.core.tables.structure import Structure
from finger_pin.mechanism.gaps.signed_distance import GAP_OUT

# Derivations and origins: core/stepping/NOTES.md.
# Accuracy to which gaps are computed, m: `mechanism/gaps/nearest.py` flattens distances by as much (`INSIDE`).
GAP_ACCURACY = 1e-9
# Steps as far as the last one that a culled pair stays open for, 1: the next one may be longer.
_STEPS_AHEAD = 3.0
# Culled pairs, beside as many as are active, from which on loops leave theirs out, 1: parts cost more than numbers.
_FEWEST_CULLED = 300
# Greatest deflection of bristles that count as straight, m: a ten thousandth of the diameter of an atom.
_STRAIGHT_DEFLECTION = 1e-14


@njit_always_inline
def record_start_gaps(structure: Structure, parameters: Parameters, pieces: PathWork) -> None:
    """Record the gap of every active pair at the start of a step."""
    paths, geometry = structure.paths, parameters.paths
    for e in range(paths.columns.size):
        if paths.columns[e] > 1 and pieces.culled[paths.row[e]] == 0:
            pieces.clear[e], pieces.far[e] = pieces.out[e, GAP_OUT.gap], distance(geometry, e, pieces)


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
    paths, geometry, control = structure.paths, parameters.paths, pieces.control
    endless = np.isinf(geometry.extents[e])
    total, turned = 0.0, 0.0
    for s in range(paths.start[e], paths.start[e + 1]):
        j, other, lever = paths.at[s], paths.opposing_coordinate[s], geometry.motion_bounds[s]
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
    return add_turning(total, turned, pieces.far[e])


@njit_inline
def add_turning(path: float, turned: float, far: float) -> float:
    """Return the longest path of a point that moves by a path and turns at a distance, m."""
    if turned == 0.0:
        return path
    return (path + turned * far) / (1.0 - turned) if turned < 1.0 else np.inf


@njit_inline
def set_culled(structure: Structure, k: int, value: int, culled: Indices) -> None:
    """Set or clear the flag `culled` of a contact's rows."""
    for m in range(k, k + structure.contact_arms):
        culled[m] = value


@njit_inline
def list_active_pairs(structure: Structure, pieces: PathWork) -> None:
    """List the active contact pairs, and where numbers of the state may be other than zero."""
    live, first, count, parts = pieces.live, 2 * structure.prescribed.size, 0, 0
    live[0, 0], live[0, 1] = 0, first
    for e in range(structure.contact_rows // structure.contact_arms):
        if pieces.culled[structure.paths.row[e]] == 0:
            pieces.active_pairs[count] = e
            count += 1
            begin = first + structure.paths.row[e] // structure.contact_arms * (structure.contact_arms - 1)
            if live[parts, 1] != begin:
                parts += 1
                live[parts, 0] = begin
            live[parts, 1] = begin + structure.contact_arms - 1
    pieces.active_pair_count[0] = count
    # Those of all other rows come after.
    begin = first + contact_states(structure)
    if live[parts, 1] != begin:
        parts += 1
        live[parts, 0] = begin
    live[parts, 1] = first + structure.state_row.size
    pieces.live_count[0] = parts + 1
    if 2 * count > structure.contact_rows // structure.contact_arms - _FEWEST_CULLED:
        # Loops over all, from zero on, are the faster.
        live[0, 1], pieces.live_count[0] = first + structure.state_row.size, 1


@njit_always_inline
def activate_near(structure: Structure, parameters: Parameters, pieces: PathWork) -> None:
    """Activate the pairs that may close in the bounded motion; fill the paths of all."""
    paths = structure.paths
    for e in range(paths.columns.size):
        k = paths.row[e]
        if paths.columns[e] > 1:
            pieces.path[e] = bound_relative_path(structure, parameters, e, pieces)
            if pieces.culled[k]:
                pieces.ahead[e] = pieces.clear[e] - pieces.path[e]
                if not pieces.ahead[e] > 0.0:
                    set_culled(structure, k, 0, pieces.culled)


@njit_always_inline
def record_end_gaps(structure: Structure, parameters: Parameters, pieces: PathWork) -> None:
    """Record the gap of every active pair at the end of a bounded motion."""
    paths, geometry = structure.paths, parameters.paths
    for e in range(paths.columns.size):
        if paths.columns[e] > 1 and pieces.culled[paths.row[e]] == 0:
            pieces.ahead[e], pieces.far[e] = pieces.out[e, GAP_OUT.gap] - GAP_ACCURACY, distance(geometry, e, pieces)


@njit_always_inline
def _straighten(structure: Structure, rows: Matrix, k: int, states: Vector) -> bool:
    """Return whether the bristles of an open contact are straight; the rest of their bend is then cleared."""
    for m in range(k + 1, k + structure.contact_arms):
        if not abs(states[structure.state[m]]) < _STRAIGHT_DEFLECTION:
            return False
    for m in range(k + 1, k + structure.contact_arms):
        states[structure.state[m]] = rows[ROW.rate, m] = 0.0
    return True


@njit_inline
def update_culling(structure: Structure, rows: Matrix, pieces: PathWork, states: Vector) -> bool:
    """Cull or activate contact pairs at the end of a step, by bounds of their gaps there.

    Returns:
        Whether any did.
    """
    paths, changed = structure.paths, False
    for e in range(paths.columns.size):
        k = paths.row[e]
        if paths.columns[e] == 1:
            continue
        may_close = not pieces.ahead[e] > _STEPS_AHEAD * pieces.path[e]
        if pieces.culled[k]:
            pieces.clear[e] = pieces.ahead[e]
            pieces.far[e] += pieces.path[e]
            if may_close:
                changed = True
                set_culled(structure, k, 0, pieces.culled)
        elif not may_close and pieces.active[e] == 0 and _straighten(structure, rows, k, states):
            pieces.clear[e], pieces.far[e] = pieces.ahead[e], pieces.far[e] + pieces.path[e]
            changed = True
            set_culled(structure, k, 1, pieces.culled)
    return changed


@njit_always_inline
def forget_culled(structure: Structure, pieces: PathWork, first: int, values: Vector) -> None:
    """Set the states of culled contacts to zero in a vector, in which states of rows begin at a place."""
    for k in range(0, structure.contact_rows, structure.contact_arms):
        if pieces.culled[k]:
            for m in range(k + 1, k + structure.contact_arms):
                values[first + structure.state[m]] = 0.0


@njit_inline
def activate_all_pairs(structure: Structure, work: Work) -> None:
    """Activate all contact pairs, as for a new state."""
    for k in range(structure.contact_rows):
        work.paths.culled[k] = 0
    for e in range(work.paths.path.size):
        work.paths.path[e] = 0.0
    list_active_pairs(structure, work.paths)


@njit_inline
def activate_since(
    structure: Structure,
    parameters: Parameters,
    work: Work,
    first: Matrix,
    second: Matrix,
    before: Vector,
    after: Vector,
) -> None:
    """Activate the pairs that may have closed between two states, given with their quaternions."""
    for f in range(structure.charts.size):
        # What a free body has turned by: its angles count from its attitude.
        cosine = 0.0
        for r in range(4):
            cosine += first[f, r] * second[f, r]
        before[structure.charts[f]] = after[structure.charts[f]] - 2.0 * np.arccos(min(abs(cosine), 1.0))
    bound_linear_motion(before, after, structure.parents.size, work.paths)
    activate_near(structure, parameters, work.paths)
    width = work.torque.size
    for k in range(structure.contact_rows):
        # Bent bristles tell of a contact that was closed meanwhile.
        if structure.state[k] >= 0 and after[2 * width + structure.state[k]] != 0.0:
            set_culled(structure, k - k % structure.contact_arms, 0, work.paths.culled)
    list_active_pairs(structure, work.paths)


@njit_inline
def cull_distant(structure: Structure, parameters: Parameters, work: Work, state: Vector, before: Vector) -> None:
    """Cull the pairs that are far apart at a state, and store the state for `activate_since`."""
    record_end_gaps(structure, parameters, work.paths)
    update_culling(structure, work.rows, work.paths, state[2 * work.torque.size :])
    for c in range(state.size):
        before[c] = state[c]
