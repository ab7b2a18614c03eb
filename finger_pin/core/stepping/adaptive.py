"""Steps as long as a tolerance allows, compiled: which are taken, what is kept of them, how long the next may be."""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.core.control import HELD
from finger_pin.core.evaluation.charts import rechart
from finger_pin.core.jit import Unit, bound_at, compiled
from finger_pin.core.model import MODEL
from finger_pin.core.stepping import rosenbrock as at
from finger_pin.core.stepping.broad_phase import list_awake, settle
from finger_pin.core.stepping.drift import carry, defect, weigh
from finger_pin.core.stepping.error_norm import step_error, worst
from finger_pin.core.stepping.flights import NOTHING, UNSEEN, survey
from finger_pin.core.stepping.law_branches import passed, past_kink, price, strayed
from finger_pin.core.stepping.rosenbrock import try_step

_SAFETY, _SHRINK, _GROW = 0.9, 0.2, 6.0

# What a step that is cut at a kink keeps of its length at least and at most.
_SHORTEST, _LONGEST = 0.1, 0.9


@compiled
def _begin(integration: Any, model: Any, end: float) -> None:
    """Make ready to advance to a time, with all contacts awake that may be."""
    memory, control = integration.memory, model.control
    list_awake(model.tables, model.work.paths)
    memory[at.FRESH], memory[at.WHOLE], memory[at.AFTER] = 1.0, 0.0, np.inf
    # Right after a full record nothing has jumped.
    jumped = control.kind == HELD and memory[at.HELD_STEP] >= 0.0
    memory[at.JUMPED], memory[at.HELD_STEP] = 1.0 * jumped, abs(memory[at.HELD_STEP])
    if jumped and memory[at.HELD_STEP] > 0.0:
        # Held tensions have just jumped: what sufficed after the last jump is the best guess.
        memory[at.STEP], memory[at.LAST_STEP] = memory[at.HELD_STEP], 0.0
    if memory[at.GOAL] != end:
        memory[at.GOAL], memory[at.WINDOW_END] = end, 0.0


@compiled
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


@compiled
def _blame(integration: Any) -> None:
    """Remember which number of the state keeps steps short."""
    k = integration.k
    integration.memory[at.CULPRIT] = float(worst(integration.x, k[k.shape[0] - 1], integration.rtol, integration.atol))


@compiled
def _tried(integration: Any, model: Any, h: float) -> int:
    """Try a step, and count what it took; return what comes of it."""
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
    memory[at.FRESH] = 0.0
    return outcome


@compiled
def _kept_at_kinks(integration: Any, model: Any, h: float, outcome: int) -> Any:
    """Return how much of a step to try next, 1 to keep it, and the share after which a row has left its side, or 1."""
    memory, time, r = integration.memory, integration.memory[at.TIME], integration.r
    share, dear = strayed(model.tables, model.work.rows, integration.kinks), False
    if share < 1.0:
        # A row was held on a side that it has left: what that cost is an error too.
        memory[at.EVALUATIONS] += 2
        cost = price(integration, model, time + h, h, r)
        dear = not cost <= 1.0
        if not dear:
            memory[at.AFTER] = past_kink(h, share, cost, integration.rtol, integration.tableau)
    elif outcome == at.STRAYED:
        memory[at.EVALUATIONS] += 4
        share = passed(integration, model, time, h, r)
        dear = share < 1.0
    return min(_LONGEST, max(_SHORTEST, 1.02 * share)) if dear else 1.0, share


@compiled
def _fitting(integration: Any, error: float) -> Any:
    """Return by how much a step of that error is to be longer to fit the tolerance."""
    if not error <= 1e30:
        return 0.1
    return min(_GROW, max(_SHRINK, _SAFETY * max(error, 1e-10) ** (-1.0 / integration.tableau.order)))


@compiled
def _growth(integration: Any, h: float, error: float, clipped: bool) -> Any:
    """Return by how much the step after one that is taken may be longer."""
    memory, factor = integration.memory, _fitting(integration, error)
    if memory[at.LAST_STEP] > 0.0 and not clipped:
        # Gustafsson's predictive controller: the error's trend counts too, unless the end cut the step.
        trend = (memory[at.LAST_ERROR] / max(error, 1e-10) ** 2) ** (1.0 / integration.tableau.order)
        factor = min(factor, max(_SHRINK, _SAFETY * h / memory[at.LAST_STEP] * trend))
    # Right after a rejection the step does not grow.
    return min(factor, 1.0) if memory[at.CULPRIT] < 0.0 else factor


@compiled
def _estimate(integration: Any, model: Any, h: float, turned: bool, doubtful: bool) -> None:
    """Carry the error of the run over a step that is taken.

    Args:
        integration: The integration; its state is that of the step's start.
        model: The model; its state is that of the step's end.
        h: Length of the step, s.
        turned: Whether it ends at a kink.
        doubtful: Whether the two methods may err alike.
    """
    memory, drift, k, width = integration.memory, integration.drift, integration.k, model.linear.mass.shape[0]
    if integration.joints.size + integration.objects.size == 0:
        return
    if doubtful:
        defect(integration, model, memory[at.TIME], h)
    memory[at.BEHIND] = carry(
        model.linear,
        h,
        integration.tableau.gamma,
        drift,
        k[k.shape[0] - 1],
        memory[at.BEHIND],
        turned,
        integration.r,
        model.rate,
    )
    memory[at.DRIFT] += h * weigh(integration.joints, width, drift)
    memory[at.OBJECT_DRIFT] += h * weigh(integration.objects, width, drift)


