"""Exact derivatives of paths through space.

The wrenches of a piece turn with the body that carries its frame, and change with the points as that frame sees them.
"""

from __future__ import annotations

from finger_pin.core.addresses.law_code import ROW
from finger_pin.core.addresses.spatial import add_force_cross, dot, motion_cross
from finger_pin.core.evaluation.blocks import partition
from finger_pin.core.evaluation.paths import add_moment, angle_between, net_wrench, passes, turn_out
from finger_pin.core.jit import CompiledFunction, Matrix, Vector, call_shape, njit_always_inline, njit_inline, unpack
from finger_pin.core.tables.buffers import Work
from finger_pin.core.tables.linear_systems import Linear
from finger_pin.core.tables.model import MODEL
from finger_pin.core.tables.path_movers import PIECE
from finger_pin.core.tables.path_tables import WRENCH, PathParameters, PathStructure
from finger_pin.core.tables.structure import Structure
from finger_pin.mechanism.gaps.signed_distance import GAP_OUT, GAP_SLOPE, POINT, SLOPE_WIDTH
from finger_pin.mechanism.spans.span import COINCIDENT, SPAN_OUT, SPAN_SLOPE


@njit_always_inline
def _seen_from(axis: Vector, rotation: Matrix, point: Vector, weight: float, out: Vector) -> None:
    """Fill a frame's view of a point's velocity, for a unit rate of a coordinate."""
    x = weight * (axis[3] + axis[1] * point[2] - axis[2] * point[1])
    y = weight * (axis[4] + axis[2] * point[0] - axis[0] * point[2])
    z = weight * (axis[5] + axis[0] * point[1] - axis[1] * point[0])
    for c in range(3):
        out[c] = rotation[0, c] * x + rotation[1, c] * y + rotation[2, c] * z


@njit_inline
def _changed(slopes: Vector, first: int, dy: Vector, rotation: Matrix, out: Vector) -> None:
    """Fill a vector's change in base axes, from three rows of slopes."""
    for r in range(3):
        out[r] = 0.0
    for i in range(3):
        change = 0.0
        for c in range(SLOPE_WIDTH):
            change += slopes[first + SLOPE_WIDTH * i + c] * dy[c]
        for r in range(3):
            out[r] += rotation[r, i] * change


@njit_inline
def _slopes_of_piece(paths: PathStructure, geometry: PathParameters, e: int, work: Work) -> None:
    """Fill the derivatives of a piece's wrenches and turn by the coordinates that move it."""
    pieces = work.paths
    rotation, ends, columns, slopes = pieces.frame[e], pieces.ends[e], paths.columns[e], pieces.slopes
    dy, moved, point = work.vectors[0], work.vectors[1], work.centre
    call_shape(paths.slopes[e], pieces.local_points[e], geometry.shapes[e], slopes)
    turn_out(rotation, pieces.out[e], GAP_OUT.point, point)
    for r in range(3):
        point[r] += pieces.origin[e, r]
    for s in range(paths.start[e], paths.start[e + 1]):
        axis, moves = work.spatial.axis[paths.at[s]], paths.moves[s]
        for p in range(2):
            weight = 1.0 * (moves[p] - moves[PIECE.frame])
            _seen_from(axis, rotation, ends[3 * p : 3 * p + 3], weight, dy[3 * p : 3 * p + 3])
        if columns > 1 and paths.thirds[e]:
            # The slopes of a gap of three points are by the angular velocity.
            for c in range(3):
                turning = rotation[0, c] * axis[0] + rotation[1, c] * axis[1] + rotation[2, c] * axis[2]
                dy[POINT.second + c] = (moves[0] - moves[PIECE.frame]) * turning
        for m in range(columns):
            wrench, out = pieces.wrench[e, m], pieces.wrench_slope[s, m]
            for i in range(WRENCH):
                out[i] = 0.0
            if columns == 1:
                turn = 0.0
                for c in range(SLOPE_WIDTH):
                    turn += slopes[SPAN_SLOPE.turn + c] * dy[c]
                pieces.turn_slope[s] = turn
                for p in range(2):
                    force = out[6 * p + 3 : 6 * p + 6]
                    _changed(slopes, SPAN_SLOPE.first_pull + 3 * SLOPE_WIDTH * p, dy, rotation, force)
                    add_moment(ends[3 * p : 3 * p + 3], force, out[6 * p : 6 * p + 3])
                    turn_out(rotation, dy, 3 * p, moved)
                    add_moment(moved, wrench[6 * p + 3 : 6 * p + 6], out[6 * p : 6 * p + 3])
            elif m > 2:
                _changed(slopes, GAP_SLOPE.normal, dy, rotation, out[:3])
            else:
                force = out[3:6]
                first = GAP_SLOPE.normal if m == 0 else GAP_SLOPE.first_tangent + 3 * SLOPE_WIDTH * (m - 1)
                _changed(slopes, first, dy, rotation, force)
                add_moment(point, force, out[:3])
                _changed(slopes, GAP_SLOPE.point, dy, rotation, moved)
                add_moment(moved, wrench[3:6], out[:3])
            if moves[PIECE.frame]:
                for p in range(2):
                    add_force_cross(axis, wrench[6 * p : 6 * p + 6], out[6 * p : 6 * p + 6])


@njit_inline
def _turns_alike(paths: PathStructure, s: int, e: int, other: int) -> bool:
    """Return whether the coordinate at an entry of a piece turns it and another piece alike."""
    if s < paths.start[e] + paths.acting[e]:
        return False
    j, body = paths.at[s], paths.bodies[other, PIECE.second]
    for a in range(paths.start[other], paths.start[other] + paths.acting[other]):
        if paths.at[a] == j:
            return False
    return body >= 0 and (j == body or paths.carries[j, body] > 0)


