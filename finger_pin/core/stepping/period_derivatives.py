"""The map over a period with inputs and forces held, and its derivatives, along the steps that the integrator takes.

Over a step of length h at whose start J and b are the derivatives of the rate by the state and by what is held, the
derivatives V of the state follow V' = J V + b. With W = (1 - J / g)^-1 of the step's own system, g = 1 / (gamma h),

    Y_0 = V,  Y_k = W (Y_(k-1) + b / g),  V <- sum of a_k Y_k,  k = 0 ... 3,

which is of second order in h for the weights of `_fill_weights` (W^k = sum of binomial(k + i - 1, i) (J / g)^i) and
damps what is stiff. J and b are those of the step's start: what they change within the step is the error. Steps end
where the motion passes a kink, across which the rate is continuous, so that when a changed motion passes it does not
count.
"""

from __future__ import annotations

from typing import NamedTuple

from finger_pin.core.addresses.law_code import ROW
from finger_pin.core.evaluation.condensation import solve
from finger_pin.core.jit import (
    CompiledFunction,
    IndexTable,
    Indices,
    Layers,
    Matrix,
    StructType,
    Vector,
    call_at,
    copy,
    copy_matrix,
    njit_always_inline,
    njit_inline,
    unpack,
)
from finger_pin.core.signals.state_batches import exert_alone
from finger_pin.core.steps import integration as core
from finger_pin.core.tables.linear_systems import Linear
from finger_pin.core.tables.model import MODEL, Model

# Least share of a step, over gamma, over which the method of second order is A-stable: |R(i y)| <= 1 for all y.
_LEAST_SHARE = 0.459


class PeriodArgs(NamedTuple):
    """Arguments of `advance_period` for n states, u inputs, t tips and p parameters; m = u + 3 t + p.

    Attributes:
        advance: Address of the function that advances an integration.
        args: Address of its `AdvanceArgs`, with room for one step.
        plain: Address of a `Model` of the same inputs and forces, for evaluations alone.
        varied: Addresses of such models with one parameter changed each, shape (p,).
        derivatives: Filled: of the state at the end by that at the start and what is held, shape (n, n + m).
        held: Memory, b, shape (n, m).
        inverse: Memory, W, shape (n, n).
        terms: Memory for Y_(k-1) + b / g and Y_k, shape (2 n, n + m).
        weights: Memory, a_k, shape (4,).
        right: Memory, shape (n + 1,).
        steps: By how much each number of the state, and of what is held, is changed for differences, shape (n + m,).
        weights_of_rows: Weights of forces and inputs of the rows in the signals that are watched, shape (2, K, k).
        watched: Filled by `fill_watched`: these signals at the state, shape (k,).
        slopes: Filled by it: their derivatives by the state and what is held, shape (k, n + m).
        bristles: Places of bristles in the state, their rows, and columns of the rows' levels, shape (b, 3).
        levels: Filled by `limit_bristles`: their levels, infinite for all other numbers of the state, shape (n,).
    """

    advance: int
    args: int
    plain: int
    varied: Indices
    derivatives: Matrix
    held: Matrix
    inverse: Matrix
    terms: Matrix
    weights: Vector
    right: Vector
    steps: Vector
    weights_of_rows: Layers
    watched: Vector
    slopes: Matrix
    bristles: IndexTable
    levels: Vector


PERIOD_ARGS = StructType(PeriodArgs)


@njit_inline
def _evaluate(address: int, state: Vector, rates: bool) -> None:
    """Evaluate a model at a state, or its rows alone, which takes less."""
    model = unpack(address, MODEL)
    copy(state, model.state)
    if rates:
        call_at(model.evaluate, address, 0.0)
    else:
        copy(model.control.tension, model.work.command)
        exert_alone(model, address, 0.0)


