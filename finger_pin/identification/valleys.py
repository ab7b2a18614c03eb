"""Valleys of a likelihood beside the one that a search has ended in: of ringing, one for every cycle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from finger_pin.identification.problem import Problem
from finger_pin.typing import Array

# Directions that samples tell so much more surely than means over cycles do, and how many of them are looked along.
_SURER, _MOST = 4.0, 2
# How far, in deviations by the means and at the most in those by the samples, and how closely.
_FAR, _FARTHEST, _APART = 3.0, 30.0, 3.0
# What keeps directions that nothing tells from being divided by.
_LITTLE, _LEAST = 1e-4, 1e-12


def beside(problem: Problem, z: Array) -> list[Array]:
    """Return lines of places through a minimum, shape (k, p) each, in directions that are known by cycles alone.

    What cycles tell has a minimum for each of them; what means over cycles tell leaves so many of these open.
    """
    residuals, slopes = problem.residuals(z), problem.slopes(z)
    low, high = problem.box
    size = np.outer(high - low, high - low)
    by_samples, by_means = (
        size * sum(j.T @ j / max(float(np.mean(e * e)), 1e-300) for e, j in zip(*each, strict=True))
        for each in ((residuals, slopes), (problem.averaged(residuals), problem.averaged(slopes)))
    )
    least = _LITTLE * by_samples + _LEAST * np.trace(by_samples) * np.eye(len(z))
    values, vectors = scipy.linalg.eigh(by_samples, by_means + least)
    lines = []
    for value, vector in zip(values[-_MOST:], vectors.T[-_MOST:], strict=True):
        if value < _SURER**2:
            continue
        one = (high - low) * vector / np.sqrt(vector @ by_samples @ vector)
        count = int(min(_FAR * np.sqrt(value), _FARTHEST) / _APART)
        places = z + _APART * np.arange(-count, count + 1)[:, None] * one
        lines.append(places[np.all((places >= low) & (places <= high), axis=1)])
    return lines


def lowest(lines: Sequence[Array], met: Sequence[float], count: int) -> list[Array]:
    """Return the places of lines, lowest first, from which it rises to either side: at their ends, to one.

    Args:
        lines: Places, shape (k, p) each.
        met: How badly the recordings are met at all of them in turn.
        count: Of how many at the most.
    """
    found, first = [], 0
    for line in lines:
        values = np.array([np.inf, *met[first : first + len(line)], np.inf])
        first += len(line)
        dips = np.flatnonzero((values[1:-1] < values[:-2]) & (values[1:-1] < values[2:]))
        found += [(values[1 + k], line[k]) for k in dips]
    return [place for _, place in sorted(found, key=lambda each: each[0])[:count]]
