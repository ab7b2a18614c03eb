"""Intervals by the profile likelihood, and the directions in which a recording leaves the parameters free."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Self

import numpy as np
from scipy.stats import t as student

from finger_pin.identification.estimate import Fit, fit, information
from finger_pin.identification.problem import Problem
from finger_pin.typing import Array

#: Rise of minus twice the log-likelihood at the ends of an interval: 95 % of chi-squared with one degree of freedom.
LEVEL = 3.841
# Relative error of the rise at an end: half of it is that of the half width, as its root is straight there.
# And the number of refits after which a search for an end gives up.
_LEVEL_ERROR, _REFITS = 0.06, 8
# Fall of minus twice the log-likelihood from which on a refit is another minimum: twice the 0.1 by which errors of fine
# runs make it jump.
_DEEPER = 0.2
# Standard deviation, part of the range, from which on a direction is free: an interval of 95 % is as wide as the range.
_FREE_DEVIATION = 0.25
# Entries of a direction that are left out of its words, part of the largest.
_SMALL_ENTRY = 0.15


@dataclass(frozen=True, eq=False)
class ProfileBound:
    """One end of an interval.

    Attributes:
        end: z there; infinite where the recording does not close it within the bounds.
        path: Points of the profile, shape (k, 2): z and the rise of minus twice the likelihood.
        better: A minimum below the one that it started from, if one turned up.
    """

    end: float
    path: Array
    better: Fit | None = None


def covariance(problem: Problem, minimum: Fit) -> Array:
    """Return the linearised covariance of z, shape (p, p)."""
    return inverse_within_bounds(problem, information(problem, minimum))


def inverse_within_bounds(problem: Problem, known: Array) -> Array:
    """Return the covariance of z by an information, shape (p, p); no direction is less sure than bounds are wide."""
    values, vectors, size = _directions(problem, known)
    return np.asarray((vectors / np.maximum(values, 1.0)) @ vectors.T * size)


def information_of_bounds(problem: Problem, minimum: Fit) -> Array:
    """Return the information of z that bounds add to that of the recordings, shape (p, p)."""
    values, vectors, size = _directions(problem, information(problem, minimum))
    return np.asarray((vectors * np.maximum(1.0 - values, 0.0)) @ vectors.T / size)


def _directions(problem: Problem, known: Array) -> tuple[Array, Array, Array]:
    """Return eigenvalues and eigenvectors of scaled information, and the products of ranges that scale it."""
    width = np.subtract(*reversed(problem.box))
    size = np.outer(width, width)
    return *np.linalg.eigh(known * size), size


@dataclass(frozen=True, eq=False)
class SmallSample:
    """Corrections for few readings, as for a regression: RSS / (n - p), and Student's t.

    Attributes:
        variance: Factors on the variance of every parameter for the same 95 % of a normal distribution, shape (p,).
        level: Rise of minus twice the likelihood at an end of each interval, shape (p,).
        noise: Factors on the noise of every signal, for 95 % of further readings, shape (s,).
        elsewhere: The same on the mean square of the noises of a name, for readings of other recordings, shape (s,).
    """

    variance: Array
    level: Array
    noise: Array
    elsewhere: Array

    @classmethod
    def from_fit(cls, problem: Problem, minimum: Fit, spread: Array) -> Self:
        """Return the corrections at a minimum with a covariance by the likelihood alone.

        Of several outputs each has what is left of its samples by the parameters that it tells (the trace of its part
        of the information), and a parameter the degrees of freedom of Satterthwaite (Biometrics Bulletin 2, 1946).
        """
        groups, slopes = problem.groups, problem.slopes(minimum.z)
        parts = np.zeros((int(groups.max()) + 1, *spread.shape))
        count = np.zeros(len(parts))
        for group, w, n, e, j in zip(groups, minimum.weights, minimum.noise, minimum.residuals, slopes, strict=True):
            parts[group] += w / n**2 * j.T @ j
            count[group] += w * len(e)
        # Correlated samples may count for less than the parameters that they are to tell.
        told = np.einsum("kl,glk->g", spread, parts)
        left = np.maximum(count - told, 1.0)
        plain = np.einsum("kl,glm,mk->gk", spread, parts, spread)
        grown = plain * (count / left)[:, None]
        whole, corrected = np.maximum(plain.sum(axis=0), 1e-300), np.maximum(grown.sum(axis=0), 1e-300)
        free = np.maximum(corrected**2 / np.maximum(np.sum(grown**2 / left[:, None], axis=0), 1e-300), 1.0)
        factor, quantile = corrected / whole, student.ppf(0.975, free)
        return cls(
            factor * quantile**2 / LEVEL,
            factor * free * np.log1p(quantile**2 / free),
            (np.sqrt(count / left / LEVEL) * student.ppf(0.975, left))[groups],
            _elsewhere(problem, minimum, count, told)[groups],
        )


def _elsewhere(problem: Problem, minimum: Fit, count: Array, told: Array) -> Array:
    """Return factors on the mean square noise of a name for readings of other recordings, for 95 % of them, by output.

    Samples that follow each other are hardly more than one, so that one recording tells its noise badly: the mean of
    several has their degrees of freedom (Satterthwaite).

    Args:
        problem: The problem that was fitted.
        minimum: Of the problem.
        count: Number of independent samples of every output.
        told: Number of parameters that every output tells.
    """
    first = [int(np.flatnonzero(problem.groups == group)[0]) for group in range(len(count))]
    names, square = [problem.signals[k].name for k in first], minimum.noise[first] ** 2
    alike = np.array([[one == other for other in names] for one in names])
    ratio = alike @ count / np.maximum(alike @ (count - told), 1.0)
    freedom = np.maximum((alike @ square) ** 2 / (ratio * (alike @ (square**2 / np.maximum(count, 1e-300)))), 1.0)
    return np.asarray(np.sqrt(ratio / LEVEL) * student.ppf(0.975, freedom))


def profile(
    problem: Problem, minimum: Fit, k: int, way: int, spread: Array, loss: str = "linear", inflation: float = 1.0
) -> ProfileBound:
    """Return the end of the interval of parameter k on one side, 2 (l* - l(p_k)) = 3.841 times an inflation.

    Args:
        problem: The problem that was fitted.
        minimum: Of the problem.
        k: Which parameter.
        way: 1 for the upper end, -1 for the lower.
        spread: Covariance of z.
        loss: As for `fit`.
        inflation: Variance of the parameter over that by the likelihood (Pace, Salvan and Sartori, Statistica Sinica
            21, 2011), and over that of few readings; rises of the path are divided by it.
    """
    low, high = problem.box
    limit = high[k] if way > 0 else low[k]
    room = abs(limit - minimum.z[k])
    deviation = math.sqrt(max(inflation * spread[k, k], 0.0))
    tilt = spread[:, k] / spread[k, k] if spread[k, k] > 0.0 else np.zeros(len(minimum.z))
    path = [(float(minimum.z[k]), 0.0)]
    reach = min(room, max(math.sqrt(LEVEL) * deviation, 1e-6 * (high[k] - low[k])))
    inner, outer = (0.0, 0.0), (math.inf, math.inf)
    slopes: Sequence[Array] = problem.slopes(minimum.z)
    # The farthest place within the interval: refits start there, not from one beyond that may have failed.
    within, end = minimum, math.inf * way
    for _ in range(_REFITS if room > 1e-9 * (high[k] - low[k]) else 0):
        at = minimum.z[k] + way * reach
        guess = np.clip(within.z + tilt * (at - within.z[k]), low, high)
        refit = partial(fit, problem, fixed={k: at}, weights=minimum.weights, scale=minimum.noise, loss=loss)
        there = refit(guess, slopes=slopes)
        if not there.converged and math.isfinite(there.objective):
            there = refit(there.z)
        rise = (there.objective - minimum.objective) / inflation
        path.append((at, rise))
        if rise * inflation < -_DEEPER:
            return ProfileBound(end, np.array(path), there)
        if rise >= LEVEL:
            # A refit that has not come to its end tells that the end is before it, not how near.
            outer = (reach, math.sqrt(rise) if there.converged else math.inf)
        else:
            inner, within, slopes = (reach, math.sqrt(max(rise, 0.0))), there, there.slopes or slopes
            if reach >= room * (1.0 - 1e-12):
                break
        crossing, near = _crossing(inner, outer), there.converged and abs(rise - LEVEL) < _LEVEL_ERROR * LEVEL
        if near or math.isfinite(outer[0]):
            end = minimum.z[k] + way * min(crossing, room)
        if near:
            break
        further = 0.0 if math.isfinite(outer[0]) else max(1.2 * inner[0], 1e-6 * room)
        reach = min(room, max(crossing, further))
    return ProfileBound(end, np.array(path))


def _crossing(inner: tuple[float, float], outer: tuple[float, float]) -> float:
    """Return where the root of the rise in likelihood crosses that of the level, from points on either side."""
    target = math.sqrt(LEVEL)
    if math.isinf(outer[1]) and math.isfinite(outer[0]):
        return 0.5 * (inner[0] + outer[0])
    if math.isinf(outer[0]):
        return inner[0] * min(4.0, target / max(inner[1], 1e-3))
    return inner[0] + (target - inner[1]) / (outer[1] - inner[1]) * (outer[0] - inner[0])


def free_directions(problem: Problem, minimum: Fit) -> list[tuple[str, list[int]]]:
    """Return the combinations that the recordings leave open, in words and with their parameters; sorted."""
    low, high = problem.box
    width = high - low
    values, vectors = np.linalg.eigh(information(problem, minimum) * np.outer(width, width))
    directions = []
    for value, vector in zip(values, vectors.T, strict=True):
        if 1.0 / math.sqrt(max(value, 1e-300)) >= _FREE_DEVIATION:
            direction = vector * width
            size = np.abs(direction) / np.max(np.abs(direction))
            shown = [k for k in range(len(size)) if size[k] > _SMALL_ENTRY]
            directions.append((_in_words(problem, direction, shown), shown))
    return directions


def _in_words(problem: Problem, direction: Array, shown: list[int]) -> str:
    """Return a direction of z in words."""
    size = np.abs(direction) / np.max(np.abs(direction))
    names = [problem.keys[k] for k in shown]
    if len(shown) == 1:
        return f"{names[0]} is not determined: the recording hardly feels it"
    if len(shown) == 2 and all(problem.logarithmic[shown]) and min(size[shown]) > 0.8:
        same_sign = direction[shown[0]] * direction[shown[1]] > 0.0
        what = "quotient" if same_sign else "product"
        return f"of {names[0]} and {names[1]} only the {what} is determined"
    return (
        f"only a combination of {_listed(names)} is determined: {_example(problem, direction, shown)} changes nothing"
    )


def _example(problem: Problem, direction: Array, shown: Sequence[int]) -> str:
    first = shown[0]
    step = direction / direction[first] * (math.log(1.1) if problem.logarithmic[first] else 1.0)
    parts = []
    for k in shown:
        change = f"times {math.exp(step[k]):.3g}" if problem.logarithmic[k] else f"plus {step[k]:.3g}"
        parts.append(f"{problem.keys[k]} {change}")
    return " with ".join(parts)


def _listed(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}"
