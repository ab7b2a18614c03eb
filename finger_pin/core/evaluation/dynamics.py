"""The right-hand side of (18), compiled: `Mechanism.evaluate`, one state at a time."""

from __future__ import annotations

import numpy as np

from finger_pin.core.buffers import Work
from finger_pin.core.evaluation.input_values import inputs, tip_forces
from finger_pin.core.evaluation.law_code import ROW
from finger_pin.core.evaluation.paths import passes
from finger_pin.core.evaluation.rigid_body_dynamics import (
    factorise_mass,
    inverse_dynamics,
    mass_matrix,
    move,
    solve_mass,
)
from finger_pin.core.evaluation.time_functions import signal_derivatives
from finger_pin.core.jit import CompiledFunction, Vector, call_at, call_value, njit_always_inline, njit_inline, unpack
from finger_pin.core.model import MODEL
from finger_pin.core.tables import Tables


@njit_always_inline
def _tips(tables: Tables, work: Work) -> None:
    """Fill positions and Jacobians of the tips, and J^T F, after `move`."""
    size = tables.parents.size
    for j in range(size):
        work.external[j] = 0.0
    for t in range(tables.tip_body.size):
        tip, jacobian, body = work.tip[t], work.jacobian[t], tables.tip_body[t]
        for r in range(3):
            tip[r] = tables.tip_offset[t, r]
            if body >= 0:
                tip[r] = work.origin[body, r]
                for c in range(3):
                    tip[r] += work.rotation[body, r, c] * tables.tip_offset[t, c]
        j = body
        while j >= 0:
            axis = work.spatial.axis[j]
            jacobian[0, j] = axis[3] + axis[1] * tip[2] - axis[2] * tip[1]
            jacobian[1, j] = axis[4] + axis[2] * tip[0] - axis[0] * tip[2]
            jacobian[2, j] = axis[5] + axis[0] * tip[1] - axis[1] * tip[0]
            for r in range(3):
                work.external[j] += jacobian[r, j] * tables.tip_force[t, r]
            j = tables.parents[j]


@njit_always_inline
def _pin_load(tables: Tables, k: int, load: float, work: Work) -> float:
    """Return |-e S + F| of (17) for row k, and keep the vector and e."""
    body = tables.joint_pin[k]
    carrier = tables.parent_links[body]
    pull = work.pull[k]
    for r in range(3):
        value = tables.directions[body, r]
        if carrier >= 0:
            value = 0.0
            for c in range(3):
                value += work.rotation[carrier, r, c] * tables.directions[body, c]
        work.lever[k, r] = value
        pull[r] = -load * value
        for t in range(tables.tip_body.size):
            pull[r] += tables.supported_by[t, body] * tables.tip_force[t, r]
    for index in range(work.paths.closed_count[0]):
        e = work.paths.closed[index]
        passing = passes(tables.paths, e, body)
        for r in range(3):
            pull[r] += passing * work.paths.push[e, r]
    return np.sqrt(pull[0] * pull[0] + pull[1] * pull[1] + pull[2] * pull[2])


@njit_inline
def _sum_of_terms(tables: Tables, begin: int, end: int, work: Work) -> float:
    total = 0.0
    for e in range(begin, end):
        total += tables.weights[e] * work.rows[ROW.force, tables.terms[e]]
    return total


@njit_inline
def contact_states(tables: Tables) -> int:
    """Return the number of states of contacts, which come before those of other rows."""
    return tables.contact_rows - tables.contact_rows // tables.contact_arms


@njit_always_inline
def _see(tables: Tables, q: Vector, v: Vector, z: Vector, work: Work) -> None:
    """Fill the arguments of all rows' laws but contacts': positions, velocities, states and inputs from outside.

    One entry after the other, whatever row it belongs to: short loops inside a long one would cost twice as much.
    """
    rows, first = work.rows, tables.contact_rows
    for k in range(first, rows.shape[1]):
        rows[ROW.length, k] = tables.offset[k] + work.paths.length[k]
        rows[ROW.speed, k] = 0.0
        rows[ROW.curvature, k] = tables.curvature_offset[k] + work.paths.turn[k]
    for e in range(tables.arm_start[first], tables.arm_at.size):
        k, j = tables.arm_row[e], tables.arm_at[e]
        rows[ROW.length, k] += tables.measure[e] * q[j]
        rows[ROW.speed, k] += work.arm[e] * v[j]
    for e in range(tables.bend_start[first], tables.bend_at.size):
        rows[ROW.curvature, tables.bend_row[e]] += tables.bend[e] * abs(q[tables.bend_at[e]])
    for i in range(contact_states(tables), tables.state_row.size):
        rows[ROW.state, tables.state_row[i]] = z[i]
    for e in range(tables.read_at.size):
        rows[ROW.reading, tables.read_row[e]] = 0.0
    for e in range(tables.read_at.size):
        rows[ROW.reading, tables.read_row[e]] += tables.read_weight[e] * z[tables.read_at[e]]
    for i in range(tables.input_rows.size):
        k = tables.input_rows[i]
        rows[ROW.command, k] = work.command[tables.channel[k]] if tables.channel[k] >= 0 else 0.0


