"""The Jacobian of the whole, exact and in factors: the partial derivatives that `condensation` solves with."""

from __future__ import annotations

import numpy as np

from finger_pin.core.addresses.time_functions import signal_derivatives
from finger_pin.core.evaluation.input_values import input_slopes, tip_forces
from finger_pin.core.evaluation.paths import passes
from finger_pin.core.evaluation.rigid_body_derivatives import inverse_dynamics_derivatives
from finger_pin.core.evaluation.rigid_body_dynamics import inverse_dynamics
from finger_pin.core.jit import CompiledFunction, call_at, call_filling, njit_always_inline, unpack
from finger_pin.core.tables.buffers import Work
from finger_pin.core.tables.linear_systems import Linear
from finger_pin.core.tables.mechanism_parameters import Parameters
from finger_pin.core.tables.model import MODEL
from finger_pin.core.tables.structure import Structure


@njit_always_inline
def _turning_tips(structure: Structure, parameters: Parameters, work: Work, linear: Linear) -> None:
    """Subtract d(J^T F)/dq from by_position: a column turns with the joints below it and moves with the tip."""
    axes = work.spatial.axis
    for t in range(structure.tip_body.size):
        force, column = parameters.tip_force[t], work.jacobian[t]
        i = structure.tip_body[t]
        while i >= 0:
            k = structure.tip_body[t]
            while k >= 0:
                # The joint nearer to the base turns the other one's column.
                inner, outer = (k, i) if k <= i else (i, k)
                linear.by_position[i, k] -= (
                    force[0] * (axes[inner, 1] * column[2, outer] - axes[inner, 2] * column[1, outer])
                    + force[1] * (axes[inner, 2] * column[0, outer] - axes[inner, 0] * column[2, outer])
                    + force[2] * (axes[inner, 0] * column[1, outer] - axes[inner, 1] * column[0, outer])
                )
                k = structure.parents[k]
            i = structure.parents[i]


@njit_always_inline
def _load_slopes(structure: Structure, parameters: Parameters, work: Work, linear: Linear) -> None:
    """Fill the derivatives of all loads by the sum of earlier forces, and by the posture that turns the pins' links."""
    axes = work.spatial.axis
    for k in range(structure.joint_pin.size):
        body = structure.joint_pin[k]
        if not (parameters.has_tip_force or structure.contact_rows) or body < 0:
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
        for t in range(structure.tip_body.size):
            x -= structure.supported_by[t, body] * parameters.tip_force[t, 0]
            y -= structure.supported_by[t, body] * parameters.tip_force[t, 1]
            z -= structure.supported_by[t, body] * parameters.tip_force[t, 2]
        for index in range(work.paths.closed_count[0]):
            c = work.paths.closed[index]
            passing = passes(structure.paths, c, body)
            x -= passing * work.paths.push[c, 0]
            y -= passing * work.paths.push[c, 1]
            z -= passing * work.paths.push[c, 2]
        linear.load_by_time[k] = 0.0
        for t in range(structure.tip_body.size):
            for r in range(3):
                linear.load_by_time[k] += structure.supported_by[t, body] * work.force_rate[t, r] * pull[r] / size
        for j in range(structure.parents.size):
            linear.load_by_position[k, j] = 0.0
        j = structure.parent_links[body]
        while j >= 0:
            a = axes[j]
            linear.load_by_position[k, j] = (
                pull[0] * (a[1] * z - a[2] * y) + pull[1] * (a[2] * x - a[0] * z) + pull[2] * (a[0] * y - a[1] * x)
            ) / size
            j = structure.parents[j]


@CompiledFunction
def linearise(address: int, time: float) -> int:
    """Fill all partial derivatives of a `Model` at an address after `evaluate` at the same time and state."""
    model = unpack(address, MODEL)
    structure, parameters = model.structure, model.parameters
    control, x, work, linear = model.control, model.state, model.work, model.linear
    size, width = structure.parents.size, work.torque.size
    velocity = x[width : 2 * width]
    # The derivatives of inverse dynamics are taken at the actual acceleration.
    inverse_dynamics(structure, parameters, velocity, work.acceleration, work, work.bias, True)
    inverse_dynamics_derivatives(structure, velocity, work)
    for i in range(size):
        for j in range(size):
            linear.by_position[i, j] = work.by_position[i, j]
        # A body and those that it carries stand between their root and the last of them.
        for j in range(structure.roots[i], i + 1):
            linear.mass[i, j] = linear.mass[j, i] = work.mass_matrix[i, j]
            linear.by_velocity[i, j] = work.by_velocity[i, j]
            linear.by_velocity[j, i] = work.by_velocity[j, i]
    if control.palm.harmonics.shape[0] > 0:
        call_at(model.bias_rate, address, time)
    if parameters.has_tip_force:
        _turning_tips(structure, parameters, work, linear)
    input_slopes(control, time)
    if control.palm.harmonics.shape[0] == 0:
        signal_derivatives(control.guide, time, 3, work.guide_rate)
    if parameters.has_tip_force:
        tip_forces(control, time, 1, work.force_rate)
    for g in range(structure.groups.first.size):
        begin, end = structure.groups.first[g], structure.groups.end[g]
        if begin >= structure.contact_rows:
            call_filling(structure.groups.slopes[g], work.rows, parameters.laws, work.slopes, begin, end)
            continue
        for index in range(work.paths.active_pair_count[0]):
            k = structure.paths.row[work.paths.active_pairs[index]]
            if begin <= k < end:
                call_filling(
                    structure.groups.slopes[g], work.rows, parameters.laws, work.slopes, k, k + structure.contact_arms
                )
    for e in range(parameters.bend.size):
        linear.bend[e] = parameters.bend[e] * np.sign(x[structure.bend_at[e]])
    _load_slopes(structure, parameters, work, linear)
    if model.linearise_paths != 0:
        call_at(model.linearise_paths, address, time)
    return 1
