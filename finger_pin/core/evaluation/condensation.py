"""The linear systems that an implicit method solves, condensed to one equation per coordinate.

A Rosenbrock stage solves (g - J) u = r. Every row turns its slopes into the change of its force d phi in terms of the
changes dq and dv of positions and velocities, and of its own r:

    d l = A dq,  d l' = A dv,  d N and d u from the rows before,
    g dz - dz' = r_z   with  dz' = by l, l', N, u, curvature, and z itself: one division,

where rows read states of others, the changes of these states are unknowns besides, solved for when all rows are known,
and what is left is (g M + dh/dv - sum A^T G_v + (dh/dq - sum A^T G_q) / g) dv = M r_v - ... . All of it is linear in
r, so right-hand sides and gains are kept as matrices: a stage costs a product with each, and one substitution.
"""

from __future__ import annotations

from finger_pin.core.addresses.law_code import SLOPE
from finger_pin.core.evaluation.blocks import add_contact_gain, extent, factorise, substitute
from finger_pin.core.evaluation.readings import add_readings, resolve_readings
from finger_pin.core.jit import (
    CompiledFunction,
    Indices,
    Vector,
    call_at,
    copy,
    njit_always_inline,
    njit_inline,
    sum_products,
    unpack,
)
from finger_pin.core.tables.linear_systems import Linear
from finger_pin.core.tables.model import MODEL, Model
from finger_pin.core.tables.structure import Structure


@njit_always_inline
def _add_scaled(out: Vector, factor: float, source: Vector, size: int) -> None:
    """Add a multiple of the first numbers of an array."""
    for c in range(size):
        out[c] += factor * source[c]


@njit_inline
def _terms(model: Model, begin: int, end: int, slope: float, width: int, wide: int, out: Vector) -> None:
    """Fill the change of a weighted sum of earlier forces, times a slope."""
    structure, linear = model.structure, model.linear
    for c in range(wide):
        out[c] = 0.0
    for e in range(begin, end):
        k, weight = structure.terms[e], slope * model.parameters.weights[e]
        if k < structure.contact_rows:
            add_contact_gain(structure, linear.blocks, k, weight, linear.contact_gain[k], width, out)
        else:
            _add_scaled(out, weight, linear.gain[k - structure.contact_rows], wide)


@njit_always_inline
def _fill_external_forces(model: Model, address: int, g: float, b: int, width: int, wide: int) -> None:
    """Fill A^T d phi of a block by forces other than its rows': inertial forces, those at tips, and contacts."""
    structure, parameters = model.structure, model.parameters
    work, linear, force = model.work, model.linear, model.linear.force
    places, last = linear.blocks.coordinates[linear.blocks.coordinate_start[b] :], wide - 1
    for j in range(width):
        for c in range(wide + structure.read_states.size):
            force[j, c] = 0.0
        force[j, last] -= linear.bias_rate[places[j]]
    if parameters.has_tip_force:
        for t in range(structure.tip_body.size):
            for j in range(width):
                for r in range(3):
                    force[j, last] += work.jacobian[t, r, places[j]] * work.force_rate[t, r]
    if structure.contact_rows:
        linear.blocks.current[0] = b
        call_at(model.fill_contact_gains, address, g)


@njit_always_inline
def _load(model: Model, address: int, k: int, places: Indices, width: int, wide: int) -> None:
    """Fill the change of a row's load."""
    structure, parameters, linear, load = model.structure, model.parameters, model.linear, model.linear.load
    full, begin, end = wide + structure.read_states.size, structure.load_start[k], structure.load_start[k + 1]
    _terms(model, begin, end, linear.load_slope[k], width, full, load)
    if (parameters.has_tip_force or structure.contact_rows) and structure.joint_pin[k] >= 0:
        for c in range(width):
            load[c] += linear.load_by_position[k, places[c]]
        load[wide - 1] += linear.load_by_time[k]
        if structure.contact_rows:
            call_at(model.add_pushes, address, float(k))


@njit_always_inline
def _command(model: Model, k: int, places: Indices, width: int, wide: int) -> None:
    """Fill the change of a row's input."""
    structure, control, command = model.structure, model.control, model.linear.command
    full = wide + structure.read_states.size
    _terms(model, structure.input_start[k], structure.input_start[k + 1], 1.0, width, full, command)
    channel = structure.channel[k]
    if channel >= 0:
        for c in range(width):
            command[c] += control.by_position[channel, places[c]]
            command[width + c] += control.by_velocity[channel, places[c]]
        command[wide - 1] += control.by_time[channel]


