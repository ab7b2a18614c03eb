"""Adaptive step lengths, compiled: acceptance of steps, their record, and the length of the next."""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.core.collision.broad_phase import list_awake, settle
from finger_pin.core.collision.continuous import NOTHING, UNSEEN
from finger_pin.core.evaluation.attitude_charts import rechart
from finger_pin.core.inputs import HELD
from finger_pin.core.jit import CompiledFunction, call_at, copy, copy_matrix, njit_always_inline, njit_inline, unpack
from finger_pin.core.model import MODEL
from finger_pin.core.stepping import rosenbrock as at
from finger_pin.core.stepping.error_norm import step_error, worst
from finger_pin.core.stepping.rosenbrock import try_step

_SAFETY, _SHRINK, _GROW = 0.9, 0.2, 6.0


@njit_always_inline
def _begin(integration: Any, model: Any, end: float) -> None:
    """Make ready to advance to a time, with all contacts awake that may be."""
    memory, control = integration.memory, model.control
    list_awake(model.tables, model.work.paths)
    memory[at.FRESH], memory[at.WHOLE] = 1.0, 0.0
    # Right after a full record nothing has jumped.
    jumped = control.kind == HELD and memory[at.HELD_STEP] >= 0.0
    memory[at.JUMPED], memory[at.HELD_STEP] = 1.0 * jumped, abs(memory[at.HELD_STEP])
    if jumped and memory[at.HELD_STEP] > 0.0:
        # Held tensions have just jumped: what sufficed after the last jump is the best guess.
        memory[at.STEP], memory[at.LAST_STEP] = memory[at.HELD_STEP], 0.0
    if memory[at.GOAL] != end:
        memory[at.GOAL], memory[at.WINDOW_END] = end, 0.0


@njit_always_inline
def _hopeless(integration: Any, width: int) -> int:
    """Return `RUNAWAY` or `CREEPING` if there is no sense in another try, else `DONE`."""
    memory, x = integration.memory, integration.x
    if memory[at.FRESH] > 0.0:
        for c in range(width, 2 * width):
            if abs(x[c]) > at.FASTEST:
                memory[at.CULPRIT] = c
                return at.RUNAWAY
    tries = memory[at.ACCEPTED] + memory[at.REJECTED]
    if tries >= memory[at.WINDOW_END]:
        if memory[at.WINDOW_END] > 0.0 and memory[at.TIME] - memory[at.WINDOW_START] < at.WINDOW * at.LEAST_MEAN_STEP:
            _blame(integration)
            return at.CREEPING
        memory[at.WINDOW_START], memory[at.WINDOW_END] = memory[at.TIME], tries + at.WINDOW
    return at.DONE


@njit_inline
def _blame(integration: Any) -> None:
    """Remember which number of the state keeps steps short."""
    k = integration.k
    integration.memory[at.CULPRIT] = float(worst(integration.x, k[k.shape[0] - 1], integration.rtol, integration.atol))


@njit_inline
def try_counted(integration: Any, model: Any, h: float) -> int:
    """Try a step, and count its evaluations; return its outcome, as `try_step` does."""
    memory, tables = integration.memory, model.tables
    fresh, count = memory[at.FRESH] > 0.0, integration.tableau.nodes.size
    outcome = try_step(integration, model, memory[at.TIME], h, fresh)
    if outcome == at.SENSELESS:
        for c in range(integration.x.size - 1, -1, -1):
            if not np.isfinite(integration.start[c]):
                memory[at.CULPRIT] = c
        return outcome
    memory[at.JACOBIANS] += fresh
    memory[at.FACTORISATIONS] += 1
    memory[at.EVALUATIONS] += count if fresh or tables.loaded or tables.touching > 0 else count - 1
    # What follows a kink follows from this try alone.
    memory[at.FRESH], memory[at.AFTER] = 0.0, np.inf
    return outcome


@njit_inline
def _fitting(integration: Any, error: float) -> Any:
    """Return the factor by which a step of an error is to be longer to fit the tolerance."""
    if not error <= 1e30:
        return 0.1
    return min(_GROW, max(_SHRINK, _SAFETY * max(error, 1e-10) ** (-1.0 / integration.tableau.order)))


@njit_always_inline
def _growth(integration: Any, h: float, error: float, clipped: bool) -> Any:
    """Return the factor by which the step after one that is taken may be longer."""
    memory, factor = integration.memory, _fitting(integration, error)
    if memory[at.LAST_STEP] > 0.0 and not clipped:
        # Gustafsson's predictive controller: the error's trend counts too, unless the end cut the step.
        trend = (memory[at.LAST_ERROR] / max(error, 1e-10) ** 2) ** (1.0 / integration.tableau.order)
        factor = min(factor, max(_SHRINK, _SAFETY * h / memory[at.LAST_STEP] * trend))
    # Right after a rejection the step does not grow.
    return min(factor, 1.0) if memory[at.CULPRIT] < 0.0 else factor


@njit_inline
def _shorten(integration: Any, h: float, whole: float) -> None:
    """Let the next try be shorter than the last; a step that is cut at a kink was longer than that as a whole."""
    memory = integration.memory
    memory[at.REJECTED] += 1
    memory[at.CULPRIT], memory[at.STEP], memory[at.WHOLE] = -1.0, h, whole