@njit_inline
def _evaluate_changed(period: PeriodArgs, state: Vector, column: int, rates: bool) -> int:
    """Evaluate at a state with what is held changed in one number; return the address of the model that has."""
    plain = unpack(period.plain, MODEL)
    inputs, forces, step = plain.control.tension, plain.parameters.tip_force, period.steps[state.size + column]
    if column < inputs.size:
        value = inputs[column]
        inputs[column] = value + step
        _evaluate(period.plain, state, rates)
        inputs[column] = value
        return period.plain
    column -= inputs.size
    if column < 3 * forces.shape[0]:
        value = forces[column // 3, column % 3]
        forces[column // 3, column % 3] = value + step
        _evaluate(period.plain, state, rates)
        forces[column // 3, column % 3] = value
        return period.plain
    address = period.varied[column - 3 * forces.shape[0]]
    _evaluate(address, state, rates)
    return address


@njit_inline
def _fill_held(period: PeriodArgs, state: Vector) -> None:
    """Fill b at a state: derivatives of the rate by inputs, forces and parameters."""
    held, size = period.held, period.held.shape[0]
    plain = unpack(period.plain, MODEL)
    _evaluate(period.plain, state, True)
    for i in range(size):
        for c in range(held.shape[1]):
            held[i, c] = plain.rate[i]
    for c in range(held.shape[1]):
        changed = unpack(_evaluate_changed(period, state, c, True), MODEL)
        for i in range(size):
            held[i, c] = (changed.rate[i] - held[i, c]) / period.steps[size + c]


@njit_inline
def _fill_weights(share: float, weights: Vector) -> None:
    """Fill a_0 to a_3 for a share of the step, over gamma: sum a_k W^k is exp(share J / g) to second or first order."""
    for k in range(4):
        weights[k] = 0.0
    if share < _LEAST_SHARE:
        weights[0], weights[1] = 1.0 - share, share
        return
    weights[3] = 0.5 * share * share - 2.0 * share + 1.0
    weights[2] = share - 1.0 - 2.0 * weights[3]
    weights[1] = 1.0 - weights[2] - weights[3]


@njit_inline
def _fill_inverse(linear: Linear, right: Vector, solution: Vector, inverse: Matrix) -> None:
    """Fill W of the last system that was solved; states of culled contacts do not act."""
    size, shift = inverse.shape[0], linear.inverse_shift[0]
    for c in range(size):
        for i in range(size + 1):
            right[i] = 0.0
        for i in range(size):
            solution[i] = 0.0
        right[c] = 1.0 / shift
        solve(linear, right, solution)
        for i in range(size):
            inverse[i, c] = solution[i]


@njit_inline
def _multiply(first: Matrix, second: Matrix, product: Matrix) -> None:
    """Fill a product of matrices; entries of the first that are zero cost nothing."""
    for i in range(first.shape[0]):
        for c in range(second.shape[1]):
            product[i, c] = 0.0
        for k in range(first.shape[1]):
            factor = first[i, k]
            if factor != 0.0:
                for c in range(second.shape[1]):
                    product[i, c] += factor * second[k, c]


@njit_always_inline
def _propagate(period: PeriodArgs, integration: core.Integration, model: Model, step: float) -> None:
    """Take the derivatives along over a step that has just been taken, s."""
    derivatives, held, inverse, weights = period.derivatives, period.held, period.inverse, period.weights
    size, shift = inverse.shape[0], model.linear.inverse_shift[0]
    _fill_inverse(model.linear, period.right, integration.end, inverse)
    _fill_weights(step / shift, weights)
    right, product = period.terms[:size], period.terms[size:]
    copy_matrix(derivatives, product)
    for i in range(size):
        for c in range(derivatives.shape[1]):
            derivatives[i, c] *= weights[0]
    for k in range(1, 4):
        if weights[k] == 0.0:
            continue
        copy_matrix(product, right)
        for i in range(size):
            for c in range(held.shape[1]):
                right[i, size + c] += held[i, c] * shift
        _multiply(inverse, right, product)
        for i in range(size):
            for c in range(derivatives.shape[1]):
                derivatives[i, c] += weights[k] * product[i, c]


@CompiledFunction
def advance_period(address: int, end: float) -> int:
    """Advance the `PeriodArgs` at an address to a time, s, and fill the derivatives; return a status."""
    period = unpack(address, PERIOD_ARGS)
    args = unpack(period.args, core.ADVANCE_ARGS)
    integration = unpack(args.integration, core.INTEGRATION)
    model, memory = unpack(integration.model, MODEL), integration.memory
    for i in range(period.derivatives.shape[0]):
        for c in range(period.derivatives.shape[1]):
            period.derivatives[i, c] = 1.0 * (i == c)
    if integration.events.forget:
        call_at(integration.events.forget, args.integration, 0.0)
    while memory.time[0] < end:
        start = memory.time[0]
        _fill_held(period, integration.x)
        args.record_range[0] = 0
        status = call_at(period.advance, period.args, end)
        if status != core.DONE and status != core.FULL:
            return status
        _propagate(period, integration, model, memory.time[0] - start)
    return core.DONE


@CompiledFunction
def limit_bristles(address: int, _time: float) -> int:
    """Bring the bristles of the `PeriodArgs` at an address back to their levels, which steady sliding does not pass."""
    period = unpack(address, PERIOD_ARGS)
    integration = unpack(unpack(period.args, core.ADVANCE_ARGS).integration, core.INTEGRATION)
    rows = unpack(period.plain, MODEL).work.rows
    _evaluate(period.plain, integration.x, False)
    for b in range(period.bristles.shape[0]):
        place, level = period.bristles[b, 0], rows[period.bristles[b, 2], period.bristles[b, 1]]
        integration.x[place], period.levels[place] = min(max(integration.x[place], -level), level), level
    return 1


@njit_inline
def _sum_rows(period: PeriodArgs, address: int, signal: int) -> float:
    """Return a signal that is watched, after an evaluation of a model."""
    rows, weights, total = unpack(address, MODEL).work.rows, period.weights_of_rows, 0.0
    for k in range(rows.shape[1]):
        total += weights[0, k, signal] * rows[ROW.force, k] + weights[1, k, signal] * rows[ROW.command, k]
    return total


@CompiledFunction
def fill_watched(address: int, _time: float) -> int:
    """Fill the signals that are watched of the `PeriodArgs` at an address, and their derivatives."""
    period = unpack(address, PERIOD_ARGS)
    state = unpack(unpack(period.args, core.ADVANCE_ARGS).integration, core.INTEGRATION).x
    size, signals, source = state.size, period.watched.size, period.plain
    _evaluate(source, state, False)
    for s in range(signals):
        period.watched[s] = _sum_rows(period, source, s)
    for c in range(period.steps.size):
        if c < size:
            value = state[c]
            state[c] = value + period.steps[c]
            _evaluate(source, state, False)
            state[c] = value
            changed = source
        else:
            changed = _evaluate_changed(period, state, c - size, False)
        for s in range(signals):
            period.slopes[s, c] = (_sum_rows(period, changed, s) - period.watched[s]) / period.steps[c]
    return 1
