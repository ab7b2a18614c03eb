"""Work of an identification in resumable pieces: its search, intervals, refits without a setting, and other laws."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from finger_pin.description.recordings.bench import IdentifySettings
from finger_pin.exceptions import InputError
from finger_pin.identification.comparison import compare_laws
from finger_pin.identification.cross_validation import CrossValidation, find_settings, refit_without
from finger_pin.identification.intervals import CHI2_95, ProfileBound, SmallSample, covariance, profile
from finger_pin.identification.misfit import sandwich_covariance
from finger_pin.identification.open_directions import OpenDirection, open_directions
from finger_pin.identification.parameters.keys import entry_of
from finger_pin.identification.residuals.residuals import Residuals
from finger_pin.identification.search.checkpoint import Checkpoint
from finger_pin.identification.search.gauss_newton import Fit, fit, fit_at, influential_entries
from finger_pin.identification.search.objective import Objective, Stopped
from finger_pin.identification.search.search import Progress, Search, starting_points
from finger_pin.typing import Array

# Values within a parameter's bounds at which its influence on outputs is tested.
_BOUND_SAMPLES = 5


class FitPipeline:
    """Work of an identification in pieces; finished pieces count when it is stopped.

    Attributes:
        objective: The objective.
        searches: The search for its minima.
        interval_ends: By parameter and side, -1 or 1.
        covariance: Of z at the best fit; None before it is known.
        left_out: Refits without a setting, if there are any and no motion fails in one.
        open_directions: What the recordings leave open.
        comparison: As of `compare_laws`; empty without other laws.
    """

    def __init__(
        self, objective: Objective[Residuals], checkpoint: Checkpoint, loss: str, progress: Progress | None
    ) -> None:
        """Create a pipeline without finished work."""
        self.objective, self._checkpoint, self._loss, self._progress = objective, checkpoint, loss, progress
        self.searches = Search(objective, checkpoint, loss, progress)
        self.interval_ends: dict[tuple[int, int], ProfileBound] = {}
        self.covariance: Array | None = None
        self.left_out: CrossValidation | None = None
        self.open_directions: list[OpenDirection] = []
        self.comparison: dict[str, list[Any]] = {}
        # The objective that is computed finely, and its minimum.
        self._fine: tuple[Objective[Residuals], Fit] | None = None

    @property
    def best(self) -> Fit:
        """The fit from which profiles start, or the best fit so far."""
        return self._fine[1] if self._fine else self.searches.best

    def run(self, settings: IdentifySettings, starts: int, seed: int, profiles: bool, refits: bool) -> str:
        """Do all of it, as `identify` is asked; return why it is unfinished, or an empty text."""
        start = self.objective.function.parameters.start
        points = starting_points(self.objective, start, starts, seed)
        try:
            self.search(self.searches.screened(points, starts))
            (self.profile_all if profiles else self.linearise)()
            if refits:
                self.cross_validate()
            self.find_open_directions(refits)
            self.compare(settings)
        except Stopped:
            self.objective.stop = lambda: False
            if not self.searches.fits:
                best = self.objective.best[1]
                self.searches.fits.append(fit_at(self.objective, best if len(best) else start))
            return "interrupted: the best so far, and the intervals that are finished"
        return ""

    def search(self, starts: Sequence[Array]) -> None:
        """Search from starts, and beside the best place that they lead to."""
        self.searches.descend(starts)
        if not np.isfinite(self.best.objective):
            allowed = "the motion fails wherever the search starts; narrow the parameters"
            raise InputError("identify.recordings", allowed)
        self._check_influence(starts)
        if not self.objective.exact:
            self.searches.visit_neighbours()

    def linearise(self) -> None:
        """Compute intervals from slopes alone; a side that they take beyond the bounds is open."""
        fine, best, *_ = self._fit_finely(self.best)
        assert self.covariance is not None
        low, high = fine.box
        for k, side in self._sides:
            end = best.z[k] + side * np.sqrt(CHI2_95 * max(self.covariance[k, k], 0.0))
            path = np.array([[best.z[k], 0.0]])
            self.interval_ends[k, side] = ProfileBound(float(end) if low[k] < end < high[k] else math.inf * side, path)

    def profile_all(self, start: Fit | None = None, turn: int = 0) -> None:
        """Compute all profiles; restart from a lower minimum if one is found."""
        fine, best, likelihood_covariance, inflations = self._fit_finely(start or self.best)
        lower_minima: list[Fit] = []

        def profile_end(number: int, twin: Objective[Residuals]) -> None:
            k, side = self._sides[number]

            def piece() -> tuple[float, Any] | None:
                bound = profile(twin, best, k, side, likelihood_covariance, self._loss, float(inflations[k]))
                if bound.lower_minimum is not None:
                    lower_minima.append(bound.lower_minimum)
                    return None
                return bound.end, bound.path.tolist()

            stored = self._checkpoint.stored(f"side {k} {side} {turn}", piece)
            if stored is not None:
                self.interval_ends[k, side] = ProfileBound(float(stored[0]), np.array(stored[1]))

        self.searches.side_by_side("following the likelihood", profile_end, len(self._sides), fine)
        if lower_minima:
            self.interval_ends.clear()
            self.profile_all(min(lower_minima, key=lambda minimum: minimum.objective), turn + 1)

    def cross_validate(self) -> None:
        """Refit without one setting each."""
        fine, best = self._finely_fitted()
        settings = find_settings(fine.function)
        names = list(settings)

        def refit(k: int, twin: Objective[Residuals]) -> Fit:
            work = partial(refit_without, twin, best, settings, names[k], self._loss)
            # Those of readings are sooner made than read back.
            return work() if twin.exact else self._checkpoint.fit(f"without {names[k]}", twin, work)

        refits = self.searches.side_by_side("leaving out one at a time", refit, len(names), fine)
        if refits and all(np.isfinite(each.objective) for each in refits):
            residuals = [np.stack(each) for each in zip(*(each.residuals for each in refits), strict=True)]
            self.left_out = CrossValidation(settings, np.array([each.z for each in refits]), residuals)

    def find_open_directions(self, refits: bool) -> None:
        """Find the directions that the recordings leave open by slopes, and try them by refits if asked."""
        fine, best = self._finely_fitted()
        self.open_directions = open_directions(fine, best, self._loss, refits)
        self.objective.join(fine)

    def compare(self, settings: IdentifySettings) -> None:
        """Fit other laws, if there are any."""
        if settings.compare:
            if self._progress:
                self._progress("comparing laws", 0, 1)
            work = partial(compare_laws, self.objective, settings, self.best)
            self.comparison = self._checkpoint.stored("comparison", work)

    @property
    def _sides(self) -> list[tuple[int, int]]:
        """Every parameter that was asked for with either side."""
        return list(itertools.product(range(len(self.objective.function.parameters.bounds)), (-1, 1)))

    def _finely_fitted(self) -> tuple[Objective[Residuals], Fit]:
        """Return the objective that is computed finely, and its minimum, once it is known."""
        assert self._fine is not None
        return self._fine

    def _fit_finely(self, start: Fit) -> tuple[Objective[Residuals], Fit, Array, Array]:
        """Return the fine objective, its minimum near a fit, the covariance by the likelihood, and inflations.

        These are, by parameter, how much more than 3.841 the likelihood rises at the ends of its interval.
        """
        fits, fine = self.searches.fits, Objective(self.objective.function.with_accuracy("fine"), self.objective.stop)
        number = fits.index(self.best)
        best = fits[number] = fit(fine, start.z, loss=self._loss, slopes=start.slopes)
        self._fine = fine, best
        likelihood_covariance = covariance(fine, best)
        small_sample = SmallSample.from_fit(fine, best, likelihood_covariance)
        sandwich = sandwich_covariance(fine, best, likelihood_covariance)
        inflations = np.diag(sandwich) / np.diag(likelihood_covariance) * small_sample.level / CHI2_95
        self.covariance = sandwich * np.sqrt(np.outer(small_sample.variance, small_sample.variance))
        self.objective.join(fine)
        return fine, best, likelihood_covariance, inflations

    def _check_influence(self, points: Sequence[Array]) -> None:
        """Refuse parameters that no output feels."""
        objective, best, fits = self.objective, self.best, self.searches.fits
        influential, low = np.zeros(len(best.z), dtype=bool), objective.box[0]
        known_slopes = (each.slopes or objective.slopes(each.z) for each in fits)
        for slopes in itertools.chain(known_slopes, map(objective.slopes, points)):
            influential |= influential_entries(objective, slopes)
            if influential.all():
                return
        for k in np.flatnonzero(~influential):
            # A parameter may have influence elsewhere, such as friction that holds in all searches.
            for share in np.linspace(0.0, 1.0, _BOUND_SAMPLES):
                point = best.z.copy()
                point[k] = low[k] + share * objective.width[k]
                changed_residuals = objective.residuals(objective.feasible(point))
                influential[k] |= not all(map(np.array_equal, changed_residuals, best.residuals))
        for k in np.flatnonzero(~influential):
            key = objective.function.parameters.keys[k]
            raise InputError(
                entry_of(key), "no output of any recording feels it, at no value in its bounds; leave it out"
            )
