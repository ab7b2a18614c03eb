"""Adaptive Rosenbrock steps with the exact Jacobian, compiled; without Newton iterations, which could fail."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from finger_pin.core.control import HELD
from finger_pin.core.evaluation.charts import rechart
from finger_pin.core.evaluation.condensation import solve
from finger_pin.core.jit import Indices, Kind, Layers, Matrix, Unit, Vector, bound_at, call_at, compiled
from finger_pin.core.model import MODEL
from finger_pin.core.stepping.broad_phase import depart, list_awake, settle
from finger_pin.core.stepping.drift import carry, defect, weigh
from finger_pin.core.stepping.error_norm import step_error, worst
from finger_pin.core.stepping.flights import NOTHING, UNSEEN, survey
from finger_pin.core.stepping.law_branches import hold, passed, past_kink, price, release, strayed
from finger_pin.core.stepping.tableaus import Tableau

# Entries of the memory that outlives a call.
TIME, STEP, LAST_STEP, LAST_ERROR, EVALUATIONS, JACOBIANS, FACTORISATIONS, ACCEPTED, REJECTED, CULPRIT = range(10)
HELD_STEP, GOAL, WINDOW_START, WINDOW_END, DRIFT, OBJECT_DRIFT, BEHIND, MEMORY_SIZE = range(10, 18)
DONE, FULL, UNDERFLOW, NOT_FINITE, CREEPING, RUNAWAY = range(6)

_SAFETY, _SHRINK, _GROW = 0.9, 0.2, 6.0

# So many tries in a row must advance by so much time each on average, s: a second at that pace would take hours.
WINDOW, LEAST_MEAN_STEP = 20_000, 1e-9
# Where a joint turns faster, rad/s, or a mass is faster, m/s, nothing physical is left to follow: the tip of a link of
# 1 cm is then faster than sound, 343 m/s.
FASTEST = 343.0 / 0.01


class Integration(NamedTuple):
    """All that an integration works on, from its start to its end.

    Attributes:
        model: Address of the bound `Model`.
        tableau: The method.
        x: State, changed in place, shape (size,); the angles of free bodies are those since the last step.
        attitude: Unit quaternions of the free bodies, changed in place, shape (f, 4).
        rtol: Relative tolerance.
        atol: Absolute tolerances, shape (size,).
        memory: Time, step size, error history and counters; kept between calls.
        k: Scratch for the stages, shape (s, size).
        start: Scratch, f(t, x) at the start of a step, shape (size,).
        r: Scratch, shape (size + 1,).
        end: Scratch, shape (size,).
        drift: Estimate of the error so far, shape (size,).
        kinks: Where each row was between the sides of its kink when the step began, shape (K,).
        joints: Coordinates whose error is estimated; without any nothing is, which saves a tenth.
        objects: Those of free objects, likewise.
    """

    model: int
    tableau: Tableau
    x: Vector
    attitude: Matrix
    rtol: float
    atol: Vector
    memory: Vector
    k: Matrix
    start: Vector
    r: Vector
    end: Vector
    drift: Vector
    kinks: Vector
    joints: Indices
    objects: Indices


class Stretch(NamedTuple):
    """What is integrated further, and room for a record of at most m steps.

    Attributes:
        integration: Address of the bound `Integration`.
        times: Times at which steps end, shape (m,); of length zero to record nothing.
        states: States there, with the angles of free bodies since the step's start, shape (m, size).
        attitudes: Quaternions of the free bodies there, shape (m, f, 4).
        dense: Interpolants of the steps, shape (m, rows of the tableau's dense, size).
        taken: Number of steps recorded so far, shape (1,).
    """

    integration: int
    times: Vector
    states: Matrix
    attitudes: Layers
    dense: Layers
    taken: Indices


INTEGRATION, STRETCH = Kind(Integration), Kind(Stretch)


@compiled
def _step(integration: Any, model: Any, time: float, h: float, fresh: bool) -> int:
    """Try one step: fill the increments k and, in model.state, the state at its end.

    What depends on the start alone, f(t, x) and the linearisation, is kept for a second try.

    Returns:
        0 if tried, 1 if g - J is singular, 2 if f(t, x) is not finite; -1 if tried, and at a stage a row was on the
        other side of its kink than where it is held.
    """
    tableau, x, k, r, start = integration.tableau, integration.x, integration.k, integration.r, integration.start
    size, state, rate = x.size, model.state, model.rate
    tables, rows, kinks = model.tables, model.work.rows, integration.kinks
    g = 1.0 / (h * tableau.gamma)
    outcome = 0
    for i in range(tableau.nodes.size):
        for c in range(size):
            r[c], rate[c], state[c] = 0.0, start[c], x[c]
        # Whole rows at a time, so that the compiler can use vector instructions.
        for j in range(i):
            of_stage, of_coupling = tableau.stage[i, j], tableau.coupling[i, j] / h
            for c in range(size):
                state[c] += of_stage * k[j, c]
                r[c] += of_coupling * k[j, c]
        if i == 0 and fresh:
            release(tables, rows)
        # For a second try too: what pins and tips feel there is read from the memory of the evaluation.
        if i > 0 or fresh or tables.loaded or tables.touching > 0:
            call_at(model.evaluate, integration.model, time + tableau.nodes[i] * h)
        if i == 0:
            if fresh:
                for c in range(size):
                    start[c] = rate[c]
                    if not np.isfinite(rate[c]):
                        return 2
                hold(tables, rows, kinks)
                if tables.touching:
                    depart(tables, model.work.paths)
                call_at(model.linearise, integration.model, time)
            if call_at(model.condense, integration.model, g) == 0:
                return 1
        elif i < tableau.nodes.size - 1 and strayed(tables, rows, kinks) < 1.0:
            outcome = -1
        for c in range(size):
            r[c] += rate[c]
        r[size] = h * tableau.time[i]
        solve(model.linear, r, k[i])
    for c in range(size):
        state[c] += k[tableau.nodes.size - 1, c]
    return outcome


@compiled
def _still(tables: Any, model: Any, integration: Any) -> None:
    """Clear what earlier steps have left of the states of contacts that sleep, which are zero and stay so."""
    first = 2 * model.linear.mass.shape[0]
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
    stretch = bound_at(address, STRETCH)
    integration = bound_at(stretch.integration, INTEGRATION)
    model = bound_at(integration.model, MODEL)
    times, taken = stretch.times, stretch.taken
    tables, control, tableau = model.tables, model.control, integration.tableau
    rows, kinks, r = model.work.rows, integration.kinks, integration.r
    x, rtol, atol, memory = integration.x, integration.rtol, integration.atol, integration.memory
    k, start, reached, drift = integration.k, integration.start, model.state, integration.drift
    size, count = x.size, tableau.nodes.size
    exponent = 1.0 / tableau.order
    fresh, whole = True, 0.0
    list_awake(tables, model.work.paths)
    # Right after a full record nothing has jumped.
    jumped = control.kind == HELD and memory[HELD_STEP] >= 0.0
    memory[HELD_STEP] = abs(memory[HELD_STEP])
    if jumped and memory[HELD_STEP] > 0.0:
        # Held tensions have just jumped: what sufficed after the last jump is the best guess.
        memory[STEP], memory[LAST_STEP] = memory[HELD_STEP], 0.0
    if memory[GOAL] != end:
        memory[GOAL], memory[WINDOW_END] = end, 0.0
    width = model.linear.mass.shape[0]
    while memory[TIME] < end:
        if fresh:
            for c in range(width, 2 * width):
                if abs(x[c]) > FASTEST:
                    memory[CULPRIT] = c
                    return RUNAWAY
        tries = memory[ACCEPTED] + memory[REJECTED]
        if tries >= memory[WINDOW_END]:
            if memory[WINDOW_END] > 0.0 and memory[TIME] - memory[WINDOW_START] < WINDOW * LEAST_MEAN_STEP:
                memory[CULPRIT] = float(worst(x, k[count - 1], rtol, atol))
                return CREEPING
            memory[WINDOW_START], memory[WINDOW_END] = memory[TIME], tries + WINDOW
        if times.size > 0 and taken[0] == times.size:
            memory[HELD_STEP] = -memory[HELD_STEP]
            return FULL
        time, h = memory[TIME], memory[STEP]
        last = time + 1.01 * h >= end
        cut = last and end - time < h
        if last:
            h = end - time
        error, share, cost = np.inf, 1.0, 0.0
        outcome = _step(integration, model, time, h, fresh)
        if outcome == 2:
            for c in range(size - 1, -1, -1):
                if not np.isfinite(start[c]):
                    memory[CULPRIT] = c
            return NOT_FINITE
        if fresh:
            memory[JACOBIANS] += 1
        memory[FACTORISATIONS] += 1
        memory[EVALUATIONS] += count if fresh or tables.loaded or tables.touching > 0 else count - 1
        if outcome <= 0:
            error = step_error(x, reached, k[count - 1], rtol, atol)
        fresh = False
        if error <= 1.0:
            share, dear = 1.0, False
            if h > 1e-12 * max(1.0, abs(time)):
                share = strayed(tables, rows, kinks)
                # A row was held on a side that it has left: what that cost is an error too.
                if share < 1.0:
                    cost = price(integration, model, time + h, h, r)
                    dear = not cost <= 1.0
                    memory[EVALUATIONS] += 2
                elif outcome < 0:
                    share = passed(integration, model, time, h, r)
                    dear = share < 1.0
                    memory[EVALUATIONS] += 4
            seen = not tables.touching or dear or not h > 1e-12 * max(1.0, abs(time))
            touch = NOTHING if seen else survey(integration, model)
            if touch == UNSEEN:
                # The same step once more, with what slept.
                list_awake(tables, model.work.paths)
                fresh = True
                continue
            if dear or touch < NOTHING:
                memory[REJECTED] += 1
                memory[CULPRIT] = -1.0
                whole = max(whole, h)
                # Of a touch nothing has seen the next step's end is inside, and sees it.
                memory[STEP] = h * (touch if touch < NOTHING else min(0.9, max(0.1, 1.02 * share)))
                continue
        if not error <= 1e30:
            factor = 0.1
        else:
            factor = min(_GROW, max(_SHRINK, _SAFETY * max(error, 1e-10) ** -exponent))
        if error <= 1.0:
            if memory[LAST_STEP] > 0.0 and not cut:
                # Gustafsson's predictive controller: the error's trend counts too, unless the end cut the step.
                trend = (memory[LAST_ERROR] / max(error, 1e-10) ** 2) ** exponent
                predicted = _SAFETY * h / memory[LAST_STEP] * trend
                factor = min(factor, max(_SHRINK, predicted))
            again = memory[CULPRIT] < 0.0
            if again:
                # Right after a rejection the step does not grow.
                factor = min(factor, 1.0)
                memory[CULPRIT] = 0.0
            if taken[0] < times.size:
                for row in range(tableau.dense.shape[0]):
                    bend = stretch.dense[taken[0], row]
                    for c in range(size):
                        bend[c] = 0.0
                    for j in range(count):
                        factor_of_stage = tableau.dense[row, j]
                        for c in range(size):
                            bend[c] += factor_of_stage * k[j, c]
            if jumped and not cut:
                memory[HELD_STEP] = h * min(factor, 1.5)
            jumped = False
            if integration.joints.size + integration.objects.size > 0:
                if share < 1.0 or outcome < 0 or (again and tables.touching > 0):
                    defect(integration, model, time, h)
                memory[BEHIND] = carry(
                    model.linear, h, tableau.gamma, drift, k[count - 1], memory[BEHIND], share < 1.0, r, model.rate
                )
                memory[DRIFT] += h * weigh(integration.joints, width, drift)
                memory[OBJECT_DRIFT] += h * weigh(integration.objects, width, drift)
            if tables.touching and settle(tables, rows, model.work.paths, reached[2 * width :]):
                list_awake(tables, model.work.paths)
                _still(tables, model, integration)
            for c in range(size):
                x[c] = reached[c]
            memory[TIME] = end if last else time + h
            memory[LAST_STEP], memory[LAST_ERROR] = h, max(error, 1e-2)
            memory[ACCEPTED] += 1
            if not last or factor < 1.0:
                memory[STEP] = h * factor
            else:
                memory[STEP] = max(memory[STEP], h * factor)
            if whole > 0.0:
                # The step ends at a kink; the one before it says nothing of the next, which may be as long as before.
                memory[STEP], memory[LAST_STEP] = max(memory[STEP], whole), 0.0
                whole = 0.0
            if share < 1.0:
                memory[STEP] = min(memory[STEP], past_kink(h, share, cost, rtol, tableau))
            if taken[0] < times.size:
                times[taken[0]] = memory[TIME]
                for c in range(size):
                    stretch.states[taken[0], c] = x[c]
            rechart(tables, x, integration.attitude, drift)
            if taken[0] < times.size:
                for f in range(stretch.attitudes.shape[1]):
                    for c in range(4):
                        stretch.attitudes[taken[0], f, c] = integration.attitude[f, c]
                taken[0] += 1
            fresh = True
        else:
            whole = 0.0
            memory[REJECTED] += 1
            memory[CULPRIT] = -1.0
            memory[STEP] = h * min(factor, 0.9)
            if memory[STEP] < 1e-14 * max(1.0, abs(time)):
                memory[CULPRIT] = float(worst(x, k[count - 1], rtol, atol))
                return UNDERFLOW
    return DONE
