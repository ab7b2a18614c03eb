"""The Jacobian of the closed loop, exact and in factors: the partial derivatives that `elimination` solves with."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from finger_pin.core import dynamics as at
from finger_pin.core import laws
from finger_pin.core.binding import Indices, Matrix, Vector
from finger_pin.core.compilation import compiled
from finger_pin.core.plant import Plant
from finger_pin.core.rigid_body import AXIS, BY_POSITION, BY_VELOCITY, inverse_dynamics
from finger_pin.core.rigid_body_derivatives import inverse_dynamics_derivatives


class Linear(NamedTuple):
    """Partial derivatives at one state, and the factors of g - J.

    Attributes:
        tendon: One row each: strand force by own stiction, by sliding velocity; stiction rate by stiction, by
            sliding velocity, by passive position; derivative of the command in time; stiction rate by command. The
            strand force is that without micro-damping.
        joint: One row each: stiction rate by stiction, by velocity, by load.
        stiction_by_position: Tendon stiction rates by theta, shape (t, n).
        strand_by_position: Strand forces by theta, shape (s, n).
        strand_by_passive: Strand forces by the passive position of their own tendon, shape (s,).
        joint_by_position: Joint stiction rates by theta at constant strand forces, shape (n, n).
        torque_by_position: Torques other than the tendons' by theta, shape (n, n).
        torque_by_velocity: Torques other than the tendons' by theta', shape (n, n).
        tendon_gain: G, shape (t, n + p).
        strand_gain: F, shape (s, n + p).
        joint_gain: Z, shape (n, n + p).
        matrix: The reduced system, factorised in place, shape (n + p, n + p).
        pivots: Row exchanges.
        vector: The reduced right-hand side, shape (n + p,).
        constant: The constants c of tendons, strands and joints, shape (3, max(t, s, n)).
        time_derivative: df/dt with the joints' rows multiplied by M, shape (size,).
    """

    tendon: Matrix
    joint: Matrix
    stiction_by_position: Matrix
    strand_by_position: Matrix
    strand_by_passive: Vector
    joint_by_position: Matrix
    torque_by_position: Matrix
    torque_by_velocity: Matrix
    tendon_gain: Matrix
    strand_gain: Matrix
    joint_gain: Matrix
    matrix: Matrix
    pivots: Indices
    vector: Vector
    constant: Matrix
    time_derivative: Vector


# Rows of Linear.tendon and Linear.joint.
BY_STICTION, BY_SPEED, RATE_BY_STICTION, RATE_BY_SPEED, RATE_BY_PASSIVE, COMMAND_RATE, RATE_BY_COMMAND = range(7)
J_RATE_BY_STICTION, J_RATE_BY_SPEED, J_RATE_BY_LOAD = range(3)


def build_linear(plant: Plant) -> Linear:
    """Allocate the linearisation of a plant."""
    tendons, joints = plant.coupling.shape
    strands = plant.strand_coupling.shape[0]
    passive = tendons - plant.actuated
    reduced = joints + passive
    return Linear(
        tendon=np.zeros((7, tendons)),
        joint=np.zeros((3, joints)),
        stiction_by_position=np.zeros((tendons, joints)),
        strand_by_position=np.zeros((strands, joints)),
        strand_by_passive=np.zeros(strands),
        joint_by_position=np.zeros((joints, joints)),
        torque_by_position=np.zeros((joints, joints)),
        torque_by_velocity=np.zeros((joints, joints)),
        tendon_gain=np.zeros((tendons, reduced)),
        strand_gain=np.zeros((strands, reduced)),
        joint_gain=np.zeros((joints, reduced)),
        matrix=np.zeros((reduced, reduced)),
        pivots=np.zeros(reduced, dtype=np.int64),
        vector=np.zeros(reduced),
        constant=np.zeros((3, max(tendons, strands, joints))),
        time_derivative=np.zeros(3 * joints + 2 * passive + tendons),
    )


@compiled
def _command_by_position(control: Any, time: float, actuated: int, work: Any, linear: Any) -> None:
    """Fill d f^a / d theta for the active minimum of (22), and d f^a / dt."""
    slope, active = work.command_by_position, work.active[0]
    at.reference_rate(control, time, work)
    for i in range(actuated):
        rate = 0.0
        for j in range(slope.shape[1]):
            value = 0.0
            if not control.held:
                shared = control.inverse[active, j] / control.internal[active]
                value = -control.gain[j] * (control.inverse[i, j] - control.internal[i] * shared)
                rate -= value * work.joint[at.REFERENCE_RATE, j]
            slope[i, j] = value
        linear.tendon[COMMAND_RATE, i] = rate


@compiled
def _tendon_slopes(plant: Any, x: Any, work: Any, linear: Any) -> None:
    tendons, joints = plant.coupling.shape
    actuated = plant.actuated
    s_at = 2 * joints + 2 * (tendons - actuated)
    rows, table, out = work.tendon, plant.tendons, linear.tendon
    by_position, strand_by_position = linear.stiction_by_position, linear.strand_by_position
    for i in range(tendons):
        speed, coefficient, normal = rows[at.SPEED, i], rows[at.COEFFICIENT, i], rows[at.NORMAL, i]
        level, ratio, stribeck = rows[at.LEVEL, i], table[i, at.RATIO], table[i, at.STRIBECK]
        own, by_speed, by_level = laws.stiction_rate_slopes(x[s_at + i], speed, level, table[i, at.STIFFNESS])
        if level <= table[i, at.FLOOR]:
            by_level = 0.0
        sliding_slope = laws.friction_coefficient_slope(
            speed, coefficient, ratio * coefficient, stribeck, table[i, at.EXPONENT]
        )
        by_speed += by_level * normal * sliding_slope
        by_normal = by_level * rows[at.SLIDING, i]
        # M is proportional to mu^d, which depends on the posture through the curvature.
        share = rows[at.SLIDING, i] / coefficient if coefficient > 0.0 else 0.0
        by_curvature = by_level * normal * share * laws.capstan_slope(table[i, at.SURFACE], coefficient)
        for j in range(joints):
            by_position[i, j] = by_curvature * plant.curvature_matrix[i, j] * np.sign(x[j])
        if i < actuated:
            taut = 1.0 if work.strand[0, i] > 0.0 else 0.0
            command_sign = 1.0 if work.planned[i] >= 0.0 else -1.0
            out[BY_STICTION, i] = -taut
            out[BY_SPEED, i] = -taut * table[i, at.VISCOUS]
            # The normal force has the tension without micro-damping, which may be cut at zero on its own.
            viscous = table[i, at.VISCOUS]
            settled = laws.friction_force(x[s_at + i], speed, viscous, 0.0, 0.0)
            pressing = 1.0 if laws.delivered_tension(work.planned[i], settled) > 0.0 else 0.0
            own -= by_normal * pressing
            by_speed -= by_normal * pressing * viscous
            out[RATE_BY_COMMAND, i] = by_normal * (pressing + command_sign)
            out[RATE_BY_PASSIVE, i] = 0.0
            for j in range(joints):
                slope = work.command_by_position[i, j]
                strand_by_position[i, j] = taut * slope
                by_position[i, j] += out[RATE_BY_COMMAND, i] * slope
        else:
            k = i - actuated
            row, stiffness = actuated + 2 * k, plant.passive[k, at.HALF_STIFFNESS]
            near = stiffness if work.strand[0, row] > 0.0 else 0.0
            far = stiffness if work.strand[0, row + 1] > 0.0 else 0.0
            linear.strand_by_passive[row] = -near
            linear.strand_by_passive[row + 1] = far
            out[RATE_BY_PASSIVE, i] = by_normal * (far - near)
            for j in range(joints):
                strand_by_position[row, j] = -near * plant.strand_coupling[row, j]
                strand_by_position[row + 1, j] = -far * plant.strand_coupling[row + 1, j]
                by_position[i, j] += by_normal * (strand_by_position[row, j] + strand_by_position[row + 1, j])
        out[RATE_BY_STICTION, i], out[RATE_BY_SPEED, i] = own, by_speed


@compiled
def _fingertip_slopes(plant: Any, work: Any, linear: Any) -> None:
    """Add d(J^T F)/d theta to the torques; put d(e . F)/d theta into joint_by_position."""
    force = plant.fingertip_force
    joints = plant.parents.size
    for j in range(joints):
        for k in range(joints):
            linear.joint_by_position[j, k] = 0.0
    if not plant.loaded:
        return
    # e_j turns with every joint between its body and the base.
    for j in range(joints):
        k = plant.carriers[j]
        e = work.direction
        while k >= 0:
            a = work.spatial[AXIS]
            linear.joint_by_position[j, k] = (
                force[0] * (a[k, 1] * e[j, 2] - a[k, 2] * e[j, 1])
                + force[1] * (a[k, 2] * e[j, 0] - a[k, 0] * e[j, 2])
                + force[2] * (a[k, 0] * e[j, 1] - a[k, 1] * e[j, 0])
            )
            k = plant.parents[k]
    # (J^T F)_i = column_i . F; a column turns with the joints below it and moves with the fingertip.
    i = plant.tip_body
    while i >= 0:
        k = plant.tip_body
        while k >= 0:
            # The joint nearer to the base turns the other one's column.
            inner, outer = (k, i) if k <= i else (i, k)
            a, column = work.spatial[AXIS], work.jacobian
            linear.torque_by_position[i, k] += (
                force[0] * (a[inner, 1] * column[2, outer] - a[inner, 2] * column[1, outer])
                + force[1] * (a[inner, 2] * column[0, outer] - a[inner, 0] * column[2, outer])
                + force[2] * (a[inner, 0] * column[1, outer] - a[inner, 1] * column[0, outer])
            )
            k = plant.parents[k]
        i = plant.parents[i]


@compiled
def _joint_slopes(plant: Any, x: Any, work: Any, linear: Any) -> None:
    tendons, joints = plant.coupling.shape
    z_at = 2 * joints + 2 * (tendons - plant.actuated) + tendons
    rows, table, out = work.joint, plant.joints, linear.joint
    for j in range(joints):
        speed, level, reaction = x[joints + j], rows[at.J_LEVEL, j], rows[at.REACTION, j]
        own, by_speed, by_level = laws.stiction_rate_slopes(x[z_at + j], speed, level, table[j, at.J_STIFFNESS])
        if level <= table[j, at.J_FLOOR]:
            by_level = 0.0
        sliding_slope = laws.friction_coefficient_slope(
            speed, table[j, at.KINETIC], table[j, at.STATIC], table[j, at.J_STRIBECK], table[j, at.J_EXPONENT]
        )
        by_reaction = by_level * rows[at.J_SLIDING, j]
        by_load, by_along = laws.joint_reaction_slopes(rows[at.LOAD, j], rows[at.ALONG, j], reaction)
        out[J_RATE_BY_STICTION, j] = own
        out[J_RATE_BY_SPEED, j] = by_speed + by_level * reaction * sliding_slope
        out[J_RATE_BY_LOAD, j] = by_reaction * by_load
        limiter_by_position, limiter_by_velocity = laws.limiter_slopes(
            rows[at.DEPTH, j], speed, table[j, at.L_STIFFNESS], table[j, at.L_DAMPING]
        )
        linear.torque_by_position[j, j] -= limiter_by_position
        linear.torque_by_velocity[j, j] -= limiter_by_velocity + table[j, at.J_VISCOUS]
        for k in range(joints):
            linear.joint_by_position[j, k] *= by_reaction * by_along


@compiled
def _time_derivative(plant: Any, linear: Any) -> None:
    """Fill df/dt, which enters through the command alone; the joints' rows are multiplied by M."""
    tendons, joints = plant.coupling.shape
    actuated = plant.actuated
    s_at = 2 * joints + 2 * (tendons - actuated)
    z_at = s_at + tendons
    out = linear.time_derivative
    out[:] = 0.0
    for i in range(actuated):
        rate = linear.tendon[COMMAND_RATE, i]
        out[s_at + i] = linear.tendon[RATE_BY_COMMAND, i] * rate
        delivered = -linear.tendon[BY_STICTION, i] * (rate - plant.tendons[i, at.LAG] * out[s_at + i])
        for j in range(joints):
            out[joints + j] += plant.coupling[i, j] * delivered
            out[z_at + j] += linear.joint[J_RATE_BY_LOAD, j] * plant.loads[j, i] * delivered
    for j in range(joints):
        out[joints + j] -= plant.joints[j, at.J_LAG] * out[z_at + j]


@compiled
def linearise(plant: Any, control: Any, time: float, x: Any, work: Any, linear: Any) -> None:
    """Fill all partial derivatives after `evaluate` at the same time and state."""
    joints = plant.parents.size
    velocity = x[joints : 2 * joints]
    # The derivatives of inverse dynamics are taken at the actual acceleration.
    inverse_dynamics(plant, velocity, work.joint[at.ACCELERATION], work, work.joint[at.BIAS])
    inverse_dynamics_derivatives(plant, velocity, work)
    for i in range(joints):
        for j in range(joints):
            linear.torque_by_position[i, j] = -work.square[BY_POSITION, i, j]
            linear.torque_by_velocity[i, j] = -work.square[BY_VELOCITY, i, j]
    _command_by_position(control, time, plant.actuated, work, linear)
    _tendon_slopes(plant, x, work, linear)
    _fingertip_slopes(plant, work, linear)
    _joint_slopes(plant, x, work, linear)
    _time_derivative(plant, linear)
