"""Paths through space, compiled: `pieces.path_kinematics`, one posture at a time."""

from __future__ import annotations

import numpy as np

from finger_pin.core.addresses.law_code import ROW
from finger_pin.core.addresses.spatial import dot
from finger_pin.core.evaluation.rigid_body_dynamics import move
from finger_pin.core.jit import (
    CompiledFunction,
    Indices,
    Matrix,
    Vector,
    call_shape,
    njit_always_inline,
    njit_inline,
    unpack,
)
from finger_pin.core.tables.buffers import Work
from finger_pin.core.tables.mechanism_parameters import Parameters
from finger_pin.core.tables.model import MODEL
from finger_pin.core.tables.path_movers import PIECE
from finger_pin.core.tables.path_tables import WRENCH, PathParameters, PathStructure, PathWork
from finger_pin.core.tables.structure import Structure
from finger_pin.mechanism.gaps.signed_distance import GAP_OUT, POINT
from finger_pin.mechanism.spans.span import COINCIDENT, SPAN_OUT


@njit_inline
def add_moment(point: Vector, force: Vector, out: Vector) -> None:
    """Add the moment of a force at a point."""
    out[0] += point[1] * force[2] - point[2] * force[1]
    out[1] += point[2] * force[0] - point[0] * force[2]
    out[2] += point[0] * force[1] - point[1] * force[0]


@njit_always_inline
def _frame(paths: PathStructure, geometry: PathParameters, e: int, work: Work) -> None:
    """Place a piece's frame and its points, and express its points in the frame."""
    pieces = work.paths
    rotation, origin, ends = pieces.frame[e], pieces.origin[e], pieces.ends[e]
    body = paths.bodies[e, PIECE.frame]
    if body >= 0:
        above = work.rotation[body]
        for r in range(3):
            origin[r] = work.origin[body, r]
            for i in range(3):
                origin[r] += above[r, i] * geometry.origin[e, i]
            for c in range(3):
                rotation[r, c] = 0.0
                for i in range(3):
                    rotation[r, c] += above[r, i] * geometry.rotation[e, i, c]
    for p in range(2 + paths.thirds[e]):
        body = paths.bodies[e, PIECE.third if p == 2 else p]
        for r in range(3):
            value = geometry.points[e, 3 * p + r]
            if body >= 0:
                value = work.origin[body, r]
                for i in range(3):
                    value += work.rotation[body, r, i] * geometry.points[e, 3 * p + i]
            ends[3 * p + r] = value
        for c in range(3):
            value = 0.0
            for r in range(3):
                value += rotation[r, c] * (ends[3 * p + r] - origin[r])
            pieces.local_points[e, 3 * p + c] = value


@njit_inline
def turn_out(rotation: Matrix, out: Vector, first: int, vector: Vector) -> None:
    """Fill three numbers of a wrench with a vector given in a frame."""
    for r in range(3):
        vector[r] = rotation[r, 0] * out[first] + rotation[r, 1] * out[first + 1] + rotation[r, 2] * out[first + 2]


@njit_inline
def look_at(paths: PathStructure, geometry: PathParameters, e: int, work: Work) -> bool:
    """Fill value and wrenches of a piece between placed bodies; return false if it is out of reach."""
    pieces = work.paths
    _frame(paths, geometry, e, work)
    out, points = pieces.out[e], pieces.local_points[e]
    beyond = 0.0
    for c in range(3):
        middle = 0.5 * (points[POINT.first + c] + points[POINT.second + c])
        beyond += middle * middle
    beyond = np.sqrt(beyond) - geometry.reach[e]
    if beyond > 0.0:
        out[GAP_OUT.gap] = beyond
    else:
        call_shape(paths.value[e], points, geometry.shapes[e], out)
    return not beyond > 0.0


@njit_inline
def net_wrench(moves: Indices, wrench: Vector, out: Vector) -> None:
    """Fill the wrench on all of the three bodies that a coordinate moves."""
    first, second = 1.0 * (moves[0] - moves[2]), 1.0 * (moves[1] - moves[2])
    for i in range(6):
        out[i] = first * wrench[i] + second * wrench[6 + i]


@njit_inline
def _measure(paths: PathStructure, geometry: PathParameters, e: int, work: Work) -> None:
    """Fill the value of a piece, its wrenches and arms; forget the corner before it."""
    pieces = work.paths
    look_at(paths, geometry, e, work)
    out, columns = pieces.out[e], paths.columns[e]
    pieces.active[e] = 1 if columns == 1 or out[GAP_OUT.gap] < 0.0 or work.rows[ROW.side, paths.row[e]] > 0.0 else 0
    rotation, ends, point = pieces.frame[e], pieces.ends[e], work.centre
    if pieces.active[e] == 0:
        return
    for m in range(columns):
        for i in range(WRENCH):
            pieces.wrench[e, m, i] = 0.0
    if columns == 1:
        pieces.before[e] = -1
        wrench = pieces.wrench[e, 0]
        for p in range(2):
            turn_out(rotation, out, SPAN_OUT.first_pull + 3 * p, wrench[6 * p + 3 : 6 * p + 6])
            add_moment(ends[3 * p : 3 * p + 3], wrench[6 * p + 3 : 6 * p + 6], wrench[6 * p : 6 * p + 3])
    else:
        turn_out(rotation, out, GAP_OUT.point, point)
        for r in range(3):
            point[r] += pieces.origin[e, r]
        # A moment about the normal.
        for m in range(3, columns):
            turn_out(rotation, out, GAP_OUT.normal, pieces.wrench[e, m, :3])
        for m in range(3):
            wrench = pieces.wrench[e, m]
            turn_out(rotation, out, GAP_OUT.normal if m == 0 else GAP_OUT.first_tangent + 3 * (m - 1), wrench[3:6])
            add_moment(point, wrench[3:6], wrench[:3])
    net = work.vectors[0]
    for r in range(paths.start[e], paths.start[e] + paths.acting[e]):
        for m in range(columns):
            net_wrench(paths.moves[r], pieces.wrench[e, m], net)
            pieces.arm[r, m] = dot(work.spatial.axis[paths.at[r]], net)


