"""The Jacobian of the whole, exact and in factors: the partial derivatives that `condensation` solves with."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from finger_pin.core.control import Control
from finger_pin.core.evaluation.blocks import Blocks, build_blocks
from finger_pin.core.evaluation.inputs import input_slopes, tip_forces
from finger_pin.core.evaluation.paths import passes
from finger_pin.core.evaluation.rigid_body import AXIS, BY_POSITION, BY_VELOCITY, MASS_MATRIX, inverse_dynamics
from finger_pin.core.evaluation.rigid_body_derivatives import inverse_dynamics_derivatives
from finger_pin.core.evaluation.time_functions import signal_derivatives
from finger_pin.core.jit import Indices, Matrix, Vector, call_at, call_filling, compiled_within
from finger_pin.core.tables import END, FIRST, Tables


class Linear(NamedTuple):
    """Partial derivatives at one state, and the solution of (g - J) u = r; K rows, N coordinates, Z states.

    Columns of what is wide are (r of positions, N | r of velocities, N | r of states, Z | h d_i of a stage, 1) of one
    block; before the reduced system is solved, velocities stand in place of their r. Of what blocks have in common
    the rows are those of the whole.

    Attributes:
        mass: M with the lumps, shape (N, N).
        by_position: d(M a + h - J^T F)/dq at the actual acceleration, shape (N, N).
        by_velocity: dh/dv, shape (N, N).
        bias_rate: dh/dt by the motion of the base, shape (N,).
        arm: dl'/dv, shape (arms,).
        measure: dl/dq, shape (arms,).
        turning: dl'/dq at constant v, shape (arms,).
        bend: d(curvature)/dq, as in the tables, shape (bends,).
        load_slope: dN/dS, S the sum of earlier forces, shape (K,).
        load_by_position: dN/dq at constant S, shape (K, N).
        load_by_time: dN/dt at constant S, shape (K,).
        gain: d phi, shape (K, wide).
        state_gain: d z, shape (Z, wide).
        load, command: Of one row, shape (wide,).
        force: Sum of A^T d phi of a block, shape (N, wide).
        reduced: Of a block, shape (N, N), factorised in place.
        pivots: Row exchanges, shape (N,).
        velocity: The solution's velocities of a block, shape (N, wide).
        solution: The solution u, shape (2 N + Z, wide).
        loose: Of the states of open contacts, u / r, shape (Z,).
        right: The right-hand side of a block, shape (wide,).
        blocks: The coupled blocks.
    """

    mass: Matrix
    by_position: Matrix
    by_velocity: Matrix
    bias_rate: Vector
    arm: Vector
    measure: Vector
    turning: Vector
    bend: Vector
    load_slope: Vector
    load_by_position: Matrix
    load_by_time: Vector
    gain: Matrix
    state_gain: Matrix
    load: Vector
    command: Vector
    force: Matrix
    reduced: Matrix
    pivots: Indices
    velocity: Matrix
    solution: Matrix
    loose: Vector
    right: Vector
    blocks: Blocks


def build_linear(tables: Tables, control: Control) -> Linear:
    """Allocate the linearisation of tables."""
    count, width = len(tables.state), len(tables.parents) + len(tables.lumps)
    states = int(tables.state.max(initial=-1)) + 1
    wide = 2 * width + states + 1
    linear = Linear(
        mass=np.zeros((width, width)),
        by_position=np.zeros((width, width)),
        by_velocity=np.zeros((width, width)),
        bias_rate=np.zeros(width),
        arm=np.zeros(len(tables.arm)),
        measure=np.zeros(len(tables.arm)),
        turning=np.zeros(len(tables.arm)),
        bend=np.zeros(len(tables.bend)),
        load_slope=np.zeros(count),
        load_by_position=np.zeros((count, width)),
        load_by_time=np.zeros(count),
        gain=np.zeros((count, wide)),
        state_gain=np.zeros((states, wide)),
        load=np.zeros(wide),
        command=np.zeros(wide),
        force=np.zeros((width, wide)),
        reduced=np.zeros((width, width)),
        pivots=np.zeros(width, dtype=np.int64),
        velocity=np.zeros((width, wide)),
        solution=np.zeros((wide - 1, wide)),
        loose=np.zeros(states),
        right=np.zeros(wide),
        blocks=build_blocks(tables, control),
    )
    take_numbers(linear, tables)
    return linear


def take_numbers(linear: Linear, tables: Tables) -> None:
    """Copy the entries of a linearisation that no posture changes from tables into its memory."""
    lumped = np.arange(len(tables.parents), len(linear.mass))
    linear.mass[lumped, lumped] = tables.lumps
    linear.arm[:], linear.measure[:], linear.bend[:] = tables.arm, tables.measure, tables.bend


@compiled_within
def _turning_tips(tables: Any, work: Any, linear: Any) -> None:
    """Subtract d(J^T F)/dq from by_position: a column turns with the joints below it and moves with the tip."""
    axes = work.spatial[AXIS]
    for t in range(tables.tip_body.size):
        force, column = tables.tip_force[t], work.jacobian[t]
        i = tables.tip_body[t]
        while i >= 0:
            k = tables.tip_body[t]
            while k >= 0:
                # The joint nearer to the base turns the other one's column.
                inner, outer = (k, i) if k <= i else (i, k)
                linear.by_position[i, k] -= (
                    force[0] * (axes[inner, 1] * column[2, outer] - axes[inner, 2] * column[1, outer])
                    + force[1] * (axes[inner, 2] * column[0, outer] - axes[inner, 0] * column[2, outer])
                    + force[2] * (axes[inner, 0] * column[1, outer] - axes[inner, 1] * column[0, outer])
                )
                k = tables.parents[k]
            i = tables.parents[i]


@compiled_within
def _load_slopes(tables: Any, work: Any, linear: Any) -> None:
    """Fill the derivatives of all loads by the sum of earlier forces, and by the posture that turns the pins' links."""
    axes = work.spatial[AXIS]
    for k in range(tables.pins.size):
        body = tables.pins[k]
        if not (tables.loaded or tables.touching) or body < 0:
            # `evaluate` has left the sum itself here.
            linear.load_slope[k] = np.sign(work.pull[k, 0])
            continue
        pull, e = work.pull[k], work.lever[k]
        size = np.sqrt(pull[0] * pull[0] + pull[1] * pull[1] + pull[2] * pull[2])
        # At N = 0 there is a kink, which the floor of the friction level hides.
        size = max(size, 1e-100)
        linear.load_slope[k] = -(pull[0] * e[0] + pull[1] * e[1] + pull[2] * e[2]) / size
        # pull = -S e + F, so -S e turns as pull - F does.
        x, y, z = pull[0], pull[1], pull[2]
        for t in range(tables.tip_body.size):
            x -= tables.carried[t, body] * tables.tip_force[t, 0]
            y -= tables.carried[t, body] * tables.tip_force[t, 1]
            z -= tables.carried[t, body] * tables.tip_force[t, 2]
        for index in range(work.paths.closed_count[0]):
            c = work.paths.closed[index]
            passing = passes(tables.paths, c, body)
            x -= passing * work.paths.push[c, 0]
            y -= passing * work.paths.push[c, 1]
            z -= passing * work.paths.push[c, 2]
        linear.load_by_time[k] = 0.0
        for t in range(tables.tip_body.size):
            for r in range(3):
                linear.load_by_time[k] += tables.carried[t, body] * work.force_rate[t, r] * pull[r] / size
        for j in range(tables.parents.size):
            linear.load_by_position[k, j] = 0.0
        j = tables.carriers[body]
        while j >= 0:
            a = axes[j]
            linear.load_by_position[k, j] = (
                pull[0] * (a[1] * z - a[2] * y) + pull[1] * (a[2] * x - a[0] * z) + pull[2] * (a[0] * y - a[1] * x)
            ) / size
            j = tables.parents[j]


