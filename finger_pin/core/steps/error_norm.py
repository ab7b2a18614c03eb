"""The error of a step in units of the tolerances."""

from __future__ import annotations

import numpy as np

from finger_pin.core.jit import Vector, njit_always_inline, njit_inline
from finger_pin.core.steps.integration import Integration


@njit_always_inline
def _add_errors(
    integration: Integration, end: Vector, difference: Vector, first: int, last: int, total: float
) -> float:
    """Return a sum with the squares of errors in a part of the state added, in tolerances."""
    x, rtol, atol = integration.x, integration.rtol, integration.atol
    for c in range(first, last):
        if not np.isfinite(end[c]):
            return np.inf
        scale = atol[c] + rtol * max(abs(x[c]), abs(end[c]))
        total += (difference[c] / scale) ** 2
    return total


@njit_inline
def step_error(integration: Integration, end: Vector, difference: Vector) -> float:
    """Return the error of a step as a multiple of the tolerance, root mean square over the state that is counted.

    It is infinite where the end is not finite: an infinite scale would make any error small.
    """
    live, total, parts, size = integration.live, 0.0, integration.live_count[0], integration.x.size
    if parts == 1:
        total = _add_errors(integration, end, difference, 0, size, total)
    else:
        for part in range(parts):
            total = _add_errors(integration, end, difference, live[part, 0], live[part, 1], total)
    return np.sqrt(total / integration.memory.counted[0])


@njit_always_inline
def largest_error_state(x: Vector, difference: Vector, rtol: float, atol: Vector) -> int:
    """Return the index of the first state whose error is no number, else of that with the largest error.

    Errors are compared as multiples of the tolerance.
    """
    largest, index = -1.0, 0
    for c in range(x.size):
        ratio = abs(difference[c]) / (atol[c] + rtol * abs(x[c]))
        if np.isnan(ratio):
            return c
        if ratio > largest:
            largest, index = ratio, c
    return index
