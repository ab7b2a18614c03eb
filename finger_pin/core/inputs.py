"""What comes from outside, compiled: the paper's controller (19)-(22), inputs over time, or inputs that are held."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from finger_pin.core.binding import Indices, Matrix, Vector
from finger_pin.core.compilation import compiled
from finger_pin.core.law_code import inlined
from finger_pin.core.signal import Signal, no_signal, signal_curvatures, signal_derivative, signal_rates, signal_values
from finger_pin.core.trigonometry import sine_cosine
from finger_pin.description.routing import Array
from finger_pin.laws import controller as controller_laws
from finger_pin.laws import palm as palm_laws

HELD, PLANNED, SCHEDULED = range(3)

_proportional_torque = inlined(controller_laws.proportional_torque)
_internal_level = inlined(controller_laws.internal_level)
_base_motion = inlined(palm_laws.base_motion)


class Control(NamedTuple):
    """Inputs of N coordinates and u channels; T planned tensions, those of passive tendons among them.

    Attributes:
        kind: HELD, PLANNED or SCHEDULED.
        tension: What is held, shape (u,); zero for inputs that are planned or scheduled.
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
        force: What varies of the forces at the t tips, 3 t functions or none, N, base frame.
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
    tension: Vector
    gain: Vector
    minimum: Vector
    inverse: Matrix
    internal: Vector
    loop: Indices
    channel: Indices
    reference: Signal
    coupling: Matrix
    offset: Vector
    schedule: Signal
    force: Signal
    damping: Vector
    damped: bool
    guide: Signal
    palm: Signal
    desired: Vector
    rate: Vector
    acceleration: Vector
    planned: Vector
    active: Indices
    level: Vector
    base: Vector
    slope: Vector
    by_position: Matrix
    by_velocity: Matrix
    by_time: Vector


def planned_control(
    channels: int,
    gain: Array,
    minimum: Array,
    inverse: Array,
    internal: Array,
    channel: NDArray[np.int64],
    reference: Signal,
    coupling: Array,
    offset: Array,
    loop: NDArray[np.int64] | None = None,
    damping: Array | None = None,
) -> Control:
    """Return the paper's controller, with damping K_D (theta^d' - theta') if given, or several of them side by side."""
    loops = np.zeros(len(minimum), dtype=np.int64) if loop is None else np.asarray(loop, dtype=np.int64)
    control = _control(
        PLANNED, channels, gain, minimum, inverse, internal, loops, channel, reference, coupling, offset, no_signal()
    )
    if damping is None:
        return control
    return control._replace(damping=np.array(damping, dtype=float), damped=bool(np.any(damping)))


def held_control(channels: int, coordinates: int) -> Control:
    """Return the control that keeps given tensions."""
    return _without_plan(HELD, channels, coordinates, no_signal())


def scheduled_control(schedule: Signal, coordinates: int) -> Control:
    """Return the control that gives inputs over time."""
    return _without_plan(SCHEDULED, len(schedule.harmonics), coordinates, schedule)


