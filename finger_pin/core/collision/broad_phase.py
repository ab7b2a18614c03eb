"""Conservative culling of contact pairs that are open, at rest and cannot close within the next steps.

A culled pair keeps a lower bound of its gap, from which paths of its bodies against each other are subtracted. Where
all parts of two solids are culled, the pair rests: the parts share one bound.
"""

from __future__ import annotations

import numpy as np

from finger_pin.core.addresses.law_code import ROW
from finger_pin.core.collision.path_bounds import bound_linear_motion, bound_pair_path, bound_relative_path, distance
from finger_pin.core.evaluation.dynamics import contact_states
from finger_pin.core.evaluation.paths import look_at
from finger_pin.core.jit import Indices, Matrix, Vector, njit_always_inline, njit_inline
from finger_pin.core.tables.buffers import Work
from finger_pin.core.tables.mechanism_parameters import Parameters
from finger_pin.core.tables.path_tables import PathWork
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
def record_start_gaps(parameters: Parameters, pieces: PathWork) -> None:
    """Record the gap of every active pair at the start of a step."""
    for index in range(pieces.active_pair_count[0]):
        e = pieces.active_pairs[index]
        pieces.clear[e], pieces.far[e] = pieces.out[e, GAP_OUT.gap], distance(parameters.paths, e, pieces)


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
    for p in range(pieces.resting.size):
        if pieces.resting[p]:
            continue
        for e in range(structure.paths.pair_start[p], structure.paths.pair_start[p + 1]):
            if pieces.culled[structure.paths.row[e]]:
                continue
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


@njit_inline
def _wake(structure: Structure, p: int, pieces: PathWork) -> None:
    """Bound the parts of a pair one by one again: none has come nearer than the pair has moved."""
    pieces.resting[p] = 0
    for e in range(structure.paths.pair_start[p], structure.paths.pair_start[p + 1]):
        pieces.clear[e] -= pieces.pair_moved[p]
        pieces.far[e] += pieces.pair_moved[p]
        pieces.path[e] = pieces.pair_path[p]
        pieces.ahead[e] = pieces.clear[e] - pieces.path[e]


@njit_inline
def rests(structure: Structure, parameters: Parameters, p: int, pieces: PathWork) -> bool:
    """Return whether a pair rested and cannot close in the bounded motion; fill its path, and wake it if it may."""
    pieces.pair_path[p] = bound_pair_path(structure, parameters, p, pieces)
    if pieces.resting[p] and not pieces.pair_clear[p] > pieces.pair_path[p]:
        _wake(structure, p, pieces)
    return pieces.resting[p] > 0


@njit_always_inline
def activate_near(structure: Structure, parameters: Parameters, pieces: PathWork) -> None:
    """Activate the pairs that may close in the bounded motion; fill the paths of all."""
    paths = structure.paths
    for p in range(pieces.resting.size):
        if rests(structure, parameters, p, pieces):
            continue
        for e in range(paths.pair_start[p], paths.pair_start[p + 1]):
            pieces.path[e] = bound_relative_path(structure, parameters, e, pieces)
            if pieces.culled[paths.row[e]]:
                pieces.ahead[e] = pieces.clear[e] - pieces.path[e]
                if not pieces.ahead[e] > 0.0:
                    set_culled(structure, paths.row[e], 0, pieces.culled)


@njit_always_inline
def record_end_gaps(parameters: Parameters, pieces: PathWork) -> None:
    """Record the gap of every active pair at the end of a bounded motion."""
    for index in range(pieces.active_pair_count[0]):
        e = pieces.active_pairs[index]
        pieces.ahead[e] = pieces.out[e, GAP_OUT.gap] - GAP_ACCURACY
        pieces.far[e] = distance(parameters.paths, e, pieces)


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
def update_culling(structure: Structure, parameters: Parameters, work: Work, states: Vector) -> bool:
    """Cull or activate contact pairs at the end of a step, where bodies are placed, by bounds of their gaps there.

    Returns:
        Whether any did.
    """
    paths, pieces, changed = structure.paths, work.paths, False
    for p in range(pieces.resting.size):
        path = pieces.pair_path[p]
        if pieces.resting[p]:
            if pieces.pair_clear[p] - path > _STEPS_AHEAD * path:
                pieces.pair_clear[p] -= path
                pieces.pair_moved[p] += path
                continue
            _wake(structure, p, pieces)
        least, far, stays = np.inf, 0.0, True
        for e in range(paths.pair_start[p], paths.pair_start[p + 1]):
            k = paths.row[e]
            may_close = not pieces.ahead[e] > _STEPS_AHEAD * pieces.path[e]
            if may_close and pieces.culled[k]:
                # Its bound may have worn off on the way.
                look_at(paths, parameters.paths, e, work)
                pieces.ahead[e] = pieces.out[e, GAP_OUT.gap] - GAP_ACCURACY
                pieces.far[e] = distance(parameters.paths, e, pieces) - pieces.path[e]
                may_close = not pieces.ahead[e] > _STEPS_AHEAD * pieces.path[e]
            stays = stays and pieces.culled[k] > 0 and not may_close
            if pieces.culled[k]:
                pieces.clear[e] = pieces.ahead[e]
                pieces.far[e] += pieces.path[e]
                if may_close:
                    changed = True
                    set_culled(structure, k, 0, pieces.culled)
            elif not may_close and pieces.active[e] == 0 and _straighten(structure, work.rows, k, states):
                pieces.clear[e], pieces.far[e] = pieces.ahead[e], pieces.far[e] + pieces.path[e]
                changed = True
                set_culled(structure, k, 1, pieces.culled)
            least, far = min(least, pieces.clear[e]), max(far, pieces.far[e])
        pieces.pair_moved[p], pieces.pair_far[p] = 0.0, far
        if stays and least > _STEPS_AHEAD * path:
            # All have been culled before, so that their states are zero.
            pieces.resting[p], pieces.pair_clear[p] = 1, least
    return changed


@njit_always_inline
def forget_culled(structure: Structure, pieces: PathWork, first: int, values: Vector) -> None:
    """Set the states of culled contacts to zero in a vector, in which states of rows begin at a place."""
    for p in range(pieces.resting.size):
        if pieces.resting[p]:
            continue
        for e in range(structure.paths.pair_start[p], structure.paths.pair_start[p + 1]):
            k = structure.paths.row[e]
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
    for p in range(work.paths.resting.size):
        work.paths.resting[p], work.paths.pair_path[p] = 0, 0.0
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
    for p in range(work.paths.resting.size):
        for e in range(structure.paths.pair_start[p], structure.paths.pair_start[p + 1]):
            for k in range(structure.paths.row[e] + 1, structure.paths.row[e] + structure.contact_arms):
                # Bent bristles tell of a contact that was closed meanwhile.
                if after[2 * width + structure.state[k]] != 0.0:
                    if work.paths.resting[p]:
                        _wake(structure, p, work.paths)
                    set_culled(structure, structure.paths.row[e], 0, work.paths.culled)
    list_active_pairs(structure, work.paths)


@njit_inline
def cull_distant(structure: Structure, parameters: Parameters, work: Work, state: Vector, before: Vector) -> None:
    """Cull the pairs that are far apart at a state, and store the state for `activate_since`."""
    record_end_gaps(parameters, work.paths)
    update_culling(structure, parameters, work, state[2 * work.torque.size :])
    for c in range(state.size):
        before[c] = state[c]
