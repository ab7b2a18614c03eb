"""The search, piece by piece: its starts, its ends, and their intervals; finished pieces are kept."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import TypeVar

import numpy as np
from scipy.linalg import eigh
from scipy.stats import qmc

from finger_pin.core.threads import in_threads
from finger_pin.description.recordings.bench import IdentifySettings
from finger_pin.exceptions import InputError
from finger_pin.identification.checkpoint import Checkpoint
from finger_pin.identification.comparison import LawComparison, compare_laws
from finger_pin.identification.estimate import Fit, best_of, felt, fit, fit_off_flats
from finger_pin.identification.intervals import LEVEL, ProfileBound, SmallSample, covariance, profile
from finger_pin.identification.likelihood import minus_twice_likelihood
from finger_pin.identification.misfit import sandwich
from finger_pin.identification.problem import Problem
from finger_pin.identification.scenario_parameters import entry_of
from finger_pin.typing import Array

#: Called with what is being done, how much of it is finished, and how much there is.
Progress = Callable[[str, int, int], None]
_Found = TypeVar("_Found")
# Sobol points tried for every further search, by one evaluation.
_TRIED = 4
# A motion hunts where minus twice the log-likelihood jumps by so much for a change of this part of the bounds.
_JUMP, _TINY = 10.0, 1e-5
# Minus twice the log-likelihood above the best rough search at which another one is given up: exp(-50) as likely.
_HOPELESS = 100.0
# Lines through the best place: directions that samples tell so many times as surely as means over cycles do (beyond the
# second it makes no difference), the number of lines, and the deviations of samples between places.
_SURER, _SUREST, _LINES, _SPACING = 4.0, 10.0, 2, 3.0
# Neighbouring minima that searches go on from, and the fall of minus twice the log-likelihood that counts as deeper.
_VALLEYS, _DEEPER = 2, 1.0
# Places in the bounds of a parameter at which it is asked whether an output depends on it.
_PLACES = 5


class FitPipeline:
    """The work of an identification, piece by piece; pieces that are finished when it is stopped count."""

    def __init__(self, problem: Problem, ledger: Checkpoint, loss: str, progress: Progress | None) -> None:
        """Create a pipeline without finished work."""
        self.problem, self.ledger, self.loss = problem, ledger, loss
        self.tell = progress or (lambda words, done, total: None)
        self.fits: list[Fit] = []
        self.middle: Fit | None = None
        self.sides: dict[tuple[int, int], ProfileBound] = {}
        self.spread: Array | None = None
        self.comparison: LawComparison | None = None

    @property
    def best(self) -> Fit:
        """The start of the profiles; before them, the place of the best fit."""
        return self.middle or best_of(self.problem, self.fits)

    def screen_starts(self, places: Sequence[Array], count: int) -> list[Array]:
        """Return the first place, and those of the others with the best fit.

        Where the motion hunts there are no slopes to follow: such places come last.
        """

        def misfit(problem: Problem, z: Array) -> float:
            return _met(problem, problem.residuals(z))

        problem, others = self.problem.rough() if self.problem.moves else self.problem, len(places) - 1
        misfits = self._side_by_side(
            "trying starts", lambda item: misfit(item[1], places[1 + item[0]]), others, problem
        )
        order = np.argsort(misfits, kind="stable").tolist()
        tiny = _TINY * np.subtract(*self.problem.box)

        def hunts(item: tuple[int, Problem]) -> bool:
            k = order[item[0]]
            return not abs(misfit(item[1], places[1 + k] + tiny) - misfits[k]) < _JUMP

        near = order[: 2 * (count - 1)] if self.problem.moves else []
        hunting = dict(zip(near, self._side_by_side("trying starts", hunts, len(near), problem), strict=True))
        return [places[0], *(places[1 + k] for k in sorted(order, key=lambda k: hunting.get(k, True))[: count - 1])]

    def search(self, starts: Sequence[Array]) -> None:
        """Search from all starts, of motions roughly first, and go on from the promising ends."""
        places, starts, hopeless = starts, *self._roughly(starts)
        minima: dict[int, Fit] = {}

        def one(item: tuple[int, Problem]) -> None:
            k, twin = item
            start = self.ledger.reached(f"start {k}", starts[k])
            minima[k] = self.ledger.fit(f"start {k}", twin, partial(fit_off_flats, twin, start, self.loss))

        try:
            self._side_by_side("searching", one, len(starts))
        finally:
            self.fits += [minima[k] for k in sorted(minima)]
        self.fits += [fit(self.problem, z, fixed=dict(enumerate(z))) for z in hopeless]
        if not np.isfinite(self.best.objective):
            raise InputError(
                "identify.recordings", "the motion fails wherever the search starts; narrow the parameters"
            )
        _check_felt(self.problem, self.fits, places)
        if self.problem.moves:
            self._cross()

    def _roughly(self, starts: Sequence[Array]) -> tuple[Sequence[Array], Sequence[Array]]:
        """Return the ends of rough searches in two groups: promising ones, and the others."""
        if not self.problem.moves:
            return starts, []
        rough, minima = self.problem.rough(), dict[int, Fit]()

        def one(item: tuple[int, Problem]) -> None:
            k, twin = item
            work = partial(fit_off_flats, twin, self.ledger.reached(f"rough {k}", starts[k]), self.loss)
            minima[k] = self.ledger.fit(f"rough {k}", twin, work)

        self._side_by_side("searching roughly", one, len(starts), rough)
        met = {k: _met(rough, minima[k].residuals) for k in sorted(minima)}
        near = [k for k in met if met[k] <= min(met.values()) + _HOPELESS]
        return [minima[k].z for k in near], [minima[k].z for k in met if k not in near]

    def _cross(self) -> None:
        """Move to deeper neighbouring minima as long as there are any."""
        words = "looking beside the best place"
        for turn in itertools.count():
            best, number = self.best, self.fits.index(self.best)
            lines = beside(self.problem, best.z)
            places = [place for line in lines for place in line]

            def misfit(item: tuple[int, Problem], places: Sequence[Array] = places) -> float:
                return _met(item[1], item[1].residuals(places[item[0]]))

            valleys = lowest(lines, self._side_by_side(words, misfit, len(places)), _VALLEYS + 1)
            near = [z for z in valleys if not np.array_equal(z, best.z)][:_VALLEYS]

            def one(item: tuple[int, Problem], near: Sequence[Array] = near, turn: int = turn) -> Fit:
                k, twin = item
                return self.ledger.fit(f"valley {turn} {k}", twin, partial(fit, twin, near[k], loss=self.loss))

            self.fits[number] = best_of(self.problem, [best, *self._side_by_side(words, one, len(near))])
            if _met(self.problem, self.best.residuals) > _met(self.problem, best.residuals) - _DEEPER:
                return

    def _settle(self, place: Fit) -> tuple[Problem, Fit, Array, Array]:
        """Return the problem computed finely, the minimum near a place, its covariance by the likelihood, inflations.

        These are, by parameter, how much more than 3.841 the likelihood rises at the ends of its interval.
        """
        fine, number = self.problem.fine(), self.fits.index(self.best)
        best = self.fits[number] = self.middle = fit(fine, place.z, loss=self.loss, slopes=place.slopes)
        naive = covariance(fine, best)
        few, spread = SmallSample.from_fit(fine, best, naive), sandwich(fine, best, naive)
        inflations = np.diag(spread) / np.diag(naive) * few.level / LEVEL
        self.spread = spread * np.sqrt(np.outer(few.variance, few.variance))
        self.problem.join(fine)
        return fine, best, naive, inflations

    def linearise(self, place: Fit) -> None:
        """Compute intervals from slopes alone; a side that they take beyond the bounds is open."""
        fine, best, *_ = self._settle(place)
        low, high = fine.box
        assert self.spread is not None
        for k, way in itertools.product(range(self.problem.asked), (-1, 1)):
            end = best.z[k] + way * np.sqrt(LEVEL * max(self.spread[k, k], 0.0))
            path = np.array([[best.z[k], 0.0]])
            self.sides[k, way] = ProfileBound(float(end) if low[k] < end < high[k] else math.inf * way, path)

    def profile_all(self, place: Fit, turn: int = 0) -> None:
        """Compute all profiles; restart from a lower minimum if one is found."""
        fine, best, naive, inflations = self._settle(place)
        ends = [(k, way) for k in range(self.problem.asked) for way in (-1, 1)]

        def one(item: tuple[int, Problem]) -> Fit | None:
            (k, way), twin = ends[item[0]], item[1]
            work = partial(profile, twin, best, k, way, naive, self.loss, float(inflations[k]))
            side = self.ledger.side(f"side {k} {way} {turn}", work)
            if side.better is None:
                self.sides[k, way] = side
            return side.better

        lower_minima = self._side_by_side("following the likelihood", one, len(ends), fine)
        better = [each for each in lower_minima if each is not None]
        if better:
            self.sides.clear()
            self.profile_all(min(better, key=lambda minimum: minimum.objective), turn + 1)

    def _side_by_side(
        self, words: str, task: Callable[[tuple[int, Problem]], _Found], count: int, problem: Problem | None = None
    ) -> list[_Found]:
        """Run numbered tasks, each with its own copy of the problem, in threads where they simulate."""
        twins, finished = [(problem or self.problem).alone() for _ in range(count)], itertools.count(1)
        self.tell(words, 0, count)

        def one(item: tuple[int, Problem]) -> _Found:
            outcome = task(item)
            self.tell(words, next(finished), count)
            return outcome

        items = list(enumerate(twins))
        try:
            return in_threads(one, items) if self.problem.moves else [one(item) for item in items]
        finally:
            for twin in twins:
                self.problem.join(twin)

    def compare(self, settings: IdentifySettings) -> None:
        """Fit other laws, if there are any."""
        if settings.compare:
            self.tell("comparing laws", 0, 1)
            work = partial(compare_laws, self.problem, settings, self.best)
            self.comparison = self.ledger.comparison(work)


def starting_points(problem: Problem, count: int, seed: int) -> list[Array]:
    """Return the points to start from: the scenario's own numbers, then scrambled Sobol points to choose from."""
    low, high = problem.box
    further = _TRIED * max(count - 1, 0)
    shares = qmc.Sobol(len(low), rng=seed).random_base2(max(further - 1, 0).bit_length())[:further]
    return [problem.start, *map(problem.feasible, low + (high - low) * shares)]