def _without_plan(kind: int, channels: int, coordinates: int, schedule: Signal) -> Control:
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
    reference: Signal,
    coupling: Array,
    offset: Array,
    schedule: Signal,
) -> Control:
    coordinates, loops = len(gain), int(loop.max(initial=-1)) + 1
    functions = max(len(reference.harmonics), len(schedule.harmonics))
    return Control(
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


@compiled
def _coupled(control: Any, values: Any, out: Any) -> None:
    """Fill what a derivative of the base signals makes of the desired positions, by the coupling (20)."""
    for j in range(out.size):
        out[j] = 0.0
        for k in range(control.coupling.shape[1]):
            out[j] += control.coupling[j, k] * values[k]


@compiled
def inputs(control: Any, time: float, position: Any, velocity: Any, out: Any) -> None:
    """Fill the inputs: f_hat of (19), (21), (22), or what is scheduled; what is held, beside them or alone."""
    for i in range(out.size):
        out[i] = control.tension[i]
    if control.kind == HELD:
        return
    if control.kind == SCHEDULED:
        signal_values(control.schedule, time, out)
        for i in range(out.size):
            out[i] += control.tension[i]
        return
    signal_values(control.reference, time, control.base)
    desired, planned, base = control.desired, control.planned, control.base
    count = position.size
    for j in range(count):
        wanted = control.offset[j]
        for k in range(control.coupling.shape[1]):
            wanted += control.coupling[j, k] * base[k]
        desired[j] = _proportional_torque(control.gain[j], wanted, position[j])
    if control.damped:
        signal_rates(control.reference, time, control.slope)
        _coupled(control, control.slope, control.rate)
        for j in range(count):
            desired[j] += control.damping[j] * (control.rate[j] - velocity[j])
    for c in range(control.level.size):
        control.level[c] = -np.inf
    for i in range(planned.size):
        value = 0.0
        for j in range(count):
            value += control.inverse[i, j] * desired[j]
        planned[i] = value
        candidate = _internal_level(control.minimum[i], value, control.internal[i])
        c = control.loop[i]
        if candidate > control.level[c]:
            control.level[c] = candidate
            control.active[c] = i
    for i in range(planned.size):
        planned[i] += control.level[control.loop[i]] * control.internal[i]
        if control.channel[i] >= 0:
            out[control.channel[i]] = planned[i]


@compiled
def input_slopes(control: Any, time: float) -> None:
    """Fill du/dq, du/dv and du/dt after `inputs`, for the active minimum of (22)."""
    by_position, by_time = control.by_position, control.by_time
    if control.kind == HELD:
        return
    if control.kind == SCHEDULED:
        signal_rates(control.schedule, time, by_time)
        return
    count = control.gain.size
    signal_rates(control.reference, time, control.base)
    _coupled(control, control.base, control.rate)
    if control.damped:
        signal_curvatures(control.reference, time, control.base)
        _coupled(control, control.base, control.acceleration)
    for i in range(control.planned.size):
        row = control.channel[i]
        if row < 0:
            continue
        active = control.active[control.loop[i]]
        by_time[row] = 0.0
        for j in range(count):
            shared = control.inverse[active, j] / control.internal[active]
            share = control.inverse[i, j] - control.internal[i] * shared
            by_position[row, j] = -control.gain[j] * share
            control.by_velocity[row, j] = -control.damping[j] * share
            by_time[row] += share * (control.gain[j] * control.rate[j] + control.damping[j] * control.acceleration[j])


@compiled
def tip_forces(control: Any, time: float, tables: Any) -> None:
    """Fill the forces at the tips where they vary in time."""
    if control.force.harmonics.shape[0] > 0:
        signal_values(control.force, time, tables.tip_force.reshape(-1))


@compiled
def tip_force_rates(control: Any, time: float, rates: Any) -> None:
    """Fill their time derivatives, shape (t, 3)."""
    if control.force.harmonics.shape[0] > 0:
        signal_rates(control.force, time, rates.reshape(-1))


@compiled
def guide(control: Any, time: float, order: int, out: Any) -> None:
    """Fill a time derivative of the paths along which coordinates are moved; what is given without stays."""
    for j in range(min(out.size, control.guide.harmonics.shape[0])):
        out[j] = signal_derivative(control.guide, j, time, order)


@compiled
def _coordinates(signal: Any, time: float, order: int) -> Any:
    return (
        signal_derivative(signal, 0, time, order),
        signal_derivative(signal, 1, time, order),
        signal_derivative(signal, 2, time, order),
        signal_derivative(signal, 3, time, order),
        signal_derivative(signal, 4, time, order),
        signal_derivative(signal, 5, time, order),
    )


@compiled
def move_base(control: Any, time: float, tables: Any, work: Any) -> None:
    """Fill velocity and acceleration of the base, and their rates, where it moves."""
    if control.palm.harmonics.shape[0] == 0:
        return
    place = _coordinates(control.palm, time, 0)
    turns = sine_cosine(place[3]) + sine_cosine(place[4]) + sine_cosine(place[5])
    found = _base_motion(
        _coordinates(control.palm, time, 1),
        _coordinates(control.palm, time, 2),
        _coordinates(control.palm, time, 3),
        turns,
        (tables.gravity[0], tables.gravity[1], tables.gravity[2]),
    )
    for k in range(6):
        work.base_velocity[k] = found[k]
        work.base_acceleration[k] = found[6 + k]
        work.base_rate[0, k] = found[15 + k]
        work.base_rate[1, k] = found[21 + k]
