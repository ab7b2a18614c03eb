"""Functions by which a model cuts an integrator's steps: a little behind a kink, a reversal of sliding, a touch."""

from __future__ import annotations

import numpy as np

from finger_pin.core.collision.broad_phase import activate_all_pairs, forget_culled, list_active_pairs, update_culling
from finger_pin.core.collision.continuous import MISSED_BY_CULLING, NOTHING_MISSED, detect_missed_contacts
from finger_pin.core.events.branches import (
    branch_error,
    freeze,
    left,
    left_share,
    locate_event,
    max_step_after_event,
    midpoint_violation,
    release,
)
from finger_pin.core.events.reversals import before_reversal, bristles_over_limit
from finger_pin.core.jit import CompiledFunction, call_at, njit_always_inline, unpack
from finger_pin.core.steps.integration import INTEGRATION, LEFT_BRANCH, Events, Integration
from finger_pin.core.steps.interpolation import cut_to_share, interpolant
from finger_pin.core.tables.model import MODEL, Model

# Derivations and origins: core/stepping/NOTES.md.
# Least and greatest length of another try that is to end at a kink, in parts of the step.
_MIN_RETRY_SHARE, _MAX_RETRY_SHARE = 0.1, 0.9
# Length of that try over the share at which the row leaves its branch, 1: it ends behind the kink, as cut steps do.
_RETRY_OVERSHOOT = 1.02
# Length of another try after a step that held an overloaded bristle, in parts of the step.
_OVERLOAD_RETRY_SHARE = 0.25
# Least length of a step that is cut, in parts of the time or s, whichever is more: 4,500 times the spacing of doubles.
_MIN_CUT_STEP = 1e-12


def step_events(contacts: bool) -> Events:
    """Return the functions of models with or without contacts; what is not needed is not compiled."""
    always, touching = (release, freeze, left, cut_step), (find_missed_contacts, cull_contacts, activate_contacts)
    return Events(*(unit.address for unit in always), *(unit.address if contacts else 0 for unit in touching))


@CompiledFunction
def cut_step(address: int, h: float) -> int:
    """Cut a step that an `Integration` at an address has tried; fill its interpolant and the shares taken and next."""
    integration = unpack(address, INTEGRATION)
    model, memory = unpack(integration.model, MODEL), integration.memory
    interpolant(integration)
    taken_share, retry_share, share = _accepted_shares(integration, model, h, int(memory.outcome[0]))
    if retry_share == 1.0:
        before = _part_before_reversal(integration, model, taken_share * h)
        if before < share:
            memory.max_next_step_size[0] = np.inf
        taken_share *= before
        if bristles_over_limit(integration, model) and taken_share * h > _MIN_CUT_STEP * max(1.0, abs(memory.time[0])):
            retry_share = _OVERLOAD_RETRY_SHARE * taken_share
    memory.taken_share[0], memory.retry_share[0] = taken_share, retry_share
    if retry_share == 1.0 and integration.events.detect:
        call_at(integration.events.detect, address, h)
    return 1


@CompiledFunction
def find_missed_contacts(address: int, _h: float) -> int:
    """Cut a tried step of an `Integration` at an unseen touch, or activate the culled pairs that may have closed."""
    integration = unpack(address, INTEGRATION)
    model, memory = unpack(integration.model, MODEL), integration.memory
    touch = detect_missed_contacts(integration, model)
    if touch == MISSED_BY_CULLING:
        list_active_pairs(model.structure, model.work.paths)
        memory.stale[0] = 1.0
    elif touch < NOTHING_MISSED:
        # Of a touch nothing has seen the next step's end is inside, and sees it.
        memory.retry_share[0] = memory.taken_share[0] * touch
    return 1


@CompiledFunction
def cull_contacts(address: int, _time: float) -> int:
    """Cull and activate contact pairs at the end of a step; clear the states of culled ones in all vectors."""
    integration = unpack(address, INTEGRATION)
    model = unpack(integration.model, MODEL)
    structure, paths, first = model.structure, model.work.paths, 2 * model.linear.mass.shape[0]
    if update_culling(structure, model.parameters, model.work, model.state[first:]):
        list_active_pairs(structure, paths)
        forget_culled(structure, paths, first, integration.start)
        forget_culled(structure, paths, first, model.rate)
        for j in range(integration.k.shape[0]):
            forget_culled(structure, paths, first, integration.k[j])
        for j in range(integration.dense.shape[0]):
            forget_culled(structure, paths, first, integration.dense[j])
    return 1


@CompiledFunction
def activate_contacts(address: int, _time: float) -> int:
    """Make all contact pairs of an `Integration`'s model active: what another run could cull may be close in it."""
    model = unpack(unpack(address, INTEGRATION).model, MODEL)
    activate_all_pairs(model.structure, model.work)
    return 1


@njit_always_inline
def _accepted_shares(integration: Integration, model: Model, h: float, outcome: int) -> tuple[float, float, float]:
    """Return the shares of a step that is taken, for another try, and until a row leaves its branch.

    Returns:
        The share that is taken, at the end of which the model's state is; 1, or how much to try next; and the share
        after which a row has left its side, or 1.
    """
    memory, time = integration.memory, integration.memory.time[0]
    share, dear, part = left_share(model.structure, model.work, integration.kinks), False, 1.0
    # Of a step as short as this nothing can be cut, but the next one must still not be too long.
    long = h > _MIN_CUT_STEP * max(1.0, abs(time))
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
    elif outcome == LEFT_BRANCH:
        memory.evaluations[0] += 4
        share = midpoint_violation(integration, model, time, h)
        dear = share < 1.0
    return part, min(_MAX_RETRY_SHARE, max(_MIN_RETRY_SHARE, _RETRY_OVERSHOOT * share)) if dear and long else 1.0, share


@njit_always_inline
def _part_before_reversal(integration: Integration, model: Model, h: float) -> float:
    """End a step a little behind the first reversal of sliding; return the share that is taken, 1 without one."""
    memory, part = integration.memory, before_reversal(integration, model, h)
    if part < 1.0:
        cut_to_share(integration, model.state, part)
        if model.structure.contact_rows:
            # Gaps are looked for from those at its end.
            memory.evaluations[0] += 1
            call_at(model.evaluate, integration.model, memory.time[0] + part * h)
    return part
