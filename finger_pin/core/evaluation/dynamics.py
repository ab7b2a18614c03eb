"""The right-hand side of (18), compiled: `Mechanism.evaluate`, one state at a time."""

from __future__ import annotations

import numpy as np

from finger_pin.core.addresses.law_code import ROW
from finger_pin.core.addresses.time_functions import signal_derivatives
from finger_pin.core.evaluation.input_values import inputs, tip_forces
from finger_pin.core.evaluation.paths import passes
from finger_pin.core.evaluation.rigid_body_dynamics import (
    factorise_mass,
    inverse_dynamics,
    mass_matrix,
    move,
    solve_mass,
)
from finger_pin.core.jit import CompiledFunction, Vector, call_at, call_value, njit_always_inline, njit_inline, unpack
from finger_pin.core.tables.buffers import Work
from finger_pin.core.tables.mechanism_parameters import Parameters
from finger_pin.core.tables.model import MODEL
from finger_pin.core.tables.structure import Structure


@njit_always_inline
def _fill_tips(structure: Structure, parameters: Parameters, work: Work) -> None:
    """Fill positions and Jacobians of the tips, and J^T F, after `move`."""
    size = structure.parents.size
    for j in range(size):
        work.external[j] = 0.0
    for t in range(structure.tip_body.size):
        tip, jacobian, body = work.tip[t], work.jacobian[t], structure.tip_body[t]
        for r in range(3):
            tip[r] = parameters.tip_offset[t, r]
            if body >= 0:
                tip[r] = work.origin[body, r]
                for c in range(3):
                    tip[r] += work.rotation[body, r, c] * parameters.tip_offset[t, c]
        j = body
        while j >= 0:
            axis = work.spatial.axis[j]
            jacobian[0, j] = axis[3] + axis[1] * tip[2] - axis[2] * tip[1]
            jacobian[1, j] = axis[4] + axis[2] * tip[0] - axis[0] * tip[2]
            jacobian[2, j] = axis[5] + axis[0] * tip[1] - axis[1] * tip[0]
            for r in range(3):
                work.external[j] += jacobian[r, j] * parameters.tip_force[t, r]
            j = structure.parents[j]


@njit_always_inline
def _pin_load(structure: Structure, parameters: Parameters, k: int, load: float, work: Work) -> float:
    """Return |-e S + F| of (17) for row k, and keep the vector and e."""
    body = structure.joint_pin[k]
    carrier = structure.parent_links[body]
    pull = work.pull[k]
    for r in range(3):
        value = parameters.directions[body, r]
        if carrier >= 0:
            value = 0.0
            for c in range(3):
                value += work.rotation[carrier, r, c] * parameters.directions[body, c]
        work.lever[k, r] = value
        pull[r] = -load * value
        for t in range(structure.tip_body.size):
            pull[r] += structure.supported_by[t, body] * parameters.tip_force[t, r]
    for index in range(work.paths.closed_count[0]):
        e = work.paths.closed[index]
        passing = passes(structure.paths, e, body)
        for r in range(3):
            pull[r] += passing * work.paths.push[e, r]
    return np.sqrt(pull[0] * pull[0] + pull[1] * pull[1] + pull[2] * pull[2])


@njit_inline
def _sum_of_terms(structure: Structure, parameters: Parameters, begin: int, end: int, work: Work) -> float:
    total = 0.0
    for e in range(begin, end):
        total += parameters.weights[e] * work.rows[ROW.force, structure.terms[e]]
    return total


@njit_inline
def contact_states(structure: Structure) -> int:
    """Return the number of states of contacts, which come before those of other rows."""
    return structure.contact_rows - structure.contact_rows // structure.contact_arms


@njit_always_inline
def _fill_law_arguments(
    structure: Structure, parameters: Parameters, q: Vector, v: Vector, z: Vector, work: Work
) -> None:
    """Fill the arguments of all rows' laws but contacts': positions, velocities, states and inputs from outside.

    One entry after the other, whatever row it belongs to: short loops inside a long one would cost twice as much.
    """
    rows, first = work.rows, structure.contact_rows
    for k in range(first, rows.shape[1]):
        rows[ROW.length, k] = parameters.offset[k] + work.paths.length[k]
        rows[ROW.speed, k] = 0.0
        rows[ROW.curvature, k] = parameters.curvature_offset[k] + work.paths.turn[k]
    for e in range(structure.arm_start[first], structure.arm_at.size):
        k, j = structure.arm_row[e], structure.arm_at[e]
        rows[ROW.length, k] += parameters.measure[e] * q[j]
        rows[ROW.speed, k] += work.arm[e] * v[j]
    for e in range(structure.bend_start[first], structure.bend_at.size):
        rows[ROW.curvature, structure.bend_row[e]] += parameters.bend[e] * abs(q[structure.bend_at[e]])
    for i in range(contact_states(structure), structure.state_row.size):
        rows[ROW.state, structure.state_row[i]] = z[i]
    for e in range(structure.read_at.size):
        rows[ROW.reading, structure.read_row[e]] = 0.0
    for e in range(structure.read_at.size):
        rows[ROW.reading, structure.read_row[e]] += parameters.read_weight[e] * z[structure.read_at[e]]
    for i in range(structure.input_rows.size):
        k = structure.input_rows[i]
        rows[ROW.command, k] = work.command[structure.channel[k]] if structure.channel[k] >= 0 else 0.0


