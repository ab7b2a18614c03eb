"""Exact derivatives of inverse dynamics by position and velocity, compiled.

They are those of Singh, Russell and Wensing, Efficient Analytical Derivatives of Rigid-Body Dynamics using Spatial
Vector Algebra, IEEE RA-L 7 (2022), in the conventions of `rigid_body`.
"""

from __future__ import annotations

from finger_pin.core.addresses.spatial import add_force_cross, apply_inertia, dot, motion_cross
from finger_pin.core.jit import Vector, njit_always_inline
from finger_pin.core.tables.buffers import Work
from finger_pin.core.tables.structure import Structure


@njit_always_inline
def _coriolis_block(inertia: Vector, motion: Vector, out: Vector) -> None:
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


@njit_always_inline
def inverse_dynamics_derivatives(structure: Structure, velocity: Vector, work: Work) -> None:
    """Fill the derivatives of inverse dynamics by position and velocity after `inverse_dynamics` and `mass_matrix`.

    Of bodies that neither carries the other they are zero from the start.
    """
    size = structure.parents.size
    by_position, by_velocity = work.by_position, work.by_velocity
    for i in range(size):
        parent = structure.parents[i]
        _coriolis_block(work.inertia[i], work.spatial.motion[i], work.coriolis[i])
        # axis_curve = a_parent x S + v_parent x (v_parent x S)
        above = work.base_acceleration if parent < 0 else work.spatial.acceleration[parent]
        carried = work.base_velocity if parent < 0 else work.spatial.motion[parent]
        motion_cross(above, work.spatial.axis[i], work.spatial.axis_curve[i])
        motion_cross(carried, work.spatial.axis_rate[i], work.vectors[0])
        for k in range(6):
            work.spatial.axis_curve[i, k] += work.vectors[0][k]
    for i in range(size - 1, -1, -1):
        block, axis = work.coriolis[i], work.spatial.axis[i]
        rate, curve = work.spatial.axis_rate[i], work.spatial.axis_curve[i]
        # Bt = B^T S, which acts on angular parts only.
        b0 = block[0] * axis[0] + block[3] * axis[1] + block[6] * axis[2] + block[10] * axis[5] - block[11] * axis[4]
        b1 = block[1] * axis[0] + block[4] * axis[1] + block[7] * axis[2] + block[11] * axis[3] - block[9] * axis[5]
        b2 = block[2] * axis[0] + block[5] * axis[1] + block[8] * axis[2] + block[9] * axis[4] - block[10] * axis[3]
        momentum = work.spatial.momentum[i]
        by_q, by_v = work.vectors[0], work.vectors[1]
        apply_inertia(work.composite[i], curve, by_q)
        apply_inertia(work.composite[i], rate, by_v)
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
        add_force_cross(axis, work.spatial.force[i], by_q)
        j = i
        while j >= 0:
            above, above_rate = work.spatial.axis[j], work.spatial.axis_rate[j]
            above_curve = work.spatial.axis_curve[j]
            by_position[i, j] = 2.0 * (b0 * above_rate[0] + b1 * above_rate[1] + b2 * above_rate[2]) + dot(
                momentum, above_curve
            )
            by_velocity[i, j] = 2.0 * (b0 * above[0] + b1 * above[1] + b2 * above[2] + dot(momentum, above_rate))
            if j != i:
                by_position[j, i] = dot(above, by_q)
                by_velocity[j, i] = dot(above, by_v)
            j = structure.parents[j]
        parent = structure.parents[i]
        if parent >= 0:
            for k in range(12):
                work.coriolis[parent, k] += block[k]
