"""Rigid-body dynamics of trees of revolute and prismatic joints, and their exact derivatives, compiled.

Everything is expressed in the base frame about its origin O: motion vectors are (angular velocity, velocity of the
body's point at O), force vectors are (moment about O, force). Every joint turns about or slides along the z axis of
its own frame; `plant` turns the frames of the model so that this holds.

Inverse dynamics, composite inertias and bias are those of Featherstone, Rigid Body Dynamics Algorithms (2008); the
derivatives are those of Singh, Russell and Wensing, Efficient Analytical Derivatives of Rigid-Body Dynamics using
Spatial Vector Algebra, IEEE RA-L 7 (2022).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.core.compilation import compiled

# Columns of the table of bodies.
ROTATION, TRANSLATION, MASS, CENTRE, INERTIA, BODY_COLUMNS = 0, 9, 12, 13, 16, 22
PRISMATIC = 1
# Layers of work.spatial, one motion or force vector per body, and of work.square.
AXIS, AXIS_RATE, AXIS_CURVE, MOTION, SPATIAL_ACCELERATION, FORCE, MOMENTUM, SPATIAL_LAYERS = range(8)
MASS_MATRIX, CHOLESKY, BY_POSITION, BY_VELOCITY, SQUARE_LAYERS = range(5)


@compiled
def _motion_cross(a: Any, b: Any, out: Any) -> None:
    """Fill out = a x b for motion vectors."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
    out[3] = a[1] * b[5] - a[2] * b[4] + a[4] * b[2] - a[5] * b[1]
    out[4] = a[2] * b[3] - a[0] * b[5] + a[5] * b[0] - a[3] * b[2]
    out[5] = a[0] * b[4] - a[1] * b[3] + a[3] * b[1] - a[4] * b[0]


@compiled
def _add_force_cross(a: Any, f: Any, out: Any) -> None:
    """Add a x* f to out, a motion vector acting on a force vector."""
    out[0] += a[1] * f[2] - a[2] * f[1] + a[4] * f[5] - a[5] * f[4]
    out[1] += a[2] * f[0] - a[0] * f[2] + a[5] * f[3] - a[3] * f[5]
    out[2] += a[0] * f[1] - a[1] * f[0] + a[3] * f[4] - a[4] * f[3]
    out[3] += a[1] * f[5] - a[2] * f[4]
    out[4] += a[2] * f[3] - a[0] * f[5]
    out[5] += a[0] * f[4] - a[1] * f[3]


@compiled
def _apply_inertia(inertia: Any, a: Any, out: Any) -> None:
    """Fill out = I a; an inertia is (mass, first moment h, second moment about O: xx xy xz yy yz zz)."""
    m, hx, hy, hz = inertia[0], inertia[1], inertia[2], inertia[3]
    out[0] = inertia[4] * a[0] + inertia[5] * a[1] + inertia[6] * a[2] + hy * a[5] - hz * a[4]
    out[1] = inertia[5] * a[0] + inertia[7] * a[1] + inertia[8] * a[2] + hz * a[3] - hx * a[5]
    out[2] = inertia[6] * a[0] + inertia[8] * a[1] + inertia[9] * a[2] + hx * a[4] - hy * a[3]
    out[3] = m * a[3] - hy * a[2] + hz * a[1]
    out[4] = m * a[4] - hz * a[0] + hx * a[2]
    out[5] = m * a[5] - hx * a[1] + hy * a[0]


