"""The wiring of (18) and of the control loop, compiled: the laws of `Finger` and `ClosedLoop`, number by number."""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.core import laws
from finger_pin.core.compilation import compiled
from finger_pin.core.rigid_body import (
    AXIS,
    factorise_mass,
    inverse_dynamics,
    mass_matrix,
    move,
    solve_mass,
)

# Columns of plant.tendons, plant.joints and plant.passive.
OFFSET, SURFACE, RATIO, STIFFNESS, VISCOUS, STRIBECK, FLOOR, EXPONENT, LAG = range(9)
KINETIC, STATIC, J_STIFFNESS, J_VISCOUS, J_STRIBECK, J_FLOOR, LOWER, UPPER, L_STIFFNESS, L_DAMPING = range(10)
J_EXPONENT, J_LAG = range(10, 12)
HALF_STIFFNESS, PASSIVE_MASS = range(2)

# Rows of work.tendon.
SPEED, LOSS, NORMAL, COEFFICIENT, SLIDING, LEVEL, CURVATURE = range(7)
# Rows of work.joint.
BIAS, LOAD, REACTION, J_SLIDING, J_LEVEL, DEPTH, LIMITER, ALONG, TORQUE, EXTERNAL, REFERENCE, REFERENCE_RATE = range(12)
DESIRED, ACCELERATION, ZERO, BASE, J_LOSS = range(12, 17)


@compiled
def reference(control: Any, time: float, work: Any) -> None:
    """Fill the desired positions of all joints."""
    joint, table = work.joint, control.reference
    size = table.shape[0]
    for j in range(size):
        offset, amplitude, frequency, phase = table[j, 0], table[j, 1], table[j, 2], table[j, 3]
        joint[BASE, j] = laws.harmonic_position(time, offset, amplitude, frequency, phase)
    for j in range(size):
        position = control.offset[j]
        for k in range(size):
            position += control.coupling[j, k] * joint[BASE, k]
        joint[REFERENCE, j] = position


@compiled
def reference_rate(control: Any, time: float, work: Any) -> None:
    """Fill the desired velocities of all joints."""
    joint, table = work.joint, control.reference
    size = table.shape[0]
    for j in range(size):
        joint[BASE, j] = laws.harmonic_rate(time, table[j, 1], table[j, 2], table[j, 3])
    for j in range(size):
        rate = 0.0
        for k in range(size):
            rate += control.coupling[j, k] * joint[BASE, k]
        joint[REFERENCE_RATE, j] = rate


@compiled
def command(control: Any, time: float, position: Any, actuated: int, work: Any) -> None:
    """Fill work.planned with the tensions that the controller asks for, (19), (21), (22)."""
    planned = work.planned
    if control.held:
        for i in range(actuated):
            planned[i] = control.tension[i]
        return
    reference(control, time, work)
    joint = work.joint
    for j in range(position.size):
        joint[DESIRED, j] = laws.proportional_torque(control.gain[j], joint[REFERENCE, j], position[j])
    level = -np.inf
    for i in range(planned.size):
        value = 0.0
        for j in range(position.size):
            value += control.inverse[i, j] * joint[DESIRED, j]
        planned[i] = value
        candidate = laws.internal_level(control.minimum[i], value, control.internal[i])
        if candidate > level:
            level = candidate
            work.active[0] = i
    for i in range(planned.size):
        planned[i] += level * control.internal[i]


@compiled
def _tendons(plant: Any, x: Any, work: Any, rate: Any) -> None:
    """Fill tendon forces, their stiction rates and the acceleration of the passive tendons."""
    tendons, joints = plant.coupling.shape
    actuated = plant.actuated
    passive = tendons - actuated
    p_at, w_at, s_at = 2 * joints, 2 * joints + passive, 2 * joints + 2 * passive
    rows, strand, table = work.tendon, work.strand[0], plant.tendons
    for i in range(tendons):
        curvature, speed = table[i, OFFSET], 0.0
        for j in range(joints):
            curvature += plant.curvature_matrix[i, j] * abs(x[j])
            speed += plant.coupling[i, j] * x[joints + j]
        if i >= actuated:
            speed = x[w_at + i - actuated]
        stiction = x[s_at + i]
        if i < actuated:
            settled = laws.friction_force(stiction, speed, table[i, VISCOUS], 0.0, 0.0)
            normal = abs(laws.delivered_tension(work.planned[i], settled)) + abs(work.planned[i])
        else:
            k = i - actuated
            row, stiffness = actuated + 2 * k, plant.passive[k, HALF_STIFFNESS]
            proximal, distal = -x[p_at + k], x[p_at + k]
            for j in range(joints):
                proximal -= plant.strand_coupling[row, j] * x[j]
                distal -= plant.strand_coupling[row + 1, j] * x[j]
            strand[row] = laws.half_tension(proximal, stiffness)
            strand[row + 1] = laws.half_tension(distal, stiffness)
            normal = strand[row] + strand[row + 1]
            rate[p_at + k] = speed
        coefficient = laws.capstan_coefficient(table[i, SURFACE], curvature)
        sliding = laws.friction_coefficient(
            speed, coefficient, table[i, RATIO] * coefficient, table[i, STRIBECK], table[i, EXPONENT]
        )
        level = laws.friction_level(normal, sliding, table[i, FLOOR])
        change = laws.stiction_rate(stiction, speed, level, table[i, STIFFNESS])
        loss = laws.friction_force(stiction, speed, table[i, VISCOUS], change, table[i, LAG])
        rate[s_at + i] = change
        if i < actuated:
            strand[i] = laws.delivered_tension(work.planned[i], loss)
        else:
            k = i - actuated
            row = actuated + 2 * k
            rate[w_at + k] = laws.passive_acceleration(
                strand[row], strand[row + 1], loss, plant.passive[k, PASSIVE_MASS]
            )
        rows[SPEED, i], rows[LOSS, i], rows[NORMAL, i], rows[CURVATURE, i] = speed, loss, normal, curvature
        rows[COEFFICIENT, i], rows[SLIDING, i], rows[LEVEL, i] = coefficient, sliding, level


