"""Forces of contacts, and their part in the systems of `condensation`.

A contact has a row along the normal, and for every slip a row and a state.
"""

from __future__ import annotations

from finger_pin.core.addresses.law_code import ROW
from finger_pin.core.addresses.law_code import TOUCH_SLOPE as AT
from finger_pin.core.evaluation.blocks import add_contact_gain, extent
from finger_pin.core.evaluation.paths import measure_paths, passes, push
from finger_pin.core.jit import CompiledFunction, Matrix, Vector, call_value, njit_always_inline, njit_inline, unpack
from finger_pin.core.tables.buffers import Work
from finger_pin.core.tables.linear_systems import Linear
from finger_pin.core.tables.mechanism_parameters import Parameters
from finger_pin.core.tables.model import MODEL
from finger_pin.core.tables.structure import Structure


@CompiledFunction
def measure(address: int, _time: float) -> int:
    """Fill lengths, turns and arms of rows with paths through space, and forces of contacts, after `move`."""
    model = unpack(address, MODEL)
    measure_paths(model.structure, model.parameters, model.work)
    if model.structure.contact_rows:
        width = model.work.torque.size
        _evaluate_contacts(
            model.structure, model.parameters, model.state[width : 2 * width], model.state[2 * width :], model.work
        )
    return 1


@njit_always_inline
def _evaluate_contacts(structure: Structure, parameters: Parameters, v: Vector, z: Vector, work: Work) -> None:
    """Evaluate the contacts, which come before all other rows, but for those culled, and add to A^T phi."""
    rows, paths = work.rows, work.paths
    for g in range(structure.groups.first.size):
        begin, end = structure.groups.first[g], structure.groups.end[g]
        if begin >= structure.contact_rows:
            continue
        for index in range(paths.active_pair_count[0]):
            e = paths.active_pairs[index]
            k = structure.paths.row[e]
            if not begin <= k < end:
                continue
            for m in range(k, k + structure.contact_arms):
                speed = 0.0
                # One that is open moves nothing, and sees no speed.
                for a in range(structure.arm_start[m], structure.arm_start[m + 1] if paths.active[e] else 0):
                    speed += work.arm[a] * v[structure.arm_at[a]]
                rows[ROW.length, m], rows[ROW.speed, m] = paths.length[m], speed
                if m > k:
                    rows[ROW.state, m] = z[structure.state[m]]
            call_value(structure.groups.value[g], rows, parameters.laws, k, k + structure.contact_arms)
    push(structure, work)
    for index in range(work.paths.closed_count[0]):
        k = structure.paths.row[work.paths.closed[index]]
        for e in range(structure.arm_start[k], structure.arm_start[k + structure.contact_arms]):
            work.torque[structure.arm_at[e]] += work.arm[e] * rows[ROW.force, structure.arm_row[e]]


@njit_inline
def _add_inputs(structure: Structure, k: int, linear: Linear, width: int, out: Vector) -> None:
    """Add the change of a contact's gap, speed and slips, with the weights in ``contact_weights``."""
    place, weights = linear.blocks.place, linear.contact_weights
    for m in range(structure.contact_arms):
        by_length, by_speed = (weights[0] if m == 0 else 0.0), weights[m + 1]
        for e in range(structure.arm_start[k + m], structure.arm_start[k + m + 1]):
            j = place[structure.arm_at[e]]
            out[j] += by_length * linear.measure[e] + by_speed * linear.turning[e]
            out[width + j] += by_speed * linear.arm[e]


@njit_inline
def _invert(matrix: Matrix) -> None:
    """Invert a matrix in place, without pivoting: g less what makes bristles relax is positive definite."""
    size = matrix.shape[0]
    for p in range(size):
        inverse, matrix[p, p] = 1.0 / matrix[p, p], 1.0
        for c in range(size):
            matrix[p, c] *= inverse
        for r in range(size):
            if r != p:
                factor, matrix[r, p] = matrix[r, p], 0.0
                for c in range(size):
                    matrix[r, c] -= factor * matrix[p, c]


@njit_always_inline
def _contact_gains(structure: Structure, g: float, k: int, work: Work, linear: Linear, width: int) -> None:
    """Fill the gains of the rows of a contact and of its states, in columns of its block and of these states."""
    slopes, place = work.slopes, linear.blocks.place
    matrix, weights, states = (
        linear.contact_matrix,
        linear.contact_weights,
        structure.state[k + 1 : k + structure.contact_arms],
    )
    size = 2 * width + states.size
    # (g - A) dz = r_z + B (what the contact sees).
    for i in range(states.size):
        for j in range(states.size):
            matrix[i, j] = (g if i == j else 0.0) - slopes[AT.rate_by_state_1 + j, k + 1 + i]
    _invert(matrix)
    for i in range(states.size):
        state_gain = linear.contact_state_gain[states[i]]
        for column in range(size):
            state_gain[column] = 0.0
        for c in range(weights.size):
            weights[c] = 0.0
            for j in range(states.size):
                weights[c] += matrix[i, j] * slopes[AT.rate_by_gap + c, k + 1 + j]
        _add_inputs(structure, k, linear, width, state_gain)
        for j in range(states.size):
            state_gain[2 * width + j] = matrix[i, j]
    for m in range(structure.contact_arms):
        row = linear.contact_gain[k + m]
        for column in range(size):
            row[column] = 0.0
        for j in range(states.size):
            slope, state_gain = slopes[AT.force_by_state_1 + j, k + m], linear.contact_state_gain[states[j]]
            for column in range(size):
                row[column] += slope * state_gain[column]
        for c in range(weights.size):
            weights[c] = slopes[AT.force_by_gap + c, k + m]
        _add_inputs(structure, k, linear, width, row)
        for e in range(structure.arm_start[k + m], structure.arm_start[k + m + 1]):
            arm, target = linear.arm[e], linear.force[place[structure.arm_at[e]]]
            if arm != 0.0:
                add_contact_gain(structure, linear.blocks, k, arm, row, width, target)


@CompiledFunction
def fill_contact_gains(address: int, g: float) -> int:
    """Fill the gains of a block's closed contacts, and add them to A^T d phi."""
    model = unpack(address, MODEL)
    linear, blocks = model.linear, model.linear.blocks
    b = blocks.current[0]
    width, _ = extent(blocks, b)
    for index in range(blocks.touch_start[b], blocks.touch_start[b + 1]):
        _contact_gains(model.structure, g, blocks.touches[index], model.work, linear, width)
    return 1


@CompiledFunction
def add_pushes(address: int, row: float) -> int:
    """Add to the change of a row's load that of the forces of the closed contacts of its block on its pin."""
    model = unpack(address, MODEL)
    structure, work, linear, pressed = model.structure, model.work, model.linear, int(row)
    paths, pieces, blocks, load = structure.paths, work.paths, linear.blocks, linear.load
    width, _ = extent(blocks, blocks.current[0])
    for index in range(pieces.closed_count[0]):
        e = pieces.closed[index]
        passing = passes(paths, e, structure.joint_pin[pressed])
        if passing == 0.0 or work.rows[ROW.side, paths.row[e]] < 0.0:
            continue
        size = max(work.rows[ROW.load, pressed], 1e-100)
        for m in range(3):
            share = 0.0
            for r in range(3):
                share += passing * work.pull[pressed, r] * pieces.wrench[e, m, 3 + r] / size
            k = paths.row[e] + m
            add_contact_gain(structure, blocks, k, share, linear.contact_gain[k], width, load)
    return 1
