"""Memory of the linear systems that an implicit method solves, and the blocks that they fall into."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from finger_pin.core.jit import Indices, Matrix, Vector
from finger_pin.core.tables.inputs import InputTable
from finger_pin.core.tables.islands import find_islands
from finger_pin.core.tables.structure import Structure
from finger_pin.exceptions import InputError
from finger_pin.threads import physical_memory


class Blocks(NamedTuple):
    """Atoms, and the blocks to which contacts join them; N coordinates, K rows, Z states, A atoms.

    Members of all blocks stand in a row, one block after the other; ``*_start`` has where each begins.

    Attributes:
        atom: Of every coordinate, shape (N,).
        row_atom: Of every row, shape (K,); -1 for contacts.
        label: Block of every atom, shape (A,).
        number: Number of blocks, shape (1,).
        coordinate_start, coordinates: Shapes (A + 1,) and (N,).
        row_start, rows: Of all rows but those of contacts, shapes (A + 1,) and (K,).
        touch_start, touches: First rows of closed contacts, shapes (A + 1,) and (contacts,).
        state_start, states: Shapes (A + 1,) and (Z,).
        place: Of every coordinate in its block, shape (N,).
        state_place: Of every state in its block, shape (Z,).
        loose: For the states of contacts that are open, -dz'/dz, shape (Z,); zero for all others.
        active_states, active_state_count: States of active contact pairs, shape (Z,), and how many, shape (1,).
        current: The block that is being condensed, shape (1,).
    """

    atom: Indices
    row_atom: Indices
    label: Indices
    number: Indices
    coordinate_start: Indices
    coordinates: Indices
    row_start: Indices
    rows: Indices
    touch_start: Indices
    touches: Indices
    state_start: Indices
    states: Indices
    place: Indices
    state_place: Indices
    loose: Vector
    active_states: Indices
    active_state_count: Indices
    current: Indices


def build_blocks(structure: Structure, control: InputTable) -> Blocks:
    """Return the blocks of a structure while nothing touches."""
    count, width, states = len(structure.state), len(structure.prescribed), len(structure.state_row)
    atom, row_atom, atoms = np.zeros(width, dtype=np.int64), np.zeros(count, dtype=np.int64), 1
    if structure.contact_rows:
        islands = find_islands(structure, control, False)
        atoms = len(islands)
        for index, island in enumerate(islands):
            atom[island.coordinates], row_atom[island.rows] = index, index
        row_atom[structure.touch > 0] = -1

    def room(size: int) -> NDArray[np.int64]:
        return np.zeros(size, dtype=np.int64)

    return Blocks(
        atom=atom,
        row_atom=row_atom,
        label=room(atoms),
        number=np.ones(1, dtype=np.int64),
        coordinate_start=np.array([0, *[width] * atoms]),
        coordinates=np.arange(width),
        row_start=np.array([0, *[count] * atoms]),
        rows=np.arange(count),
        touch_start=room(atoms + 1),
        touches=room(structure.contact_rows // structure.contact_arms),
        state_start=np.array([0, *[states] * atoms]),
        states=np.arange(states),
        place=np.arange(width),
        state_place=np.arange(states),
        loose=np.zeros(states),
        active_states=room(states),
        active_state_count=room(1),
        current=room(1),
    )


class Linear(NamedTuple):
    """Partial derivatives at one state, and the factors of g - J; K rows, N coordinates, Z states.

    Columns of what is wide are (r of positions, N | r of velocities, N | r of states, Z | h d_i of a stage, 1) of one
    block; in gains, changes of positions and velocities stand in place of their r. What is full has a column more for
    the change of every state that any row reads, R. Of what blocks have in common the rows are those of the whole.

    Attributes:
        mass: M with the lumps, shape (N, N).
        by_position: d(M a + h - J^T F)/dq at the actual acceleration, shape (N, N).
        by_velocity: dh/dv, shape (N, N).
        bias_rate: dh/dt by the motion of the base, shape (N,).
        arm: dl'/dv, shape (arms,).
        measure: dl/dq, shape (arms,).
        turning: dl'/dq at constant v, shape (arms,).
        bend: d(curvature)/dq, shape (bends,).
        load_slope: dN/dS, S the sum of earlier forces, shape (K,).
        load_by_position: dN/dq at constant S, shape (K, N).
        load_by_time: dN/dt at constant S, shape (K,).
        contact_matrix: g - A of the states of a contact, inverted in place, shape (contact arms - 1,) twice.
        contact_weights: Slopes of one of its rows or states by gap, speed and slips, shape (contact arms + 1,).
        contact_gain: d phi of contacts, in columns (r of positions, N | of velocities, N | of the contact's own
            states), shape (contact rows, 2 N + slips).
        contact_state_gain: d z of their states, shape (contact states, 2 N + slips).
        gain: d phi of all other rows, shape (K less contact rows, full).
        state_gain: d z of their states, shape (Z less contact states, full).
        load, command: Of one row, shape (full,).
        force: Sum of A^T d phi of a block, shape (N, full).
        read_gain: d z of the states that are read, shape (wide, R).
        read_matrix: What they change of each other, shape (R, R), factorised in place.
        read_pivots: Row exchanges, shape (R,).
        reduced: Systems of the blocks' velocities, one after the other, shape (N, N), factorised in place.
        pivots: Row exchanges, shape (N,).
        velocity: Their right-hand sides, shape (N, wide).
        inverse_shift: 1 / g, shape (1,).
        change: Of the velocities of a block, shape (N,).
        loose: Of the states of open contacts, u / r, shape (Z,).
        right: The right-hand side of a block, and then the changes of its positions and velocities, shape (wide,).
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
    contact_matrix: Matrix
    contact_weights: Vector
    contact_gain: Matrix
    contact_state_gain: Matrix
    gain: Matrix
    state_gain: Matrix
    load: Vector
    command: Vector
    force: Matrix
    read_gain: Matrix
    read_matrix: Matrix
    read_pivots: Indices
    reduced: Matrix
    pivots: Indices
    velocity: Matrix
    inverse_shift: Vector
    change: Vector
    loose: Vector
    right: Vector
    blocks: Blocks