@compiled
def _fingertip(plant: Any, work: Any) -> None:
    """Fill the fingertip Jacobian, J^T F, the link directions and e . F after `move`."""
    force, joint = plant.fingertip_force, work.joint
    size = plant.parents.size
    tip, body = work.centre, plant.tip_body
    for r in range(3):
        tip[r] = plant.tip_offset[r]
        if body >= 0:
            tip[r] = work.origin[body, r]
            for c in range(3):
                tip[r] += work.rotation[body, r, c] * plant.tip_offset[c]
    for j in range(size):
        carrier = plant.carriers[j]
        joint[ALONG, j] = 0.0
        joint[EXTERNAL, j] = 0.0
        for r in range(3):
            work.jacobian[r, j] = 0.0
            value = plant.directions[j, r]
            if carrier >= 0:
                value = 0.0
                for c in range(3):
                    value += work.rotation[carrier, r, c] * plant.directions[j, c]
            work.direction[j, r] = value
            joint[ALONG, j] += value * force[r]
    j = body
    while j >= 0:
        axis = work.spatial[AXIS, j]
        work.jacobian[0, j] = axis[3] + axis[1] * tip[2] - axis[2] * tip[1]
        work.jacobian[1, j] = axis[4] + axis[2] * tip[0] - axis[0] * tip[2]
        work.jacobian[2, j] = axis[5] + axis[0] * tip[1] - axis[1] * tip[0]
        for r in range(3):
            joint[EXTERNAL, j] += work.jacobian[r, j] * force[r]
        j = plant.parents[j]


@compiled
def _joints(plant: Any, x: Any, work: Any, rate: Any) -> None:
    """Fill joint reactions, friction, limiters and the net torque."""
    tendons, joints = plant.coupling.shape
    z_at = 2 * joints + 2 * (tendons - plant.actuated) + tendons
    joint, table, strand, force = work.joint, plant.joints, work.strand[0], plant.fingertip_force
    squared = force[0] * force[0] + force[1] * force[1] + force[2] * force[2]
    for j in range(joints):
        speed, stiction = x[joints + j], x[z_at + j]
        load, torque = 0.0, 0.0
        for s in range(strand.size):
            load += plant.loads[j, s] * strand[s]
            torque += plant.strand_coupling[s, j] * strand[s]
        along = joint[ALONG, j]
        reaction = laws.joint_reaction(load, along, np.sqrt(max(squared - along * along, 0.0)))
        sliding = laws.friction_coefficient(
            speed, table[j, KINETIC], table[j, STATIC], table[j, J_STRIBECK], table[j, J_EXPONENT]
        )
        level = laws.friction_level(reaction, sliding, table[j, J_FLOOR])
        change = laws.stiction_rate(stiction, speed, level, table[j, J_STIFFNESS])
        loss = laws.friction_force(stiction, speed, table[j, J_VISCOUS], change, table[j, J_LAG])
        depth = laws.penetration(x[j], table[j, LOWER], table[j, UPPER])
        limiter = laws.limiter_torque(depth, speed, table[j, L_STIFFNESS], table[j, L_DAMPING])
        rate[z_at + j] = change
        joint[LOAD, j], joint[REACTION, j], joint[J_SLIDING, j], joint[J_LEVEL, j] = load, reaction, sliding, level
        joint[DEPTH, j], joint[LIMITER, j], joint[J_LOSS, j] = depth, limiter, loss
        joint[TORQUE, j] = torque - loss - limiter + joint[EXTERNAL, j]


@compiled
def evaluate(plant: Any, control: Any, time: float, x: Any, work: Any, rate: Any) -> None:
    """Fill the rate of the packed state, and everything in ``work`` that the linearisation needs."""
    joints = plant.parents.size
    position, velocity = x[:joints], x[joints : 2 * joints]
    joint = work.joint
    command(control, time, position, plant.actuated, work)
    _tendons(plant, x, work, rate)
    move(plant, position, velocity, work)
    # Without a force the rows that it fills stay zero.
    if plant.loaded:
        _fingertip(plant, work)
    _joints(plant, x, work, rate)
    mass_matrix(plant, work)
    factorise_mass(joints, work)
    inverse_dynamics(plant, velocity, joint[ZERO], work, joint[BIAS])
    for j in range(joints):
        rate[j] = velocity[j]
        joint[ACCELERATION, j] = joint[TORQUE, j] - joint[BIAS, j]
    solve_mass(joints, work, joint[ACCELERATION])
    for j in range(joints):
        rate[joints + j] = joint[ACCELERATION, j]
