"""Search for the estimate in resumable pieces: starts, minima and their intervals."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import TypeVar

import numpy as np
from scipy.stats import qmc

from finger_pin.description.recordings.bench import IdentifySettings
from finger_pin.exceptions import InputError
from finger_pin.identification.checkpoint import Checkpoint
from finger_pin.identification.comparison import LawComparison, compare_laws
from finger_pin.identification.cross_validation import CrossValidation, cross_validation, find_settings, refit_without
from finger_pin.identification.estimate import Fit, best_of, fit, fit_with_restarts, influential_parameters
from finger_pin.identification.intervals import CHI2_95, ProfileBound, SmallSample, covariance, profile
from finger_pin.identification.likelihood import minus_twice_likelihood
from finger_pin.identification.misfit import sandwich_covariance
from finger_pin.identification.open_directions import OpenDirection, lowest_minima, neighbour_lines, open_directions
from finger_pin.identification.problem import Problem
from finger_pin.identification.scenario_parameters import entry_of
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
# Values within a parameter's bounds at which its influence on outputs is tested.
_BOUND_SAMPLES = 5


class FitPipeline:
    """Work of an identification in pieces; finished pieces count when it is stopped."""

    def __init__(self, problem: Problem, checkpoint: Checkpoint, loss: str, progress: Progress | None) -> None:
        """Create a pipeline without finished work."""
        self.problem, self.checkpoint, self.loss = problem, checkpoint, loss
        self.report_progress = progress or (lambda words, done, total: None)
        self.fits: list[Fit] = []
        self.fine_fit: Fit | None = None
        self.interval_ends: dict[tuple[int, int], ProfileBound] = {}
        self.covariance: Array | None = None
        self._fine: Problem | None = None
        self.left_out: CrossValidation | None = None
        self.open_directions: list[OpenDirection] = []
        self.comparison: LawComparison | None = None

    @property
    def best(self) -> Fit:
        """The fit from which profiles start, or the best fit so far."""
        return self.fine_fit or best_of(self.problem, self.fits)

    def screen_starts(self, points: Sequence[Array], count: int) -> list[Array]:
        """Return the first point, and the best of the others, up to a count.

        A hunting motion has no slopes to follow: such points come last.
        """

        def misfit(problem: Problem, z: Array) -> float:
            return _objective(problem, problem.residuals(z))

        problem, other_count = self.problem.rough() if self.problem.has_motion else self.problem, len(points) - 1
        misfits = self._side_by_side(
            "trying starts", lambda item: misfit(item[1], points[1 + item[0]]), other_count, problem
        )
        order = np.argsort(misfits, kind="stable").tolist()
        change = _HUNTING_CHANGE * np.subtract(*self.problem.box)

        def hunts(item: tuple[int, Problem]) -> bool:
            k = order[item[0]]
            return not abs(misfit(item[1], points[1 + k] + change) - misfits[k]) < _HUNTING_JUMP

        candidates = order[: 2 * (count - 1)] if self.problem.has_motion else []
        hunting_flags = self._side_by_side("trying starts", hunts, len(candidates), problem)
        hunting = dict(zip(candidates, hunting_flags, strict=True))
        return [points[0], *(points[1 + k] for k in sorted(order, key=lambda k: hunting.get(k, True))[: count - 1])]

    def search(self, starts: Sequence[Array]) -> None:
        """Search from all starts; for motions, search roughly first and continue from the promising ends."""
        points, starts, abandoned = starts, *self._search_roughly(starts)
        minima: dict[int, Fit] = {}

        def search_from(item: tuple[int, Problem]) -> None:
            k, twin = item
            start = self.checkpoint.last_point(f"start {k}", starts[k])
            minima[k] = self.checkpoint.fit(f"start {k}", twin, partial(fit_with_restarts, twin, start, self.loss))

        try:
            self._side_by_side("searching", search_from, len(starts))
        finally:
            self.fits += [minima[k] for k in sorted(minima)]
        self.fits += [fit(self.problem, z, fixed=dict(enumerate(z))) for z in abandoned]
        if not np.isfinite(self.best.objective):
            raise InputError(
                "identify.recordings", "the motion fails wherever the search starts; narrow the parameters"
            )
        _check_influence(self.problem, self.fits, points)
        if self.problem.has_motion:
            self._search_neighbours()

    def _search_roughly(self, starts: Sequence[Array]) -> tuple[Sequence[Array], Sequence[Array]]:
        """Return the ends of rough searches in two groups: promising ones, and the others."""
        if not self.problem.has_motion:
            return starts, []
        rough, minima = self.problem.rough(), dict[int, Fit]()

        def search_from(item: tuple[int, Problem]) -> None:
            k, twin = item
            work = partial(fit_with_restarts, twin, self.checkpoint.last_point(f"rough {k}", starts[k]), self.loss)
            minima[k] = self.checkpoint.fit(f"rough {k}", twin, work)

        self._side_by_side("searching roughly", search_from, len(starts), rough)
        objectives = {k: _objective(rough, minima[k].residuals) for k in sorted(minima)}
        promising = [k for k in objectives if objectives[k] <= min(objectives.values()) + _ABANDONED_RISE]
        return [minima[k].z for k in promising], [minima[k].z for k in objectives if k not in promising]

    def _search_neighbours(self) -> None:
        """Move to deeper neighbouring minima as long as there are any."""
        label = "looking beside the best place"
        for turn in itertools.count():
            best, number = self.best, self.fits.index(self.best)
            lines = neighbour_lines(self.problem, best.z)
            points = [point for line in lines for point in line]

            def misfit(item: tuple[int, Problem], points: Sequence[Array] = points) -> float:
                return _objective(item[1], item[1].residuals(points[item[0]]))

            neighbours = lowest_minima(lines, self._side_by_side(label, misfit, len(points)), _NEIGHBOUR_COUNT + 1)
            others = [z for z in neighbours if not np.array_equal(z, best.z)][:_NEIGHBOUR_COUNT]

            def search_from(item: tuple[int, Problem], others: Sequence[Array] = others, turn: int = turn) -> Fit:
                k, twin = item
                return self.checkpoint.fit(f"valley {turn} {k}", twin, partial(fit, twin, others[k], loss=self.loss))

            self.fits[number] = best_of(self.problem, [best, *self._side_by_side(label, search_from, len(others))])
            before, after = (_objective(self.problem, each.residuals) for each in (best, self.best))
            if after > before - _LOWER_MINIMUM_FALL:
                return

    def _fit_finely(self, start: Fit) -> tuple[Problem, Fit, Array, Array]:
        """Return the fine problem, its minimum near a fit, the covariance by the likelihood, and inflations.

        These are, by parameter, how much more than 3.841 the likelihood rises at the ends of its interval.
        """
        fine, number = self.problem.fine(), self.fits.index(self.best)
        best = self.fits[number] = self.fine_fit = fit(fine, start.z, loss=self.loss, slopes=start.slopes)
        likelihood_covariance = covariance(fine, best)
        small_sample = SmallSample.from_fit(fine, best, likelihood_covariance)
        sandwich = sandwich_covariance(fine, best, likelihood_covariance)
        inflations = np.diag(sandwich) / np.diag(likelihood_covariance) * small_sample.level / CHI2_95
        self.covariance = sandwich * np.sqrt(np.outer(small_sample.variance, small_sample.variance))
        self.problem.join(fine)
        self._fine = fine
        return fine, best, likelihood_covariance, inflations

    def linearise(self, start: Fit) -> None:
        """Compute intervals from slopes alone; a side that they take beyond the bounds is open."""
        fine, best, *_ = self._fit_finely(start)
        low, high = fine.box
        assert self.covariance is not None
        for k, side in itertools.product(range(self.problem.requested_count), (-1, 1)):
            end = best.z[k] + side * np.sqrt(CHI2_95 * max(self.covariance[k, k], 0.0))
            path = np.array([[best.z[k], 0.0]])
            self.interval_ends[k, side] = ProfileBound(float(end) if low[k] < end < high[k] else math.inf * side, path)

    def profile_all(self, start: Fit, turn: int = 0) -> None:
        """Compute all profiles; restart from a lower minimum if one is found."""
        fine, best, likelihood_covariance, inflations = self._fit_finely(start)
        ends = [(k, side) for k in range(self.problem.requested_count) for side in (-1, 1)]

        def profile_end(item: tuple[int, Problem]) -> Fit | None:
            (k, side), twin = ends[item[0]], item[1]
            work = partial(profile, twin, best, k, side, likelihood_covariance, self.loss, float(inflations[k]))
            bound = self.checkpoint.interval_end(f"side {k} {side} {turn}", work)
            if bound.lower_minimum is None:
                self.interval_ends[k, side] = bound
            return bound.lower_minimum

        lower_minima = self._side_by_side("following the likelihood", profile_end, len(ends), fine)
        better_minima = [each for each in lower_minima if each is not None]
        if better_minima:
            self.interval_ends.clear()
            self.profile_all(min(better_minima, key=lambda minimum: minimum.objective), turn + 1)

    def cross_validate(self) -> None:
        """Refit without one setting each."""
        fine, best = self._fine, self.best
        assert fine is not None
        settings = find_settings(fine)
        names = list(settings)

        def refit(item: tuple[int, Problem]) -> Fit:
            name, twin = names[item[0]], item[1]
            work = partial(refit_without, twin, best, settings, name, self.loss)
            # Those of readings are sooner made than read back.
            return work() if not twin.has_motion else self.checkpoint.fit(f"without {name}", twin, work)

        refits = self._side_by_side("leaving out one at a time", refit, len(names), fine)
        self.left_out = cross_validation(settings, refits)

    def find_open_directions(self, refits: bool) -> None:
        """Find the directions that the recordings leave open by slopes, and try them by refits if asked."""
        assert self._fine is not None
        self.open_directions = open_directions(self._fine, self.best, self.loss, refits)
        self.problem.join(self._fine)

    def _side_by_side(
        self, label: str, task: Callable[[tuple[int, Problem]], _Outcome], count: int, problem: Problem | None = None
    ) -> list[_Outcome]:
        """Run numbered tasks, each with its own copy of the problem, in threads where they simulate."""
        twins, finished = [(problem or self.problem).thread_copy() for _ in range(count)], itertools.count(1)
        self.report_progress(label, 0, count)

        def run_task(item: tuple[int, Problem]) -> _Outcome:
            outcome = task(item)
            self.report_progress(label, next(finished), count)
            return outcome

        items = list(enumerate(twins))
        try:
            return in_threads(run_task, items) if self.problem.has_motion else [run_task(item) for item in items]
        finally:
            for twin in twins:
                self.problem.join(twin)

    def compare(self, settings: IdentifySettings) -> None:
        """Fit other laws, if there are any."""
        if settings.compare:
            self.report_progress("comparing laws", 0, 1)
            work = partial(compare_laws, self.problem, settings, self.best)
            self.comparison = self.checkpoint.comparison(work)


def starting_points(problem: Problem, count: int, seed: int) -> list[Array]:
    """Return the points to start from: the scenario's own numbers, then scrambled Sobol points to choose from."""
    low, high = problem.box
    extra_count = _SOBOL_PER_SEARCH * max(count - 1, 0)
    shares = qmc.Sobol(len(low), rng=seed).random_base2(max(extra_count - 1, 0).bit_length())[:extra_count]
    return [problem.start, *map(problem.feasible, low + (high - low) * shares)]