@njit_inline
def evaluate_rows(structure: Structure, parameters: Parameters, work: Work, g: int, begin: int, end: int) -> None:
    """Evaluate the law of some rows of a group, with their inputs from outside and the forces of earlier rows."""
    rows = work.rows
    if structure.groups.fed[g]:
        for k in range(begin, end):
            rows[ROW.command, k] += _sum_of_terms(
                structure, parameters, structure.input_start[k], structure.input_start[k + 1], work
            )
    if structure.groups.pressed[g]:
        for k in range(begin, end):
            load = _sum_of_terms(structure, parameters, structure.load_start[k], structure.load_start[k + 1], work)
            if (parameters.has_tip_force or structure.contact_rows) and structure.joint_pin[k] >= 0:
                rows[ROW.load, k] = _pin_load(structure, parameters, k, load, work)
            else:
                work.pull[k, 0] = load
                rows[ROW.load, k] = abs(load)
    call_value(structure.groups.value[g], rows, parameters.laws, begin, end)


@njit_always_inline
def _evaluate_laws(structure: Structure, parameters: Parameters, work: Work) -> None:
    """Evaluate the laws of all rows but contacts in their order, each with the forces of those before."""
    for g in range(structure.groups.first.size):
        begin, end = structure.groups.first[g], structure.groups.end[g]
        if begin >= structure.contact_rows:
            evaluate_rows(structure, parameters, work, g, begin, end)


@njit_always_inline
def _add_row_forces(structure: Structure, work: Work, rate: Vector) -> None:
    """Add to A^T phi, and fill the rates of the rows' states, after `_evaluate_laws`."""
    rows, torque = work.rows, work.torque
    for e in range(structure.arm_start[structure.contact_rows], structure.arm_at.size):
        torque[structure.arm_at[e]] += work.arm[e] * rows[ROW.force, structure.arm_row[e]]
    for index in range(work.paths.active_pair_count[0]):
        k = structure.paths.row[work.paths.active_pairs[index]]
        for m in range(k + 1, k + structure.contact_arms):
            rate[structure.state[m]] = rows[ROW.rate, m]
    for i in range(contact_states(structure), structure.state_row.size):
        rate[i] = rows[ROW.rate, structure.state_row[i]]


@CompiledFunction
def exert(address: int, time: float) -> int:
    """Fill the rows' arguments, forces and rates of states, after `move` and with known inputs."""
    model = unpack(address, MODEL)
    structure, parameters, control, x, work = model.structure, model.parameters, model.control, model.state, model.work
    width = work.torque.size
    if parameters.has_tip_force:
        tip_forces(control, time, 0, parameters.tip_force)
        _fill_tips(structure, parameters, work)
    for j in range(width):
        work.torque[j] = 0.0
    if model.measure != 0:
        call_at(model.measure, address, time)
    _fill_law_arguments(structure, parameters, x[:width], x[width : 2 * width], x[2 * width :], work)
    _evaluate_laws(structure, parameters, work)
    _add_row_forces(structure, work, model.rate[2 * width :])
    return 1


@CompiledFunction
def evaluate(address: int, time: float) -> int:
    """Fill the rate of the packed state of a `Model`, and everything in ``work`` that the linearisation needs."""
    model = unpack(address, MODEL)
    structure, parameters = model.structure, model.parameters
    control, x, work, rate = model.control, model.state, model.work, model.rate
    size, width = structure.parents.size, work.torque.size
    q, v = x[:width], x[width : 2 * width]
    inputs(control, time, q, v, work.command)
    if model.move_base != 0:
        call_at(model.move_base, address, time)
    move(structure, parameters, q, v, work)
    call_at(model.exert, address, time)
    mass_matrix(structure, parameters, work)
    factorise_mass(structure, size, work)
    inverse_dynamics(structure, parameters, v, work.acceleration, work, work.bias, False)
    for j in range(size):
        work.acceleration[j] = work.torque[j] + work.external[j] - work.bias[j]
    solve_mass(structure, size, work, work.acceleration)
    for j in range(size, width):
        work.acceleration[j] = work.torque[j] / parameters.lumps[j - size]
    if work.guide.size > 0:
        if control.palm.harmonics.shape[0] == 0:
            signal_derivatives(control.guide, time, 2, work.guide)
        for j in range(width):
            if structure.prescribed[j] >= 0:
                work.acceleration[j] = work.guide[structure.prescribed[j]]
    for j in range(width):
        rate[j] = v[j]
        rate[width + j] = work.acceleration[j]
    return 1
