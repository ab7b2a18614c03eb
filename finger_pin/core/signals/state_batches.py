"""Batched evaluation of states, compiled."""

from __future__ import annotations

from typing import NamedTuple

from finger_pin.core.addresses.law_code import ROW
from finger_pin.core.collision.broad_phase import activate_all_pairs, activate_since, cull_distant
from finger_pin.core.evaluation.attitude_charts import place_bodies
from finger_pin.core.evaluation.paths import turn_out
from finger_pin.core.evaluation.rigid_body_dynamics import move
from finger_pin.core.jit import (
    CompiledFunction,
    Layers,
    Matrix,
    StructType,
    Vector,
    call_at,
    call_filling,
    copy,
    njit_always_inline,
    njit_inline,
    unpack,
)
from finger_pin.core.tables.buffers import Work
from finger_pin.core.tables.chains import BODY
from finger_pin.core.tables.mechanism_parameters import Parameters
from finger_pin.core.tables.model import MODEL, Model
from finger_pin.core.tables.structure import Structure
from finger_pin.mechanism.gaps.signed_distance import GAP_OUT


class States(NamedTuple):
    """States of one island under given inputs, and buffers for their signals.

    Attributes:
        model: Address of a bound `Model`.
        states: Shape (m, size).
        commands: Shape (m, u).
        forces: At the tips, shape (m, t, 3).
        rates: Filled with the rates, shape (m, size), or (0, size) where they are not wanted.
        rows: Filled with the table of rows from the first place on, shape (columns, first + m or more, K), or
            (columns, 0, K) if only J^T F, energies and powers are wanted.
        first: Where in it the first state stands.
        column: The first column of the table that is wanted.
        torques: Filled with the sum of A^T phi, shape (m, N), or (0, N) if only rows are wanted.
        tendons: 1 for the rows of tendons, 0 for all others, shape (K,).
        tendon_torques: Filled with the sum of A^T phi over tendons, shape (m, N), or (0, N).
        externals: Filled with J^T F, as ``torques``.
        energy_terms: Filled with energies and powers, shape (m, energies) or (0, energies); the last is that of a base
            that moves.
        bases: Velocity, acceleration and gravity of the base, and accelerations of what is moved along paths, shape
            (m, 15 + g), or (0, 15 + g) at rest.
        attitudes: Quaternions of free bodies, shape (m, f, 4).
        touches: Filled with what contacts do in space, forces, points and normals, shape (m, contacts, 9), or
            (0, contacts, 9).
    """

    model: int
    states: Matrix
    commands: Matrix
    forces: Layers
    rates: Matrix
    rows: Layers
    first: int
    column: int
    torques: Matrix
    tendons: Vector
    tendon_torques: Matrix
    externals: Matrix
    energy_terms: Matrix
    bases: Matrix
    attitudes: Layers
    touches: Layers


class Motions(NamedTuple):
    """Many positions and velocities of the bodies, and their signals to be filled.

    With a base that moves energies are those of the motion in the world, where the base has no height.

    Attributes:
        model: Address of a bound `Model`.
        positions: Shape (m, n).
        velocities: Shape (m, n).
        tips: Filled with the positions of the tips, shape (m, t, 3).
        kinetic: Filled with energies, shape (m,).
        potential: Likewise.
        bases: As of `States`.
    """

    model: int
    positions: Matrix
    velocities: Matrix
    tips: Layers
    kinetic: Vector
    potential: Vector
    bases: Matrix


STATES, MOTIONS = StructType(States), StructType(Motions)


@njit_inline
def fill_energy_terms(structure: Structure, parameters: Parameters, work: Work, totals: Vector) -> None:
    """Sum up stored energies and powers of all rows after an evaluation."""
    for c in range(totals.size):
        totals[c] = 0.0
    for g in range(structure.groups.first.size):
        begin, end = structure.groups.first[g], structure.groups.end[g]
        if begin < structure.contact_rows:
            for index in range(work.paths.active_pair_count[0]):
                k = structure.paths.row[work.paths.active_pairs[index]]
                if begin <= k < end:
                    call_filling(
                        structure.groups.account[g],
                        work.rows,
                        parameters.laws,
                        work.powers,
                        k,
                        k + structure.contact_arms,
                    )
                    for i in range(structure.energies.shape[1]):
                        if structure.energies[g, i] >= 0:
                            totals[structure.energies[g, i]] += work.powers[i, k]
            continue
        call_filling(structure.groups.account[g], work.rows, parameters.laws, work.powers, begin, end)
        for i in range(structure.energies.shape[1]):
            entry = structure.energies[g, i]
            if entry >= 0:
                total = totals[entry]
                for k in range(begin, end):
                    total += work.powers[i, k]
                totals[entry] = total