def _objective(problem: Problem, residuals: Sequence[Array]) -> float:
    """Return minus twice the log-likelihood with equal weights; infinite if a motion fails."""
    if not all(np.isfinite(each).all() for each in residuals):
        return np.inf
    return minus_twice_likelihood(residuals, np.ones(len(residuals)), problem.noise_groups, problem.least_noise)


def _check_influence(problem: Problem, fits: Sequence[Fit], points: Sequence[Array]) -> None:
    influential, (low, high) = np.zeros(len(problem.keys), dtype=bool), problem.box
    known_slopes = (each.slopes or problem.slopes(each.z) for each in fits)
    for slopes in itertools.chain(known_slopes, map(problem.slopes, points)):
        influential |= influential_parameters(problem, slopes)
        if influential.all():
            return
    best = best_of(problem, fits)
    for k in np.flatnonzero(~influential):
        # A parameter may have influence elsewhere, such as friction that holds in all searches.
        for share in np.linspace(0.0, 1.0, _BOUND_SAMPLES):
            point = best.z.copy()
            point[k] = low[k] + share * (high - low)[k]
            changed_residuals = problem.residuals(problem.feasible(point))
            influential[k] |= not all(map(np.array_equal, changed_residuals, best.residuals))
    if influential.all():
        return
    key = problem.keys[int(np.flatnonzero(~influential)[0])]
    raise InputError(entry_of(key), "no output of any recording feels it, at no value in its bounds; leave it out")
