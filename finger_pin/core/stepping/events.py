"""Events of a motion: rows that turn round or reach a kink, and another tension that leads in (22); compiled."""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.core.evaluation.law_code import SIDE
from finger_pin.core.jit import call_at, njit_always_inline, njit_inline, unpack
from finger_pin.core.model import MODEL
from finger_pin.core.stepping.interpolation import begin_step, within

# How near a change of sign is found, of the step; after so many evaluations at most.
_NEAR, _MOST = 1e-6, 40


@njit_inline
def state_at(b: Any, step: int, time: float, out: Any) -> None:
    """Fill the state at a time of a step, or of a later one."""
    while step < b.ends.size - 1 and time > b.ends[step]:
        step += 1
    begin_step(b, step)
    within(b, step, time, out)


@njit_inline
def rate_at(address: int, time: float, state: Any) -> None:
    """Evaluate a model at a state."""
    model = unpack(address, MODEL)
    for c in range(state.size):
        model.state[c] = state[c]
    call_at(model.evaluate, address, time)


@njit_inline
def look(col: Any, model: Any, step: int, time: float, out: Any) -> None:
    """Fill the functions that change sign at the motion's kinks, at a time of a step or of a later one."""
    state_at(col.motion, step, time, col.state)
    rate_at(col.model, time, col.state)
    first, control = col.rows.size, model.control
    for w in range(first):
        out[w] = model.work.rows[col.columns[w], col.rows[w]]
    for c in range(col.leaders.size):
        # By how much lambda is larger than any other tension needs, while the same one leads.
        active = control.active[c]
        leader = active if col.sides[first + c] == 0.0 else col.leaders[c]
        lead = np.inf
        for i in range(control.planned.size):
            if control.loop[i] == c and (i == leader) == (leader != active):
                lead = min(lead, (control.planned[i] - control.minimum[i]) / control.internal[i])
        col.leaders[c], out[first + c] = leader, lead if leader == active else -lead
    for w in range(col.sides.size):
        if col.sides[w] == 0.0:
            # At rest until now.
            col.sides[w] = np.sign(out[w])


@njit_inline
def turned_after(col: Any, before: Any, after: Any) -> Any:
    """Return after which share, at the least, a row has changed its side between two looks; 1 if none has."""
    share = 1.0
    for w in range(col.sides.size):
        if col.sides[w] * after[w] < 0.0:
            share = min(share, before[w] / (before[w] - after[w]) if col.sides[w] * before[w] > 0.0 else 0.0)
    return share


@njit_inline
def _hold(col: Any, address: int) -> None:
    """Hold the rows of a model on their sides, as far as their laws allow."""
    model = unpack(address, MODEL)
    for w in range(col.rows.size):
        if col.held[w]:
            model.work.rows[SIDE, col.rows[w]] = col.sides[w]


@njit_inline
def hold_all(col: Any) -> None:
    """Hold the rows of all models on their sides, as far as their laws allow."""
    _hold(col, col.model)
    for k in range(col.changed.size):
        if col.changed[k] != 0:
            _hold(col, col.changed[k])


@njit_always_inline
def last_before(col: Any, model: Any, step: int, begin: float, end: float) -> Any:
    """Return a time just before the first change of sign between two times; ``after`` is just behind it."""
    first, low, high = begin, begin, end
    look(col, model, step, low, col.before)
    for trial in range(_MOST):
        if high - low <= _NEAR * (end - first):
            break
        share = turned_after(col, col.before, col.after)
        # From both sides: by secants just beyond the guess, and now and then by the middle.
        ahead = 0.3 * _NEAR * (end - first) / (high - low)
        share = 0.5 if trial % 4 == 3 else share + (ahead if trial % 2 == 0 else -ahead)
        middle = low + min(max(share, 0.01 * ahead), 1.0 - 0.01 * ahead) * (high - low)
        look(col, model, step, middle, col.between)
        if turned_after(col, col.between, col.between) < 1.0:
            high = middle
            for w in range(col.sides.size):
                col.after[w] = col.between[w]
        else:
            low = middle
            for w in range(col.sides.size):
                col.before[w] = col.between[w]
    return low


@njit_always_inline
def cross(col: Any) -> None:
    """Go over to the other side of every bend that is behind, by ``after``."""
    for w in range(col.sides.size):
        if col.sides[w] * col.after[w] < 0.0:
            if w < col.rows.size:
                col.sides[w] = -col.sides[w]
            else:
                # The next look sees who leads.
                col.sides[w] = 0.0
    hold_all(col)