def _met(problem: Problem, residuals: Sequence[Array]) -> float:
    """Return minus twice the log-likelihood with equal weights; infinite if a motion fails."""
    if not all(np.isfinite(each).all() for each in residuals):
        return np.inf
    return minus_twice_likelihood(residuals, np.ones(len(residuals)), problem.groups, problem.least_noise)


def _check_felt(problem: Problem, fits: Sequence[Fit], places: Sequence[Array]) -> None:
    moving, (low, high) = np.zeros(len(problem.keys), dtype=bool), problem.box
    known = (each.slopes or problem.slopes(each.z) for each in fits)
    for slopes in itertools.chain(known, map(problem.slopes, places)):
        moving |= felt(problem, slopes)
        if moving.all():
            return
    best = best_of(problem, fits)
    for k in np.flatnonzero(~moving):
        # What is not felt at one place may be at another, such as friction that holds wherever searches have been.
        for share in np.linspace(0.0, 1.0, _PLACES):
            place = best.z.copy()
            place[k] = low[k] + share * (high - low)[k]
            moved = problem.residuals(problem.feasible(place))
            moving[k] |= not all(map(np.array_equal, moved, best.residuals))
    if moving.all():
        return
    key = problem.keys[int(np.flatnonzero(~moving)[0])]
    raise InputError(entry_of(key), "no output of any recording feels it, at no value in its bounds; leave it out")


