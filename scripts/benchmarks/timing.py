"""Clocks, and costs compared at equal error."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

_Result = TypeVar("_Result")


class Cost(NamedTuple):
    """A time, s, and its relation to the error asked for: ``=`` interpolated, ``<=`` or ``>=`` a bound.

    It is an upper bound where even the coarsest run is more accurate than asked, and a lower one where no run is
    accurate enough.
    """

    time: float
    relation: str


def clocked(function: Callable[[], _Result]) -> tuple[float, _Result]:
    """Return the wall time of a call, s, and its result."""
    began = time.perf_counter()
    result = function()
    return time.perf_counter() - began, result


def interleaved(jobs: Mapping[str, Callable[[], Any]], rounds: int) -> dict[str, float]:
    """Return the least wall time of every job, s; the jobs take turns, so that all see the same machine."""
    least = dict.fromkeys(jobs, math.inf)
    for _ in range(rounds):
        for name, job in jobs.items():
            least[name] = min(least[name], clocked(job)[0])
    return least


def cost_at(points: Sequence[tuple[float, float]], error: float) -> Cost | None:
    """Return the cost at an error, on the front of the best (error, cost) points, straight between them in log-log.

    Args:
        points: Pairs of error and cost; those with an error that is not a positive number are left out.
        error: Error at which to interpolate.
    """
    front: list[tuple[float, float]] = []
    for point in sorted(p for p in points if math.isfinite(p[0]) and p[0] > 0.0):
        if not front or point[1] < front[-1][1]:
            front.append(point)
    if not front:
        return None
    if error < front[0][0]:
        return Cost(front[0][1], ">=")
    if error > front[-1][0]:
        return Cost(front[-1][1], "<=")
    for (fine, dear), (coarse, cheap) in itertools.pairwise(front):
        if fine <= error <= coarse:
            share = math.log(error / fine) / math.log(coarse / fine)
            return Cost(dear * (cheap / dear) ** share, "=")
    return Cost(front[0][1], "=")
