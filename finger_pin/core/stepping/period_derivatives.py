"""The map over a period with inputs and forces held, and its derivatives, along the steps that the integrator takes.

Over a step of length h at whose start J and b are the derivatives of the rate by the state and by what is held, the
derivatives V of the state follow V' = J V + b. With W = (1 - J / g)^-1 of the step's own system, g = 1 / (gamma h),

    D_1 = W (V + b / g) - V,  D_k = W D_(k-1) - D_(k-1),  V <- V + sum of c_k D_k,  k = 1 ... p + 1,

which is of order p in g h: with s = g h, exp(s (W - 1) / W) = sum of L_k(s) (1 - W)^k by the generating function of
Laguerre polynomials L_k of parameter -1, and the last c makes the sum zero where W is, which damps what is stiff. J and
b are those of the step's start: what they change within the step is the error, of first order in h. Where derivatives
are to be exact, the first sixth of a step has those of its start, the next two thirds those of its middle, and the last
those of its end, on the branches of kinks on which it was taken: Simpson's rule for what they change. Where that rule
misses a part of the way that the state goes, as laws may bend where no step ends, the step is halved until it does not.
Steps end where the motion passes a kink; `period_kinks` has what derivatives gain there.
"""

from __future__ import annotations

from finger_pin.core.addresses.law_code import ROW
from finger_pin.core.evaluation.condensation import solve
from finger_pin.core.evaluation.rigid_body_dynamics import solve_mass
from finger_pin.core.jit import (
    CompiledFunction,
    Matrix,
    Vector,
    call_at,
    copy,
    copy_matrix,
    njit_always_inline,
    njit_inline,
    unpack,
)
from finger_pin.core.stepping.period_evaluations import (
    PERIOD_ARGS,
    PeriodArgs,
    change_rows,
    evaluate_changed,
    evaluate_plain,
    held_parameters,
    is_of_rows,
    keep_rows,
    restore_rows,
)
from finger_pin.core.stepping.period_kinks import LEAST_PART, bends, cross_kinks, reach
from finger_pin.core.steps import integration as core
from finger_pin.core.tables.linear_systems import Linear
from finger_pin.core.tables.model import MODEL, Model

# Least share of a step, over gamma, over which the method of second order is A-stable: |R(i y)| <= 1 for all y; and the
# one that is chosen where it is free, over which that of fourth order is, too, as from 1.48 to 4.03 (Hairer and Wanner,
# "Solving ordinary differential equations II", 2nd ed., 1996, table IV.6.4).
_LEAST_SHARE, _SHARE = 0.459, 2.5


@njit_inline
def _fill_by_rows(period: PeriodArgs, plain: Model, c: int) -> None:
    """Fill the derivatives of the rate by a number of what is held that acts by some rows alone."""
    structure, work, held, kept = plain.structure, plain.work, period.held, period.plain_rows
    bodies, width, change, step = structure.parents.size, work.torque.size, work.torque, period.steps[held.shape[0] + c]
    for j in range(width):
        change[j] = 0.0
    for i in range(held.shape[0]):
        held[i, c] = 0.0
    arm, other_arm = plain.parameters.arm, held_parameters(period, plain, c).arm
    change_rows(period, plain, c)
    for r in range(period.range_start[c], period.range_start[c + 1]):
        for k in range(period.row_ranges[r, 1], period.row_ranges[r, 2]):
            whole = work.rows[ROW.force, k]
            force = (whole - kept[ROW.force, k]) / step
            for e in range(structure.arm_start[k], structure.arm_start[k + 1]):
                change[structure.arm_at[e]] += work.arm[e] * force + (other_arm[e] - arm[e]) / step * whole
            if structure.state[k] >= 0:
                held[2 * width + structure.state[k], c] = (work.rows[ROW.rate, k] - kept[ROW.rate, k]) / step
    restore_rows(period, plain, c)
    solve_mass(structure, bodies, work, change)
    for j in range(width):
        if structure.prescribed[j] < 0:
            held[width + j, c] = change[j] if j < bodies else change[j] / plain.parameters.lumps[j - bodies]


