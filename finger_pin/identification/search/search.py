"""Search for the least minimum: from several starts, roughly first where runs have errors, and beside the best one."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeVar

import numpy as np
from scipy.linalg import eigh
from scipy.stats import qmc

from finger_pin.identification.search.checkpoint import Checkpoint
from finger_pin.identification.search.gauss_newton import Fit, best_of, fit, fit_at, fit_with_restarts
from finger_pin.identification.search.objective import Objective
from finger_pin.threads import in_threads
from finger_pin.typing import Array

#: Called with the name of the task, the number of finished parts, and the number of all.
Progress = Callable[[str, int, int], None]
_Outcome = TypeVar("_Outcome")
# Sobol points per search beyond the first; each costs one evaluation.
_SOBOL_PER_SEARCH = 4
# Jump of minus twice the log-likelihood that shows a hunting motion, and the change for it, part of the bounds.
_HUNTING_JUMP, _HUNTING_CHANGE = 10.0, 1e-5
# Minus twice the log-likelihood above that of the best rough search at which another is abandoned: exp(-50) as likely.
_ABANDONED_RISE = 100.0
# Number of neighbouring minima to search from, and least fall of minus twice the log-likelihood to a lower minimum.
_NEIGHBOUR_COUNT, _LOWER_MINIMUM_FALL = 2, 1.0
# Lines through the best point: least and greatest ratio of the deviation by means over cycles to that by samples along
# their directions, number of lines, and spacing of points in deviations by samples.
_MIN_CONTRAST, _MAX_CONTRAST, _LINE_COUNT, _POINT_SPACING = 4.0, 10.0, 2, 3.0


class Search:
    """Minima of an objective; finished pieces count when it is stopped.

    Attributes:
        objective: The objective.
        fits: The minimum from every start.
    """

    def __init__(self, objective: Objective[Any], checkpoint: Checkpoint, loss: str, progress: Progress | None) -> None:
        """Prepare a search; the loss is one of `LOSSES`."""
        self.objective, self.fits = objective, list[Fit]()
        self._checkpoint, self._loss = checkpoint, loss
        self._report = progress or (lambda words, done, total: None)

    @property
    def best(self) -> Fit:
        """The best fit so far."""
        return best_of(self.objective, self.fits)

    def screened(self, points: Sequence[Array], count: int) -> list[Array]:
        """Return the first point, and the best of the others, up to a count.

        A hunting motion has no slopes to follow: such points come last.
        """
        objective = self.objective if self.objective.exact else self._rough()
        values = self._values("trying starts", points[1:], objective)
        order = np.argsort(values, kind="stable").tolist()
        candidates = [] if objective.exact else order[: 2 * (count - 1)]
        change = _HUNTING_CHANGE * -self.objective.width
        beside = self._values("trying starts", [points[1 + k] + change for k in candidates], objective)
        hunts = {k: not abs(value - values[k]) < _HUNTING_JUMP for k, value in zip(candidates, beside, strict=True)}
        return [points[0], *(points[1 + k] for k in sorted(order, key=lambda k: hunts.get(k, True))[: count - 1])]

    def descend(self, starts: Sequence[Array]) -> None:
        """Descend from all starts; where runs have errors, roughly first and then from the promising ends."""
        abandoned: Sequence[Array] = []
        if not self.objective.exact:
            rough, minima = self._rough(), dict[int, Fit]()
            self._descend("searching roughly", "rough", starts, minima, rough)
            values = {k: rough.likelihood.minus_twice_log(minima[k].residuals) for k in sorted(minima)}
            promising = [k for k in values if values[k] <= min(values.values()) + _ABANDONED_RISE]
            starts = [minima[k].z for k in promising]
            abandoned = [minima[k].z for k in values if k not in promising]
        minima = {}
        try:
            self._descend("searching", "start", starts, minima, self.objective)
        finally:
            self.fits += [minima[k] for k in sorted(minima)]
        self.fits += [fit_at(self.objective, z) for z in abandoned]

    def _rough(self) -> Objective[Any]:
        return Objective(self.objective.function.with_accuracy("rough"), self.objective.stop)

    def _descend(
        self, label: str, name: str, starts: Sequence[Array], minima: dict[int, Fit], objective: Objective[Any]
    ) -> None:
        """Add the minima from all starts by number."""

        def descend_from(k: int, twin: Objective[Any]) -> None:
            start = self._checkpoint.last_point(f"{name} {k}", starts[k])
            minima[k] = self._checkpoint.fit(f"{name} {k}", twin, partial(fit_with_restarts, twin, start, self._loss))

        self.side_by_side(label, descend_from, len(starts), objective)

    def visit_neighbours(self) -> None:
        """Move to deeper minima beside the best one as long as there are any."""
        label, likelihood = "looking beside the best place", self.objective.likelihood
        for turn in itertools.count():
            best, number = self.best, self.fits.index(self.best)
            lines = _neighbour_lines(self.objective, best.z)
            values = self._values(label, [point for line in lines for point in line], self.objective)
            neighbours = _lowest_minima(lines, values, _NEIGHBOUR_COUNT + 1)
            others = [z for z in neighbours if not np.array_equal(z, best.z)][:_NEIGHBOUR_COUNT]

            def descend_from(k: int, twin: Objective[Any], others: Sequence[Array] = others, turn: int = turn) -> Fit:
                return self._checkpoint.fit(f"valley {turn} {k}", twin, partial(fit, twin, others[k], loss=self._loss))

            found = self.side_by_side(label, descend_from, len(others), self.objective)
            self.fits[number] = best_of(self.objective, [best, *found])
            before, after = (likelihood.minus_twice_log(each.residuals) for each in (best, self.best))
            if after > before - _LOWER_MINIMUM_FALL:
                return

    def side_by_side(
        self, label: str, task: Callable[[int, Objective[Any]], _Outcome], count: int, objective: Objective[Any]
    ) -> list[_Outcome]:
        """Run numbered tasks, each with its own copy of an objective, in threads where they simulate."""
        twins, finished = [objective.thread_copy() for _ in range(count)], itertools.count(1)
        self._report(label, 0, count)

        def run_task(k: int) -> _Outcome:
            outcome = task(k, twins[k])
            self._report(label, next(finished), count)
            return outcome

        try:
            return list(map(run_task, range(count))) if objective.exact else in_threads(run_task, range(count))
        finally:
            for twin in twins:
                self.objective.join(twin)

    def _values(self, label: str, points: Sequence[Array], objective: Objective[Any]) -> list[float]:
        """Return minus twice the log-likelihood at points."""

        def value(k: int, twin: Objective[Any]) -> float:
            return twin.likelihood.minus_twice_log(twin.residuals(points[k]))

        return self.side_by_side(label, value, len(points), objective)


def starting_points(objective: Objective[Any], start: Array, count: int, seed: int) -> list[Array]:
    """Return the points to start from: a start, then scrambled Sobol points to choose from."""
    low, high = objective.box
    extra_count = _SOBOL_PER_SEARCH * max(count - 1, 0)
    shares = qmc.Sobol(len(low), rng=seed).random_base2(max(extra_count - 1, 0).bit_length())[:extra_count]
    return [start, *map(objective.feasible, low + (high - low) * shares)]


def _neighbour_lines(objective: Objective[Any], z: Array) -> list[Array]:
    """Return lines of points through a minimum, shape (k, p) each, along directions with several minima.

    The likelihood of samples has a minimum for every cycle; that of means over cycles covers several of them.
    """
    residuals, slopes = objective.residuals(z), objective.slopes(z)
    (low, high), block_means = objective.box, objective.function.block_means
    size = np.outer(high - low, high - low)
    by_samples, by_means = (
        size * sum(j.T @ j / max(float(np.mean(e * e)), 1e-300) for e, j in zip(*each, strict=True))
        for each in ((residuals, slopes), (block_means(residuals), block_means(slopes)))
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


def _lowest_minima(lines: Sequence[Array], objectives: Sequence[float], count: int) -> list[Array]:
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