@njit_always_inline
def _act(tables: Tables, work: Work) -> None:
    """Evaluate the laws of all rows but contacts in their order, each with the forces of those before."""
    rows = work.rows
    for g in range(tables.groups.first.size):
        begin, end = tables.groups.first[g], tables.groups.end[g]
        if begin < tables.contact_rows:
            continue
        if tables.groups.fed[g]:
            for k in range(begin, end):
                rows[ROW.command, k] += _sum_of_terms(tables, tables.input_start[k], tables.input_start[k + 1], work)
        if tables.groups.pressed[g]:
            for k in range(begin, end):
                load = _sum_of_terms(tables, tables.load_start[k], tables.load_start[k + 1], work)
                if (tables.has_tip_force or tables.contact_rows) and tables.joint_pin[k] >= 0:
                    rows[ROW.load, k] = _pin_load(tables, k, load, work)
                else:
                    work.pull[k, 0] = load
                    rows[ROW.load, k] = abs(load)
        call_value(tables.groups.value[g], rows, tables.parameters, begin, end)


@njit_always_inline
def _drive(tables: Tables, work: Work, rate: Vector) -> None:
    """Add to A^T phi, and fill the rates of the rows' states, after `_act`."""
    rows, torque = work.rows, work.torque
    for e in range(tables.arm_start[tables.contact_rows], tables.arm_at.size):
        torque[tables.arm_at[e]] += work.arm[e] * rows[ROW.force, tables.arm_row[e]]
    for index in range(work.paths.active_pair_count[0]):
        k = tables.paths.row[work.paths.active_pairs[index]]
        for m in range(k + 1, k + tables.contact_arms):
            rate[tables.state[m]] = rows[ROW.rate, m]
    for i in range(contact_states(tables), tables.state_row.size):
        rate[i] = rows[ROW.rate, tables.state_row[i]]


@CompiledFunction
def exert(address: int, time: float) -> int:
    """Fill the rows' arguments, forces and rates of states, after `move` and with known inputs."""
    model = unpack(address, MODEL)
    tables, control, x, work = model.tables, model.control, model.state, model.work
    width = work.torque.size
    if tables.has_tip_force:
        tip_forces(control, time, 0, tables.tip_force)
        _tips(tables, work)
    for j in range(width):
        work.torque[j] = 0.0
    if model.measure != 0:
        call_at(model.measure, address, time)
    _see(tables, x[:width], x[width : 2 * width], x[2 * width :], work)
    _act(tables, work)
    _drive(tables, work, model.rate[2 * width :])
    return 1


@CompiledFunction
def evaluate(address: int, time: float) -> int:
    """Fill the rate of the packed state of a `Model`, and everything in ``work`` that the linearisation needs."""
    model = unpack(address, MODEL)
    tables, control, x, work, rate = model.tables, model.control, model.state, model.work, model.rate
    size, width = tables.parents.size, work.torque.size
    q, v = x[:width], x[width : 2 * width]
    inputs(control, time, q, v, work.command)
    if model.move_base != 0:
        call_at(model.move_base, address, time)
    move(tables, q, v, work)
    call_at(model.exert, address, time)
    mass_matrix(tables, work)
    factorise_mass(tables, size, work)
    inverse_dynamics(tables, v, work.acceleration, work, work.bias, False)
    for j in range(size):
        work.acceleration[j] = work.torque[j] + work.external[j] - work.bias[j]
    solve_mass(tables, size, work, work.acceleration)
    for j in range(size, width):
        work.acceleration[j] = work.torque[j] / tables.lumps[j - size]
    if work.guide.size > 0:
        if control.palm.harmonics.shape[0] == 0:
            signal_derivatives(control.guide, time, 2, work.guide)
        for j in range(width):
            if tables.prescribed[j] >= 0:
                work.acceleration[j] = work.guide[tables.prescribed[j]]
    for j in range(width):
        rate[j] = v[j]
        rate[width + j] = work.acceleration[j]
    return 1
