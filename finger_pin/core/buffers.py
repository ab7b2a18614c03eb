"""Buffers of the compiled core: the memory that it works in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from finger_pin.core.evaluation.law_code import SLOPES, widest
from finger_pin.core.inputs import InputTable
from finger_pin.core.islands import find_islands
from finger_pin.core.jit import Indices, Layers, Matrix, Vector
from finger_pin.core.path_tables import COLUMNS, PathWork, build_path_work
from finger_pin.core.tables import Tables
from finger_pin.core.threads import physical_memory
from finger_pin.exceptions import InputError
from finger_pin.laws.law import ContactLaw, Law

# Layers of work.spatial, one motion or force vector per body, and of work.square.
AXIS, AXIS_RATE, AXIS_CURVE, MOTION, SPATIAL_ACCELERATION, FORCE, MOMENTUM, SPATIAL_LAYERS = range(8)
MASS_MATRIX, CHOLESKY, BY_POSITION, BY_VELOCITY, SQUARE_LAYERS = range(5)


class Work(NamedTuple):
    """Memory of one evaluation and its linearisation; never holds anything between calls.

    Attributes:
        base_velocity, base_acceleration: Of the base, less gravity, in its own axes, shape (6,).
        base_rate: Their rates, shape (2, 6).
        base_power: Power of the base, shape (1,), W.
        rows: Arguments and results of the rows' laws, shape (columns, K); columns named in `law_code`.
        slopes: Derivatives of the laws, shape (SLOPES, K).
        powers: Stored energy and powers of the rows, shape (1 + powers, K).
        arm: As in the tables, shape (arms,), with what paths through space add.
        gradient: dl/dq there, with what they add, shape (arms,).
        pull: Total force on the pin of each row, shape (K, 3), N.
        lever: The pin's link direction, shape (K, 3).
        tip: Positions of the tips, shape (t, 3), m.
        jacobian: Of the tips, shape (t, 3, N).
        force_rate: Time derivatives of the forces at the tips, shape (t, 3), N/s.
        torque, external, bias, acceleration: Shape (N,).
        command: Inputs, shape (u,).
        guide, guide_rate: Accelerations of what is moved along paths, and their rates, shape (g,).
    """

    rotation: Layers
    origin: Matrix
    centre: Vector
    base_velocity: Vector
    base_acceleration: Vector
    base_rate: Matrix
    base_power: Vector
    spatial: Layers
    inertia: Matrix
    composite: Matrix
    coriolis: Matrix
    vectors: Matrix
    square: Layers
    rows: Matrix
    slopes: Matrix
    powers: Matrix
    arm: Vector
    gradient: Vector
    pull: Matrix
    lever: Matrix
    tip: Matrix
    jacobian: Layers
    force_rate: Matrix
    torque: Vector
    external: Vector
    bias: Vector
    acceleration: Vector
    command: Vector
    guide: Vector
    guide_rate: Vector
    paths: PathWork


def build_work(tables: Tables, laws: Sequence[Law | ContactLaw], channels: int) -> Work:
    """Allocate the memory for tables whose rows follow some laws."""
    size, count, width, tips = len(tables.parents), len(tables.state), len(tables.prescribed), len(tables.tip_body)
    columns, powers = widest(laws)
    work = Work(
        rotation=np.zeros((size, 3, 3)),
        origin=np.zeros((size, 3)),
        centre=np.zeros(3),
        base_velocity=np.zeros(6),
        base_power=np.zeros(1),
        base_acceleration=np.zeros(6),
        base_rate=np.zeros((2, 6)),
        spatial=np.zeros((SPATIAL_LAYERS, size, 6)),
        inertia=np.zeros((size, 10)),
        composite=np.zeros((size, 10)),
        coriolis=np.zeros((size, 12)),
        vectors=np.zeros((2, 6)),
        square=np.zeros((SQUARE_LAYERS, size, size)),
        rows=np.zeros((columns, count)),
        slopes=np.zeros((SLOPES, count)),
        powers=np.zeros((powers, count)),
        arm=np.zeros(len(tables.arm)),
        gradient=np.zeros(len(tables.arm)),
        pull=np.zeros((count, 3)),
        lever=np.zeros((count, 3)),
        tip=np.zeros((tips, 3)),
        jacobian=np.zeros((tips, 3, width)),
        force_rate=np.zeros((tips, 3)),
        torque=np.zeros(width),
        external=np.zeros(width),
        bias=np.zeros(width),
        acceleration=np.zeros(width),
        command=np.zeros(channels),
        guide=np.zeros(int(tables.prescribed.max(initial=-1)) + 1),
        guide_rate=np.zeros(int(tables.prescribed.max(initial=-1)) + 1),
        paths=build_path_work(tables.paths, count, width),
    )
    # No path and no moving body changes these.
    work.base_acceleration[3:] = -tables.gravity
    work.arm[:], work.gradient[:] = tables.arm, tables.measure
    work.paths.frame[:], work.paths.origin[:] = tables.paths.rotation, tables.paths.origin
    return work


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


def build_blocks(tables: Tables, control: InputTable) -> Blocks:
    """Return the blocks of tables while nothing touches."""
    count, width, states = len(tables.state), len(tables.prescribed), len(tables.state_row)
    atom, row_atom, atoms = np.zeros(width, dtype=np.int64), np.zeros(count, dtype=np.int64), 1
    if tables.contact_rows:
        islands = find_islands(tables, control, False)
        atoms = len(islands)
        for index, island in enumerate(islands):
            atom[island.coordinates], row_atom[island.rows] = index, index
        row_atom[tables.touch > 0] = -1

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
        touches=room(tables.contact_rows // COLUMNS),
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
    """Partial derivatives at one state, and the solution of (g - J) u = r; K rows, N coordinates, Z states.

    Columns of what is wide are (r of positions, N | r of velocities, N | r of states, Z | h d_i of a stage, 1) of one
    block; before the reduced system is solved, velocities stand in place of their r. Of what blocks have in common
    the rows are those of the whole.

    Attributes:
        mass: M with the lumps, shape (N, N).
        by_position: d(M a + h - J^T F)/dq at the actual acceleration, shape (N, N).
        by_velocity: dh/dv, shape (N, N).
        bias_rate: dh/dt by the motion of the base, shape (N,).
        arm: dl'/dv, shape (arms,).
        measure: dl/dq, shape (arms,).
        turning: dl'/dq at constant v, shape (arms,).
        bend: d(curvature)/dq, as in the tables, shape (bends,).
        load_slope: dN/dS, S the sum of earlier forces, shape (K,).
        load_by_position: dN/dq at constant S, shape (K, N).
        load_by_time: dN/dt at constant S, shape (K,).
        gain: d phi, shape (K, wide).
        state_gain: d z, shape (Z, wide).
        load, command: Of one row, shape (wide,).
        force: Sum of A^T d phi of a block, shape (N, wide).
        reduced: Of a block, shape (N, N), factorised in place.
        pivots: Row exchanges, shape (N,).
        velocity: The solution's velocities of a block, shape (N, wide).
        solution: The solution u, shape (2 N + Z, wide).
        loose: Of the states of open contacts, u / r, shape (Z,).
        right: The right-hand side of a block, shape (wide,).
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
    gain: Matrix
    state_gain: Matrix
    load: Vector
    command: Vector
    force: Matrix
    reduced: Matrix
    pivots: Indices
    velocity: Matrix
    solution: Matrix
    loose: Vector
    right: Vector
    blocks: Blocks


