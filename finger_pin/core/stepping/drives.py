"""Loops of motors in position drive, compiled: sampled at their own period while an island advances."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from finger_pin.core.jit import (
    CompiledFunction,
    Indices,
    Matrix,
    StructType,
    Vector,
    call_at,
    njit_always_inline,
    unpack,
)
from finger_pin.core.steps.integration import ADVANCE_ARGS, DONE, FULL, INTEGRATION
from finger_pin.core.tables.model import MODEL
from finger_pin.laws.motor import OPEN_CIRCUIT
from finger_pin.typing import Array


class Drives(NamedTuple):
    """The loops of m motors, U = V clip(k_p e + k_d e' + k_i int e, -1, 1); arrays that are memory change in place.

    Attributes:
        motors: Motors whose rotors are in one island.
        places: Coordinates of the rotors, shape (m,).
        channels: Inputs that are their voltages, shape (m,).
        period: s.
        first: Time of the first sample, s; not above zero, and negative where a run goes on.
        goals: theta_m^d at the samples, one every period, shape (k, m), rad; the last one is kept.
        prescribed_voltages: Voltages at the same times in place of a loop's, shape (k, m), V; NaN where the loop runs.
        resolution: Step of the measured angles, 0 for none, shape (m,), rad.
        gains: k_p, k_d, k_i, shape (3, m).
        supply: V at the same times, shape (k, m), V.
        torque_off: Times from which on no current flows, shape (m,), s.
        sample_count: Memory, the number of samples so far, shape (1,).
        integral: Memory, int e, shape (m,).
        last: Memory, e of the last sample, shape (m,).
        voltages: Memory, U from every sample on, shape (k, m), V.
        errors: Memory, likewise e, shape (k, m), rad.
        integrals: Memory, likewise int e, shape (k, m), rad s.
    """

    motors: Indices
    places: Indices
    channels: Indices
    period: float
    first: float
    goals: Matrix
    prescribed_voltages: Matrix
    resolution: Vector
    gains: Matrix
    supply: Matrix
    torque_off: Vector
    sample_count: Indices
    integral: Vector
    last: Vector
    voltages: Matrix
    errors: Matrix
    integrals: Matrix

    def zero_order_hold(self, values: Array, time: Array | float) -> Array:
        """Return samples, shape (k, m), held until the next, at one time or more; an instant belongs to its sample."""
        held_values: Array = values[np.clip(self.latest(time), 0, len(values) - 1)]
        return held_values

    def latest(self, time: Array | float) -> Indices:
        """Return the numbers of the last samples at one time, or at times; one within rounding counts."""
        latest: Indices = np.floor((np.asarray(time) - self.first) / self.period * (1.0 + 1e-12)).astype(int)
        return latest


class AdvanceDrivenArgs(NamedTuple):
    """Arguments of `advance_driven`: an integration while loops run.

    Attributes:
        drives: The loops.
        args: Address of the bound `AdvanceArgs`.
        advance: Address of what is called to advance, with the block at ``advance_args``.
        advance_args: Address of a block.
    """

    drives: Drives
    args: int
    advance: int
    advance_args: int


ADVANCE_DRIVEN_ARGS = StructType(AdvanceDrivenArgs)


def sample(drives: Drives, time: float, x: Vector, tension: Vector) -> None:
    """Take a sample of all motors at a time, s, and set their voltages."""
    last = drives.goals.shape[0] - 1
    k = min(drives.sample_count[0], last)
    for j in drives.motors:
        angle, step = x[drives.places[j]], drives.resolution[j]
        if step > 0.0:
            angle = np.round(angle / step) * step
        error = drives.goals[k, j] - angle
        rate = (error - drives.last[j]) / drives.period if drives.sample_count[0] > 0 else 0.0
        drives.last[j] = error
        summed = drives.integral[j] + error * drives.period
        duty = drives.gains[0, j] * error + drives.gains[1, j] * rate + drives.gains[2, j] * summed
        if abs(duty) < 1.0:
            # The integral stands still while the supply is at its limit.
            drives.integral[j] = summed
        voltage = drives.supply[k, j] * min(max(duty, -1.0), 1.0)
        if not np.isnan(drives.prescribed_voltages[k, j]):
            voltage = drives.prescribed_voltages[k, j]
        if time * (1.0 + 1e-12) >= drives.torque_off[j]:
            voltage = OPEN_CIRCUIT
        # Until the next one is taken, perhaps never.
        after = min(k + 1, last)
        drives.voltages[k, j] = drives.voltages[after, j] = voltage
        drives.errors[k, j] = drives.errors[after, j] = error
        drives.integrals[k, j] = drives.integrals[after, j] = drives.integral[j]
        tension[drives.channels[j]] = voltage
    drives.sample_count[0] += 1


_sample = njit_always_inline(sample)


@CompiledFunction
def advance_driven(address: int, end: float) -> int:
    """Advance as `adaptive.advance` does, and sample at every multiple of the period on the way, both ends included.

    The end and a sample there may differ by rounding.
    """
    driven = unpack(address, ADVANCE_DRIVEN_ARGS)
    drives, args = driven.drives, unpack(driven.args, ADVANCE_ARGS)
    integration = unpack(args.integration, INTEGRATION)
    model = unpack(integration.model, MODEL)
    memory, times = integration.memory, args.times
    while True:
        due = drives.first + drives.sample_count[0] * drives.period
        if memory.time[0] * (1.0 + 1e-12) >= due:
            _sample(drives, due, integration.x, model.control.tension)
            due = drives.first + drives.sample_count[0] * drives.period
        if memory.time[0] >= end:
            return DONE
        if args.record_range[0] == args.record_range[1] and times.size > 0:
            return FULL
        status: int = call_at(driven.advance, driven.advance_args, min(end, due))
        if status != DONE:
            return status
