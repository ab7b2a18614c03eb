"""States between the ends of steps, and the inputs there, compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from finger_pin.core.jit import (
    CompiledFunction,
    Indices,
    Layers,
    Matrix,
    StructType,
    Vector,
    njit_always_inline,
    njit_inline,
    unpack,
)
from finger_pin.core.steps.integration import Integration


class Interpolation(NamedTuple):
    """The m steps of an island, and arrays for its states at k times.

    Attributes:
        begin: When the first step begins, s.
        start: State then, shape (size,).
        attitude: Quaternions of free bodies then, shape (f, 4).
        ends: Ends of the steps, shape (m,), s.
        states: States there, before the angles of free bodies are reset, shape (m, size).
        attitudes: Quaternions after that, shape (m, f, 4).
        dense: Coefficients of the steps' interpolants, shape (m, rows, size).
        charts: First of the three coordinates that turn each free body, shape (f,).
        width: Number of coordinates.
        before: Scratch, the state at the begin of a step, shape (size,).
        times: Shape (k,), s; in order they are found soonest.
        interpolated: Filled with states, shape (k, size).
        turned: Filled with the quaternions from which angles count, shape (k, f, 4).
    """

    begin: float
    start: Vector
    attitude: Matrix
    ends: Vector
    states: Matrix
    attitudes: Layers
    dense: Layers
    charts: Indices
    width: int
    before: Vector
    times: Vector
    interpolated: Matrix
    turned: Layers


INTERPOLATION = StructType(Interpolation)


@CompiledFunction
def interpolate_many(address: int, _time: float) -> int:
    """Fill the interpolated states of an `Interpolation` at an address; at least one step must be stored."""
    steps = unpack(address, INTERPOLATION)
    step = -1
    for k in range(steps.times.size):
        step = step_at(steps, steps.times[k], step)
        interpolate_within(steps, step, steps.times[k], steps.interpolated[k])
        for f in range(steps.charts.size):
            for c in range(4):
                steps.turned[k, f, c] = steps.attitude[f, c] if step == 0 else steps.attitudes[step - 1, f, c]
    return 1


@njit_inline
def start_time(steps: Interpolation, step: int) -> float:
    """Return the time at which a step begins."""
    return steps.begin if step == 0 else steps.ends[step - 1]


@njit_inline
def step_at(steps: Interpolation, time: float, previous: int) -> int:
    """Return the index of the step that contains a time, or -1; the search starts at a known step."""
    step, last = max(previous, 0), steps.ends.size - 1
    while step > 0 and time < steps.ends[step - 1]:
        step -= 1
    while step < last and time >= steps.ends[step]:
        step += 1
    if step != previous:
        begin_step(steps, step)
    return step


@njit_inline
def begin_step(steps: Interpolation, step: int) -> None:
    """Fill the state at the begin of a step."""
    for c in range(steps.before.size):
        steps.before[c] = steps.start[c] if step == 0 else steps.states[step - 1, c]
    if step > 0:
        reset_angles(steps.charts, steps.width, steps.before)


@njit_inline
def interpolate_within(steps: Interpolation, step: int, time: float, out: Vector) -> None:
    """Fill the state at a time within the current step."""
    begin = start_time(steps, step)
    share = (time - begin) / (steps.ends[step] - begin)
    interpolate_share(steps.before, steps.states[step], steps.dense[step], share, out)


@njit_inline
def interpolate_share(before: Vector, after: Vector, dense: Matrix, share: float, out: Vector) -> None:
    """Fill the state after a share of a step, from the states at its ends and its row of ``dense``."""
    last, rest = dense.shape[0] - 1, 1.0 - share
    # Whole rows at a time, so that the compiler can use vector instructions.
    for c in range(before.size):
        out[c] = dense[last, c]
    for row in range(last - 1, -1, -1):
        for c in range(before.size):
            out[c] = dense[row, c] + share * out[c]
    for c in range(before.size):
        out[c] = rest * before[c] + share * (after[c] + rest * out[c])


@njit_always_inline
def _interpolant(integration: Integration, begin: int, end: int) -> None:
    """Fill coefficients in a part of the state."""
    tableau, k = integration.tableau, integration.k
    for row in range(integration.dense.shape[0]):
        bend = integration.dense[row]
        for c in range(begin, end):
            bend[c] = 0.0
        for j in range(tableau.nodes.size):
            weight = tableau.dense[row, j]
            for c in range(begin, end):
                bend[c] += weight * k[j, c]


@njit_always_inline
def interpolant(integration: Integration) -> None:
    """Fill the coefficients of a step's interpolant from its stages."""
    live, parts = integration.live, integration.live_count[0]
    if parts == 1:
        _interpolant(integration, 0, integration.x.size)
    else:
        for part in range(parts):
            _interpolant(integration, live[part, 0], live[part, 1])


@njit_inline
def cut_to_share(integration: Integration, after: Vector, share: float) -> None:
    """Cut a step to a share: replace the state at its end and the interpolant by those of that part."""
    before, dense, live = integration.x, integration.dense, integration.live
    highest, inverse = share ** (dense.shape[0] + 1), 1.0 / share
    for part in range(integration.live_count[0]):
        for c in range(live[part, 0], live[part, 1]):
            bend, last, new, power = 0.0, 0.0, 0.0, highest
            for row in range(dense.shape[0] - 1, -1, -1):
                old = dense[row, c]
                bend = old + share * bend
                new += power * (old - last)
                power *= inverse
                dense[row, c], last = new, old
            after[c] = (1.0 - share) * before[c] + share * (after[c] + (1.0 - share) * bend)


@njit_always_inline
def reset_angles(charts: Indices, width: int, x: Vector) -> None:
    """Reset the chart angles of free bodies to zero; their rates become the angular velocity."""
    for f in range(charts.size):
        i = charts[f]
        b, c = x[i + 1], x[i + 2]
        da, db, dc = x[width + i], x[width + i + 1], x[width + i + 2]
        x[width + i] = da * np.cos(b) * np.cos(c) + db * np.sin(c)
        x[width + i + 1] = db * np.cos(c) - da * np.cos(b) * np.sin(c)
        x[width + i + 2] = da * np.sin(b) + dc
        x[i], x[i + 1], x[i + 2] = 0.0, 0.0, 0.0
