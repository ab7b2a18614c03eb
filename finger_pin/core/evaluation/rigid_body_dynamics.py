"""Rigid-body dynamics of trees of revolute and prismatic joints, compiled.

Everything is expressed in the base frame about its origin O: motion vectors are (angular velocity, velocity of the
body's point at O), force vectors are (moment about O, force). Every joint turns about or slides along the z axis of
its own frame; `plant` turns the frames of the model so that this holds.

Inverse dynamics, composite inertias and bias are those of Featherstone, Rigid Body Dynamics Algorithms (2008).
"""

from __future__ import annotations

from finger_pin.core.addresses.spatial import add_force_cross, apply_inertia, dot, motion_cross, sine_cosine
from finger_pin.core.jit import Vector, njit_always_inline, njit_inline
from finger_pin.core.tables.buffers import Work
from finger_pin.core.tables.chains import BODY, PRISMATIC
from finger_pin.core.tables.mechanism_parameters import Parameters
from finger_pin.core.tables.structure import Structure


@njit_always_inline
def _place(structure: Structure, parameters: Parameters, i: int, angle: float, work: Work) -> None:
    """Place body i: rotation, origin and joint axis in the base frame."""
    body, parent, rotation, origin = parameters.bodies[i], structure.parents[i], work.rotation[i], work.origin[i]
    ax, ay, az = body[BODY.rotation], body[BODY.rotation + 1], body[BODY.rotation + 2]
    bx, by, bz = body[BODY.rotation + 3], body[BODY.rotation + 4], body[BODY.rotation + 5]
    cx, cy, cz = body[BODY.rotation + 6], body[BODY.rotation + 7], body[BODY.rotation + 8]
    x, y, z = body[BODY.translation], body[BODY.translation + 1], body[BODY.translation + 2]
    prismatic = structure.kinds[i] == PRISMATIC
    sine, cosine = (0.0, 1.0) if prismatic else sine_cosine(angle)
    slid = angle if prismatic else 0.0
    for r in range(3):
        a, b, c, start = 1.0 * (r == 0), 1.0 * (r == 1), 1.0 * (r == 2), 0.0
        if parent >= 0:
            above = work.rotation[parent, r]
            a, b, c, start = above[0], above[1], above[2], work.origin[parent, r]
        # A row of the frame before the joint moves.
        u, v, w = a * ax + b * bx + c * cx, a * ay + b * by + c * cy, a * az + b * bz + c * cz
        rotation[r, 0], rotation[r, 1], rotation[r, 2] = cosine * u + sine * v, cosine * v - sine * u, w
        origin[r] = start + a * x + b * y + c * z + slid * w


@njit_inline
def _massless(parameters: Parameters, i: int) -> bool:
    """Return whether a body has no inertia."""
    body = parameters.bodies[i]
    return (
        body[BODY.mass] == 0.0
        and body[BODY.inertia] == 0.0
        and body[BODY.inertia + 3] == 0.0
        and body[BODY.inertia + 5] == 0.0
    )


@njit_always_inline
def _inertia_about_origin(parameters: Parameters, i: int, work: Work) -> None:
    """Express the inertia of body i about O in base axes."""
    body, rotation, origin, out = parameters.bodies[i], work.rotation[i], work.origin[i], work.inertia[i]
    if _massless(parameters, i):
        out[:] = 0.0
        return
    mass, x, y, z = body[BODY.mass], body[BODY.centre], body[BODY.centre + 1], body[BODY.centre + 2]
    ixx, ixy, ixz = body[BODY.inertia], body[BODY.inertia + 1], body[BODY.inertia + 2]
    iyy, iyz, izz = body[BODY.inertia + 3], body[BODY.inertia + 4], body[BODY.inertia + 5]
    ax, ay, az = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    bx, by, bz = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    cx, cy, cz = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    # The centre of mass, and rows of R I.
    px = origin[0] + ax * x + ay * y + az * z
    py = origin[1] + bx * x + by * y + bz * z
    pz = origin[2] + cx * x + cy * y + cz * z
    ux, uy, uz = ax * ixx + ay * ixy + az * ixz, ax * ixy + ay * iyy + az * iyz, ax * ixz + ay * iyz + az * izz
    vx, vy, vz = bx * ixx + by * ixy + bz * ixz, bx * ixy + by * iyy + bz * iyz, bx * ixz + by * iyz + bz * izz
    wx, wy, wz = cx * ixx + cy * ixy + cz * ixz, cx * ixy + cy * iyy + cz * iyz, cx * ixz + cy * iyz + cz * izz
    out[0], out[1], out[2], out[3] = mass, mass * px, mass * py, mass * pz
    out[4] = ux * ax + uy * ay + uz * az + mass * (py * py + pz * pz)
    out[5] = ux * bx + uy * by + uz * bz - mass * px * py
    out[6] = ux * cx + uy * cy + uz * cz - mass * px * pz
    out[7] = vx * bx + vy * by + vz * bz + mass * (px * px + pz * pz)
    out[8] = vx * cx + vy * cy + vz * cz - mass * py * pz
    out[9] = wx * cx + wy * cy + wz * cz + mass * (px * px + py * py)