@njit_inline
def _add_motion(
    model: Model, k: int, width: int, by_length: float, by_speed: float, by_curvature: float, out: Vector
) -> None:
    """Add slopes by a row's length, speed and curvature, by coordinates and velocities."""
    structure, linear, place = model.structure, model.linear, model.linear.blocks.place
    for e in range(structure.arm_start[k], structure.arm_start[k + 1]):
        out[place[structure.arm_at[e]]] += by_length * linear.measure[e] + by_speed * linear.turning[e]
        out[width + place[structure.arm_at[e]]] += by_speed * linear.arm[e]
    for e in range(structure.bend_start[k], structure.bend_start[k + 1]):
        out[place[structure.bend_at[e]]] += by_curvature * linear.bend[e]


@njit_inline
def _push(structure: Structure, linear: Linear, k: int, full: int, row: Vector) -> None:
    """Add A^T d phi of a row."""
    for e in range(structure.arm_start[k], structure.arm_start[k + 1]):
        _add_scaled(linear.force[linear.blocks.place[structure.arm_at[e]]], linear.arm[e], row, full)


@njit_inline
def _gains(model: Model, address: int, g: float, b: int, width: int, wide: int) -> bool:
    """Fill the gains of a block's rows and states, and sum up A^T d phi; false if states that are read are singular."""
    structure, parameters = model.structure, model.parameters
    linear, slopes, blocks = model.linear, model.work.slopes, model.linear.blocks
    load, command = linear.load, linear.command
    own_places = blocks.coordinates[blocks.coordinate_start[b] : blocks.coordinate_start[b + 1]]
    full, first = wide + structure.read_states.size, linear.contact_state_gain.shape[0]
    _fill_external_forces(model, address, g, b, width, wide)
    for index in range(blocks.row_start[b], blocks.row_start[b + 1]):
        k = blocks.rows[index]
        row, state = linear.gain[k - structure.contact_rows], structure.state[k]
        of_length, of_speed = slopes[SLOPE.force_by_length, k], slopes[SLOPE.force_by_speed, k]
        of_curvature = slopes[SLOPE.force_by_curvature, k]
        of_load, of_command = slopes[SLOPE.force_by_load, k], slopes[SLOPE.force_by_command, k]
        by_load = by_command = 0.0
        factor = total = 0.0
        if state >= 0:
            factor = 1.0 / (g - slopes[SLOPE.rate_by_state, k])
            by_load, by_command = factor * slopes[SLOPE.rate_by_load, k], factor * slopes[SLOPE.rate_by_command, k]
            # d phi by z and by z' = g dz - r_z.
            total = slopes[SLOPE.force_by_state, k] + g * slopes[SLOPE.force_by_rate, k]
        state_gain = linear.state_gain[max(state - first, 0)]
        for c in range(full):
            row[c] = 0.0
        if state >= 0:
            for c in range(full):
                state_gain[c] = 0.0
        pressed = structure.load_start[k + 1] > structure.load_start[k] or (
            structure.contact_rows and structure.joint_pin[k] >= 0
        )
        if pressed and (of_load != 0.0 or by_load != 0.0):
            _load(model, address, k, own_places, width, wide)
            _add_scaled(row, of_load, load, full)
            if by_load != 0.0:
                _add_scaled(state_gain, by_load, load, full)
        fed = structure.channel[k] >= 0 or structure.input_start[k + 1] > structure.input_start[k]
        if fed and (of_command != 0.0 or by_command != 0.0):
            _command(model, k, own_places, width, wide)
            _add_scaled(row, of_command, command, full)
            if by_command != 0.0:
                _add_scaled(state_gain, by_command, command, full)
        reads = structure.read_start[k + 1] > structure.read_start[k]
        if state >= 0:
            by_length, by_speed = factor * slopes[SLOPE.rate_by_length, k], factor * slopes[SLOPE.rate_by_speed, k]
            _add_motion(model, k, width, by_length, by_speed, factor * slopes[SLOPE.rate_by_curvature, k], state_gain)
            if reads:
                add_readings(structure, parameters, k, factor * slopes[SLOPE.rate_by_reading, k], wide, state_gain)
            _add_scaled(row, total, state_gain, full)
            # The column of r_z itself, without the difference g dz - r_z.
            itself = 2 * width + blocks.state_place[state]
            state_gain[itself] += factor
            row[itself] += factor * (
                slopes[SLOPE.force_by_state, k] + slopes[SLOPE.force_by_rate, k] * slopes[SLOPE.rate_by_state, k]
            )
        elif of_length == 0.0 and of_speed == 0.0 and of_curvature == 0.0 and not (pressed or fed or reads):
            # An idle row, such as a limiter inside its range.
            continue
        _add_motion(model, k, width, of_length, of_speed, of_curvature, row)
        if reads:
            add_readings(structure, parameters, k, slopes[SLOPE.force_by_reading, k], wide, row)
        _push(structure, linear, k, full, row)
    return full == wide or resolve_readings(structure, linear, b, width, wide)