@compiled
def _shorten(integration: Any, h: float, whole: float) -> None:
    """Let the next try be shorter than the last; a step that is cut at a kink was longer than that as a whole."""
    memory = integration.memory
    memory[at.REJECTED] += 1
    memory[at.CULPRIT], memory[at.STEP], memory[at.WHOLE] = -1.0, h, whole


@compiled
def _pace(integration: Any, h: float, error: float, final: bool, clipped: bool) -> None:
    """Count a step that is taken, and say how long the next may be."""
    memory = integration.memory
    factor = _growth(integration, h, error, clipped)
    if memory[at.JUMPED] > 0.0 and not clipped:
        memory[at.HELD_STEP] = h * min(factor, 1.5)
    memory[at.STEP] = max(memory[at.STEP], h * factor) if final and factor >= 1.0 else h * factor
    memory[at.LAST_STEP], memory[at.LAST_ERROR] = h, max(error, 1e-2)
    if memory[at.WHOLE] > 0.0:
        # The step ends at a kink; the one before it says nothing of the next, which may be as long as before.
        memory[at.STEP], memory[at.LAST_STEP] = max(memory[at.STEP], memory[at.WHOLE]), 0.0
    memory[at.STEP] = min(memory[at.STEP], memory[at.AFTER])
    memory[at.ACCEPTED] += 1
    memory[at.FRESH], memory[at.JUMPED] = 1.0, 0.0
    memory[at.CULPRIT], memory[at.WHOLE], memory[at.AFTER] = max(memory[at.CULPRIT], 0.0), 0.0, np.inf


@compiled
def _record(stretch: Any, integration: Any) -> None:
    """Keep the interpolant of a step, if there is a record; its end comes later."""
    if stretch.taken[0] == stretch.times.size:
        return
    k, tableau = integration.k, integration.tableau
    for row in range(tableau.dense.shape[0]):
        bend = stretch.dense[stretch.taken[0], row]
        for c in range(bend.size):
            bend[c] = 0.0
        for j in range(tableau.nodes.size):
            of_stage = tableau.dense[row, j]
            for c in range(bend.size):
                bend[c] += of_stage * k[j, c]


@compiled
def _arrive(stretch: Any, integration: Any, model: Any, time: float) -> None:
    """Go to the end of a step, and keep it, if there is a record."""
    x, attitude, tables, taken = integration.x, integration.attitude, model.tables, stretch.taken[0]
    first = 2 * model.linear.mass.shape[0]
    if tables.touching and settle(tables, model.work.rows, model.work.paths, model.state[first:]):
        list_awake(tables, model.work.paths)
        _still(integration, model, first)
    for c in range(x.size):
        x[c] = model.state[c]
    integration.memory[at.TIME] = time
    if taken < stretch.times.size:
        stretch.times[taken] = time
        for c in range(x.size):
            stretch.states[taken, c] = x[c]
    rechart(tables, x, attitude, integration.drift)
    if taken < stretch.times.size:
        for f in range(attitude.shape[0]):
            for c in range(4):
                stretch.attitudes[taken, f, c] = attitude[f, c]
        stretch.taken[0] += 1
    integration.memory[at.FRESH] = 1.0


@compiled
def _still(integration: Any, model: Any, first: int) -> None:
    """Clear what earlier steps have left of the states of contacts that sleep, which are zero and stay so."""
    tables = model.tables
    for row in range(0, tables.touching, 3):
        if model.work.paths.asleep[row]:
            for m in range(row + 1, row + 3):
                c = first + tables.state[m]
                integration.start[c] = integration.drift[c] = model.rate[c] = 0.0
                for j in range(integration.k.shape[0]):
                    integration.k[j, c] = 0.0


@Unit
def advance(address: int, end: float) -> int:
    """Take steps of the `Stretch` at an address until a time, s, or until its record is full; return a status."""
    stretch = bound_at(address, at.STRETCH)
    integration = bound_at(stretch.integration, at.INTEGRATION)
    model, memory = bound_at(integration.model, MODEL), integration.memory
    _begin(integration, model, end)
    while memory[at.TIME] < end:
        status = _hopeless(integration, model.linear.mass.shape[0])
        if status != at.DONE:
            return status
        if stretch.times.size > 0 and stretch.taken[0] == stretch.times.size:
            memory[at.HELD_STEP] = -memory[at.HELD_STEP]
            return at.FULL
        time, h = memory[at.TIME], memory[at.STEP]
        final = time + 1.01 * h >= end
        clipped = final and end - time < h
        if final:
            h = end - time
        outcome = _tried(integration, model, h)
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
        kept, share = 1.0, 1.0
        worth = h > 1e-12 * max(1.0, abs(time))
        if worth:
            kept, share = _kept_at_kinks(integration, model, h, outcome)
        touch = survey(integration, model) if worth and kept == 1.0 and model.tables.touching else NOTHING
        if touch == UNSEEN:
            # The same step once more, with what slept.
            list_awake(model.tables, model.work.paths)
            memory[at.FRESH] = 1.0
        elif kept < 1.0 or touch < NOTHING:
            # Of a touch nothing has seen the next step's end is inside, and sees it.
            _shorten(integration, h * (touch if touch < NOTHING else kept), max(memory[at.WHOLE], h))
        else:
            again = memory[at.CULPRIT] < 0.0 and model.tables.touching > 0
            _record(stretch, integration)
            _estimate(integration, model, h, share < 1.0, share < 1.0 or outcome == at.STRAYED or again)
            _arrive(stretch, integration, model, end if final else time + h)
            _pace(integration, h, error, final, clipped)
    return at.DONE
