"""Jumps of the derivatives over a period at kinks that the motion passes, where rates may jump.

A row that leaves its branch when its kink c passes zero has the rate f- before and f+ behind. Where a change makes that
earlier, f+ acts longer by grad c . V / c', with c' = grad c . f-, so that

    V <- V + (f+ - f-) (grad c . V + dc/dh) / c'

for what is held, h (Hiskens and Pai, "Trajectory sensitivity analysis of hybrid systems", IEEE Trans. Circuits Syst. I
47, 2000). A step ends a little behind its kink: to first order of that distance the same mends what J of the branch
that has been left misleads V by.
"""

from __future__ import annotations

from finger_pin.core.addresses.law_code import ROW
from finger_pin.core.jit import call_at, copy, njit_always_inline, njit_inline, unpack
from finger_pin.core.stepping.period_evaluations import PeriodArgs, evaluate_changed, evaluate_plain
from finger_pin.core.steps import integration as core
from finger_pin.core.steps.interpolation import interpolate_share
from finger_pin.core.tables.model import MODEL, Model

# Least jump of a rate that counts, in changes of the state for differences, per s: where derivatives are to be exact,
# and elsewhere.
_LEAST_JUMP, _LEAST_ROUGH_JUMP = 1.0, 1e7
# What Simpson's rule for the rate may miss, of the way that a number of the state goes, and of its change for
# differences, which is rounding.
_MISS, _ROUNDING = 1e-6, 1e-9
#: Least part of a step: as near as its end is behind a kink.
LEAST_PART = 1e-4


@njit_always_inline
def reach(period: PeriodArgs, integration: core.Integration, model: Model, step: float, share: float) -> float:
    """Evaluate a model at a share of a step that has just been taken; return the time there, s."""
    time = integration.memory.time[0] - (1.0 - share) * step
    interpolate_share(period.start, integration.x, integration.dense, share, period.state)
    copy(period.state, model.state)
    call_at(model.evaluate, integration.model, time)
    return time


@njit_always_inline
def bends(
    period: PeriodArgs, integration: core.Integration, model: Model, step: float, begin: float, part: float
) -> bool:
    """Return whether Simpson's rule for the rate misses a part of a step, as where a law bends unseen within it."""
    miss, way, size = period.right, period.gradient, period.start.size
    for i in range(size):
        miss[i] = way[i] = 0.0
    for node in range(3):
        weight, sign = step * part * (4.0 if node == 1 else 1.0) / 6.0, node - 1.0
        reach(period, integration, model, step, begin + 0.5 * node * part)
        for i in range(size):
            miss[i] += weight * model.rate[i] - sign * model.state[i]
            way[i] += weight * abs(model.rate[i])
    for i in range(size):
        if abs(miss[i]) > _MISS * way[i] + _ROUNDING * period.steps[i]:
            return True
    return False


@njit_inline
def _fill_gradient(period: PeriodArgs, column: int, k: int) -> float:
    """Fill the derivatives of a row's kink by the state and what is held; return its rate along ``period.start``."""
    state, steps, gradient, rate = period.state, period.steps, period.gradient, 0.0
    plain = unpack(period.plain, MODEL)
    evaluate_plain(period.plain, state, False)
    value = plain.work.rows[column, k]
    for c in range(gradient.size):
        changed = unpack(evaluate_changed(period, state, c, False), MODEL)
        gradient[c] = (changed.work.rows[column, k] - value) / steps[c]
    for c in range(state.size):
        rate += gradient[c] * period.start[c]
    return rate


@njit_always_inline
def _cross(period: PeriodArgs, integration: core.Integration, model: Model, column: int, k: int) -> None:
    """Take the derivatives over the kink of a row that has left its branch."""
    rows, derivatives, size = model.work.rows, period.derivatives, period.start.size
    least, most, side = _LEAST_JUMP if period.exact else _LEAST_ROUGH_JUMP, 0.0, rows[ROW.side, k]
    passed, jump = rows[column, k], period.right
    rows[ROW.side, k] = -side
    call_at(model.evaluate, integration.model, integration.memory.time[0])
    rows[ROW.side, k] = side
    for i in range(size):
        jump[i] = model.rate[i] - period.start[i]
        most = max(most, abs(jump[i]) / period.steps[i])
    if not most > least:
        return
    rate = _fill_gradient(period, column, k)
    # Of one that comes back to its kink it is not known when it has passed that.
    if not rate * passed > 0.0:
        return
    for c in range(derivatives.shape[1]):
        earlier = period.gradient[c] if c >= size else 0.0
        for i in range(size):
            earlier += period.gradient[i] * derivatives[i, c]
        earlier /= rate
        for i in range(size):
            derivatives[i, c] += jump[i] * earlier


@njit_inline
def cross_kinks(period: PeriodArgs, integration: core.Integration, model: Model) -> None:
    """Take the derivatives over the kinks that were passed in the step that has just been taken."""
    structure, rows, kinks, time = model.structure, model.work.rows, integration.kinks, integration.memory.time[0]
    copy(integration.x, model.state)
    copy(integration.x, period.state)
    call_at(model.evaluate, integration.model, time)
    copy(model.rate, period.start)
    for g in range(structure.groups.first.size):
        column = structure.groups.kink[g]
        if column < 0:
            continue
        for k in range(structure.groups.first[g], structure.groups.end[g]):
            if kinks[k] * rows[column, k] < 0.0 and not (k < structure.contact_rows and model.work.paths.culled[k]):
                _cross(period, integration, model, column, k)
                # The other rows, too, count from the rate before.
                call_at(model.evaluate, integration.model, time)
