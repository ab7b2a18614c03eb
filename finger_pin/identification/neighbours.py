"""Minima beside the one that a search has ended in: of what rings, one for every cycle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import eigh

from finger_pin.identification.problem import Problem
from finger_pin.typing import Array

# Lines through the best point: least and greatest ratio of the deviation by means over cycles to that by samples along
# their directions, number of lines, and spacing of points in deviations by samples.
_MIN_CONTRAST, _MAX_CONTRAST, _LINE_COUNT, _POINT_SPACING = 4.0, 10.0, 2, 3.0


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