def build_linear(structure: Structure, control: InputTable) -> Linear:
    """Allocate the linearisation of a structure."""
    count, width, states = len(structure.state), len(structure.prescribed), len(structure.state_row)
    wide, reads, touching = 2 * width + states + 1, len(structure.read_states), structure.contact_rows
    full, slips = wide + reads, touching - touching // structure.contact_arms
    own = (touching + slips) * (2 * width + structure.contact_arms - 1)
    needed = 8.0 * (full * (count + states - touching - slips + 2 * width) + own)
    if needed > (present := physical_memory()):
        parts, most = structure.contact_rows // structure.contact_arms, present / 2**30
        allowed = f"{parts} parts of bodies can touch, which needs {needed / 2**30:.3g} GiB of memory, of {most:.3g}"
        raise InputError("contacts", f"{allowed}; let fewer bodies touch")
    return Linear(
        mass=np.zeros((width, width)),
        by_position=np.zeros((width, width)),
        by_velocity=np.zeros((width, width)),
        bias_rate=np.zeros(width),
        arm=np.zeros(len(structure.arm_at)),
        measure=np.zeros(len(structure.arm_at)),
        turning=np.zeros(len(structure.arm_at)),
        bend=np.zeros(len(structure.bend_at)),
        load_slope=np.zeros(count),
        load_by_position=np.zeros((count, width)),
        load_by_time=np.zeros(count),
        contact_matrix=np.zeros((structure.contact_arms - 1,) * 2),
        contact_weights=np.zeros(structure.contact_arms + 1),
        contact_gain=np.zeros((touching, 2 * width + structure.contact_arms - 1)),
        contact_state_gain=np.zeros((slips, 2 * width + structure.contact_arms - 1)),
        gain=np.zeros((count - touching, full)),
        state_gain=np.zeros((states - slips, full)),
        load=np.zeros(full),
        command=np.zeros(full),
        force=np.zeros((width, full)),
        read_gain=np.zeros((wide, reads)),
        read_matrix=np.zeros((reads, reads)),
        read_pivots=np.zeros(reads, dtype=np.int64),
        reduced=np.zeros((width, width)),
        pivots=np.zeros(width, dtype=np.int64),
        velocity=np.zeros((width, wide)),
        inverse_shift=np.zeros(1),
        change=np.zeros(width),
        loose=np.zeros(states),
        right=np.zeros(wide),
        blocks=build_blocks(structure, control),
    )
