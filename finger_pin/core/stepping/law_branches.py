"""Rows that are held on one side of their law's kink during a step, so that what is integrated is smooth."""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.core.evaluation.law_code import SIDE
from finger_pin.core.jit import call_at, compiled
from finger_pin.core.stepping.error_norm import step_error
from finger_pin.core.stepping.interpolation import bend_of_stages
from finger_pin.core.tables import END, FIRST, KINK

# A step after a kink that is rejected costs as much as two that grow.
_SHARE = 0.25


@compiled
def release(tables: Any, rows: Any) -> None:
    """Let all rows follow the motion."""
    for g in range(tables.groups.shape[0]):
        if tables.groups[g, KINK] >= 0:
            for k in range(tables.groups[g, FIRST], tables.groups[g, END]):
                rows[SIDE, k] = 0.0


@compiled
def hold(tables: Any, rows: Any, kinks: Any) -> None:
    """Hold all rows on the side of their kink where they are."""
    for g in range(tables.groups.shape[0]):
        column = tables.groups[g, KINK]
        if column >= 0:
            for k in range(tables.groups[g, FIRST], tables.groups[g, END]):
                kinks[k] = rows[column, k]
                rows[SIDE, k] = np.sign(rows[column, k])


@compiled
def strayed(tables: Any, rows: Any, kinks: Any) -> Any:
    """Return the least share of the step after which a held row has left its side; 1 if none has."""
    share = 1.0
    for g in range(tables.groups.shape[0]):
        column = tables.groups[g, KINK]
        if column >= 0:
            for k in range(tables.groups[g, FIRST], tables.groups[g, END]):
                if rows[SIDE, k] * rows[column, k] < 0.0:
                    share = min(share, kinks[k] / (kinks[k] - rows[column, k]))
    return share


@compiled
def turn(tables: Any, rows: Any, kinks: Any) -> None:
    """Turn the held rows that have left their side."""
    for g in range(tables.groups.shape[0]):
        column = tables.groups[g, KINK]
        if column >= 0:
            for k in range(tables.groups[g, FIRST], tables.groups[g, END]):
                if kinks[k] * rows[column, k] < 0.0:
                    rows[SIDE, k] = -rows[SIDE, k]


@compiled
def price(integration: Any, model: Any, time: float, h: float, r: Any) -> Any:
    """Return what it costs that rows are held on a side that they have left, as a multiple of the tolerance."""
    tables, rows, kinks, size = model.tables, model.work.rows, integration.kinks, integration.x.size
    call_at(model.evaluate, integration.model, time)
    turn(tables, rows, kinks)
    for c in range(size):
        r[c] = model.rate[c]
    call_at(model.evaluate, integration.model, time)
    turn(tables, rows, kinks)
    for c in range(size):
        r[c] = h * (model.rate[c] - r[c])
    return step_error(integration.x, model.state, r, integration.rtol, integration.atol)


@compiled
def past_kink(h: float, share: float, cost: float, rtol: float, tableau: Any) -> Any:
    """Return how long the step after a kink may be, s.

    Stiff methods damp what they are too long for, and both of a pair alike: of a vibration of y radians in a step the
    difference is at most radian y^order, and falls again as 1 / y. An impact would be swallowed. So the step has a
    share of those radians by which the difference is the tolerance; one of more would be rejected if the difference
    told. The jump of the rates, `cost` over the step, has grown over its last 1 - share. Growing on, it adds
    cost (t / h)^2 / (2 (1 - share)) tolerances; an impact, which turns a speed back, y^2 / 2 of that speed, and so at
    most y^2 / (2 rtol) tolerances. Of a slower one the difference tells, but for speeds of a few tolerances.
    """
    radians = _SHARE * (rtol / tableau.radian) ** (1.0 / tableau.order)
    return h * radians * np.sqrt((1.0 - share) / max(rtol * cost, 1e-300))


@compiled
def passed(integration: Any, model: Any, time: float, h: float, r: Any) -> Any:
    """Return the share of a step after which a row has left its side in the middle, if that costs too much; else 1.

    A row that is back at the end would not be seen there.
    """
    tableau, x, k, state = integration.tableau, integration.x, integration.k, model.state
    last, size = tableau.nodes.size - 1, x.size
    for c in range(size):
        state[c] = 0.5 * (x[c] + state[c] + 0.5 * bend_of_stages(tableau, k, c, 0.5))
    call_at(model.evaluate, integration.model, time + 0.5 * h)
    share = strayed(model.tables, model.work.rows, integration.kinks)
    if share < 1.0 and price(integration, model, time + 0.5 * h, h, r) <= 1.0:
        share = 1.0
    for c in range(size):
        state[c] = x[c]
    for j in range(last):
        of_stage = tableau.stage[last, j]
        for c in range(size):
            state[c] += of_stage * k[j, c]
    for c in range(size):
        state[c] += k[last, c]
    call_at(model.evaluate, integration.model, time + h)
    return share if share == 1.0 else 0.5 * share
