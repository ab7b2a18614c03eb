"""The right-hand side of (18), compiled: `Mechanism.evaluate`, one state at a time."""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.core.binding import call_at
from finger_pin.core.compilation import compiled
from finger_pin.core.inputs import inputs, tip_forces
from finger_pin.core.law_code import COMMAND, CURVATURE, FORCE, LENGTH, LOAD, RATE, SPEED, STATE, call_value
from finger_pin.core.paths import passes, push
from finger_pin.core.rigid_body import AXIS, factorise_mass, inverse_dynamics, mass_matrix, move, solve_mass
from finger_pin.core.tables import BENT, END, FED, FIRST, PRESSED, STATEFUL


@compiled
def _tips(tables: Any, work: Any) -> None:
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
            axis = work.spatial[AXIS, j]
            jacobian[0, j] = axis[3] + axis[1] * tip[2] - axis[2] * tip[1]
            jacobian[1, j] = axis[4] + axis[2] * tip[0] - axis[0] * tip[2]
            jacobian[2, j] = axis[5] + axis[0] * tip[1] - axis[1] * tip[0]
            for r in range(3):
                work.external[j] += jacobian[r, j] * tables.tip_force[t, r]
            j = tables.parents[j]


@compiled
def _pin_load(tables: Any, k: int, load: float, work: Any) -> Any:
    """Return |-e S + F| of (17) for row k, and keep the vector and e."""
    body = tables.pins[k]
    carrier = tables.carriers[body]
    total = 0.0
    for r in range(3):
        value = tables.directions[body, r]
        if carrier >= 0:
            value = 0.0
            for c in range(3):
                value += work.rotation[carrier, r, c] * tables.directions[body, c]
        work.lever[k, r] = value
        pull = -load * value
        for t in range(tables.tip_body.size):
            pull += tables.carried[t, body] * tables.tip_force[t, r]
        for e in range(tables.paths.columns.size):
            pull += passes(tables.paths, e, body) * work.paths.push[e, r]
        work.pull[k, r] = pull
        total += pull * pull
    return np.sqrt(total)


@compiled
def _sum_of_terms(tables: Any, begin: int, end: int, work: Any) -> Any:
    total = 0.0
    for e in range(begin, end):
        total += tables.weights[e] * work.rows[FORCE, tables.terms[e]]
    return total


@compiled
def _exert(tables: Any, q: Any, v: Any, z: Any, work: Any, rate: Any) -> None:
    """Evaluate all rows in their order: their torques, and the rates of their states.

    What a group does not have stays as `build_work` has set it.
    """
    rows = work.rows
    for j in range(work.torque.size):
        work.torque[j] = 0.0
    for g in range(tables.groups.shape[0]):
        begin, end = tables.groups[g, FIRST], tables.groups[g, END]
        for k in range(begin, end):
            length, speed = tables.offset[k] + work.paths.length[k], 0.0
            for e in range(tables.arm_start[k], tables.arm_start[k + 1]):
                j = tables.arm_at[e]
                length += tables.measure[e] * q[j]
                speed += work.arm[e] * v[j]
            rows[LENGTH, k], rows[SPEED, k] = length, speed
        if tables.groups[g, BENT]:
            for k in range(begin, end):
                curvature = tables.curvature_offset[k] + work.paths.turn[k]
                for e in range(tables.bend_start[k], tables.bend_start[k + 1]):
                    curvature += tables.bend[e] * abs(q[tables.bend_at[e]])
                rows[CURVATURE, k] = curvature
        if tables.groups[g, STATEFUL]:
            for k in range(begin, end):
                if tables.state[k] >= 0:
                    rows[STATE, k] = z[tables.state[k]]
        if tables.groups[g, FED]:
            for k in range(begin, end):
                command = work.command[tables.channel[k]] if tables.channel[k] >= 0 else 0.0
                given = _sum_of_terms(tables, tables.input_start[k], tables.input_start[k + 1], work)
                rows[COMMAND, k] = command + given
        if tables.groups[g, PRESSED]:
            for k in range(begin, end):
                load = _sum_of_terms(tables, tables.load_start[k], tables.load_start[k + 1], work)
                if (tables.loaded or tables.touching) and tables.pins[k] >= 0:
                    rows[LOAD, k] = _pin_load(tables, k, load, work)
                else:
                    work.pull[k, 0] = load
                    rows[LOAD, k] = abs(load)
        call_value(tables.laws[g, 0], rows, tables.parameters, begin, end)
        for k in range(begin, end):
            force = rows[FORCE, k]
            for e in range(tables.arm_start[k], tables.arm_start[k + 1]):
                work.torque[tables.arm_at[e]] += work.arm[e] * force
        if tables.groups[g, STATEFUL]:
            for k in range(begin, end):
                if tables.state[k] >= 0:
                    rate[tables.state[k]] = rows[RATE, k]
        if end > begin and tables.touch[begin] > 0:
            push(tables, work)


@compiled
def evaluate(model: Any, address: int, time: float) -> None:
    """Fill the rate of the packed state, and everything in ``work`` that the linearisation needs."""
    tables, control, x, work, rate = model.tables, model.control, model.state, model.work, model.rate
    size, width = tables.parents.size, work.torque.size
    q, v, z = x[:width], x[width : 2 * width], x[2 * width :]
    inputs(control, time, q, v, work.command)
    if model.carry != 0:
        call_at(model.carry, address, time)
    move(tables, q, v, work)
    if tables.loaded:
        tip_forces(control, time, tables)
        _tips(tables, work)
    if model.measure != 0:
        call_at(model.measure, address, time)
    _exert(tables, q, v, z, work, rate[2 * width :])
    mass_matrix(tables, work)
    factorise_mass(size, work)
    inverse_dynamics(tables, v, work.acceleration, work, work.bias, False)
    for j in range(size):
        work.acceleration[j] = work.torque[j] + work.external[j] - work.bias[j]
    solve_mass(size, work, work.acceleration)
    for j in range(size, width):
        work.acceleration[j] = work.torque[j] / tables.lumps[j - size]
    for j in range(width):
        rate[j] = v[j]
        rate[width + j] = work.acceleration[j]
