"""Directions from a minimum: along which others lie, one for every cycle, and along which recordings leave it open."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from finger_pin.identification.estimate import Fit, fit, information
from finger_pin.identification.intervals import CHI2_95
from finger_pin.identification.problem import Problem
from finger_pin.typing import Array

# Lines through the best point: least and greatest ratio of the deviation by means over cycles to that by samples along
# their directions, number of lines, and spacing of points in deviations by samples.
_MIN_CONTRAST, _MAX_CONTRAST, _LINE_COUNT, _POINT_SPACING = 4.0, 10.0, 2, 3.0
# Standard deviation, part of the range, from which on a direction is free: an interval of 95 % is as wide as the range.
_FREE_DEVIATION = 0.25
# Entries of a direction that are left out of its words, part of the largest.
_SMALL_ENTRY = 0.15
# Parameters that are left out of the words of a step, part of the largest move over its range.
_SMALL_MOVE = 0.01
# Least step that is worth a try, part of that by which a free direction may move.
_LEAST_STEP = 0.1


def neighbour_lines(problem: Problem, z: Array) -> list[Array]:
    """Return lines of points through a minimum, shape (k, p) each, along directions with several minima.

    The likelihood of samples has a minimum for every cycle; that of means over cycles covers several of them.
    """
    residuals, slopes = problem.residuals(z), problem.slopes(z)
    low, high = problem.box
    size = np.outer(high - low, high - low)
    by_samples, by_means = (
        size * sum(j.T @ j / max(float(np.mean(e * e)), 1e-300) for e, j in zip(*each, strict=True))
        for each in ((residuals, slopes), (problem.block_means(residuals), problem.block_means(slopes)))
    )
    rounding = max(1e-12 * np.trace(by_samples), 1e-300) * np.eye(len(z))
    values, vectors = eigh(by_means + rounding, by_samples + rounding)
    lines = []
    for value, vector in zip(values[:_LINE_COUNT], vectors.T[:_LINE_COUNT], strict=True):
        contrast = min(1.0 / np.sqrt(max(value, 1e-300)), _MAX_CONTRAST)
        if contrast < _MIN_CONTRAST:
            continue
        spacing = _POINT_SPACING * (high - low) * vector / np.sqrt(vector @ by_samples @ vector)
        count = int(contrast)
        points = z + np.arange(-count, count + 1)[:, None] * spacing
        lines.append(points[np.all((points >= low) & (points <= high), axis=1)])
    return lines


def lowest_minima(lines: Sequence[Array], objectives: Sequence[float], count: int) -> list[Array]:
    """Return the local minima along lines, lowest first; an end counts if it rises inwards.

    Args:
        lines: Places, shape (k, p) each.
        objectives: Objective at each point of all lines in turn.
        count: Greatest number of minima.
    """
    minima, first = [], 0
    for line in lines:
        values = np.array([np.inf, *objectives[first : first + len(line)], np.inf])
        first += len(line)
        dips = np.flatnonzero((values[1:-1] < values[:-2]) & (values[1:-1] < values[2:]))
        minima += [(values[1 + k], line[k]) for k in dips]
    return [point for _, point in sorted(minima, key=lambda minimum: minimum[0])[:count]]


@dataclass(frozen=True)
class OpenDirection:
    """A combination of parameters that the recordings leave open by slopes.

    Attributes:
        text: The direction in words.
        parameters: Indices of the parameters that it leaves open; none where a refit has shown otherwise.
    """

    text: str
    parameters: tuple[int, ...]


def open_directions(problem: Problem, minimum: Fit, loss: str = "linear", refits: bool = True) -> list[OpenDirection]:
    """Return the combinations that the recordings leave open, each with a step along it that a refit has tried.

    Args:
        problem: The problem that was fitted.
        minimum: Of the problem.
        loss: As for `fit`.
        refits: Whether a refit tries it.
    """
    low, high = problem.box
    width = high - low
    values, vectors = np.linalg.eigh(information(problem, minimum) * np.outer(width, width))
    directions = []
    for value, vector in zip(values, vectors.T, strict=True):
        if 1.0 / math.sqrt(max(value, 1e-300)) >= _FREE_DEVIATION:
            direction = vector * width
            # In parts of the ranges: what has little room is moved across it by little.
            size = np.abs(vector) / np.max(np.abs(vector))
            shown = [k for k in range(len(size)) if size[k] > _SMALL_ENTRY]
            directions.append(_describe(problem, minimum, direction, shown, loss, refits))
    return directions


def _describe(
    problem: Problem, minimum: Fit, direction: Array, shown: Sequence[int], loss: str, refits: bool
) -> OpenDirection:
    """Return a direction of z in words, after a try if there is no simpler form."""
    size = np.abs(direction) / np.max(np.abs(direction))
    names = [problem.keys[k] for k in shown]
    if len(shown) == 1:
        return OpenDirection(f"{names[0]} is not determined: the recording hardly feels it", tuple(shown))
    if len(shown) == 2 and all(problem.logarithmic[shown]) and min(size[shown]) > 0.8:
        same_sign = direction[shown[0]] * direction[shown[1]] > 0.0
        combination = "quotient" if same_sign else "product"
        text = f"of {names[0]} and {names[1]} only the {combination} is determined"
        return OpenDirection(text, tuple(shown))
    listed = f"{', '.join(names[:-1])} and {names[-1]}"
    step = _step_within_bounds(problem, minimum.z, direction) if refits else None
    if step is None:
        reason = "the bounds leave no room for a try" if refits else "nothing was tried"
        text = f"by slopes a combination of {listed} is open, along which {reason}"
        return OpenDirection(text, tuple(shown))
    low, high = problem.box
    moved, rise = _refit_after(problem, minimum, step, int(np.argmax(np.abs(step) / (high - low))), loss)
    example = _step_text(problem, moved - minimum.z)
    if rise < CHI2_95:
        text = f"only a combination of {listed} is determined: with {example} the recordings are met as well"
        return OpenDirection(f"{text} (2 log L falls by {max(rise, 0.0):.2g}; 3.8 ends an interval)", tuple(shown))
    worse = f"2 log L falls by {rise:.3g}" if math.isfinite(rise) else "the motion fails"
    text = f"by slopes a combination of {listed} is open, but with {example} {worse} (3.8 ends an interval)"
    return OpenDirection(text, ())


def _step_within_bounds(problem: Problem, z: Array, direction: Array) -> Array | None:
    """Return the longer of the two steps along a direction that stay within the bounds; None if both are short."""
    low, high = problem.box
    full = direction * _FREE_DEVIATION / np.max(np.abs(direction) / (high - low))
    steps = []
    for step in (full, -full):
        room = np.where(step > 0.0, high - z, z - low)
        shares = np.divide(room, np.abs(step), out=np.full(len(z), np.inf), where=step != 0.0)
        # Entries that hardly count are cut at their bounds.
        size = np.abs(step) / (high - low)
        counted = size > _SMALL_ENTRY * np.max(size)
        share = min(1.0, float(np.min(shares[counted])))
        steps.append((share, np.clip(z + share * step, low, high) - z))
    share, longest = max(steps, key=lambda pair: pair[0])
    return longest if share >= _LEAST_STEP else None


def _refit_after(problem: Problem, minimum: Fit, step: Array, k: int, loss: str) -> tuple[Array, float]:
    """Return z with parameter k a step away and the others fitted anew, and the rise of minus twice log L."""
    start = minimum.z + step
    refit = fit(problem, start, fixed={k: float(start[k])}, weights=minimum.weights, scale=minimum.noise, loss=loss)
    return refit.z, refit.objective - minimum.objective


def _step_text(problem: Problem, step: Array) -> str:
    """Return a step in words: all parameters that it moves."""
    size = np.abs(step) / np.subtract(*reversed(problem.box))
    parts = []
    for k in np.flatnonzero(size > _SMALL_MOVE * np.max(size)):
        change = f"times {math.exp(step[k]):.3g}" if problem.logarithmic[k] else f"plus {step[k]:.3g}"
        if change != "times 1":
            parts.append(f"{problem.keys[k]} {change}")
    return ", ".join(parts)
