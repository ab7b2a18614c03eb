"""Likelihood of residuals with a noise for each output."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from finger_pin.typing import Array


def pooled(residuals: Sequence[Array], weights: Array, groups: NDArray[np.intp]) -> tuple[Array, Array]:
    """Return the number of independent samples of every group of signals, and their mean square."""
    count, squares = np.zeros((2, int(groups.max(initial=-1)) + 1))
    for e, w, group in zip(residuals, weights, groups, strict=True):
        count[group] += w * len(e)
        squares[group] += w * float(e @ e)
    return count, squares / np.maximum(count, 1e-300)


def minus_twice_likelihood(
    residuals: Sequence[Array], weights: Array, groups: NDArray[np.intp], least_noise: Array
) -> float:
    """Return the sum of w n log(SSE / n), minus twice the log-likelihood; a noise for each group of signals.

    Where SSE / n is below the square of the least noise s of a signal, the term is w (n log(s^2) + SSE / s^2 - n): that
    of a known noise, which joins the other one smoothly.
    """
    count, square = pooled(residuals, weights, groups)
    least = np.zeros(len(count))
    least[groups] = least_noise**2
    there = count > 0.0
    value = np.sum(count[there] * np.log(np.maximum(np.maximum(square, least)[there], 1e-300)))
    known = there & (square < least)
    return float(value + np.sum(count[known] * (square[known] / least[known] - 1.0)))
