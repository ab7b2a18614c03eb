"""The estimate: least squares with a noise for every signal, weighed by how many of its samples are independent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from finger_pin.description.routing import Array
from finger_pin.studies.identification.problem import Problem, minus_twice_likelihood

# Rounds of residuals and noise in turn, and where they have settled.
_ROUNDS, _SETTLED = 8, 1e-3


@dataclass(frozen=True, eq=False)
class Fit:
    """A minimum.

    Attributes:
        z: Where, as it is searched for, shape (p,).
        residuals: Of every signal.
        noise: rms of the residuals of every signal, shape (s,).
        correlation: Of neighbouring residuals, shape (s,).
        weights: Part of the samples that are independent, (1 - rho) / (1 + rho), shape (s,) (Bartlett).
        objective: Sum of w n log(SSE / n).
    """

    z: Array
    residuals: Sequence[Array]
    noise: Array
    correlation: Array
    weights: Array
    objective: float


def fit(
    problem: Problem,
    start: Array,
    *,
    held: dict[int, float] | None = None,
    weights: Array | None = None,
    loss: str = "linear",
) -> Fit:
    """Return the minimum that is reached from a start.

    Args:
        problem: What is fitted.
        start: Shape (p,), transformed.
        held: Entries of z that stay as they are.
        weights: Of the signals; by default they follow from the residuals at the end.
        loss: As of `scipy.optimize.least_squares`, for outliers.
    """
    from scipy.optimize import least_squares

    z = start.copy()
    for k, value in (held or {}).items():
        z[k] = value
    free = np.array([k for k in range(len(z)) if k not in (held or {})], dtype=int)
    low, high = (bound[free] for bound in problem.box)
    shares = np.ones(len(problem.signals)) if weights is None else weights
    residuals = problem.residuals(z)
    noise = _noise(problem, residuals)

    def at(part: Array) -> Array:
        whole = z.copy()
        whole[free] = part
        return whole

    def weighed(parts: Sequence[Array]) -> Array:
        return np.concatenate([f * part for f, part in zip(np.sqrt(shares) / noise, parts, strict=True)])

    for _ in range(_ROUNDS if free.size else 0):
        margin = 1e-9 * (high - low)
        found = least_squares(
            lambda part: weighed(problem.residuals(at(part))),
            np.clip(z[free], low + margin, high - margin),
            lambda part: weighed(problem.slopes(at(part)))[:, free],
            (low, high),
            x_scale=high - low,
            loss=loss,
            xtol=1e-9,
            ftol=1e-9,
        )
        z = at(found.x)
        residuals = problem.residuals(z)
        before, noise = noise, _noise(problem, residuals)
        if weights is None:
            shares = _independent(problem, residuals)[1]
        # What counts is how the signals are weighed against each other.
        if np.ptp(np.log(noise / before)) < _SETTLED:
            break
    correlation, own = _independent(problem, residuals)
    shares = own if weights is None else weights
    return Fit(z, residuals, noise, correlation, shares, minus_twice_likelihood(residuals, shares))


def information(problem: Problem, found: Fit) -> Array:
    """Return the Fisher information of z at a minimum, shape (p, p)."""
    slopes = problem.slopes(found.z)
    factors = found.weights / found.noise**2
    total: Array = sum(f * j.T @ j for f, j in zip(factors, slopes, strict=True))
    return total


def _noise(problem: Problem, residuals: Sequence[Array]) -> Array:
    """Return the rms of the residuals of every signal, never less than what rounding leaves of it."""
    least = [1e-9 * max(float(np.max(np.abs(s.measured), initial=0.0)), 1e-9) for s in problem.signals]
    rms = [float(np.sqrt(np.mean(e * e))) if len(e) else 1.0 for e in residuals]
    return np.maximum(rms, least)


def _independent(problem: Problem, residuals: Sequence[Array]) -> tuple[Array, Array]:
    """Return the correlation of neighbouring residuals of every signal, and the share that is independent."""
    rho = np.zeros(len(residuals))
    for k, (signal, e) in enumerate(zip(problem.signals, residuals, strict=True)):
        if signal.ordered and len(e) > 2 and np.any(e):
            rho[k] = np.clip(float(e[1:] @ e[:-1]) / float(e @ e), 0.0, 1.0 - 2.0 / len(e))
    return rho, (1.0 - rho) / (1.0 + rho)