@compiled_within
def linearise(model: Any, address: int, time: float) -> None:
    """Fill all partial derivatives after `evaluate` at the same time and state."""
    tables, control, x, work, linear = model.tables, model.control, model.state, model.work, model.linear
    size, width = tables.parents.size, work.torque.size
    velocity = x[width : 2 * width]
    # The derivatives of inverse dynamics are taken at the actual acceleration.
    inverse_dynamics(tables, velocity, work.acceleration, work, work.bias, True)
    inverse_dynamics_derivatives(tables, velocity, work)
    for i in range(size):
        for j in range(size):
            linear.by_position[i, j] = work.square[BY_POSITION, i, j]
        # A body and those that it carries stand between their root and the last of them.
        for j in range(tables.roots[i], i + 1):
            linear.mass[i, j] = linear.mass[j, i] = work.square[MASS_MATRIX, i, j]
            linear.by_velocity[i, j] = work.square[BY_VELOCITY, i, j]
            linear.by_velocity[j, i] = work.square[BY_VELOCITY, j, i]
    if control.palm.harmonics.shape[0] > 0:
        call_at(model.sway, address, time)
    if tables.loaded:
        _turning_tips(tables, work, linear)
    input_slopes(control, time)
    if control.palm.harmonics.shape[0] == 0:
        signal_derivatives(control.guide, time, 3, work.guide_rate)
    if tables.loaded:
        tip_forces(control, time, 1, work.force_rate)
    for g in range(tables.groups.shape[0]):
        begin, end = tables.groups[g, FIRST], tables.groups[g, END]
        if begin >= tables.touching:
            call_filling(tables.laws[g, 1], work.rows, tables.parameters, work.slopes, begin, end)
            continue
        for index in range(work.paths.awake_count[0]):
            k = tables.paths.row[work.paths.awake[index]]
            if begin <= k < end:
                call_filling(tables.laws[g, 1], work.rows, tables.parameters, work.slopes, k, k + 3)
    for e in range(tables.bend.size):
        linear.bend[e] = tables.bend[e] * np.sign(x[tables.bend_at[e]])
    _load_slopes(tables, work, linear)
    if model.turn != 0:
        call_at(model.turn, address, time)