@njit_inline
def move(structure: Structure, parameters: Parameters, position: Vector, velocity: Vector, work: Work) -> None:
    """Fill axes, velocities and composite inertias of all bodies."""
    for i in range(structure.parents.size):
        parent = structure.parents[i]
        _place(structure, parameters, i, position[i], work)
        _inertia_about_origin(parameters, i, work)
        axis, rotation, origin = work.spatial.axis[i], work.rotation[i], work.origin[i]
        x, y, z = rotation[0, 2], rotation[1, 2], rotation[2, 2]
        if structure.kinds[i] == PRISMATIC:
            axis[0], axis[1], axis[2], axis[3], axis[4], axis[5] = 0.0, 0.0, 0.0, x, y, z
        else:
            axis[0], axis[1], axis[2] = x, y, z
            axis[3] = origin[1] * z - origin[2] * y
            axis[4] = origin[2] * x - origin[0] * z
            axis[5] = origin[0] * y - origin[1] * x
        above = work.base_velocity if parent < 0 else work.spatial.motion[parent]
        motion_cross(above, axis, work.spatial.axis_rate[i])
        for k in range(6):
            work.spatial.motion[i, k] = above[k] + axis[k] * velocity[i]
        for k in range(10):
            work.composite[i, k] = work.inertia[i, k]
    for i in range(structure.parents.size - 1, -1, -1):
        if structure.parents[i] >= 0:
            for k in range(10):
                work.composite[structure.parents[i], k] += work.composite[i, k]


@njit_inline
def inverse_dynamics(
    structure: Structure,
    parameters: Parameters,
    velocity: Vector,
    acceleration: Vector,
    work: Work,
    torque: Vector,
    moving: bool,
) -> None:
    """Fill torque = M a + C v + G after `move`, and the accelerations and composite forces of the bodies.

    Without ``moving`` the acceleration is taken as zero: the bias forces.
    """
    size = structure.parents.size
    for i in range(size):
        parent = structure.parents[i]
        joint_acceleration = acceleration[i] if moving else 0.0
        for k in range(6):
            above = work.base_acceleration[k] if parent < 0 else work.spatial.acceleration[parent, k]
            work.spatial.acceleration[i, k] = (
                above + work.spatial.axis[i, k] * joint_acceleration + work.spatial.axis_rate[i, k] * velocity[i]
            )
        if _massless(parameters, i):
            work.spatial.force[i] = 0.0
            continue
        apply_inertia(work.inertia[i], work.spatial.acceleration[i], work.spatial.force[i])
        apply_inertia(work.inertia[i], work.spatial.motion[i], work.vectors[0])
        add_force_cross(work.spatial.motion[i], work.vectors[0], work.spatial.force[i])
    for i in range(size - 1, -1, -1):
        joint_acceleration = acceleration[i] if moving else 0.0
        torque[i] = (
            dot(work.spatial.axis[i], work.spatial.force[i]) + parameters.bodies[i, BODY.armature] * joint_acceleration
        )
        if structure.parents[i] >= 0:
            for k in range(6):
                work.spatial.force[structure.parents[i], k] += work.spatial.force[i, k]


@njit_always_inline
def mass_matrix(structure: Structure, parameters: Parameters, work: Work) -> None:
    """Fill the lower half of work.mass_matrix = M after `move`; entries between trees are zero from the start."""
    size = structure.parents.size
    for i in range(size):
        momentum = work.spatial.momentum[i]
        apply_inertia(work.composite[i], work.spatial.axis[i], momentum)
        j = i
        while j >= 0:
            work.mass_matrix[i, j] = dot(work.spatial.axis[j], momentum)
            j = structure.parents[j]
        work.mass_matrix[i, i] += parameters.bodies[i, BODY.armature]


@njit_always_inline
def factorise_mass(structure: Structure, size: int, work: Work) -> None:
    """Fill work.mass_factor with M = L^T D L, from the leaves to the roots, so that no entry between branches fills.

    L has ones on its diagonal, where D^-1 stands instead (Featherstone 2008, section 6.5).
    """
    factor = work.mass_factor
    for i in range(size):
        for c in range(structure.roots[i], i + 1):
            factor[i, c] = work.mass_matrix[i, c]
    for j in range(size - 1, -1, -1):
        # Slices, whose indices are not negative, let the compiler use vector instructions.
        root, inverse = structure.roots[j], 1.0 / factor[j, j]
        row, i = factor[j, root:], structure.parents[j]
        while i >= 0:
            share, above = factor[j, i] * inverse, factor[i, root:]
            for c in range(i + 1 - root):
                above[c] -= share * row[c]
            i = structure.parents[i]
        for c in range(j - root):
            row[c] *= inverse
        factor[j, j] = inverse


@njit_always_inline
def solve_mass(structure: Structure, size: int, work: Work, vector: Vector) -> None:
    """Replace a vector by M^-1 vector after `factorise_mass`."""
    factor = work.mass_factor
    for j in range(size - 1, -1, -1):
        value, root = vector[j], structure.roots[j]
        row, part = factor[j, root:], vector[root:]
        for c in range(j - root):
            part[c] -= row[c] * value
    for j in range(size):
        value, row = vector[j] * factor[j, j], factor[j]
        for c in range(structure.roots[j], j):
            value -= row[c] * vector[c]
        vector[j] = value