def build_linear(tables: Tables, control: InputTable) -> Linear:
    """Allocate the linearisation of tables.

    Raises:
        InputError: If so many bodies can touch that it cannot fit into the machine's memory.
    """
    count, width, states = len(tables.state), len(tables.prescribed), len(tables.state_row)
    wide = 2 * width + states + 1
    if (needed := 8.0 * wide * max(count, wide)) > (present := physical_memory()):
        pairs, most = tables.contact_rows // COLUMNS, present / 2**30
        allowed = f"{pairs} pairs of bodies can touch, which needs {needed / 2**30:.3g} GiB of memory, of {most:.3g}"
        raise InputError("contacts", f"{allowed}; let fewer bodies touch")
    linear = Linear(
        mass=np.zeros((width, width)),
        by_position=np.zeros((width, width)),
        by_velocity=np.zeros((width, width)),
        bias_rate=np.zeros(width),
        arm=np.zeros(len(tables.arm)),
        measure=np.zeros(len(tables.arm)),
        turning=np.zeros(len(tables.arm)),
        bend=np.zeros(len(tables.bend)),
        load_slope=np.zeros(count),
        load_by_position=np.zeros((count, width)),
        load_by_time=np.zeros(count),
        gain=np.zeros((count, wide)),
        state_gain=np.zeros((states, wide)),
        load=np.zeros(wide),
        command=np.zeros(wide),
        force=np.zeros((width, wide)),
        reduced=np.zeros((width, width)),
        pivots=np.zeros(width, dtype=np.int64),
        velocity=np.zeros((width, wide)),
        solution=np.zeros((wide - 1, wide)),
        loose=np.zeros(states),
        right=np.zeros(wide),
        blocks=build_blocks(tables, control),
    )
    # No posture changes these.
    lumped = np.arange(len(tables.parents), width)
    linear.mass[lumped, lumped] = tables.lumps
    linear.arm[:], linear.measure[:], linear.bend[:] = tables.arm, tables.measure, tables.bend
    return linear
