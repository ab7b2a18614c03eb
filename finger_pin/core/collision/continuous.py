"""Continuous collision detection: touches within a step that no stage has seen.

They are looked for until there is none, or one is found.

Bodies that are g_0 and g_1 apart at two moments, and touch in between, move against each other by g_0 + g_1 at least. A
step is halved until the path of every part is shorter than that. Where bodies slide along each other, close and far,
so is another bound: along a normal that is the same at both moments, a path is off its chord by no more than an eighth
of its largest second derivative.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from finger_pin.core.addresses.law_code import ROW
from finger_pin.core.collision.broad_phase import GAP_ACCURACY, rests, set_culled
from finger_pin.core.collision.path_bounds import add_turning, bound_relative_path, bound_step_motion, distance
from finger_pin.core.jit import Matrix, Vector, call_at, njit_always_inline, njit_inline
from finger_pin.core.steps.integration import Integration
from finger_pin.core.tables.mechanism_parameters import Parameters
from finger_pin.core.tables.model import Model
from finger_pin.core.tables.path_movers import PIECE
from finger_pin.core.tables.path_tables import LOOK, MAX_LOOKS, PathWork
from finger_pin.core.tables.structure import Structure
from finger_pin.mechanism.gaps.signed_distance import GAP_OUT

# Bernstein coefficients of a coordinate over a step.
_Coefficients: TypeAlias = tuple[float, float, float, float, float]
# Of a step in which all touches have been seen, and of one in which a culled pair may have closed.
NOTHING_MISSED, MISSED_BY_CULLING = 2.0, 1.0
# Derivations and origins: core/stepping/NOTES.md.
# Rounding of a gap, m: 450 times the spacing of doubles at a distance of a metre.
_GAP_ROUNDING = 1e-13
# Greatest path, m and in parts of the depths at its ends, on which bodies that overlap do not part and meet again.
MIN_PARTING_PATH, PARTING_PATH_PER_DEPTH = 1e-6, 4.0
# Least cosine of the angle between the normals at two moments, 1, at which the bound by the chord is tried: 60 degrees.
_MIN_NORMAL_COSINE = 0.5
# Bisections for the moment of a meeting: to 2^-10 of the interval; and its latest share, 1: the end
# itself would be no other try.
_MEETING_BISECTIONS, _MAX_MEETING_SHARE = 10, 0.999


@njit_inline
def _difference(pieces: PathWork, j: int, other: int, i: int) -> float:
    return pieces.control[j, i] if other < 0 else pieces.control[j, i] - pieces.control[other, i]


@njit_always_inline
def _part(start: float, end: float, b: _Coefficients) -> _Coefficients:
    """Return the Bernstein coefficients of a part of a polynomial."""
    b0, b1, b2, b3, b4 = b
    s, c = end, 1.0 - end
    for _ in range(2):
        # What is left of s, then, turned round, what is right of the start.
        d1, d2, d3, d4 = c * b0 + s * b1, c * b1 + s * b2, c * b2 + s * b3, c * b3 + s * b4
        e1, e2, e3 = c * d1 + s * d2, c * d2 + s * d3, c * d3 + s * d4
        f1, f2 = c * e1 + s * e2, c * e2 + s * e3
        b4, b3, b2, b1, b0 = b0, d1, e1, f1, c * f1 + s * f2
        s, c = 1.0 - start / end, start / end
    return b0, b1, b2, b3, b4


@njit_always_inline
def _bounds(
    structure: Structure, parameters: Parameters, pieces: PathWork, e: int, one: Vector, two: Vector
) -> tuple[float, float]:
    """Return bounds of the path between two moments, and of its distance from its chord, m."""
    paths, geometry, far = structure.paths, parameters.paths, max(one[LOOK.far], two[LOOK.far])
    endless = np.isinf(geometry.extents[e])
    path = turned = moves = bends = turns = swing = curl = 0.0
    for s in range(paths.start[e], paths.start[e + 1]):
        j, other, lever = paths.at[s], paths.opposing_coordinate[s], geometry.motion_bounds[s]
        carries = paths.moves[s, PIECE.frame] > paths.moves[s, PIECE.first] and structure.kinds[j] == 0
        if lever == 0.0 and not carries:
            continue
        whole = (
            _difference(pieces, j, other, 0),
            _difference(pieces, j, other, 1),
            _difference(pieces, j, other, 2),
            _difference(pieces, j, other, 3),
            _difference(pieces, j, other, 4),
        )
        b0, b1, b2, b3, b4 = _part(one[LOOK.share], two[LOOK.share], whole)
        d0, d1, d2, d3 = b1 - b0, b2 - b1, b3 - b2, b4 - b3
        travel = abs(d0) + abs(d1) + abs(d2) + abs(d3)
        most = max(max(abs(d0), abs(d1)), max(abs(d2), abs(d3)))
        curve = max(max(abs(d1 - d0), abs(d2 - d1)), abs(d3 - d2))
        path += lever * travel
        moves += lever * most
        bends += lever * curve
        if structure.kinds[j] == 0:
            turns += most
        if carries:
            # As the second body sees it, the first turns about it.
            swing += most
            curl += curve
            if endless:
                turned += travel
    path = add_turning(path, turned, far)
    moves, bends = moves + swing * (far + path), bends + curl * (far + path)
    # The second derivative of a coordinate is at most 12 times the second differences, the first one 4 times the first.
    return path, 1.5 * bends + 4.0 * turns * moves


@njit_always_inline
def _is_clear(structure: Structure, parameters: Parameters, pieces: PathWork, e: int, one: Vector, two: Vector) -> bool:
    """Return whether bodies surely neither touch nor part between two moments."""
    path, bend = _bounds(structure, parameters, pieces, e, one, two)
    if one[LOOK.gap] < 0.0 or two[LOOK.gap] < 0.0:
        return path < PARTING_PATH_PER_DEPTH * (abs(one[LOOK.gap]) + abs(two[LOOK.gap])) + MIN_PARTING_PATH
    if path < one[LOOK.gap] + two[LOOK.gap] + _GAP_ROUNDING:
        return True
    tilt, size = 0.0, 0.0
    for i in range(LOOK.normal_x, LOOK.normal_z + 1):
        tilt += (one[i] - two[i]) * (one[i] - two[i])
        size += one[i] * two[i]
    if not size > _MIN_NORMAL_COSINE:
        return False
    # Of the plane across the first normal the second tells, as far as it is the same.
    slant = np.sqrt(tilt) * (max(one[LOOK.far], two[LOOK.far]) + parameters.paths.extents[e]) if tilt > 0.0 else 0.0
    return bend + slant + GAP_ACCURACY < min(one[LOOK.gap], two[LOOK.gap])


@njit_inline
def _look(integration: Integration, model: Model, e: int, share: float, look: Vector) -> None:
    """Store a gap and its slopes at a share of the step."""
    pieces, state = model.work.paths, model.state
    s, c = share, 1.0 - share
    w0, w1, w2, w3, w4 = c**4, 4.0 * c**3 * s, 6.0 * c * c * s * s, 4.0 * c * s**3, s**4
    for j in range(model.structure.parents.size):
        b = pieces.control[j]
        state[j] = w0 * b[0] + w1 * b[1] + w2 * b[2] + w3 * b[3] + w4 * b[4]
    in_reach = call_at(model.look, integration.model, float(e))
    look[LOOK.share], look[LOOK.gap] = share, pieces.out[e, GAP_OUT.gap]
    look[LOOK.far] = distance(model.parameters.paths, e, pieces)
    for r in range(3):
        # Of what is far away the normal is not asked for.
        look[LOOK.normal_x + r] = pieces.out[e, GAP_OUT.normal + r] if in_reach else 0.0


@njit_always_inline
def _meeting(integration: Integration, model: Model, e: int, one: Vector, two: Vector) -> float:
    """Return the time just after two bodies have met, which are apart at one moment and touch at another."""
    looks = model.work.paths.looks
    early, late, middle = one[LOOK.share], two[LOOK.share], looks[MAX_LOOKS - 1]
    for _ in range(_MEETING_BISECTIONS):
        _look(integration, model, e, 0.5 * (early + late), middle)
        if middle[LOOK.gap] < 0.0:
            late = middle[LOOK.share]
        else:
            early = middle[LOOK.share]
    return min(late, _MAX_MEETING_SHARE)


@njit_inline
def _scan(integration: Integration, model: Model, e: int) -> tuple[float, float]:
    """Return shares of the step to a meeting of bodies that part again before its end, and to any; `NOTHING_MISSED`.

    Those that are not apart at its end are another meeting where the step does not know of their contact.
    """
    structure, parameters, pieces = model.structure, model.parameters, model.work.paths
    looks = pieces.looks
    _look(integration, model, e, 1.0, looks[1])
    _look(integration, model, e, 0.0, looks[0])
    pieces.ahead[e] = looks[1, LOOK.gap] - GAP_ACCURACY
    parted, met, depth = looks[0, LOOK.gap] >= 0.0, NOTHING_MISSED, 1
    while depth > 0:
        one, two = looks[0], looks[depth]
        if depth < MAX_LOOKS - 2 and not _is_clear(structure, parameters, pieces, e, one, two):
            depth += 1
            _look(integration, model, e, 0.5 * (one[LOOK.share] + two[LOOK.share]), looks[depth])
            continue
        if two[LOOK.gap] >= 0.0:
            if met < NOTHING_MISSED:
                return met, met
            parted = True
        elif parted and met == NOTHING_MISSED:
            met = _meeting(integration, model, e, one, two)
        for i in range(looks.shape[1]):
            one[i] = two[i]
        depth -= 1
    return NOTHING_MISSED, met


@njit_always_inline
def _is_pressed(structure: Structure, rows: Matrix, k: int) -> bool:
    """Return whether a contact presses, or would if it were not frozen open."""
    pressed = False
    for g in range(structure.groups.first.size):
        if structure.groups.first[g] <= k < structure.groups.end[g]:
            pressed = rows[structure.groups.kink[g], k] > 0.0
    return pressed


@njit_always_inline
def detect_missed_contacts(integration: Integration, model: Model) -> float:
    """Return the share of a tried step after which bodies touch and part again before its end, or `NOTHING_MISSED`.

    It is `MISSED_BY_CULLING` if a culled pair is closed at the end, or may be: it is active now.
    """
    structure, parameters = model.structure, model.parameters
    pieces, rows, state = model.work.paths, model.work.rows, model.state
    paths, size, first, woken = structure.paths, structure.parents.size, NOTHING_MISSED, False
    seen = -1
    bound_step_motion(integration.dense, integration.k, integration.x, state, size, pieces)
    for p in range(pieces.resting.size):
        if rests(structure, parameters, p, pieces):
            continue
        for e in range(paths.pair_start[p], paths.pair_start[p + 1]):
            k, path = paths.row[e], bound_relative_path(structure, parameters, e, pieces)
            pieces.path[e] = path
            if pieces.culled[k]:
                pieces.ahead[e] = pieces.clear[e] - path
                if pieces.ahead[e] > 0.0:
                    continue
                share, seen = _scan(integration, model, e)[0], e
                if share < NOTHING_MISSED or pieces.ahead[e] < 0.0:
                    # Until it is listed again it exerts nothing, whatever else the step has met.
                    set_culled(structure, k, 0, pieces.culled)
                    woken = True
            else:
                start, end = pieces.clear[e], pieces.out[e, GAP_OUT.gap]
                pieces.ahead[e] = end - GAP_ACCURACY - path
                if min(start, end) >= 0.0 and path < start + end:
                    continue
                if max(start, end) < 0.0 and rows[ROW.side, k] > 0.0:
                    continue
                ahead = pieces.ahead[e]
                (parting, meeting), seen = _scan(integration, model, e), e
                share = parting if _is_pressed(structure, rows, k) else meeting
                pieces.ahead[e] = ahead
            first = min(first, share)
    if seen >= 0:
        # Bodies are where the step ends again.
        _look(integration, model, seen, 1.0, pieces.looks[0])
    for j in range(size):
        state[j] = pieces.control[j, 4]
    return MISSED_BY_CULLING if woken else first
