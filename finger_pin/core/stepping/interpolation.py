"""States between the ends of steps, and the inputs there, compiled."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from finger_pin.core.evaluation.inputs import inputs
from finger_pin.core.jit import Indices, Kind, Layers, Matrix, Unit, Vector, bound_at, compiled
from finger_pin.core.model import MODEL


class Between(NamedTuple):
    """The m steps of an island, and arrays for its states at k times.

    Attributes:
        begin: When the first step begins, s.
        start: State then, shape (size,).
        attitude: Quaternions of free bodies then, shape (f, 4).
        ends: Ends of the steps, shape (m,), s.
        states: States there, before the angles of free bodies begin anew, shape (m, size).
        attitudes: Quaternions after that, shape (m, f, 4).
        dense: Coefficients of the steps' interpolants, shape (m, rows, size).
        charts: First of the three coordinates that turn each free body, shape (f,).
        width: Number of coordinates.
        before: Scratch, the state at the begin of a step, shape (size,).
        times: Shape (k,), s; in order they are found soonest.
        found: Filled with states, shape (k, size).
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
    found: Matrix
    turned: Layers


class Commands(NamedTuple):
    """Times and states of an island, and its inputs there.

    Attributes:
        model: Address of a bound `Model`.
        times: Shape (k,), s.
        states: Shape (k, size).
        found: Filled with inputs, shape (k, u).
    """

    model: int
    times: Vector
    states: Matrix
    found: Matrix


BETWEEN, COMMANDS = Kind(Between), Kind(Commands)


@Unit
def interpolate_many(address: int, _time: float) -> int:
    """Fill the states of a `Between` at an address; there must be a step."""
    b = bound_at(address, BETWEEN)
    ends, states, found, before, last = b.ends, b.states, b.found, b.before, b.ends.size - 1
    step, known = 0, -1
    for k in range(b.times.size):
        at = b.times[k]
        while step > 0 and at < ends[step - 1]:
            step -= 1
        while step < last and at >= ends[step]:
            step += 1
        begin = b.begin if step == 0 else ends[step - 1]
        if step != known:
            known = step
            for c in range(before.size):
                before[c] = b.start[c] if step == 0 else states[step - 1, c]
            if step > 0:
                begin_anew(b.charts, b.width, before)
        between(before, states[step], b.dense[step], (at - begin) / (ends[step] - begin), found[k])
        for f in range(b.charts.size):
            for c in range(4):
                b.turned[k, f, c] = b.attitude[f, c] if step == 0 else b.attitudes[step - 1, f, c]
    return 1


@compiled
def between(before: Any, after: Any, dense: Any, share: float, out: Any) -> None:
    """Fill the state after a share of a step, from the states at its ends and its row of ``dense``."""
    last = dense.shape[0] - 1
    for c in range(before.size):
        bend = dense[last, c]
        for row in range(last - 1, -1, -1):
            bend = dense[row, c] + share * bend
        out[c] = (1.0 - share) * before[c] + share * (after[c] + (1.0 - share) * bend)


@compiled
def bend_of_stages(tableau: Any, k: Any, c: int, share: float) -> Any:
    """Return the bend of a state after a share of a step, as `between` has it, from the stages k, shape (s, size)."""
    bend = 0.0
    for row in range(tableau.dense.shape[0] - 1, -1, -1):
        value = 0.0
        for j in range(tableau.nodes.size):
            value += tableau.dense[row, j] * k[j, c]
        bend = value + share * bend
    return bend


@compiled
def begin_anew(charts: Any, width: int, x: Any) -> None:
    """Let the angles of free bodies begin anew, as `rechart` does: their rates become the angular velocity."""
    for f in range(charts.size):
        i = charts[f]
        b, c = x[i + 1], x[i + 2]
        da, db, dc = x[width + i], x[width + i + 1], x[width + i + 2]
        x[width + i] = da * np.cos(b) * np.cos(c) + db * np.sin(c)
        x[width + i + 1] = db * np.cos(c) - da * np.cos(b) * np.sin(c)
        x[width + i + 2] = da * np.sin(b) + dc
        x[i], x[i + 1], x[i + 2] = 0.0, 0.0, 0.0


@Unit
def command_many(address: int, _time: float) -> int:
    """Fill the inputs of the `Commands` at an address."""
    commands = bound_at(address, COMMANDS)
    model = bound_at(commands.model, MODEL)
    width = model.work.torque.size
    for k in range(commands.times.size):
        state = commands.states[k]
        inputs(model.control, commands.times[k], state[:width], state[width : 2 * width], commands.found[k])
    return 1