@njit_always_inline
def _fill_contact_points(structure: Structure, work: Work, out: Matrix) -> None:
    """Fill the forces of contacts on the second body, the points, and the normals; zero for open ones."""
    paths, pieces = structure.paths, work.paths
    for index in range(pieces.closed_count[0]):
        e = pieces.closed[index]
        k = paths.row[e]
        if work.rows[ROW.force, k] == 0.0:
            continue
        # Contacts come before all other rows.
        touch = out[k // structure.contact_arms]
        turn_out(pieces.frame[e], pieces.out[e], GAP_OUT.point, touch[3:6])
        for r in range(3):
            touch[3 + r] += pieces.origin[e, r]
            touch[6 + r] = pieces.wrench[e, 0, 3 + r]
            for i in range(3):
                touch[r] -= work.rows[ROW.force, k + i] * pieces.wrench[e, i, 3 + r]


@njit_always_inline
def _set_state(many: States, model: Model, m: int) -> None:
    """Set inputs, forces at the tips and state to the m-th."""
    for i in range(many.commands.shape[1]):
        model.control.tension[i] = many.commands[m, i]
    for t in range(many.forces.shape[1]):
        for r in range(3):
            model.parameters.tip_force[t, r] = many.forces[m, t, r]
    copy(many.states[m], model.state)


@njit_always_inline
def _evaluate(many: States, model: Model, m: int) -> None:
    """Evaluate the state that is set."""
    if many.rates.shape[0] > 0 or many.bases.shape[0] > 0:
        call_at(model.evaluate, many.model, 0.0)
    else:
        copy(many.commands[m], model.work.command)
        exert_alone(model, many.model, 0.0)


@njit_inline
def exert_alone(model: Model, address: int, time: float) -> None:
    """Fill the rows' forces and rates under known inputs, without accelerations."""
    structure, parameters, width = model.structure, model.parameters, model.work.torque.size
    # Only some rows need to know where bodies are.
    if parameters.has_tip_force or structure.paths.columns.size > 0:
        move(structure, parameters, model.state[:width], model.state[width : 2 * width], model.work)
    call_at(model.exert, address, time)


@njit_always_inline
def _store_signals(many: States, model: Model, m: int) -> None:
    """Fill the m-th place with the latest evaluation."""
    structure, parameters, work, rates, rows = model.structure, model.parameters, model.work, many.rates, many.rows
    if rates.shape[0] > 0:
        for c in range(many.states.shape[1]):
            rates[m, c] = model.rate[c]
    if rows.shape[1] > 0:
        for c in range(rows.shape[0]):
            for k in range(rows.shape[2]):
                rows[c, many.first + m, k] = work.rows[many.column + c, k]
    if many.tendon_torques.shape[0] > 0:
        torque = many.tendon_torques[m]
        for j in range(torque.size):
            torque[j] = 0.0
        for a in range(structure.arm_row.size):
            k = structure.arm_row[a]
            if many.tendons[k] != 0.0:
                torque[structure.arm_at[a]] += work.arm[a] * work.rows[ROW.force, k]
    if many.touches.shape[0] > 0 and structure.contact_rows:
        _fill_contact_points(structure, work, many.touches[m])
    if many.energy_terms.shape[0] > 0:
        for j in range(many.torques.shape[1]):
            many.torques[m, j] = work.torque[j]
            many.externals[m, j] = work.external[j]
        fill_energy_terms(structure, parameters, work, many.energy_terms[m])
        fill_base_power(model, many.model, many.bases.shape[0] > 0, many.energy_terms[m])


@njit_inline
def fill_base_power(model: Model, address: int, moving: bool, totals: Vector) -> None:
    """Record the power of a moving base or of prescribed coordinates after an evaluation."""
    work, width, last = model.work, model.work.torque.size, totals.size - 1
    if model.base_power != 0 and moving:
        call_at(model.base_power, address, 0.0)
        totals[last] = work.base_power[0]
    if work.guide.size > 0:
        for j in range(width):
            if model.structure.prescribed[j] >= 0:
                totals[last] -= work.torque[j] * model.state[width + j]


@CompiledFunction
def evaluate_many(address: int, _time: float) -> int:
    """Evaluate the `States` at an address."""
    many = unpack(address, STATES)
    model = unpack(many.model, MODEL)
    structure, parameters, work, before = model.structure, model.parameters, model.work, model.rate
    # Signals have the gaps of all contacts; for powers alone those far apart are culled from state to state.
    culling = structure.contact_rows > 0 and many.rows.shape[1] == 0 and many.bases.shape[0] == 0
    activate_all_pairs(structure, work)
    for m in range(many.states.shape[0]):
        _set_state(many, model, m)
        if culling and m > 0:
            activate_since(structure, parameters, work, many.attitudes[m - 1], many.attitudes[m], before, model.state)
        _set_base(many.bases, m, parameters, work)
        place_bodies(structure, parameters, many.attitudes[m])
        _evaluate(many, model, m)
        _store_signals(many, model, m)
        if culling:
            cull_distant(structure, parameters, work, model.state, before)
    return 1


@njit_inline
def _set_base(bases: Matrix, m: int, parameters: Parameters, work: Work) -> None:
    """Set the motion of the base to the m-th, or to rest."""
    for k in range(6):
        moved = bases.shape[0] > 0
        work.base_velocity[k] = bases[m, k] if moved else 0.0
        rest = -parameters.gravity[k - 3] if k >= 3 else 0.0
        work.base_acceleration[k] = bases[m, 6 + k] if moved else rest
    for i in range(work.guide.size):
        work.guide[i] = bases[m, 15 + i] if bases.shape[0] > 0 else 0.0


@CompiledFunction
def motion_many(address: int, _time: float) -> int:
    """Fill the `Motions` at an address."""
    many = unpack(address, MOTIONS)
    positions, velocities, tips, bases = many.positions, many.velocities, many.tips, many.bases
    model = unpack(many.model, MODEL)
    structure, parameters, work = model.structure, model.parameters, model.work
    for m in range(positions.shape[0]):
        _set_base(bases, m, parameters, work)
        move(structure, parameters, positions[m], velocities[m], work)
        for t in range(tips.shape[1]):
            body = structure.tip_body[t]
            for r in range(3):
                value = parameters.tip_offset[t, r]
                if body >= 0:
                    value = work.origin[body, r]
                    for c in range(3):
                        value += work.rotation[body, r, c] * parameters.tip_offset[t, c]
                tips[m, t, r] = value
        moving, lifted = 0.0, 0.0
        for i in range(structure.parents.size):
            inertia, v = work.inertia[i], work.spatial.motion[i]
            # v . I v, with I = (mass, first moment, second moment about O).
            moving += inertia[0] * (v[3] * v[3] + v[4] * v[4] + v[5] * v[5])
            moving += inertia[4] * v[0] * v[0] + inertia[7] * v[1] * v[1] + inertia[9] * v[2] * v[2]
            moving += 2.0 * (inertia[5] * v[0] * v[1] + inertia[6] * v[0] * v[2] + inertia[8] * v[1] * v[2])
            moving += 2.0 * v[3] * (v[1] * inertia[3] - v[2] * inertia[2])
            moving += 2.0 * v[4] * (v[2] * inertia[1] - v[0] * inertia[3])
            moving += 2.0 * v[5] * (v[0] * inertia[2] - v[1] * inertia[1])
            moving += parameters.bodies[i, BODY.armature] * velocities[m, i] * velocities[m, i]
            for r in range(3):
                weight = bases[m, 12 + r] if bases.shape[0] > 0 else parameters.gravity[r]
                lifted -= weight * inertia[1 + r]
        many.kinetic[m] = 0.5 * moving
        many.potential[m] = lifted
    return 1
