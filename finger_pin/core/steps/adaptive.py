"""Adaptive step lengths, compiled: acceptance of steps, their record, and the length of the next."""

from __future__ import annotations

import numpy as np

from finger_pin.core.evaluation.attitude_charts import rechart
from finger_pin.core.jit import CompiledFunction, call_at, copy, copy_matrix, njit_always_inline, njit_inline, unpack
from finger_pin.core.steps import integration as at
from finger_pin.core.steps.error_norm import largest_error_state, step_error
from finger_pin.core.steps.integration import AdvanceArgs, Integration
from finger_pin.core.steps.rosenbrock import try_step
from finger_pin.core.tables.inputs import HELD
from finger_pin.core.tables.model import MODEL, Model

_SAFETY, _SHRINK, _GROW = 0.9, 0.2, 6.0


@njit_always_inline
def _begin(integration: Integration, model: Model, end: float) -> None:
    """Prepare to advance to a time."""
    memory, control = integration.memory, model.control
    memory.fresh[0], memory.uncut_step_size[0] = 1.0, 0.0
    # Right after a full record nothing has jumped.
    jumped = control.kind == HELD and memory.continued[0] == 0.0
    memory.jumped[0], memory.continued[0] = 1.0 * jumped, 0.0
    if jumped and memory.held_step_size[0] > 0.0:
        # Held tensions have just jumped: what sufficed after the last jump is the best guess.
        memory.step_size[0], memory.last_step_size[0] = memory.held_step_size[0], 0.0
    if memory.goal[0] != end:
        memory.goal[0], memory.window_end[0] = end, 0.0


@njit_always_inline
def _stop_status(integration: Integration, width: int) -> int:
    """Return `RUNAWAY` or `STALLED` if the integration should be abandoned, else `DONE`."""
    memory, x = integration.memory, integration.x
    if memory.fresh[0] > 0.0:
        for c in range(width, 2 * width):
            if abs(x[c]) > at.FASTEST:
                memory.limiting_state[0] = c
                return at.RUNAWAY
    tries = memory.accepted_steps[0] + memory.rejected_steps[0]
    if tries >= memory.window_end[0]:
        if memory.window_end[0] > 0.0 and memory.time[0] - memory.window_start[0] < at.WINDOW * at.LEAST_MEAN_STEP:
            _note_limiting_state(integration)
            return at.STALLED
        memory.window_start[0], memory.window_end[0] = memory.time[0], tries + at.WINDOW
    return at.DONE


@njit_inline
def _note_limiting_state(integration: Integration) -> None:
    """Store the index of the state with the largest error."""
    k = integration.k
    worst_state = largest_error_state(integration.x, k[k.shape[0] - 1], integration.rtol, integration.atol)
    integration.memory.limiting_state[0] = float(worst_state)


@njit_inline
def try_counted(address: int, integration: Integration, model: Model, h: float) -> int:
    """Try a step and count its evaluations; return the outcome of `try_step`."""
    memory = integration.memory
    fresh, count = memory.fresh[0] > 0.0, integration.tableau.nodes.size
    outcome = try_step(address, integration, model, memory.time[0], h, fresh)
    if outcome == at.NOT_FINITE_AT_START:
        for c in range(integration.x.size - 1, -1, -1):
            if not np.isfinite(integration.start[c]):
                memory.limiting_state[0] = c
        return outcome
    memory.jacobians[0] += fresh
    memory.factorisations[0] += 1
    memory.evaluations[0] += count if fresh or integration.reevaluate else count - 1
    # What follows a kink follows from this try alone.
    memory.fresh[0], memory.max_next_step_size[0] = 0.0, np.inf
    return outcome


@njit_inline
def _fitting(integration: Integration, error: float) -> float:
    """Return the factor by which a step is lengthened so that its error fits the tolerance."""
    if not error <= 1e30:
        return 0.1
    return min(_GROW, max(_SHRINK, _SAFETY * max(error, 1e-10) ** (-1.0 / integration.tableau.order)))


@njit_always_inline
def _growth(integration: Integration, h: float, error: float, clipped: bool) -> float:
    """Return the factor by which the step after an accepted one may be longer."""
    memory, factor = integration.memory, _fitting(integration, error)
    if memory.last_step_size[0] > 0.0 and not clipped:
        # Gustafsson's predictive controller: the error's trend counts too, unless the end cut the step.
        trend = (memory.last_error[0] / max(error, 1e-10) ** 2) ** (1.0 / integration.tableau.order)
        factor = min(factor, max(_SHRINK, _SAFETY * h / memory.last_step_size[0] * trend))
    # Right after a rejection the step does not grow.
    return min(factor, 1.0) if memory.rejected[0] > 0.0 else factor