@njit_always_inline
def _add_turns(structure: Structure, work: Work, linear: Linear, index: int) -> None:
    """Add the derivatives of the angle by which a row's path turns."""
    paths, pieces = structure.paths, work.paths
    k, gather, before, bends = paths.rows[index], pieces.gather, -1, False
    for leg in range(paths.leg_start[index], paths.leg_start[index + 1]):
        e = paths.piece[leg]
        if paths.bends[leg]:
            for s in range(paths.start[e], paths.start[e + 1]):
                gather[paths.at[s]] += pieces.turn_slope[s]
        before, bends = (before, bends or paths.bends[leg] > 0) if paths.follows[leg] else (-1, False)
        if not pieces.out[e, SPAN_OUT.length] > COINCIDENT:
            continue
        earlier, turning, before, bends = before, bends, e, False
        if earlier < 0 or not turning:
            continue
        incoming, outgoing = pieces.wrench[earlier, 0, 9:12], pieces.wrench[e, 0, 3:6]
        _, sine = angle_between(incoming, outgoing)
        # A straight corner is a kink, as |q| is at 0.
        inverse = 1.0 / sine if sine > 1e-12 else 0.0
        for s in range(paths.start[e], paths.start[e + 1]):
            change = pieces.wrench_slope[s, 0]
            if _turns_alike(paths, s, e, earlier):
                continue
            for r in range(3):
                gather[paths.at[s]] += inverse * incoming[r] * change[3 + r]
        for s in range(paths.start[earlier], paths.start[earlier + 1]):
            change = pieces.wrench_slope[s, 0]
            if _turns_alike(paths, s, earlier, e):
                continue
            for r in range(3):
                gather[paths.at[s]] += inverse * change[9 + r] * outgoing[r]
    for b in range(structure.bend_start[k], structure.bend_start[k + 1]):
        linear.bend[b] += gather[structure.bend_at[b]]
    for j in range(gather.size):
        gather[j] = 0.0


@njit_always_inline
def _turn_pushes(structure: Structure, work: Work, k: int, by_position: Vector) -> None:
    """Add to a pin's load the change from contacts that turn with the posture at constant forces."""
    paths, pieces = structure.paths, work.paths
    size = max(work.rows[ROW.load, k], 1e-100)
    for index in range(pieces.closed_count[0]):
        e = pieces.closed[index]
        share = passes(paths, e, structure.joint_pin[k]) / size
        if share == 0.0:
            continue
        for s in range(paths.start[e], paths.start[e + 1]):
            for m in range(3):
                force = share * work.rows[ROW.force, paths.row[e] + m]
                for r in range(3):
                    by_position[paths.at[s]] += force * work.pull[k, r] * pieces.wrench_slope[s, m, 3 + r]


@CompiledFunction
def linearise_paths(address: int, _time: float) -> int:
    """Fill the derivatives of arms, turns and loads by contacts; subtract those of A^T phi from by_position."""
    model = unpack(address, MODEL)
    structure, parameters, work, linear = model.structure, model.parameters, model.work, model.linear
    velocity = model.state[work.torque.size : 2 * work.torque.size]
    paths, geometry, pieces, touching, arms = (
        structure.paths,
        parameters.paths,
        work.paths,
        structure.contact_rows,
        structure.contact_arms,
    )
    closed = arms * pieces.closed_count[0]
    for index in range(pieces.closed_count[0]):
        _slopes_of_piece(paths, geometry, pieces.closed[index], work)
    for e in range(touching // arms, paths.columns.size):
        _slopes_of_piece(paths, geometry, e, work)
    axes, gather, net, crossed = work.spatial.axis, pieces.gather, work.vectors[0], work.vectors[1]
    for at in range(closed + paths.rows.size - touching):
        index = paths.row[pieces.closed[at // arms]] + at % arms if at < closed else at - closed + touching
        k = paths.rows[index]
        if k >= touching:
            _add_turns(structure, work, linear, index)
        for leg in range(paths.leg_start[index], paths.leg_start[index + 1]):
            e, m = paths.piece[leg], paths.column[leg]
            weight = geometry.weight[leg]
            force = weight * work.rows[ROW.force, k]
            begin, end = paths.start[e], paths.start[e] + paths.acting[e]
            for r in range(begin, end):
                i, turning = paths.at[r], 0.0
                for s in range(begin, end):
                    j = paths.at[s]
                    net_wrench(paths.moves[s], pieces.wrench_slope[r, m], net)
                    slope = dot(axes[j], net)
                    if paths.carries[i, j]:
                        # A joint nearer to the base turns the axes of those that it carries.
                        motion_cross(axes[i], axes[j], crossed)
                        net_wrench(paths.moves[s], pieces.wrench[e, m], net)
                        slope += dot(crossed, net)
                    linear.by_position[j, i] -= force * slope
                    turning += slope * velocity[j]
                gather[i] += weight * turning
        for a in range(structure.arm_start[k], structure.arm_start[k + 1]):
            linear.arm[a], linear.measure[a] = work.arm[a], work.gradient[a]
            linear.turning[a] = gather[structure.arm_at[a]]
            gather[structure.arm_at[a]] = 0.0
    if structure.contact_rows:
        for k in range(structure.joint_pin.size):
            if structure.joint_pin[k] >= 0:
                _turn_pushes(structure, work, k, linear.load_by_position[k])
        partition(structure, work, linear.blocks, linear.contact_gain)
    return 1
