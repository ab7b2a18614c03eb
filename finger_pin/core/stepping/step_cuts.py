"""The share of a step that was tried that is taken: up to a little behind a kink, a reversal of sliding, a touch."""

from __future__ import annotations

import numpy as np

from finger_pin.core.collision.continuous import detect_missed_contacts
from finger_pin.core.jit import CompiledFunction, call_at, njit_always_inline, unpack
from finger_pin.core.model import MODEL, Model
from finger_pin.core.stepping import rosenbrock as at
from finger_pin.core.stepping.interpolation import cut, interpolant
from finger_pin.core.stepping.kink_sides import (
    branch_error,
    left_branch,
    locate_event,
    max_step_after_event,
    midpoint_violation,
)
from finger_pin.core.stepping.reversals import before_reversal, bristles_over_limit
from finger_pin.core.stepping.rosenbrock import Integration

# What a step that is cut at a kink keeps of its length at least and at most, and one that holds what runs away.
_SHORTEST, _LONGEST, _SHORTENED = 0.1, 0.9, 0.25


@CompiledFunction
def cut_step(address: int, h: float) -> int:
    """Cut a step that an `Integration` at an address has tried; fill its interpolant and the share that is taken."""
    integration = unpack(address, at.INTEGRATION)
    model, memory = unpack(integration.model, MODEL), integration.memory
    interpolant(integration.tableau, integration.k, integration.dense)
    part, kept, share = _kept_at_kinks(integration, model, h, int(memory.outcome[0]))
    if kept == 1.0:
        before = _part_before_reversal(integration, model, part * h)
        if before < share:
            memory.max_next_step_size[0], share = np.inf, 1.0
        part *= before
        if bristles_over_limit(integration, model) and part * h > 1e-12 * max(1.0, abs(memory.time[0])):
            kept = _SHORTENED * part
    memory.taken_share[0], memory.retry_share[0], memory.left_share[0] = part, kept, share
    return 1


@CompiledFunction
def find_missed_contacts(address: int, _h: float) -> int:
    """Detect missed contacts in the step that an `Integration` at an address has tried."""
    integration = unpack(address, at.INTEGRATION)
    integration.memory.touch_share[0] = detect_missed_contacts(integration, unpack(integration.model, MODEL))
    return 1


@njit_always_inline
def _kept_at_kinks(integration: Integration, model: Model, h: float, outcome: int) -> tuple[float, float, float]:
    """Return the shares of a step that is taken, for another try, and until a row leaves its branch.

    Returns:
        The share that is taken, at the end of which the model's state is; 1, or how much to try next; and the share
        after which a row has left its side, or 1.
    """
    memory, time = integration.memory, integration.memory.time[0]
    share, dear, part = left_branch(model.tables, model.work.rows, integration.kinks), False, 1.0
    # Of a step as short as this nothing can be cut, but the next one must still not be too long.
    long = h > 1e-12 * max(1.0, abs(time))
    if share < 1.0:
        # A row was held on a side that it has left: what that cost is an error too.
        memory.evaluations[0] += 2
        cost = branch_error(integration, model, time + h, h)
        dear = not cost <= 1.0
        if dear and long and cost < np.inf:
            part, within, left, count = locate_event(integration, model, time, h, share, cost)
            memory.evaluations[0] += count
            if part < 1.0:
                share, cost, dear = within, left, False
        memory.max_next_step_size[0] = max_step_after_event(
            part * h, share, cost, integration.rtol, integration.tableau
        )
    elif outcome == at.LEFT_BRANCH:
        memory.evaluations[0] += 4
        share = midpoint_violation(integration, model, time, h)
        dear = share < 1.0
    return part, min(_LONGEST, max(_SHORTEST, 1.02 * share)) if dear and long else 1.0, share


@njit_always_inline
def _part_before_reversal(integration: Integration, model: Model, h: float) -> float:
    """End a step a little behind the first reversal of sliding; return the share that is taken, 1 without one."""
    memory, part = integration.memory, before_reversal(integration, model, h)
    if part < 1.0:
        cut(integration.x, model.state, integration.dense, part)
        if model.tables.contact_rows:
            # Gaps are looked for from those at its end.
            memory.evaluations[0] += 1
            call_at(model.evaluate, integration.model, memory.time[0] + part * h)
    return part
