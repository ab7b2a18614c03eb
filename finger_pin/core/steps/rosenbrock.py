"""Rosenbrock step with the exact Jacobian, compiled; there are no Newton iterations."""

from __future__ import annotations

import numpy as np

from finger_pin.core.evaluation.condensation import solve
from finger_pin.core.jit import call_at, njit_always_inline
from finger_pin.core.steps.integration import LEFT_BRANCH, NOT_FINITE_AT_START, SINGULAR, TRIED, Integration
from finger_pin.core.tables.model import Model


@njit_always_inline
def _begin_stage(integration: Integration, model: Model, i: int, h: float, begin: int, end: int) -> None:
    """Fill the state of a stage, and in r what those before add to its rate, in a part of the state."""
    tableau, x, k, r, start = integration.tableau, integration.x, integration.k, integration.r, integration.start
    state, rate = model.state, model.rate
    for c in range(begin, end):
        r[c], rate[c], state[c] = 0.0, start[c], x[c]
    # Whole rows at a time, so that the compiler can use vector instructions.
    for j in range(i):
        stage_weight, coupling_weight = tableau.stage[i, j], tableau.coupling[i, j] / h
        for c in range(begin, end):
            state[c] += stage_weight * k[j, c]
            r[c] += coupling_weight * k[j, c]


@njit_always_inline
def try_step(address: int, integration: Integration, model: Model, time: float, h: float, fresh: bool) -> int:
    """Try one step: fill the increments k and, in model.state, the state at its end.

    What depends on the start alone, f(t, x) and the linearisation, is kept for a second try.

    Returns:
        `TRIED`; `LEFT_BRANCH`, if at a stage a branch is left that is frozen; `SINGULAR`, if g - J is;
        `NOT_FINITE_AT_START`, if f(t, x) is not finite.
    """
    tableau, k, r, start, live = integration.tableau, integration.k, integration.r, integration.start, integration.live
    size, state, rate, events = start.size, model.state, model.rate, integration.events
    # Mostly all of the state is live: loops from zero to its size are the fastest.
    parts = integration.live_count[0]
    g = 1.0 / (h * tableau.gamma)
    outcome = TRIED
    for i in range(tableau.nodes.size):
        if parts == 1:
            _begin_stage(integration, model, i, h, 0, size)
        else:
            for part in range(parts):
                _begin_stage(integration, model, i, h, live[part, 0], live[part, 1])
        if i == 0 and fresh:
            call_at(events.release, address, 0.0)
        if i > 0 or fresh or integration.reevaluate:
            call_at(model.evaluate, integration.model, time + tableau.nodes[i] * h)
        if i == 0:
            if fresh:
                for c in range(size):
                    start[c] = rate[c]
                    if not np.isfinite(rate[c]):
                        return NOT_FINITE_AT_START
                call_at(events.freeze, address, 0.0)
                call_at(model.linearise, integration.model, time)
            if call_at(model.condense, integration.model, g) == 0:
                return SINGULAR
        elif i < tableau.nodes.size - 1 and call_at(events.left, address, 0.0):
            outcome = LEFT_BRANCH
        for c in range(size):
            r[c] += rate[c]
        r[size] = h * tableau.time[i]
        solve(model.linear, r, k[i])
    for c in range(size):
        state[c] += k[tableau.nodes.size - 1, c]
    return outcome