def beside(problem: Problem, z: Array) -> list[Array]:
    """Return lines of points through a minimum, shape (k, p) each, along directions with several minima.

    What cycles tell has a minimum for each of them; what means over cycles tell leaves so many of these open.
    """
    residuals, slopes = problem.residuals(z), problem.slopes(z)
    low, high = problem.box
    size = np.outer(high - low, high - low)
    by_samples, by_means = (
        size * sum(j.T @ j / max(float(np.mean(e * e)), 1e-300) for e, j in zip(*each, strict=True))
        for each in ((residuals, slopes), (problem.averaged(residuals), problem.averaged(slopes)))
    )
    rounding = max(1e-12 * np.trace(by_samples), 1e-300) * np.eye(len(z))
    values, vectors = eigh(by_means + rounding, by_samples + rounding)
    lines = []
    for value, vector in zip(values[:_LINES], vectors.T[:_LINES], strict=True):
        surer = min(1.0 / np.sqrt(max(value, 1e-300)), _SUREST)
        if surer < _SURER:
            continue
        one = _SPACING * (high - low) * vector / np.sqrt(vector @ by_samples @ vector)
        count = int(surer)
        places = z + np.arange(-count, count + 1)[:, None] * one
        lines.append(places[np.all((places >= low) & (places <= high), axis=1)])
    return lines


def lowest(lines: Sequence[Array], met: Sequence[float], count: int) -> list[Array]:
    """Return the local minima along lines, lowest first; an end counts if it rises inwards.

    Args:
        lines: Places, shape (k, p) each.
        met: How badly the recordings are met at all of them in turn.
        count: Of how many at the most.
    """
    minima, first = [], 0
    for line in lines:
        values = np.array([np.inf, *met[first : first + len(line)], np.inf])
        first += len(line)
        dips = np.flatnonzero((values[1:-1] < values[:-2]) & (values[1:-1] < values[2:]))
        minima += [(values[1 + k], line[k]) for k in dips]
    return [place for _, place in sorted(minima, key=lambda minimum: minimum[0])[:count]]
