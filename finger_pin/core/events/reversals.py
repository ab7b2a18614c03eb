"""Steps that end at reversals of sliding.

The rate of bristles bends where the sign of their speed changes. Frictions are held on the side of their speed at the
start of a step. From where the speed turns on, that misleads the rate in proportion to the speed there, and the
interpolant of a step tells where that is. What is misled by more than the tolerance is not taken.

Friction above what it can bear, as when a tendon goes slack while its mass rings, runs away: the faster it slides, the
less it holds. Steps too long for that hold it instead, and misled a little each, it grows with what pulls.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.core.addresses.law_code import ROW
from finger_pin.core.jit import Matrix, call_value, njit_always_inline, njit_inline
from finger_pin.core.steps.integration import Integration
from finger_pin.core.tables.mechanism_parameters import Parameters
from finger_pin.core.tables.model import Model
from finger_pin.core.tables.structure import Structure

# Derivations and origins: core/stepping/NOTES.md.
# Greatest reversal error of a step that is taken as a whole, in tolerances: beside an error of 1 it adds 1.6 %.
_MAX_REVERSAL_ERROR = 0.18
# Least reversal error of a step that is cut, in tolerances, a tenth of the greatest: above zero, so that the next step
# begins on the other side; and the one that is aimed at, between both.
_MIN_REVERSAL_ERROR, _TARGET_REVERSAL_ERROR = 0.018, 0.08
# Samples of the speed in a step, 1: twice the degree of its interpolant.
_SPEED_SAMPLES = 8
# Ends that are tried, 1: the first ones by the square law of a single reversal, then by bisection.
_MAX_END_TRIALS, _SQUARE_LAW_TRIALS = 8, 3
# Greatest ratio of a bristle's deflection to its limit at which it may bend further, 1: by (9a) the ratio does not pass
# 1 while the limit is constant.
_MAX_LOAD_RATIO = 2.0
# Growth of an overloaded deflection that passes as an error of the step, in tolerances.
_MAX_OVERLOAD_GROWTH = 0.1
# Least speed at which a deflection's limit is asked for, m/s, where it is a quotient of two rates proportional to it.
_MIN_SLIDING_SPEED = 1e-9


@njit_inline
def before_reversal(integration: Integration, model: Model, h: float) -> float:
    """Return the share of a step that is taken: all of it, or to a little behind the first reversal of sliding.

    By how much bristles are misled in that is filled into ``integration.end``.
    """
    share, high, cost, low, below = 1.0, 1.0, 0.0, 0.0, 0.0
    for trial in range(1 + _MAX_END_TRIALS):
        if trial > 0:
            # Behind the first reversal it grows as the square, and more where others follow.
            share_of_interval = (
                np.sqrt((_TARGET_REVERSAL_ERROR - below) / (cost - below)) if trial <= _SQUARE_LAW_TRIALS else 0.5
            )
            share = low + share_of_interval * (high - low)
        error, turned = _reversal_error(integration, model, h, share)
        if error > _MAX_REVERSAL_ERROR:
            high, cost = share, error
            if trial == 0:
                low = turned
        elif trial == 0 or error >= _MIN_REVERSAL_ERROR:
            break
        else:
            low, below = share, error
    return share


@njit_always_inline
def _reversal_error(integration: Integration, model: Model, h: float, share: float) -> tuple[float, float]:
    """Return the error of bristles misled in a share of a step, in tolerances, and the share at which that begins."""
    structure, parameters = model.structure, model.parameters
    rows, error, total, first = model.work.rows, integration.end, 0.0, 1.0
    size, width = integration.x.size, model.linear.mass.shape[0]
    for c in range(2 * width, size):
        error[c] = 0.0
    for g in range(structure.groups.first.size):
        if structure.groups.kink[g] != ROW.speed:
            continue
        for k in range(structure.groups.first[g], structure.groups.end[g]):
            speed, fastest, turned = _speed_against_branch(integration, model, k, share)
            if speed > 0.0:
                c = 2 * width + structure.state[k]
                error[c] = share * h * speed * _rate_jump(structure, parameters, rows, g, k, fastest) / abs(fastest)
                scale = integration.atol[c] + integration.rtol * max(abs(integration.x[c]), abs(model.state[c]))
                total += (error[c] / scale) ** 2
                first = min(first, turned)
    return np.sqrt(total / size), first


@njit_always_inline
def _speed_against_branch(integration: Integration, model: Model, k: int, share: float) -> Any:
    """Return the mean speed of a row against its side in a share of a step, the fastest, and the share at its begin."""
    structure, dense, branch = model.structure, integration.dense, model.work.rows[ROW.side, k]
    start, end = branch * integration.kinks[k], branch * model.work.rows[ROW.speed, k]
    width, one, two, three = model.linear.mass.shape[0], 0.0, 0.0, 0.0
    for e in range(structure.arm_start[k], structure.arm_start[k + 1]):
        arm, c = branch * model.work.arm[e], width + structure.arm_at[e]
        one += arm * dense[0, c]
        two += arm * dense[1, c]
        if dense.shape[0] > 2:
            three += arm * dense[2, c]
    speed, fastest, turned = 0.0, 0.0, 1.0
    if 4.0 * min(start, end) >= abs(one) + abs(two) + abs(three):
        return speed, fastest, turned
    before = start
    for i in range(1, _SPEED_SAMPLES + 1):
        s = share * i / _SPEED_SAMPLES
        after = (1.0 - s) * start + s * (end + (1.0 - s) * (one + s * (two + s * three)))
        low, high = min(before, after), max(before, after)
        if low < 0.0:
            # Of a straight line between two looks what is below zero.
            speed += 0.5 * low * low / (high - low) if high > 0.0 else -0.5 * (low + high)
            left = after / (after - before) if after < 0.0 < before else 1.0
            fastest, turned = min(fastest, low), min(turned, share * (i - left) / _SPEED_SAMPLES)
        before = after
    return speed / _SPEED_SAMPLES, branch * fastest, turned


@njit_always_inline
def _rate_jump(structure: Structure, parameters: Parameters, rows: Matrix, g: int, k: int, speed: float) -> float:
    """Return the jump of a state's rate at a speed between the two sides of its kink."""
    branch, row_speed, jump = rows[ROW.side, k], rows[ROW.speed, k], 0.0
    # As it is held, on the other side, and at last as it was.
    for weight in (-1.0, 1.0, 0.0):
        rows[ROW.side, k] = -branch if weight > 0.0 else branch
        rows[ROW.speed, k] = speed if weight != 0.0 else row_speed
        call_value(structure.groups.value[g], rows, parameters.laws, k, k + 1)
        jump += weight * rows[ROW.rate, k]
    return jump


