"""Inputs from outside as arrays: the paper's controller (19)-(22), inputs over time, or held inputs."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from finger_pin.core.addresses.time_functions import SignalTable, no_signal
from finger_pin.core.jit import Indices, Matrix, Vector
from finger_pin.core.tables.axes import along
from finger_pin.references.signal import Signal
from finger_pin.typing import Array

HELD, PLANNED, SCHEDULED = range(3)


class InputTable(NamedTuple):
    """Inputs of N coordinates and u channels; T planned tensions, those of passive tendons among them.

    Attributes:
        kind: HELD, PLANNED or SCHEDULED.
        tension: Held inputs, shape (u,); zero for those that are planned or scheduled.
        gain: K_P, shape (N,).
        minimum: f0, shape (T,).
        inverse: Pseudo-inverse of H_c^T, shape (T, N).
        internal: f^k, shape (T,).
        loop: The controller that a planned tension belongs to, each with a lambda of its own, shape (T,).
        channel: The channel of a planned tension, -1 for a passive tendon, shape (T,).
        reference: Desired positions before the coupling (20), r functions.
        coupling: Shape (N, r).
        offset: Shape (N,).
        schedule: Inputs over time, u functions.
        force: Varying part of the forces at the t tips, 3 t functions or none, N, base frame.
        damping: K_D, shape (N,).
        damped: Whether it is not zero.
        guide: Paths along which coordinates are moved, or no functions.
        palm: Path of the base: x, y, z, roll, pitch, yaw, or no functions for a base at rest.
        desired, rate, acceleration: Memory, tau^d, then theta^d' and theta^d'', shape (N,).
        planned: Memory, f_hat, shape (T,).
        active: Memory, the tension that sets lambda, by controller.
        level: Memory, lambda, by controller.
        base, slope: Memory, values of a signal.
        by_position, by_velocity: Memory, du/dq and du/dv, shape (u, N).
        by_time: Memory, du/dt, shape (u,).
    """

    kind: int
    tension: Annotated[Vector, along("channel")]
    gain: Annotated[Vector, along("coordinate")]
    minimum: Annotated[Vector, along("planned")]
    inverse: Annotated[Matrix, along("planned", "coordinate")]
    internal: Annotated[Vector, along("planned")]
    loop: Annotated[Indices, along("planned", of="loop")]
    channel: Annotated[Indices, along("planned", of="channel")]
    reference: SignalTable
    coupling: Annotated[Matrix, along("coordinate", "r")]
    offset: Annotated[Vector, along("coordinate")]
    schedule: SignalTable
    force: SignalTable
    damping: Annotated[Vector, along("coordinate")]
    damped: bool
    guide: SignalTable
    palm: SignalTable
    desired: Annotated[Vector, along("coordinate")]
    rate: Annotated[Vector, along("coordinate")]
    acceleration: Annotated[Vector, along("coordinate")]
    planned: Annotated[Vector, along("planned")]
    active: Annotated[Indices, along("loop")]
    level: Annotated[Vector, along("loop")]
    base: Vector
    slope: Vector
    by_position: Annotated[Matrix, along("channel", "coordinate")]
    by_velocity: Annotated[Matrix, along("channel", "coordinate")]
    by_time: Annotated[Vector, along("channel")]


def planned_control(
    channels: int,
    gain: Array,
    minimum: Array,
    inverse: Array,
    internal: Array,
    channel: NDArray[np.int64],
    reference: SignalTable,
    coupling: Array,
    offset: Array,
    loop: NDArray[np.int64] | None = None,
    damping: Array | None = None,
) -> InputTable:
    """Return the paper's controller, with damping K_D (theta^d' - theta') if given, or several of them side by side."""
    loops = np.zeros(len(minimum), dtype=np.int64) if loop is None else np.asarray(loop, dtype=np.int64)
    control = _control(
        PLANNED, channels, gain, minimum, inverse, internal, loops, channel, reference, coupling, offset, no_signal()
    )
    if damping is None:
        return control
    return control._replace(damping=np.array(damping, dtype=float), damped=bool(np.any(damping)))


def held_control(channels: int, coordinates: int) -> InputTable:
    """Return the control that keeps given tensions."""
    return _without_plan(HELD, channels, coordinates, no_signal())


def scheduled_control(schedule: SignalTable, coordinates: int) -> InputTable:
    """Return the control that gives inputs over time."""
    return _without_plan(SCHEDULED, len(schedule.harmonics), coordinates, schedule)


def _without_plan(kind: int, channels: int, coordinates: int, schedule: SignalTable) -> InputTable:
    nothing, none = np.zeros(0), np.zeros(0, dtype=np.int64)
    return _control(
        kind,
        channels,
        np.zeros(coordinates),
        nothing,
        np.zeros((0, coordinates)),
        nothing,
        none,
        none,
        no_signal(),
        np.zeros((coordinates, 0)),
        np.zeros(coordinates),
        schedule,
    )


def _control(
    kind: int,
    channels: int,
    gain: Array,
    minimum: Array,
    inverse: Array,
    internal: Array,
    loop: NDArray[np.int64],
    channel: NDArray[np.int64],
    reference: SignalTable,
    coupling: Array,
    offset: Array,
    schedule: SignalTable,
) -> InputTable:
    coordinates, loops = len(gain), int(loop.max(initial=-1)) + 1
    functions = max(len(reference.harmonics), len(schedule.harmonics))
    return InputTable(
        kind=kind,
        tension=np.zeros(channels),
        gain=np.array(gain, dtype=float),
        minimum=np.array(minimum, dtype=float),
        inverse=np.ascontiguousarray(inverse, dtype=float),
        internal=np.array(internal, dtype=float),
        loop=np.array(loop, dtype=np.int64),
        channel=np.array(channel, dtype=np.int64),
        reference=reference,
        coupling=np.ascontiguousarray(coupling, dtype=float),
        offset=np.array(offset, dtype=float),
        schedule=schedule,
        force=no_signal(),
        damping=np.zeros(coordinates),
        damped=False,
        guide=no_signal(),
        palm=no_signal(),
        desired=np.zeros(coordinates),
        rate=np.zeros(coordinates),
        acceleration=np.zeros(coordinates),
        planned=np.zeros(len(minimum)),
        active=np.zeros(loops, dtype=np.int64),
        level=np.zeros(loops),
        base=np.zeros(functions),
        slope=np.zeros(functions),
        by_position=np.zeros((channels, coordinates)),
        by_velocity=np.zeros((channels, coordinates)),
        by_time=np.zeros(channels),
    )


def core_signal(signal: Signal) -> SignalTable:
    """Return a signal as arrays of the core's own; polynomials that are zero are left out."""
    harmonics = np.array(signal.harmonics, dtype=float)
    if signal.is_harmonic:
        return SignalTable(harmonics, np.zeros(0), np.zeros((6, 0, len(harmonics))))
    return SignalTable(harmonics, signal.knots.copy(), signal.coefficients.copy())