@CompiledFunction
def condense(address: int, g: float) -> int:
    """Factorise g - J, after `linearise`; return 0 if it is singular, else 1."""
    model = unpack(address, MODEL)
    linear, blocks = model.linear, model.linear.blocks
    linear.inverse_shift[0] = 1.0 / g
    for index in range(blocks.active_state_count[0]):
        s = blocks.active_states[index]
        linear.loose[s] = 1.0 / (g + blocks.loose[s]) if blocks.loose[s] > 0.0 else 0.0
    for b in range(blocks.number[0]):
        if not _condense_block(model, address, g, b):
            return 0
    return 1


@njit_always_inline
def _condense_block(model: Model, address: int, g: float, b: int) -> bool:
    """Fill the reduced system of a block, factorised, and its right-hand sides; false if it is singular."""
    linear, blocks = model.linear, model.linear.blocks
    begin, end = blocks.coordinate_start[b], blocks.coordinate_start[b + 1]
    places = blocks.coordinates[begin:end]
    width, wide = extent(blocks, b)
    if not _gains(model, address, g, b, width, wide):
        return False
    force, velocity, reduced = linear.force, linear.velocity[begin:end], linear.reduced[begin:end]
    inverse = 1.0 / g
    for i in range(width):
        at_row = places[i]
        of_mass, of_position, of_velocity = linear.mass[at_row], linear.by_position[at_row], linear.by_velocity[at_row]
        for j in range(width):
            by_position = (of_position[places[j]] - force[i, j]) * inverse
            reduced[i, j] = g * of_mass[places[j]] + of_velocity[places[j]] - force[i, width + j] + by_position
            velocity[i, j] = -by_position
            velocity[i, width + j] = of_mass[places[j]]
        for c in range(2 * width, wide):
            velocity[i, c] = force[i, c]
        if model.structure.prescribed[at_row] >= 0:
            # v' is given as a function of time.
            for j in range(width):
                reduced[i, j] = 0.0
            for c in range(wide):
                velocity[i, c] = 0.0
            reduced[i, i], velocity[i, width + i] = g, 1.0
            velocity[i, wide - 1] = model.work.guide_rate[model.structure.prescribed[at_row]]
    return factorise(reduced, width, linear.pivots[begin:end])


@njit_always_inline
def _solve_velocities(linear: Linear, begin: int, width: int, wide: int) -> None:
    """Replace r of a block's positions and velocities by their changes."""
    right, change, inverse = linear.right, linear.change, linear.inverse_shift[0]
    for i in range(width):
        change[i] = sum_products(linear.velocity[begin + i], right, wide)
    substitute(linear.reduced[begin : begin + width], width, linear.pivots[begin : begin + width], change)
    # Gains multiply dq = (r_q + dv) / g and dv.
    for i in range(width):
        right[i], right[width + i] = (right[i] + change[i]) * inverse, change[i]


@njit_inline
def solve(linear: Linear, r: Vector, u: Vector) -> None:
    """Fill u with the solution of (g - J) u = r; the last entry of r is h d_i. States of culled contacts stay."""
    blocks, right = linear.blocks, linear.right
    whole = linear.mass.shape[0]
    if blocks.touches.size == 0:
        # One block for good, all in its order.
        copy(r, right)
        _solve_velocities(linear, 0, whole, r.size)
        for i in range(2 * whole):
            u[i] = right[i]
        for s in range(u.size - 2 * whole):
            u[2 * whole + s] = sum_products(linear.state_gain[s], right, r.size)
        return
    for index in range(blocks.active_state_count[0]):
        s = blocks.active_states[index]
        u[2 * whole + s] = linear.loose[s] * r[2 * whole + s]
    for b in range(blocks.number[0]):
        begin, end = blocks.coordinate_start[b], blocks.coordinate_start[b + 1]
        places = blocks.coordinates[begin:end]
        states = blocks.states[blocks.state_start[b] : blocks.state_start[b + 1]]
        width, wide = extent(blocks, b)
        for c in range(width):
            right[c], right[width + c] = r[places[c]], r[whole + places[c]]
        for c in range(states.size):
            right[2 * width + c] = r[2 * whole + states[c]]
        right[wide - 1] = r[r.size - 1]
        _solve_velocities(linear, begin, width, wide)
        for i in range(width):
            u[places[i]], u[whole + places[i]] = right[i], right[width + i]
        first = linear.contact_state_gain.shape[0]
        slips = linear.contact_state_gain.shape[1] - 2 * whole
        touching = slips * (blocks.touch_start[b + 1] - blocks.touch_start[b])
        for c in range(touching):
            gain, own = linear.contact_state_gain[states[c]], 2 * width + c - c % slips
            change = sum_products(gain, right, 2 * width)
            for j in range(slips):
                change += gain[2 * width + j] * right[own + j]
            u[2 * whole + states[c]] = change
        for s in states[touching:]:
            u[2 * whole + s] = sum_products(linear.state_gain[s - first], right, wide)
