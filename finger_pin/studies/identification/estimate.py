"""The estimate: least squares with a noise for every signal, weighed by how many of its samples are independent."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from finger_pin.description.routing import Array
from finger_pin.studies.identification.problem import Problem, minus_twice_likelihood, pooled

# Rounds of residuals and noise in turn, and where they have settled.
_ROUNDS, _SETTLED = 5, 1e-2
# Where a search ends: relative changes of z, and of the objective before and after the noise is known.
_CLOSE, _ROUGH, _STILL = 1e-7, 1e-2, 1e-3
# Steps on the way to the others' best values where one is held, and how little they may still gain.
_STEPS, _GAIN = 4, 0.01


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
    if not all(np.isfinite(e).all() for e in residuals):
        # What cannot be integrated there is the worst of all minima.
        nothing = np.zeros(len(residuals))
        return Fit(z, residuals, nothing, nothing, nothing, math.inf)
    noise = _noise(problem, residuals)

    def at(part: Array) -> Array:
        whole = z.copy()
        whole[free] = part
        return whole

    def weighed(parts: Sequence[Array]) -> Array:
        return np.concatenate([f * part for f, part in zip(np.sqrt(shares) / noise, parts, strict=True)])

    several, count = problem.groups.max(initial=0) > 0, sum(map(len, residuals))
    for k in range(_ROUNDS if free.size else 0):
        margin = 1e-9 * (high - low)
        found = least_squares(
            lambda part: weighed(problem.residuals(at(part))),
            np.clip(z[free], low + margin, high - margin),
            lambda part: weighed(problem.slopes(at(part)))[:, free],
            (low, high),
            x_scale=high - low,
            loss=loss,
            xtol=_CLOSE,
            # What it may still fall is little against what ends an interval; before the noise is known, more.
            ftol=_ROUGH if several and k == 0 else _STILL / count,
        )
        z = at(found.x)
        residuals = problem.residuals(z)
        before, noise = noise, _noise(problem, residuals)
        if weights is None:
            shares = _independent(problem, residuals)[1]
        # What counts is how the signals are weighed against each other.
        if not several or np.ptp(np.log(noise / before)) < _SETTLED:
            break
    correlation, own = _independent(problem, residuals)
    shares = own if weights is None else weights
    objective = minus_twice_likelihood(residuals, shares, problem.groups)
    return Fit(z, residuals, noise, correlation, shares, objective)


def fit_beside(problem: Problem, found: Fit, guess: Array, held: int) -> Fit:
    """Return the minimum where one entry of z is held near a minimum, by steps with the slopes of that minimum.

    Args:
        problem: What is fitted.
        found: The minimum.
        guess: Where to start; its entry ``held`` stays.
        held: Which.
    """
    others = np.arange(len(guess)) != held
    slopes, factors = problem.slopes(found.z), found.weights / found.noise**2
    inner = sum(f * j[:, others].T @ j[:, others] for f, j in zip(factors, slopes, strict=True))
    solve = np.linalg.pinv(np.atleast_2d(inner), rcond=1e-12, hermitian=True)
    low, high = problem.box
    best = _fit_at(problem, guess, found.weights)
    for _ in range(_STEPS if others.any() else 0):
        pull = sum(f * j[:, others].T @ e for f, j, e in zip(factors, slopes, best.residuals, strict=True))
        z = best.z.copy()
        z[others] = np.clip(z[others] - solve @ pull, low[others], high[others])
        if float(pull @ solve @ pull) < _GAIN:
            break
        next_ = _fit_at(problem, z, found.weights)
        if not next_.objective < best.objective:
            # The slopes have changed too much.
            return fit(problem, best.z, held={held: guess[held]}, weights=found.weights)
        best = next_
    return best


def _fit_at(problem: Problem, z: Array, weights: Array) -> Fit:
    residuals = problem.residuals(z)
    noise = _noise(problem, residuals)
    objective = minus_twice_likelihood(residuals, weights, problem.groups)
    return Fit(z, residuals, noise, np.zeros(len(weights)), weights, objective)


def information(problem: Problem, found: Fit) -> Array:
    """Return the Fisher information of z at a minimum, shape (p, p)."""
    slopes = problem.slopes(found.z)
    factors = found.weights / found.noise**2
    total: Array = sum(f * j.T @ j for f, j in zip(factors, slopes, strict=True))
    return total


def _noise(problem: Problem, residuals: Sequence[Array]) -> Array:
    """Return the rms of the residuals of every output, never less than what rounding leaves of it."""
    groups = problem.groups
    count, square = pooled(residuals, np.ones(len(residuals)), groups)
    rms = np.where(count > 0.0, np.sqrt(square), 1.0)[groups]
    least = [1e-9 * max(float(np.max(np.abs(s.measured), initial=0.0)), 1e-9) for s in problem.signals]
    return np.maximum(rms, least)


def _independent(problem: Problem, residuals: Sequence[Array]) -> tuple[Array, Array]:
    """Return the correlation of neighbouring residuals of every output, and the share that is independent."""
    groups, rho = problem.groups, np.zeros(len(residuals))
    for group in np.unique(groups):
        places = np.flatnonzero(groups == group).tolist()
        own = [k for k in places if problem.signals[k].ordered and len(residuals[k]) > 2]
        size = sum(float(residuals[k] @ residuals[k]) for k in own)
        together = sum(float(residuals[k][1:] @ residuals[k][:-1]) for k in own)
        count = sum(len(residuals[k]) for k in own)
        rho[groups == group] = np.clip(together / size, 0.0, 1.0 - 2.0 / count) if size > 0.0 else 0.0
    return rho, (1.0 - rho) / (1.0 + rho)
