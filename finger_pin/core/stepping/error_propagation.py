"""Propagation of a run's error: local errors, moved on by the linearised flow."""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.core.evaluation.condensation import solve
from finger_pin.core.jit import CompiledFunction, Vector, call_at, njit_always_inline, njit_inline, unpack
from finger_pin.core.linear_systems import Linear
from finger_pin.core.model import MODEL, Model
from finger_pin.core.stepping.integration import INTEGRATION, Integration
from finger_pin.core.stepping.interpolation import between

# Terms of the flow. With three, vibrations that steps of a radian or two follow would be damped, and with them what a
# loop that hunts makes of small errors; with six they are not.
_TERMS = 6
# How many steps one sum of terms covers; longer ones make fast vibrations grow.
_LONGEST = 1.2
# After a much longer step the flow is caught up over several, with no more sums than that in each.
_MOST_SUMS = 64.0

# Nodes after the start, and weights, of Lobatto's quadrature of fifth order; the first weight is the last one.
_NODES = (0.5 - np.sqrt(0.05), 0.5 + np.sqrt(0.05), 1.0)
_WEIGHTS = (5.0 / 12.0, 5.0 / 12.0, 1.0 / 12.0)


@CompiledFunction
def propagate_error(address: int, h: float) -> int:
    """Propagate the error estimate of the `Integration` at an address over the taken share of a step.

    Its state is that of the step's start, that of its model the one at the end.
    """
    integration = unpack(address, INTEGRATION)
    model, memory = unpack(integration.model, MODEL), integration.memory
    global_error, k, width = integration.global_error, integration.k, model.linear.mass.shape[0]
    part, turned, last = memory.taken_share[0], memory.left_share[0] < 1.0, k.shape[0] - 1
    if memory.errors_alike[0] > 0.0:
        defect(address, integration, model, memory.time[0], h, part)
    else:
        for c in range(global_error.size):
            k[last, c] *= part
        for c in range(2 * width, global_error.size):
            k[last, c] -= integration.end[c]
    memory.error_lag[0] = carry(
        model.linear,
        part * h,
        integration.tableau.gamma / part,
        global_error,
        k[last],
        memory.error_lag[0],
        turned,
        integration.r,
        model.rate,
    )
    memory.joint_error[0] += part * h * weigh(integration.joints, width, global_error)
    memory.object_error[0] += part * h * weigh(integration.objects, width, global_error)
    return 1


@njit_always_inline
def carry(
    linear: Linear,
    h: float,
    gamma: float,
    global_error: Vector,
    difference: Vector,
    behind: float,
    turned: bool,
    r: Vector,
    u: Vector,
) -> float:
    """Propagate the error from the middle of the last step to that of this one, and add the local error.

    There the linearisation at this step's start is central. One that lags behind reversals damps what vibrates. Where
    a step ends at a kink, the error is carried to its end: what comes after, such as a stiff contact, is another flow.

    Args:
        linear: Condensed for g = 1 / (h gamma).
        h: Length of the step, s.
        gamma: Of the method.
        global_error: The error so far, changed in place, shape (size,).
        difference: Difference of the two methods in the step, shape (size,).
        behind: Time from where the error has been carried to, to the start of the step, s.
        turned: Whether the step ends at a kink.
        r: Scratch, shape (size + 1,).
        u: Scratch, shape (size,).

    Returns:
        Time that is left to the end of the step, s.
    """
    size, time = global_error.size, behind + 0.5 * h
    sums = min(np.ceil(time / (_LONGEST * h)), _MOST_SUMS)
    time = min(time, sums * _LONGEST * h)
    for _ in range(int(sums)):
        _flow(linear, 1.0 / (h * gamma), time / (sums * h * gamma), global_error, r, u)
    for c in range(size):
        global_error[c] += difference[c]
    if turned:
        _flow(linear, 1.0 / (h * gamma), 0.5 / gamma, global_error, r, u)
        time += 0.5 * h
    return behind + h - time


@njit_always_inline
def defect(address: int, integration: Integration, model: Model, time: float, h: float, share: float) -> None:
    """Replace the difference of the two methods in the last stage by the integrated defect of the rates along a step.

    At a kink both methods err alike. What a step's interpolant should have grown by is integrated after Lobatto
    with four nodes, and what stiff parts exaggerate is taken back by one solution of the linear system.

    Args:
        address: Of the integration.
        integration: The integration; its states are those of the step's start.
        model: The model; its state is that of the step's end, where it is evaluated last, and no branch is frozen.
        time: Of the start, s.
        h: Length of the step that was tried, s.
        share: What is taken of it.
    """
    tableau, x, k, state, rate = integration.tableau, integration.x, integration.k, model.state, model.rate
    r, end, start, length = integration.r, integration.end, integration.start, share * h
    last, size = tableau.nodes.size - 1, x.size
    call_at(integration.events.release, address, 0.0)
    for c in range(size):
        r[c], end[c] = state[c] - x[c] - _WEIGHTS[2] * length * start[c], state[c]
    for node in range(3):
        s = _NODES[node]
        between(x, end, integration.dense, s, state)
        call_at(model.evaluate, integration.model, time + s * length)
        for c in range(size):
            r[c] -= _WEIGHTS[node] * length * rate[c]
    for c in range(size):
        r[c] /= h * tableau.gamma
    r[size] = 0.0
    solve(model.linear, r, k[last])


@njit_inline
def weigh(part: Any, width: int, global_error: Vector) -> float:
    """Return the mean square of some coordinates' errors, rad2 or m2, at most one.

    Beyond a radian the linearised flow says nothing more: their errors, and those of their velocities and of all that
    is no coordinate, are less then.
    """
    total = 0.0
    for c in part:
        total += global_error[c] * global_error[c]
    mean = total / max(part.size, 1)
    if mean <= 1.0:
        return mean
    share = 1.0 / np.sqrt(mean) if mean < np.inf else 0.0
    for c in part:
        global_error[c] = global_error[c] * share if share > 0.0 else 0.0
        global_error[width + c] = global_error[width + c] * share if share > 0.0 else 0.0
    for c in range(2 * width, global_error.size):
        global_error[c] = global_error[c] * share if share > 0.0 else 0.0
    return 1.0


@njit_inline
def _flow(linear: Linear, g: float, share: float, global_error: Vector, r: Vector, u: Vector) -> None:
    """Multiply by exp(share J / g) = sum of (-D)^k L_k(share), D = J / (g - J), Laguerre polynomials with alpha = -1.

    The last term of the sum makes it vanish for fast decay.
    """
    size = global_error.size
    for c in range(size):
        u[c] = global_error[c]
    r[size] = 0.0
    before, term, total, sign = 0.0, 1.0, 1.0, 1.0
    for k in range(1, _TERMS + 1):
        before, term = term, ((2 * k - 2 - share) * term - (k - 2) * before) / k
        sign = -sign
        weight = sign * (term if k < _TERMS else -total)
        total += term
        for c in range(size):
            r[c] = g * u[c]
        solve(linear, r, u)
        for c in range(size):
            u[c] -= r[c] / g
            global_error[c] += weight * u[c]
