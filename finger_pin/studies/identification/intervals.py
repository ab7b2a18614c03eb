"""Intervals by the profile likelihood, and the directions in which a recording leaves the parameters free."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from finger_pin.description.routing import Array
from finger_pin.studies.identification.estimate import Fit, fit_beside, information
from finger_pin.studies.identification.problem import Problem

#: 95 % of the chi-squared distribution with one degree of freedom.
LEVEL = 3.841
# Where the search for an end stops: how near to the level, and after how many fits.
_NEAR, _MOST = 0.02, 8
# A direction is free where its standard deviation is this part of the range that was given, or more.
_FREE = 0.25
# Entries of a direction that are not worth a word, of the largest.
_SMALL = 0.15


@dataclass(frozen=True, eq=False)
class Side:
    """One end of an interval.

    Attributes:
        end: z there; infinite where the recording does not close it within the bounds.
        path: Points of the profile, shape (k, 2): z and the rise of minus twice the likelihood.
        better: A minimum below the one that it started from, if one turned up.
    """

    end: float
    path: Array
    better: Fit | None = None


def covariance(problem: Problem, found: Fit) -> Array:
    """Return the linearised covariance of z, shape (p, p); pseudo-inverse where a direction is free."""
    low, high = problem.box
    width = high - low
    scaled = information(problem, found) * np.outer(width, width)
    return np.asarray(np.linalg.pinv(scaled, rcond=1e-14, hermitian=True) * np.outer(width, width))


def profile(problem: Problem, found: Fit, k: int, way: int, spread: Array) -> Side:
    """Return the end of the interval of parameter k on one side, 2 (l* - l(p_k)) = 3.841.

    Args:
        problem: What was fitted.
        found: Its minimum.
        k: Which parameter.
        way: 1 for the upper end, -1 for the lower.
        spread: Covariance of z.
    """
    low, high = problem.box
    limit = high[k] if way > 0 else low[k]
    room = abs(limit - found.z[k])
    deviation = math.sqrt(max(spread[k, k], 0.0))
    tilt = spread[:, k] / spread[k, k] if spread[k, k] > 0.0 else np.zeros(len(found.z))
    path = [(float(found.z[k]), 0.0)]
    reach = min(room, max(math.sqrt(LEVEL) * deviation, 1e-6 * (high[k] - low[k])))
    inner, outer = (0.0, 0.0), (math.inf, math.inf)
    start, end = found.z.copy(), math.inf * way
    for _ in range(_MOST):
        if room <= 1e-9 * (high[k] - low[k]):
            break
        at = found.z[k] + way * reach
        guess = np.clip(start + tilt * (at - start[k]), low, high)
        guess[k] = at
        there = fit_beside(problem, found, guess, k)
        rise, start = there.objective - found.objective, there.z
        path.append((at, rise))
        if rise < -0.05:
            return Side(end, np.array(path), there)
        if abs(rise - LEVEL) < _NEAR * LEVEL:
            end = at
            break
        if rise < LEVEL:
            inner = (reach, math.sqrt(max(rise, 0.0)))
            if reach >= room * (1.0 - 1e-12):
                break
        else:
            outer = (reach, math.sqrt(rise))
        end, reach = _next(inner, outer, room, found.z[k], way, end)
    return Side(end, np.array(path))


def _next(
    inner: tuple[float, float], outer: tuple[float, float], room: float, z: float, way: int, end: float
) -> tuple[float, float]:
    """Return the best estimate of the end so far, and where to look next: the root of the rise is nearly straight."""
    target = math.sqrt(LEVEL)
    if math.isinf(outer[0]):
        further = inner[0] * min(4.0, max(1.2, target / max(inner[1], 1e-3)))
        return end, min(room, max(further, 1e-6 * room))
    share = (target - inner[1]) / (outer[1] - inner[1])
    crossing = inner[0] + share * (outer[0] - inner[0])
    return z + way * crossing, crossing


def free_directions(problem: Problem, found: Fit) -> list[tuple[str, list[int]]]:
    """Return what the recordings do not determine, in words and which parameters these are about; sorted."""
    low, high = problem.box
    width = high - low
    values, vectors = np.linalg.eigh(information(problem, found) * np.outer(width, width))
    found_free = []
    for value, vector in zip(values, vectors.T, strict=True):
        if 1.0 / math.sqrt(max(value, 1e-300)) >= _FREE:
            direction = vector * width
            size = np.abs(direction) / np.max(np.abs(direction))
            shown = [k for k in range(len(size)) if size[k] > _SMALL]
            found_free.append((_in_words(problem, direction, shown), shown))
    return found_free


def _in_words(problem: Problem, direction: Array, shown: list[int]) -> str:
    """Return a direction of z as what it leaves open."""
    size = np.abs(direction) / np.max(np.abs(direction))
    names = [problem.keys[k] for k in shown]
    if len(shown) == 1:
        return f"{names[0]} is not determined: the recording hardly feels it"
    if len(shown) == 2 and all(problem.logarithmic[shown]) and min(size[shown]) > 0.8:
        alike = direction[shown[0]] * direction[shown[1]] > 0.0
        what = "quotient" if alike else "product"
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
