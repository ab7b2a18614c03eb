"""Likelihood of residuals of signals whose noises are found with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from finger_pin.typing import Array

# Median magnitude of a standard normal variable.
_NORMAL_MEDIAN = float(norm.ppf(0.75))
# Least noise by rounding, part of the largest reading.
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Likelihood:
    """Likelihood of the residuals of s signals, with a noise for each group of them.

    Attributes:
        noises: Number of the noise of each signal, shape (s,).
        least_noise: Least standard deviation of each, shape (s,).
        outputs: Number of the output of each, whose windows are several signals, shape (s,).
        kinds: Number of the noise that each names or, if none, of what it measures, whatever the recording, shape (s,).
        largest: Largest magnitude of the readings of each, shape (s,).
        ordered: Whether samples of each follow each other, so that neighbours may err alike, shape (s,).
    """

    noises: NDArray[np.intp]
    least_noise: Array
    outputs: NDArray[np.intp]
    kinds: NDArray[np.intp]
    largest: Array
    ordered: NDArray[np.bool_]

    @property
    def first(self) -> list[int]:
        """The first signal of every output."""
        return list(map(int, np.unique(self.outputs, return_index=True)[1]))

    def minus_twice_log(self, residuals: Sequence[Array], weights: Array | None = None) -> float:
        """Return `minus_twice_likelihood` of residuals, with equal weights by default."""
        equal = np.ones(len(residuals))
        return minus_twice_likelihood(residuals, equal if weights is None else weights, self.noises, self.least_noise)

    def noise(self, residuals: Sequence[Array], robust: bool = False) -> Array:
        """Return the rms of the residuals of every noise, or that of their median, shape (s,); never below its least.

        Rounding is a noise, too.
        """
        count, square = pooled_variance(residuals, np.ones(len(residuals)), self.noises)
        rms = self.deviation(residuals) if robust else np.where(count > 0.0, np.sqrt(square), 1.0)[self.noises]
        return np.maximum(rms, np.maximum(self.least_noise, _ROUNDING * np.maximum(self.largest, _ROUNDING)))

    def deviation(self, residuals: Sequence[Array]) -> Array:
        """Return the deviation of every noise by the median of its residuals, which outliers hardly change."""
        pairs = list(zip(residuals, self.noises, strict=True))
        sizes = [np.abs(np.concatenate([e for e, g in pairs if g == k])) for k in self.noises]
        return np.array([np.median(each) / _NORMAL_MEDIAN if len(each) else 1.0 for each in sizes])

    def independence(self, residuals: Sequence[Array]) -> tuple[Array, Array]:
        """Return the correlation of neighbouring residuals of every output, and the share that is independent.

        That is (1 - rho) / (1 + rho) (Bartlett); both have shape (s,).
        """
        rho = np.zeros(len(residuals))
        for output in np.unique(self.outputs):
            places = np.flatnonzero(self.outputs == output).tolist()
            ordered = [residuals[k] for k in places if self.ordered[k] and len(residuals[k]) > 2]
            square = sum(float(e @ e) for e in ordered)
            product = sum(float(e[1:] @ e[:-1]) for e in ordered)
            if square > 0.0:
                rho[places] = np.clip(product / square, 0.0, 1.0 - 2.0 / sum(map(len, ordered)))
        return rho, (1.0 - rho) / (1.0 + rho)

    def pooled(self, noise: Array) -> Array:
        """Return the root mean square of the noises of all outputs of a kind, for every signal, shape (s,)."""
        kinds = self.kinds[self.first]
        return np.array([np.sqrt(np.mean(noise[self.first][kinds == kind] ** 2)) for kind in self.kinds])


def numbered(names: Sequence[Any]) -> NDArray[np.intp]:
    """Return the number of each name among those that differ, in their order."""
    order = list(dict.fromkeys(names))
    return np.array([order.index(name) for name in names], dtype=np.intp)


def pooled_variance(residuals: Sequence[Array], weights: Array, groups: NDArray[np.intp]) -> tuple[Array, Array]:
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
    count, square = pooled_variance(residuals, weights, groups)
    least = np.zeros(len(count))
    least[groups] = least_noise**2
    sampled = count > 0.0
    value = np.sum(count[sampled] * np.log(np.maximum(np.maximum(square, least)[sampled], 1e-300)))
    at_least_noise = sampled & (square < least)
    return float(value + np.sum(count[at_least_noise] * (square[at_least_noise] / least[at_least_noise] - 1.0)))
