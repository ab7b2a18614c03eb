"""Likelihood of residuals with a noise for each output."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from finger_pin.exceptions import InputError
from finger_pin.identification.recordings import RecordedSignal
from finger_pin.typing import Array

# Median magnitude of a standard normal variable.
_NORMAL_MEDIAN = float(norm.ppf(0.75))


@dataclass(frozen=True, eq=False)
class NoiseGrowth:
    """Noise of signals that grows with their readings x: sigma = sigma_0 w(x), w^2 = 1 + (share x / least)^2.

    With residuals e / w times G, the geometric mean of w in a group of signals, n log(SSE / n) is minus twice the
    log-likelihood again, whose logarithm of all sigma would else be missing: readings are those that are computed, as
    measured ones would count for more where they are too small by chance.

    Attributes:
        measured: Readings of every signal.
        least_noise: Least noise of every signal, shape (s,).
        noise_share: Part of the reading, shape (s,).
        groups: Group of every signal, shape (s,).
    """

    measured: Sequence[Array]
    least_noise: Array
    noise_share: Array
    groups: NDArray[np.intp]

    @classmethod
    def from_signals(cls, signals: Sequence[RecordedSignal], groups: NDArray[np.intp]) -> Self:
        """Return the growth of the noise of recorded signals."""
        least_noise, noise_share = np.array([(each.least_noise, each.noise_share) for each in signals]).reshape(-1, 2).T
        return cls([each.measured for each in signals], least_noise, noise_share, groups)

    @property
    def floor(self) -> Array:
        """The least deviation of residuals, shape (s,), by the level of the measured readings."""
        return self.least_noise * self.levels([0.0 * x for x in self.measured]) if self.active else self.least_noise

    @property
    def _ratios(self) -> Array:
        zeros = np.zeros_like(self.noise_share)
        return np.divide(self.noise_share, self.least_noise, out=zeros, where=self.noise_share > 0.0)

    @property
    def active(self) -> bool:
        """Whether the noise of any output grows with its reading."""
        return bool(np.any(self.noise_share))

    def growth(self, errors: Sequence[Array]) -> list[Array]:
        """Return w at the computed readings, which are measured less errors."""
        readings = zip(self._ratios, self.measured, errors, strict=True)
        return [np.sqrt(1.0 + (ratio * (x - e)) ** 2) if ratio else np.ones_like(x) for ratio, x, e in readings]

    def levels(self, errors: Sequence[Array]) -> Array:
        """Return G of every signal, shape (s,)."""
        return np.exp(self._grouped_means([np.log(w) for w in self.growth(errors)]))

    def weigh(self, errors: Sequence[Array]) -> list[Array]:
        """Return the residuals G e / w."""
        rows = zip(self.levels(errors), self.growth(errors), errors, strict=True)
        return [level / w * e for level, w, e in rows]

    def weigh_slopes(self, errors: Sequence[Array], slopes: Sequence[Array]) -> list[Array]:
        """Return the derivatives of the residuals from those of the errors, shape (m, p) each."""
        rows = list(zip(self.levels(errors), self.growth(errors), self.measured, errors, slopes, strict=True))
        # Of log w, as what is computed falls where the error rises.
        by_log = [-((k / w) ** 2 * (x - e))[:, None] * j for k, (_, w, x, e, j) in zip(self._ratios, rows, strict=True)]
        means = self._grouped_means(by_log)
        pairs = zip(rows, by_log, means, strict=True)
        return [(g / w)[:, None] * (j + e[:, None] * (mean - log)) for (g, w, _, e, j), log, mean in pairs]

    def _grouped_means(self, values: Sequence[Array]) -> Array:
        """Return the mean of all values of its group for every signal."""
        count = np.bincount(self.groups, [len(v) for v in values])
        sums = np.array([np.sum(v, axis=0) for v in values])
        totals = np.zeros((len(count), *sums.shape[1:]))
        np.add.at(totals, self.groups, sums)
        return np.asarray((totals.T / np.maximum(count, 1)).T[self.groups])


def numbered(names: Sequence[Any]) -> NDArray[np.intp]:
    """Return the number of each name among those that differ, in their order."""
    order = list(dict.fromkeys(names))
    return np.array([order.index(name) for name in names], dtype=np.intp)


def noise_groups(signals: Sequence[RecordedSignal]) -> NDArray[np.intp]:
    """Return the number of the noise of every signal: that of its output, or one that several outputs share.

    Raises:
        InputError: If outputs share a noise, and differ in unit or in what is said of it.
    """
    first: dict[str, RecordedSignal] = {}
    for signal in signals:
        other = first.setdefault(signal.shared_noise, signal) if signal.shared_noise else signal
        for what in ("unit", "least_noise", "noise_share"):
            value, expected = getattr(signal, what), getattr(other, what)
            if value != expected:
                entry = f"identify.recordings.{signal.recording}.outputs.{signal.name}.noise"
                allowed = f"is shared with {other.recording}.{other.name}, whose {what} is {expected}, not {value}"
                raise InputError(entry, allowed, signal.shared_noise)
    return numbered([(each.shared_noise,) if each.shared_noise else (each.recording, each.name) for each in signals])


def pooled_variance(residuals: Sequence[Array], weights: Array, groups: NDArray[np.intp]) -> tuple[Array, Array]:
    """Return the number of independent samples of every group of signals, and their mean square."""
    count, squares = np.zeros((2, int(groups.max(initial=-1)) + 1))
    for e, w, group in zip(residuals, weights, groups, strict=True):
        count[group] += w * len(e)
        squares[group] += w * float(e @ e)
    return count, squares / np.maximum(count, 1e-300)


def robust_deviation(residuals: Sequence[Array], groups: NDArray[np.intp]) -> Array:
    """Return the deviation of the residuals of every signal's output by their median, which outliers hardly change."""
    sizes = [np.abs(np.concatenate([e for e, g in zip(residuals, groups, strict=True) if g == k])) for k in groups]
    return np.array([np.median(each) / _NORMAL_MEDIAN if len(each) else 1.0 for each in sizes])


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


def block_means(values: Sequence[Array], counts: Sequence[int]) -> list[Array]:
    """Return means of consecutive samples."""
    pairs = zip(values, counts, strict=True)
    return [e[: len(e) // n * n].reshape(-1, n, *e.shape[1:]).mean(axis=1) for e, n in pairs]