@compiled
def _dot(a: Any, b: Any) -> Any:
    """Return the scalar product of a motion and a force vector."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]


@compiled
def _place(plant: Any, i: int, angle: float, work: Any) -> None:
    """Place body i: rotation, origin and joint axis in the base frame."""
    body, parent, rotation = plant.bodies[i], plant.parents[i], work.rotation[i]
    frame = work.frame
    if parent < 0:
        for r in range(3):
            for c in range(3):
                frame[r, c] = body[ROTATION + 3 * r + c]
            work.origin[i, r] = body[TRANSLATION + r]
    else:
        above = work.rotation[parent]
        for r in range(3):
            for c in range(3):
                frame[r, c] = (
                    above[r, 0] * body[ROTATION + c]
                    + above[r, 1] * body[ROTATION + 3 + c]
                    + above[r, 2] * body[ROTATION + 6 + c]
                )
            work.origin[i, r] = (
                work.origin[parent, r]
                + above[r, 0] * body[TRANSLATION]
                + above[r, 1] * body[TRANSLATION + 1]
                + above[r, 2] * body[TRANSLATION + 2]
            )
    prismatic = plant.kinds[i] == PRISMATIC
    cosine, sine = (1.0, 0.0) if prismatic else (np.cos(angle), np.sin(angle))
    for r in range(3):
        rotation[r, 0] = cosine * frame[r, 0] + sine * frame[r, 1]
        rotation[r, 1] = cosine * frame[r, 1] - sine * frame[r, 0]
        rotation[r, 2] = frame[r, 2]
        if prismatic:
            work.origin[i, r] += angle * frame[r, 2]


@compiled
def _inertia_about_origin(plant: Any, i: int, work: Any) -> None:
    """Express the inertia of body i about O in base axes."""
    body, rotation, out = plant.bodies[i], work.rotation[i], work.inertia[i]
    mass = body[MASS]
    ixx, ixy, ixz = body[INERTIA], body[INERTIA + 1], body[INERTIA + 2]
    iyy, iyz, izz = body[INERTIA + 3], body[INERTIA + 4], body[INERTIA + 5]
    centre = work.centre
    for r in range(3):
        centre[r] = (
            work.origin[i, r]
            + rotation[r, 0] * body[CENTRE]
            + rotation[r, 1] * body[CENTRE + 1]
            + rotation[r, 2] * body[CENTRE + 2]
        )
    squared = centre[0] * centre[0] + centre[1] * centre[1] + centre[2] * centre[2]
    out[0] = mass
    position = 4
    for r in range(3):
        out[1 + r] = mass * centre[r]
        a, b, c = rotation[r, 0], rotation[r, 1], rotation[r, 2]
        x, y, z = a * ixx + b * ixy + c * ixz, a * ixy + b * iyy + c * iyz, a * ixz + b * iyz + c * izz
        for s in range(r, 3):
            value = x * rotation[s, 0] + y * rotation[s, 1] + z * rotation[s, 2] - mass * centre[r] * centre[s]
            out[position] = value + mass * squared if r == s else value
            position += 1


@compiled
def move(plant: Any, position: Any, velocity: Any, work: Any) -> None:
    """Fill axes, velocities and composite inertias of all bodies."""
    for i in range(plant.parents.size):
        parent = plant.parents[i]
        _place(plant, i, position[i], work)
        _inertia_about_origin(plant, i, work)
        axis, rotation, origin = work.spatial[AXIS, i], work.rotation[i], work.origin[i]
        x, y, z = rotation[0, 2], rotation[1, 2], rotation[2, 2]
        if plant.kinds[i] == PRISMATIC:
            axis[0], axis[1], axis[2], axis[3], axis[4], axis[5] = 0.0, 0.0, 0.0, x, y, z
        else:
            axis[0], axis[1], axis[2] = x, y, z
            axis[3] = origin[1] * z - origin[2] * y
            axis[4] = origin[2] * x - origin[0] * z
            axis[5] = origin[0] * y - origin[1] * x
        if parent < 0:
            for k in range(6):
                work.spatial[AXIS_RATE, i, k] = 0.0
                work.spatial[MOTION, i, k] = axis[k] * velocity[i]
        else:
            _motion_cross(work.spatial[MOTION, parent], axis, work.spatial[AXIS_RATE, i])
            for k in range(6):
                work.spatial[MOTION, i, k] = work.spatial[MOTION, parent, k] + axis[k] * velocity[i]
        for k in range(10):
            work.composite[i, k] = work.inertia[i, k]
    for i in range(plant.parents.size - 1, -1, -1):
        if plant.parents[i] >= 0:
            for k in range(10):
                work.composite[plant.parents[i], k] += work.composite[i, k]


@compiled
def inverse_dynamics(plant: Any, velocity: Any, acceleration: Any, work: Any, torque: Any) -> None:
    """Fill torque = M a + C v + G after `move`, and the accelerations and composite forces of the bodies."""
    size = plant.parents.size
    for i in range(size):
        parent = plant.parents[i]
        for k in range(6):
            above = work.base_acceleration[k] if parent < 0 else work.spatial[SPATIAL_ACCELERATION, parent, k]
            work.spatial[SPATIAL_ACCELERATION, i, k] = (
                above + work.spatial[AXIS, i, k] * acceleration[i] + work.spatial[AXIS_RATE, i, k] * velocity[i]
            )
        _apply_inertia(work.inertia[i], work.spatial[SPATIAL_ACCELERATION, i], work.spatial[FORCE, i])
        _apply_inertia(work.inertia[i], work.spatial[MOTION, i], work.vectors[0])
        _add_force_cross(work.spatial[MOTION, i], work.vectors[0], work.spatial[FORCE, i])
    for i in range(size - 1, -1, -1):
        torque[i] = _dot(work.spatial[AXIS, i], work.spatial[FORCE, i])
        if plant.parents[i] >= 0:
            for k in range(6):
                work.spatial[FORCE, plant.parents[i], k] += work.spatial[FORCE, i, k]


@compiled
def mass_matrix(plant: Any, work: Any) -> None:
    """Fill work.square[MASS_MATRIX] = M after `move`."""
    size = plant.parents.size
    for i in range(size):
        momentum = work.spatial[MOMENTUM, i]
        _apply_inertia(work.composite[i], work.spatial[AXIS, i], momentum)
        for j in range(i):
            work.square[MASS_MATRIX, i, j] = 0.0
            work.square[MASS_MATRIX, j, i] = 0.0
        j = i
        while j >= 0:
            value = _dot(work.spatial[AXIS, j], momentum)
            work.square[MASS_MATRIX, i, j] = value
            work.square[MASS_MATRIX, j, i] = value
            j = plant.parents[j]


@compiled
def factorise_mass(size: int, work: Any) -> None:
    """Fill work.square[CHOLESKY] with the Cholesky factor of M."""
    factor = work.square[CHOLESKY]
    for i in range(size):
        for j in range(i + 1):
            value = work.square[MASS_MATRIX, i, j]
            for k in range(j):
                value -= factor[i, k] * factor[j, k]
            factor[i, j] = np.sqrt(value) if i == j else value / factor[j, j]


@compiled
def solve_mass(size: int, work: Any, vector: Any) -> None:
    """Replace a vector by M^-1 vector after `factorise_mass`."""
    factor = work.square[CHOLESKY]
    for i in range(size):
        value = vector[i]
        for k in range(i):
            value -= factor[i, k] * vector[k]
        vector[i] = value / factor[i, i]
    for i in range(size - 1, -1, -1):
        value = vector[i]
        for k in range(i + 1, size):
            value -= factor[k, i] * vector[k]
        vector[i] = value / factor[i, i]


@compiled
def _coriolis_block(inertia: Any, motion: Any, out: Any) -> None:
    """Fill the upper left block of the body's Coriolis matrix, and its linear momentum in out[9:12].

    B(I, v) = ((v x*) I - I (v x) + (I v) x*) / 2 has only two non-zero blocks: this one, and below it minus the
    cross product with the linear momentum.
    """
    wx, wy, wz, ux, uy, uz = motion[0], motion[1], motion[2], motion[3], motion[4], motion[5]
    m, hx, hy, hz = inertia[0], inertia[1], inertia[2], inertia[3]
    xx, xy, xz, yy, yz, zz = inertia[4], inertia[5], inertia[6], inertia[7], inertia[8], inertia[9]
    # W A - A W is symmetric for a symmetric A and a skew W.
    s00 = 2.0 * (wy * xz - wz * xy)
    s11 = 2.0 * (wz * xy - wx * yz)
    s22 = 2.0 * (wx * yz - wy * xz)
    s01 = wy * yz - wz * yy + wz * xx - wx * xz
    s02 = wy * zz - wz * yz + wx * xy - wy * xx
    s12 = wz * xz - wx * zz + wx * yy - wy * xy
    # U C + C U = u h^T + h u^T - 2 (u . h) 1 for the cross-product matrices U of u and C of h.
    inner = 2.0 * (ux * hx + uy * hy + uz * hz)
    # Moment of momentum about O.
    nx = xx * wx + xy * wy + xz * wz + hy * uz - hz * uy
    ny = xy * wx + yy * wy + yz * wz + hz * ux - hx * uz
    nz = xz * wx + yz * wy + zz * wz + hx * uy - hy * ux
    t01, t02, t12 = ux * hy + hx * uy, ux * hz + hx * uz, uy * hz + hy * uz
    out[0] = 0.5 * (s00 - 2.0 * ux * hx + inner)
    out[4] = 0.5 * (s11 - 2.0 * uy * hy + inner)
    out[8] = 0.5 * (s22 - 2.0 * uz * hz + inner)
    out[1], out[3] = 0.5 * (s01 - t01 + nz), 0.5 * (s01 - t01 - nz)
    out[2], out[6] = 0.5 * (s02 - t02 - ny), 0.5 * (s02 - t02 + ny)
    out[5], out[7] = 0.5 * (s12 - t12 + nx), 0.5 * (s12 - t12 - nx)
    out[9] = m * ux + wy * hz - wz * hy
    out[10] = m * uy + wz * hx - wx * hz
    out[11] = m * uz + wx * hy - wy * hx


@compiled
def inverse_dynamics_derivatives(plant: Any, velocity: Any, work: Any) -> None:
    """Fill the derivatives of inverse dynamics by position and velocity after `inverse_dynamics` and `mass_matrix`."""
    size = plant.parents.size
    by_position, by_velocity = work.square[BY_POSITION], work.square[BY_VELOCITY]
    for i in range(size):
        parent = plant.parents[i]
        _coriolis_block(work.inertia[i], work.spatial[MOTION, i], work.coriolis[i])
        # axis_curve = a_parent x S + v_parent x (v_parent x S)
        if parent < 0:
            _motion_cross(work.base_acceleration, work.spatial[AXIS, i], work.spatial[AXIS_CURVE, i])
        else:
            above = work.spatial[SPATIAL_ACCELERATION, parent]
            _motion_cross(above, work.spatial[AXIS, i], work.spatial[AXIS_CURVE, i])
            _motion_cross(work.spatial[MOTION, parent], work.spatial[AXIS_RATE, i], work.vectors[0])
            for k in range(6):
                work.spatial[AXIS_CURVE, i, k] += work.vectors[0][k]
        for j in range(size):
            by_position[i, j] = 0.0
            by_velocity[i, j] = 0.0
    for i in range(size - 1, -1, -1):
        block, axis = work.coriolis[i], work.spatial[AXIS, i]
        rate, curve = work.spatial[AXIS_RATE, i], work.spatial[AXIS_CURVE, i]
        # Bt = B^T S, which acts on angular parts only.
        b0 = block[0] * axis[0] + block[3] * axis[1] + block[6] * axis[2] + block[10] * axis[5] - block[11] * axis[4]
        b1 = block[1] * axis[0] + block[4] * axis[1] + block[7] * axis[2] + block[11] * axis[3] - block[9] * axis[5]
        b2 = block[2] * axis[0] + block[5] * axis[1] + block[8] * axis[2] + block[9] * axis[4] - block[10] * axis[3]
        momentum = work.spatial[MOMENTUM, i]
        by_q, by_v = work.vectors[0], work.vectors[1]
        _apply_inertia(work.composite[i], curve, by_q)
        _apply_inertia(work.composite[i], rate, by_v)
        for k in range(6):
            by_v[k] *= 2.0
        for k in range(3):
            by_q[k] += 2.0 * (block[3 * k] * rate[0] + block[3 * k + 1] * rate[1] + block[3 * k + 2] * rate[2])
            by_v[k] += 2.0 * (block[3 * k] * axis[0] + block[3 * k + 1] * axis[1] + block[3 * k + 2] * axis[2])
        px, py, pz = block[9], block[10], block[11]
        by_q[3] -= 2.0 * (py * rate[2] - pz * rate[1])
        by_q[4] -= 2.0 * (pz * rate[0] - px * rate[2])
        by_q[5] -= 2.0 * (px * rate[1] - py * rate[0])
        by_v[3] -= 2.0 * (py * axis[2] - pz * axis[1])
        by_v[4] -= 2.0 * (pz * axis[0] - px * axis[2])
        by_v[5] -= 2.0 * (px * axis[1] - py * axis[0])
        _add_force_cross(axis, work.spatial[FORCE, i], by_q)
        j = i
        while j >= 0:
            above, above_rate = work.spatial[AXIS, j], work.spatial[AXIS_RATE, j]
            above_curve = work.spatial[AXIS_CURVE, j]
            by_position[i, j] = 2.0 * (b0 * above_rate[0] + b1 * above_rate[1] + b2 * above_rate[2]) + _dot(
                momentum, above_curve
            )
            by_velocity[i, j] = 2.0 * (b0 * above[0] + b1 * above[1] + b2 * above[2] + _dot(momentum, above_rate))
            if j != i:
                by_position[j, i] = _dot(above, by_q)
                by_velocity[j, i] = _dot(above, by_v)
            j = plant.parents[j]
        parent = plant.parents[i]
        if parent >= 0:
            for k in range(12):
                work.coriolis[parent, k] += block[k]