@njit_inline
def _shorten(integration: Integration, h: float, whole: float) -> None:
    """Reject a try, and set the shorter size of the next one and the size before a cut at a kink."""
    memory = integration.memory
    memory.rejected_steps[0] += 1
    memory.rejected[0], memory.step_size[0], memory.uncut_step_size[0] = 1.0, h, whole


@njit_always_inline
def _pace(integration: Integration, h: float, error: float, final: bool, clipped: bool) -> None:
    """Count an accepted step, and set the size of the next."""
    memory = integration.memory
    factor = _growth(integration, h, error, clipped)
    if memory.jumped[0] > 0.0 and not clipped:
        memory.held_step_size[0] = h * min(factor, 3.0)
    memory.step_size[0] = max(memory.step_size[0], h * factor) if final and factor >= 1.0 else h * factor
    memory.last_step_size[0], memory.last_error[0] = h, max(error, 1e-2)
    if memory.uncut_step_size[0] > 0.0:
        # The step ends at a kink; the one before it says nothing of the next, which may be as long as before.
        memory.step_size[0], memory.last_step_size[0] = max(memory.step_size[0], memory.uncut_step_size[0]), 0.0
    memory.step_size[0] = min(memory.step_size[0], memory.max_next_step_size[0])
    memory.accepted_steps[0] += 1
    memory.fresh[0], memory.jumped[0] = 1.0, 0.0
    memory.rejected[0], memory.uncut_step_size[0] = 0.0, 0.0


@njit_always_inline
def accept_step(args: AdvanceArgs, integration: Integration, model: Model, time: float) -> None:
    """Move to the end of an accepted step, and store the step if there is a record."""
    x, attitude, row = integration.x, integration.attitude, args.record_range[0]
    if row < args.times.size:
        # What is settled may be zero from here on.
        copy_matrix(integration.dense, args.dense[row])
    if integration.events.settle:
        call_at(integration.events.settle, args.integration, 0.0)
    copy(model.state, x)
    integration.memory.time[0] = time
    if row < args.times.size:
        args.times[row] = time
        copy(x, args.states[row])
        copy(integration.kinks, args.branches[row])
        args.shares[row] = integration.memory.taken_share[0]
    rechart(model.structure, model.parameters, x, attitude)
    if row < args.times.size:
        for f in range(attitude.shape[0]):
            for c in range(4):
                args.attitudes[row, f, c] = attitude[f, c]
        args.record_range[0] += 1


@CompiledFunction
def advance(address: int, end: float) -> int:
    """Advance the `AdvanceArgs` at an address to a time, s, or until its record is full; return a status."""
    args = unpack(address, at.ADVANCE_ARGS)
    integration = unpack(args.integration, at.INTEGRATION)
    model, memory = unpack(integration.model, MODEL), integration.memory
    _begin(integration, model, end)
    while memory.time[0] < end:
        status = _stop_status(integration, model.linear.mass.shape[0])
        if status != at.DONE:
            return status
        if args.times.size > 0 and args.record_range[0] == args.record_range[1]:
            memory.continued[0] = 1.0
            return at.FULL
        time, h = memory.time[0], memory.step_size[0]
        final = time + 1.01 * h >= end
        clipped = final and end - time < h
        if final:
            h = end - time
        outcome = try_counted(args.integration, integration, model, h)
        if outcome == at.NOT_FINITE_AT_START:
            return at.NOT_FINITE
        error = np.inf
        if outcome != at.SINGULAR:
            error = step_error(integration, model.state, integration.k[-1])
        if not error <= 1.0:
            _shorten(integration, h * min(_fitting(integration, error), 0.9), 0.0)
            if memory.step_size[0] < 1e-14 * max(1.0, abs(time)):
                _note_limiting_state(integration)
                return at.UNDERFLOW
            continue
        memory.outcome[0], memory.stale[0] = outcome, 0.0
        call_at(integration.events.cut, args.integration, h)
        retry_share, taken_share = memory.retry_share[0], memory.taken_share[0]
        if memory.stale[0] > 0.0:
            memory.fresh[0] = 1.0
        elif retry_share < 1.0:
            _shorten(integration, h * retry_share, max(memory.uncut_step_size[0], h))
        else:
            accept_step(args, integration, model, end if final and taken_share == 1.0 else time + taken_share * h)
            _pace(integration, h, error, final, clipped)
    return at.DONE
