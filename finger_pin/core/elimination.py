"""The linear systems that an implicit method solves, with most unknowns eliminated by hand.

A Rosenbrock stage solves (g - J) u = r. Stiction couples to the rest only through velocities and forces, so it is
eliminated by hand, as are positions: with y = (velocity part, passive velocity part) of u,

    position part = (r + y) / g
    stiction of a tendon = c + G y
    strand force = c + F y
    stiction of a joint = c + Z y

and what is left is a dense system with one row per joint and passive tendon: 5 instead of 19 for the paper's finger.
The rows of the joints are kept multiplied by the mass matrix. Micro-damping needs the change of F^s' along u, which the
stiction's own row gives as g u - r without derivatives.
"""

from __future__ import annotations

from typing import Any

from finger_pin.core import dynamics as at
from finger_pin.core.compilation import compiled
from finger_pin.core.linearisation import (
    BY_SPEED,
    BY_STICTION,
    J_RATE_BY_LOAD,
    J_RATE_BY_SPEED,
    J_RATE_BY_STICTION,
    RATE_BY_PASSIVE,
    RATE_BY_SPEED,
    RATE_BY_STICTION,
)


@compiled
def _eliminate(plant: Any, g: float, linear: Any) -> None:
    """Fill the gains G, F and Z."""
    tendons, joints = plant.coupling.shape
    actuated = plant.actuated
    strands = plant.strand_coupling.shape[0]
    reduced = linear.matrix.shape[0]
    tendon, tendon_gain, strand_gain = linear.tendon, linear.tendon_gain, linear.strand_gain
    for i in range(tendons):
        factor = 1.0 / (g - tendon[RATE_BY_STICTION, i])
        speed = tendon[RATE_BY_SPEED, i]
        for c in range(joints):
            value = linear.stiction_by_position[i, c] / g
            if i < actuated:
                value += speed * plant.coupling[i, c]
            tendon_gain[i, c] = factor * value
        for c in range(joints, reduced):
            tendon_gain[i, c] = 0.0
        if i >= actuated:
            tendon_gain[i, joints + i - actuated] = factor * (tendon[RATE_BY_PASSIVE, i] / g + speed)
    for s in range(strands):
        follow = 1.0 + plant.tendons[s, at.LAG] * g if s < actuated else 0.0
        for c in range(joints):
            strand_gain[s, c] = linear.strand_by_position[s, c] / g
            if s < actuated:
                strand_gain[s, c] += (
                    tendon[BY_SPEED, s] * plant.coupling[s, c] + tendon[BY_STICTION, s] * follow * tendon_gain[s, c]
                )
        for c in range(joints, reduced):
            strand_gain[s, c] = 0.0
        if s >= actuated:
            strand_gain[s, joints + (s - actuated) // 2] = linear.strand_by_passive[s] / g
    for j in range(joints):
        factor = 1.0 / (g - linear.joint[J_RATE_BY_STICTION, j])
        for c in range(reduced):
            load = 0.0
            for s in range(strands):
                load += plant.loads[j, s] * strand_gain[s, c]
            value = linear.joint[J_RATE_BY_LOAD, j] * load
            if c < joints:
                value += linear.joint_by_position[j, c] / g
            if c == j:
                value += linear.joint[J_RATE_BY_SPEED, j]
            linear.joint_gain[j, c] = factor * value


@compiled
def factorise(plant: Any, g: float, mass: Any, linear: Any) -> bool:
    """Factorise g - J after `linearise`, with the mass matrix of that state; false if it is singular."""
    tendons, joints = plant.coupling.shape
    actuated = plant.actuated
    strands = plant.strand_coupling.shape[0]
    _eliminate(plant, g, linear)
    matrix, strand_gain = linear.matrix, linear.strand_gain
    reduced = matrix.shape[0]
    for r in range(joints):
        follow = 1.0 + plant.joints[r, at.J_LAG] * g
        for c in range(reduced):
            value = follow * linear.joint_gain[r, c]
            if c < joints:
                value += g * mass[r, c] - linear.torque_by_position[r, c] / g - linear.torque_by_velocity[r, c]
            for s in range(strands):
                value -= plant.strand_coupling[s, r] * strand_gain[s, c]
            matrix[r, c] = value
    for k in range(tendons - actuated):
        row, i, s = joints + k, actuated + k, actuated + 2 * k
        follow = 1.0 + plant.tendons[i, at.LAG] * g
        for c in range(reduced):
            matrix[row, c] = strand_gain[s + 1, c] - strand_gain[s, c] + follow * linear.tendon_gain[i, c]
        matrix[row, row] += g * plant.passive[k, at.PASSIVE_MASS] + plant.tendons[i, at.VISCOUS]
    for c in range(reduced):
        best = c
        for r in range(c + 1, reduced):
            if abs(matrix[r, c]) > abs(matrix[best, c]):
                best = r
        linear.pivots[c] = best
        if not abs(matrix[best, c]) > 0.0:
            return False
        if best != c:
            for k in range(reduced):
                matrix[c, k], matrix[best, k] = matrix[best, k], matrix[c, k]
        for r in range(c + 1, reduced):
            factor = matrix[r, c] / matrix[c, c]
            matrix[r, c] = factor
            for k in range(c + 1, reduced):
                matrix[r, k] -= factor * matrix[c, k]
    return True


@compiled
def _substitute(linear: Any) -> None:
    """Replace the reduced right-hand side by the reduced solution."""
    matrix, vector = linear.matrix, linear.vector
    reduced = matrix.shape[0]
    for c in range(reduced):
        best = linear.pivots[c]
        if best != c:
            vector[c], vector[best] = vector[best], vector[c]
    for r in range(reduced):
        value = vector[r]
        for c in range(r):
            value -= matrix[r, c] * vector[c]
        vector[r] = value
    for r in range(reduced - 1, -1, -1):
        value = vector[r]
        for c in range(r + 1, reduced):
            value -= matrix[r, c] * vector[c]
        vector[r] = value / matrix[r, r]


@compiled
def solve(plant: Any, g: float, r: Any, linear: Any, u: Any) -> None:
    """Fill u with the solution of (g - J) u = r, where r has its joints' velocity rows multiplied by M."""
    tendons, joints = plant.coupling.shape
    actuated = plant.actuated
    passive = tendons - actuated
    strands = plant.strand_coupling.shape[0]
    p_at, w_at, s_at = 2 * joints, 2 * joints + passive, 2 * joints + 2 * passive
    z_at = s_at + tendons
    tendon, y = linear.tendon, linear.vector
    of_tendon, of_strand, of_joint = linear.constant[0], linear.constant[1], linear.constant[2]
    for i in range(tendons):
        value = 0.0
        for j in range(joints):
            value += linear.stiction_by_position[i, j] * r[j]
        if i >= actuated:
            value += tendon[RATE_BY_PASSIVE, i] * r[p_at + i - actuated]
        of_tendon[i] = (r[s_at + i] + value / g) / (g - tendon[RATE_BY_STICTION, i])
    for s in range(strands):
        value = 0.0
        for j in range(joints):
            value += linear.strand_by_position[s, j] * r[j]
        if s >= actuated:
            value += linear.strand_by_passive[s] * r[p_at + (s - actuated) // 2]
        of_strand[s] = value / g
        if s < actuated:
            lag = plant.tendons[s, at.LAG]
            of_strand[s] += tendon[BY_STICTION, s] * ((1.0 + lag * g) * of_tendon[s] - lag * r[s_at + s])
    for j in range(joints):
        load, turned, torque = 0.0, 0.0, 0.0
        for s in range(strands):
            load += plant.loads[j, s] * of_strand[s]
            torque += plant.strand_coupling[s, j] * of_strand[s]
        for k in range(joints):
            turned += linear.joint_by_position[j, k] * r[k]
            torque += linear.torque_by_position[j, k] * r[k] / g
        rate = r[z_at + j] + linear.joint[J_RATE_BY_LOAD, j] * load + turned / g
        of_joint[j] = rate / (g - linear.joint[J_RATE_BY_STICTION, j])
        lag = plant.joints[j, at.J_LAG]
        y[j] = r[joints + j] + torque - ((1.0 + lag * g) * of_joint[j] - lag * r[z_at + j])
    for k in range(passive):
        s = actuated + 2 * k
        i = actuated + k
        lag = plant.tendons[i, at.LAG]
        friction = (1.0 + lag * g) * of_tendon[i] - lag * r[s_at + i]
        y[joints + k] = plant.passive[k, at.PASSIVE_MASS] * r[w_at + k] + of_strand[s] - of_strand[s + 1] - friction
    _substitute(linear)
    for j in range(joints):
        u[joints + j] = y[j]
        u[j] = (r[j] + y[j]) / g
        value = of_joint[j]
        for c in range(y.size):
            value += linear.joint_gain[j, c] * y[c]
        u[z_at + j] = value
    for k in range(passive):
        u[w_at + k] = y[joints + k]
        u[p_at + k] = (r[p_at + k] + y[joints + k]) / g
    for i in range(tendons):
        value = of_tendon[i]
        for c in range(y.size):
            value += linear.tendon_gain[i, c] * y[c]
        u[s_at + i] = value