@njit_inline
def angle_between(first: Vector, second: Vector) -> tuple[float, float]:
    """Return cosine and sine of the angle between a path's directions before and after a point."""
    cosine = -(first[0] * second[0] + first[1] * second[1] + first[2] * second[2])
    x = first[1] * second[2] - first[2] * second[1]
    y = first[2] * second[0] - first[0] * second[2]
    z = first[0] * second[1] - first[1] * second[0]
    return cosine, np.sqrt(x * x + y * y + z * z)


@njit_inline
def _corner(pieces: PathWork, before: int, e: int) -> float:
    """Return the angle between two pieces of a path, computed once for all rows of a cord."""
    if pieces.before[e] != before:
        cosine, sine = angle_between(pieces.wrench[before, 0, 9:12], pieces.wrench[e, 0, 3:6])
        pieces.before[e], pieces.corner[e] = before, np.arctan2(sine, cosine)
    return pieces.corner[e]


@CompiledFunction
def look(address: int, piece: float) -> int:
    """Place all bodies, and fill value and wrenches of a piece; return 0 if it is out of reach, else 1."""
    model = unpack(address, MODEL)
    work, width = model.work, model.work.torque.size
    move(model.structure, model.parameters, model.state[:width], model.state[width : 2 * width], work)
    return 1 if look_at(model.structure.paths, model.parameters.paths, int(piece), work) else 0


@njit_always_inline
def measure_paths(structure: Structure, parameters: Parameters, work: Work) -> None:
    """Fill lengths, turns and arms of all rows with paths, after `move`; of contacts, which come first, if active."""
    paths, geometry, pieces, first, arms = (
        structure.paths,
        parameters.paths,
        work.paths,
        structure.contact_rows,
        structure.contact_arms,
    )
    closed = 0
    for index in range(pieces.active_pair_count[0]):
        e = pieces.active_pairs[index]
        _measure(paths, geometry, e, work)
        if pieces.active[e]:
            pieces.closed[closed] = e
            closed += 1
        else:
            pieces.length[paths.row[e]] = pieces.out[e, GAP_OUT.gap]
    pieces.closed_count[0] = closed
    for e in range(first // arms, paths.columns.size):
        _measure(paths, geometry, e, work)
    gather = pieces.gather
    for at in range(arms * closed + paths.rows.size - first):
        # The rows of contacts are their places, too.
        index = at - arms * closed + first
        if at < arms * closed:
            index = paths.row[pieces.closed[at // arms]] + at % arms
        k = paths.rows[index]
        length, turn, before, bends = 0.0, 0.0, -1, False
        begin, end = structure.arm_start[k], structure.arm_start[k + 1]
        for a in range(begin, end):
            work.arm[a] = parameters.arm[a]
            work.gradient[a] = parameters.measure[a]
        for leg in range(paths.leg_start[index], paths.leg_start[index + 1]):
            e, m = paths.piece[leg], paths.column[leg]
            if m == 0:
                length += geometry.weight[leg] * pieces.out[e, SPAN_OUT.length]
            if pieces.active[e] == 0:
                continue
            if paths.bends[leg] and paths.columns[e] == 1:
                turn += pieces.out[e, SPAN_OUT.turn]
            before, bends = (before, bends or paths.bends[leg] > 0) if paths.follows[leg] else (-1, False)
            if paths.columns[e] == 1 and pieces.out[e, SPAN_OUT.length] > COINCIDENT:
                if before >= 0 and bends:
                    turn += _corner(pieces, before, e)
                before, bends = e, False
            for r in range(paths.start[e], paths.start[e] + paths.acting[e]):
                gather[paths.at[r]] += geometry.weight[leg] * pieces.arm[r, m]
        for a in range(begin, end):
            j = structure.arm_at[a]
            work.arm[a] += gather[j]
            work.gradient[a] += gather[j]
            gather[j] = 0.0
        pieces.length[k], pieces.turn[k] = length, turn


@njit_always_inline
def push(structure: Structure, work: Work) -> None:
    """Fill the forces of all contacts, after their law."""
    paths, pieces = structure.paths, work.paths
    for index in range(pieces.closed_count[0]):
        e = pieces.closed[index]
        for r in range(3):
            pieces.push[e, r] = 0.0
            for m in range(3):
                pieces.push[e, r] += work.rows[ROW.force, paths.row[e] + m] * pieces.wrench[e, m, 3 + r]


@njit_inline
def passes(paths: PathStructure, e: int, body: int) -> float:
    """Return the count of passages of a contact's force, less its reaction, through the pin of a body."""
    first, second = paths.bodies[e, PIECE.first], paths.bodies[e, PIECE.frame]
    beyond = 0.0
    if first >= 0 and (first == body or paths.carries[body, first]):
        beyond += 1.0
    if second >= 0 and (second == body or paths.carries[body, second]):
        beyond -= 1.0
    return beyond