@njit_always_inline
def bristles_over_limit(integration: Integration, model: Model) -> bool:
    """Return whether bristles far beyond their limit have bent further in a step.

    No motion does that: by (9a) |F^s|' <= sigma_0 |v| (1 - |F^s| / level), and `Law.kink` asks the like of any law.
    But implicit methods damp what grows, too.
    """
    structure, x, state, width = model.structure, integration.x, model.state, model.linear.mass.shape[0]
    for g in range(structure.groups.first.size):
        if structure.groups.kink[g] == ROW.speed:
            for k in range(structure.groups.first[g], structure.groups.end[g]):
                c = 2 * width + structure.state[k]
                growth = abs(state[c]) - abs(x[c])
                if (
                    growth > _MAX_OVERLOAD_GROWTH * (integration.atol[c] + integration.rtol * abs(state[c]))
                    and x[c] * state[c] > 0.0
                ):
                    if bristle_load_ratio(model, g, k, np.sign(x[c])) > _MAX_LOAD_RATIO:
                        return True
    return False


@njit_inline
def bristle_load_ratio(model: Model, g: int, k: int, direction: float) -> float:
    """Return the ratio of a row's bristle deflection to its limit at its speed in a direction of sliding."""
    rows, parameters, law = model.work.rows, model.parameters.laws, model.structure.groups.value[g]
    branch, speed, bent = rows[ROW.side, k], rows[ROW.speed, k], rows[ROW.state, k]
    rows[ROW.side, k], rows[ROW.speed, k] = direction, direction * max(abs(speed), _MIN_SLIDING_SPEED)
    call_value(law, rows, parameters, k, k + 1)
    rate = rows[ROW.rate, k]
    rows[ROW.state, k] = 0.0
    call_value(law, rows, parameters, k, k + 1)
    # sigma_0 v and sigma_0 v (1 - |F^s| / level).
    burden = 1.0 - rate / rows[ROW.rate, k]
    rows[ROW.side, k], rows[ROW.speed, k], rows[ROW.state, k] = branch, speed, bent
    call_value(law, rows, parameters, k, k + 1)
    return burden
