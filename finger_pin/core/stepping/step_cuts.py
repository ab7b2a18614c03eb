"""The share of a step that was tried that is taken: up to a little behind a kink, a reversal of sliding, a touch."""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.core.collision.continuous import survey
from finger_pin.core.jit import CompiledFunction, call_at, njit_always_inline, unpack
from finger_pin.core.model import MODEL
from finger_pin.core.stepping import rosenbrock as at
from finger_pin.core.stepping.interpolation import cut, interpolant
from finger_pin.core.stepping.kink_sides import crossing, passed, past_kink, price, strayed
from finger_pin.core.stepping.reversals import before_reversal, overloaded

# What a step that is cut at a kink keeps of its length at least and at most, and one that holds what runs away.
_SHORTEST, _LONGEST, _SHORTENED = 0.1, 0.9, 0.25


@CompiledFunction
def cut_step(address: int, h: float) -> int:
    """Cut a step that an `Integration` at an address has tried; fill its interpolant and the share that is taken."""
    integration = unpack(address, at.INTEGRATION)
    model, memory = unpack(integration.model, MODEL), integration.memory
    interpolant(integration.tableau, integration.k, integration.dense)
    part, kept, share = _kept_at_kinks(integration, model, h, int(memory[at.OUTCOME]))
    if kept == 1.0:
        before = _part_before_reversal(integration, model, part * h)
        if before < share:
            memory[at.AFTER], share = np.inf, 1.0
        part *= before
        if overloaded(integration, model) and part * h > 1e-12 * max(1.0, abs(memory[at.TIME])):
            kept = _SHORTENED * part
    memory[at.PART], memory[at.KEPT], memory[at.SHARE] = part, kept, share
    return 1


@CompiledFunction
def survey_step(address: int, _h: float) -> int:
    """Look for touches that no stage has seen in a step that an `Integration` at an address has tried."""
    integration = unpack(address, at.INTEGRATION)
    integration.memory[at.TOUCH] = survey(integration, unpack(integration.model, MODEL))
    return 1


@njit_always_inline
def _kept_at_kinks(integration: Any, model: Any, h: float, outcome: int) -> Any:
    """Return the share of a step that is taken, that of another try, and the share after which a row strays.

    Returns:
        The share that is taken, at the end of which the model's state is; 1, or how much to try next; and the share
        after which a row has left its side, or 1.
    """
    memory, time = integration.memory, integration.memory[at.TIME]
    share, dear, part = strayed(model.tables, model.work.rows, integration.kinks), False, 1.0
    # Of a step as short as this nothing can be cut, but the next one must still not be too long.
    long = h > 1e-12 * max(1.0, abs(time))
    if share < 1.0:
        # A row was held on a side that it has left: what that cost is an error too.
        memory[at.EVALUATIONS] += 2
        cost = price(integration, model, time + h, h)
        dear = not cost <= 1.0
        if dear and long and cost < np.inf:
            part, within, left, count = crossing(integration, model, time, h, share, cost)
            memory[at.EVALUATIONS] += count
            if part < 1.0:
                share, cost, dear = within, left, False
        memory[at.AFTER] = past_kink(part * h, share, cost, integration.rtol, integration.tableau)
    elif outcome == at.STRAYED:
        memory[at.EVALUATIONS] += 4
        share = passed(integration, model, time, h)
        dear = share < 1.0
    return part, min(_LONGEST, max(_SHORTEST, 1.02 * share)) if dear and long else 1.0, share


@njit_always_inline
def _part_before_reversal(integration: Any, model: Any, h: float) -> Any:
    """Let a step end a little behind the first reversal of sliding; return the share that is taken, 1 without one."""
    memory, part = integration.memory, before_reversal(integration, model, h)
    if part < 1.0:
        cut(integration.x, model.state, integration.dense, part)
        if model.tables.touching:
            # Gaps are looked for from those at its end.
            memory[at.EVALUATIONS] += 1
            call_at(model.evaluate, integration.model, memory[at.TIME] + part * h)
    return part