@njit_inline
def _fill_held(period: PeriodArgs, state: Vector) -> None:
    """Fill b at a state: derivatives of the rate by inputs, forces and parameters, those of rows alone first."""
    held, size = period.held, period.held.shape[0]
    plain = unpack(period.plain, MODEL)
    evaluate_plain(period.plain, state, True)
    keep_rows(period, plain)
    for c in range(held.shape[1]):
        if is_of_rows(period, c):
            _fill_by_rows(period, plain, c)
        else:
            for i in range(size):
                held[i, c] = plain.rate[i]
    for c in range(held.shape[1]):
        if not is_of_rows(period, c):
            changed = unpack(evaluate_changed(period, state, size + c, True), MODEL)
            for i in range(size):
                held[i, c] = (changed.rate[i] - held[i, c]) / period.steps[size + c]


@njit_inline
def _fill_weights(share: float, exact: bool, weights: Vector) -> int:
    """Fill c_k for a share of the step, over gamma; return p + 1."""
    weights[0], weights[1] = 1.0, share
    if share < _LEAST_SHARE:
        return 1
    order = 4 if exact else 2
    before, latest, total = 1.0, -share, 1.0 - share
    for k in range(2, order + 1):
        before, latest = latest, ((2.0 * k - 2.0 - share) * latest - (k - 2.0) * before) / k
        total += latest
        weights[k] = latest if k % 2 == 0 else -latest
    weights[order + 1] = total
    return order + 1


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
    """Fill a product of matrices, by four rows of the second at a time: each reads and writes the product once."""
    count = first.shape[1]
    whole = count - count % 4
    for i in range(first.shape[0]):
        of, out = first[i], product[i]
        for c in range(second.shape[1]):
            out[c] = 0.0
        for k in range(0, whole, 4):
            for c in range(second.shape[1]):
                out[c] += of[k] * second[k, c] + of[k + 1] * second[k + 1, c]
                out[c] += of[k + 2] * second[k + 2, c] + of[k + 3] * second[k + 3, c]
        for k in range(whole, count):
            for c in range(second.shape[1]):
                out[c] += of[k] * second[k, c]


@njit_inline
def _apply(period: PeriodArgs, linear: Linear, length: float) -> None:
    """Take the derivatives along over a time, s, with b and the last system that was condensed."""
    derivatives, held, inverse, weights = period.derivatives, period.held, period.inverse, period.weights
    size, shift = inverse.shape[0], linear.inverse_shift[0]
    count = _fill_weights(length / shift, period.exact, weights)
    before, term = period.terms[:size], period.terms[size:]
    copy_matrix(derivatives, before)
    for i in range(size):
        for c in range(held.shape[1]):
            before[i, size + c] += held[i, c] * shift
    for k in range(1, count + 1):
        _multiply(inverse, before, term)
        for i in range(size):
            for c in range(derivatives.shape[1]):
                term[i, c] -= derivatives[i, c] if k == 1 else before[i, c]
                derivatives[i, c] += weights[k] * term[i, c]
        copy_matrix(term, before)


