"""Buffers of the compiled core: the memory that it works in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from finger_pin.core.addresses.law_code import SLOPE_COLUMNS, column_counts
from finger_pin.core.jit import Layers, Matrix, Vector
from finger_pin.core.tables.path_tables import PathWork, build_path_work
from finger_pin.core.tables.structure import Structure
from finger_pin.laws.law import ContactLaw, Law


class SpatialVectors(NamedTuple):
    """Motion and force vectors of the n bodies, base frame about its origin, shape (n, 6) each.

    Attributes:
        axis: S, of the joint.
        axis_rate: v x S, with the velocity v of the body that carries it.
        axis_curve: a x S + v x (v x S), with its acceleration a, less gravity.
        motion: Velocity.
        acceleration: Likewise, less gravity.
        force: What the joint transmits.
        momentum: Of the body and all that it carries.
    """

    axis: Matrix
    axis_rate: Matrix
    axis_curve: Matrix
    motion: Matrix
    acceleration: Matrix
    force: Matrix
    momentum: Matrix


class Work(NamedTuple):
    """Memory of one evaluation and its linearisation; never holds anything between calls.

    Attributes:
        base_velocity, base_acceleration: Of the base, less gravity, in its own axes, shape (6,).
        base_rate: Their rates, shape (2, 6).
        base_power: Power of the base, shape (1,), W.
        mass_matrix, mass_factor: M, its lower half, and the factors of `factorise_mass`, shape (n, n).
        by_position, by_velocity: Derivatives of inverse dynamics, shape (n, n).
        rows: Arguments and results of the rows' laws, shape (columns, K); columns `ROW`.
        slopes: Derivatives of the laws, shape (columns, K); columns `SLOPE`, of contacts `TOUCH_SLOPE`.
        powers: Stored energy and powers of the rows, shape (1 + powers, K).
        arm: As in the parameters, shape (arms,), with what paths through space add.
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
    spatial: SpatialVectors
    inertia: Matrix
    composite: Matrix
    coriolis: Matrix
    vectors: Matrix
    mass_matrix: Matrix
    mass_factor: Matrix
    by_position: Matrix
    by_velocity: Matrix
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


def build_work(structure: Structure, laws: Sequence[Law | ContactLaw], channels: int) -> Work:
    """Allocate the memory for a structure whose rows follow some laws."""
    size, count, width = len(structure.parents), len(structure.state), len(structure.prescribed)
    tips = len(structure.tip_body)
    columns, powers = column_counts(laws)
    return Work(
        rotation=np.zeros((size, 3, 3)),
        origin=np.zeros((size, 3)),
        centre=np.zeros(3),
        base_velocity=np.zeros(6),
        base_power=np.zeros(1),
        base_acceleration=np.zeros(6),
        base_rate=np.zeros((2, 6)),
        spatial=SpatialVectors(*np.zeros((len(SpatialVectors._fields), size, 6))),
        inertia=np.zeros((size, 10)),
        composite=np.zeros((size, 10)),
        coriolis=np.zeros((size, 12)),
        vectors=np.zeros((2, 6)),
        mass_matrix=np.zeros((size, size)),
        mass_factor=np.zeros((size, size)),
        by_position=np.zeros((size, size)),
        by_velocity=np.zeros((size, size)),
        rows=np.zeros((columns, count)),
        slopes=np.zeros((SLOPE_COLUMNS, count)),
        powers=np.zeros((powers, count)),
        arm=np.zeros(len(structure.arm_at)),
        gradient=np.zeros(len(structure.arm_at)),
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
        guide=np.zeros(int(structure.prescribed.max(initial=-1)) + 1),
        guide_rate=np.zeros(int(structure.prescribed.max(initial=-1)) + 1),
        paths=build_path_work(structure.paths, count, width, 2 * width + len(structure.state_row)),
    )
