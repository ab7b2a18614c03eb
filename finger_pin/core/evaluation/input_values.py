"""Inputs from outside, compiled: values of a `InputTable`, and their slopes."""

from __future__ import annotations

import numpy as np

from finger_pin.core.addresses.time_functions import signal_derivative, signal_derivatives, signal_values
from finger_pin.core.jit import Matrix, Vector, inlined, njit_always_inline, njit_inline
from finger_pin.core.tables.inputs import HELD, SCHEDULED, InputTable
from finger_pin.laws import input_functions as controller_laws

_proportional_torque = inlined(controller_laws.proportional_torque)
_internal_level = inlined(controller_laws.internal_level)


@njit_inline
def _coupled(control: InputTable, values: Vector, out: Vector) -> None:
    """Fill a derivative of the desired positions from that of the base signals, by the coupling (20)."""
    for j in range(out.size):
        out[j] = 0.0
        for k in range(control.coupling.shape[1]):
            out[j] += control.coupling[j, k] * values[k]


@njit_inline
def inputs(control: InputTable, time: float, position: Vector, velocity: Vector, out: Vector) -> None:
    """Fill the inputs: f_hat of (19), (21), (22), or scheduled ones, and held ones."""
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
        signal_derivatives(control.reference, time, 1, control.slope)
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


@njit_always_inline
def input_slopes(control: InputTable, time: float) -> None:
    """Fill du/dq, du/dv and du/dt after `inputs`, for the active minimum of (22)."""
    by_position, by_time = control.by_position, control.by_time
    if control.kind == HELD:
        return
    if control.kind == SCHEDULED:
        signal_derivatives(control.schedule, time, 1, by_time)
        return
    count = control.gain.size
    signal_derivatives(control.reference, time, 1, control.base)
    _coupled(control, control.base, control.rate)
    if control.damped:
        signal_derivatives(control.reference, time, 2, control.base)
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


@njit_inline
def tip_forces(control: InputTable, time: float, order: int, out: Matrix) -> None:
    """Fill the varying forces at the tips, or a derivative of them, shape (t, 3)."""
    if control.force.harmonics.shape[0] > 0:
        for t in range(out.shape[0]):
            for r in range(3):
                out[t, r] = signal_derivative(control.force, 3 * t + r, time, order)