@njit_always_inline
def _propagate(period: PeriodArgs, integration: core.Integration, model: Model, step: float) -> bool:
    """Take the derivatives along over a step that has just been taken, s; false if a system is singular."""
    if not period.exact:
        _fill_inverse(model.linear, period.right, integration.end, period.inverse)
        _apply(period, model.linear, step)
        return True
    begin, part = 0.0, 1.0
    while begin < 1.0 - LEAST_PART:
        part = min(part, 1.0 - begin)
        while part > LEAST_PART and bends(period, integration, model, step, begin, part):
            part *= 0.5
        for node in range(3):
            length = step * part * (2.0 if node == 1 else 0.5) / 3.0
            time = reach(period, integration, model, step, begin + 0.5 * node * part)
            call_at(model.linearise, integration.model, time)
            if call_at(model.condense, integration.model, _SHARE / length) == 0:
                return False
            _fill_inverse(model.linear, period.right, integration.end, period.inverse)
            _fill_held(period, period.state)
            _apply(period, model.linear, length)
        begin, part = begin + part, 2.0 * part
    return True


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
        if not period.exact:
            _fill_held(period, integration.x)
        args.record_range[0] = 0
        copy(integration.x, period.start)
        status = call_at(period.advance, period.args, end)
        if status != core.DONE and status != core.FULL:
            return status
        if not _propagate(period, integration, model, memory.time[0] - start):
            return core.UNDERFLOW
        if period.exact or memory.taken_share[0] < 1.0:
            cross_kinks(period, integration, model)
    return core.DONE


@CompiledFunction
def limit_bristles(address: int, _time: float) -> int:
    """Bring the bristles of the `PeriodArgs` at an address back to their levels, which steady sliding does not pass."""
    period = unpack(address, PERIOD_ARGS)
    integration = unpack(unpack(period.args, core.ADVANCE_ARGS).integration, core.INTEGRATION)
    rows = unpack(period.plain, MODEL).work.rows
    evaluate_plain(period.plain, integration.x, False)
    for b in range(period.bristles.shape[0]):
        place, level = period.bristles[b, 0], rows[period.bristles[b, 2], period.bristles[b, 1]]
        integration.x[place], period.levels[place] = min(max(integration.x[place], -level), level), level
    return 1


@njit_inline
def _sum_rows(period: PeriodArgs, rows: Matrix, signal: int) -> float:
    """Return a signal that is watched, after an evaluation."""
    weights, total = period.weights_of_rows, 0.0
    for k in range(rows.shape[1]):
        total += weights[0, k, signal] * rows[ROW.force, k] + weights[1, k, signal] * rows[ROW.command, k]
    return total


@njit_inline
def _add_slopes(period: PeriodArgs, rows: Matrix, column: int, begin: int, end: int) -> None:
    """Add the differences of some rows from those kept to the derivatives of the signals that are watched."""
    weights, kept, step = period.weights_of_rows, period.plain_rows, period.steps[column]
    for k in range(begin, end):
        force = (rows[ROW.force, k] - kept[ROW.force, k]) / step
        command = (rows[ROW.command, k] - kept[ROW.command, k]) / step
        if force != 0.0 or command != 0.0:
            for s in range(weights.shape[2]):
                period.slopes[s, column] += weights[0, k, s] * force + weights[1, k, s] * command


@CompiledFunction
def fill_watched(address: int, _time: float) -> int:
    """Fill the signals that are watched of the `PeriodArgs` at an address, and their derivatives."""
    period = unpack(address, PERIOD_ARGS)
    state = unpack(unpack(period.args, core.ADVANCE_ARGS).integration, core.INTEGRATION).x
    plain, size = unpack(period.plain, MODEL), state.size
    evaluate_plain(period.plain, state, False)
    keep_rows(period, plain)
    for s in range(period.watched.size):
        period.watched[s] = _sum_rows(period, plain.work.rows, s)
        for c in range(period.steps.size):
            period.slopes[s, c] = 0.0
    for c in range(size, period.steps.size):
        if is_of_rows(period, c - size):
            change_rows(period, plain, c - size)
            for r in range(period.range_start[c - size], period.range_start[c - size + 1]):
                _add_slopes(period, plain.work.rows, c, period.row_ranges[r, 1], period.row_ranges[r, 2])
            restore_rows(period, plain, c - size)
    for c in range(period.steps.size):
        if c < size or not is_of_rows(period, c - size):
            changed = unpack(evaluate_changed(period, state, c, False), MODEL)
            _add_slopes(period, changed.work.rows, c, 0, changed.work.rows.shape[1])
    return 1