@njit_always_inline
def _pace(integration: Any, h: float, error: float, final: bool, clipped: bool) -> None:
    """Count a step that is taken, and set the length of the next."""
    memory = integration.memory
    factor = _growth(integration, h, error, clipped)
    if memory[at.JUMPED] > 0.0 and not clipped:
        memory[at.HELD_STEP] = h * min(factor, 3.0)
    memory[at.STEP] = max(memory[at.STEP], h * factor) if final and factor >= 1.0 else h * factor
    memory[at.LAST_STEP], memory[at.LAST_ERROR] = h, max(error, 1e-2)
    if memory[at.WHOLE] > 0.0:
        # The step ends at a kink; the one before it says nothing of the next, which may be as long as before.
        memory[at.STEP], memory[at.LAST_STEP] = max(memory[at.STEP], memory[at.WHOLE]), 0.0
    memory[at.STEP] = min(memory[at.STEP], memory[at.AFTER])
    memory[at.ACCEPTED] += 1
    memory[at.FRESH], memory[at.JUMPED] = 1.0, 0.0
    memory[at.CULPRIT], memory[at.WHOLE] = max(memory[at.CULPRIT], 0.0), 0.0


@njit_always_inline
def arrive(stretch: Any, integration: Any, model: Any, time: float) -> None:
    """Go to the end of a step, and keep it, if there is a record."""
    x, attitude, tables, taken = integration.x, integration.attitude, model.tables, stretch.taken[0]
    first = 2 * model.linear.mass.shape[0]
    if tables.touching and settle(tables, model.work.rows, model.work.paths, model.state[first:]):
        list_awake(tables, model.work.paths)
        _still(integration, model, first)
    copy(model.state, x)
    integration.memory[at.TIME] = time
    if taken < stretch.times.size:
        stretch.times[taken] = time
        copy_matrix(integration.dense, stretch.dense[taken])
        copy(x, stretch.states[taken])
        copy(integration.kinks, stretch.branches[taken])
        stretch.shares[taken] = integration.memory[at.PART]
    rechart(tables, x, attitude, integration.drift)
    if taken < stretch.times.size:
        for f in range(attitude.shape[0]):
            for c in range(4):
                stretch.attitudes[taken, f, c] = attitude[f, c]
        stretch.taken[0] += 1


@njit_always_inline
def _still(integration: Any, model: Any, first: int) -> None:
    """Clear the rates and errors of the states of contacts that sleep, which are zero and stay so."""
    tables = model.tables
    for row in range(0, tables.touching, 3):
        if model.work.paths.asleep[row]:
            for m in range(row + 1, row + 3):
                c = first + tables.state[m]
                integration.start[c] = integration.drift[c] = model.rate[c] = 0.0
                for j in range(integration.k.shape[0]):
                    integration.k[j, c] = 0.0


@CompiledFunction
def advance(address: int, end: float) -> int:
    """Take steps of the `Stretch` at an address until a time, s, or until its record is full; return a status."""
    stretch = unpack(address, at.STRETCH)
    integration = unpack(stretch.integration, at.INTEGRATION)
    model, memory = unpack(integration.model, MODEL), integration.memory
    _begin(integration, model, end)
    while memory[at.TIME] < end:
        status = _hopeless(integration, model.linear.mass.shape[0])
        if status != at.DONE:
            return status
        if stretch.times.size > 0 and stretch.taken[0] == stretch.taken[1]:
            memory[at.HELD_STEP] = -memory[at.HELD_STEP]
            return at.FULL
        time, h = memory[at.TIME], memory[at.STEP]
        final = time + 1.01 * h >= end
        clipped = final and end - time < h
        if final:
            h = end - time
        outcome = try_counted(integration, model, h)
        if outcome == at.SENSELESS:
            return at.NOT_FINITE
        error = np.inf
        if outcome != at.SINGULAR:
            error = step_error(integration.x, model.state, integration.k[-1], integration.rtol, integration.atol)
        if not error <= 1.0:
            _shorten(integration, h * min(_fitting(integration, error), 0.9), 0.0)
            if memory[at.STEP] < 1e-14 * max(1.0, abs(time)):
                _blame(integration)
                return at.UNDERFLOW
            continue
        memory[at.OUTCOME], memory[at.TOUCH] = outcome, NOTHING
        call_at(integration.cut, stretch.integration, h)
        if memory[at.KEPT] == 1.0 and model.tables.touching:
            call_at(integration.survey, stretch.integration, h)
        kept, part, touch = memory[at.KEPT], memory[at.PART], memory[at.TOUCH]
        if touch == UNSEEN:
            # The same step once more, with what slept.
            list_awake(model.tables, model.work.paths)
            memory[at.FRESH] = 1.0
        elif kept < 1.0 or touch < NOTHING:
            # Of a touch nothing has seen the next step's end is inside, and sees it.
            _shorten(integration, h * (part * touch if touch < NOTHING else kept), max(memory[at.WHOLE], h))
        else:
            if integration.joints.size + integration.objects.size > 0:
                call_at(integration.judge, stretch.integration, h)
            arrive(stretch, integration, model, end if final and part == 1.0 else time + part * h)
            _pace(integration, h, error, final, clipped)
    return at.DONE
