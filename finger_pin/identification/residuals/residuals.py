"""Residuals of recordings as a function of the parameters, their noise, and their derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.identification.likelihood import Likelihood, numbered
from finger_pin.identification.parameters.parameters import Parameters
from finger_pin.identification.residuals.recordings import RecordedSignal, RecordingModel
from finger_pin.threads import in_threads
from finger_pin.typing import Array

# Tolerances of runs over the scenario's, and the least number of block means of every output in rough searches, at
# least twice that of parameters: of a ringing signal each block covers some cycles.
_TOLERANCES, _MEAN_COUNT = {"plain": 1.0, "fine": 0.1, "rough": 10.0}, 40


@dataclass(frozen=True, eq=False)
class NoiseGrowth:
    """Noise of signals that grows with their readings x: sigma = sigma_0 w(x), w^2 = 1 + (share x / least)^2.

    With residuals e / w times G, the geometric mean of w in a group of signals, n log(SSE / n) is minus twice the
    log-likelihood again, whose logarithm of all sigma would else be missing: readings are those that are computed, as
    measured ones would count for more where they are too small by chance.

    Attributes:
        measured: Readings of every signal.
        least_noise: Least noise of every signal, shape (s,).
        noise_share: Part of the reading, shape (s,).
        groups: Group of every signal, shape (s,).
    """

    measured: Sequence[Array]
    least_noise: Array
    noise_share: Array
    groups: NDArray[np.intp]

    @property
    def floor(self) -> Array:
        """The least deviation of residuals, shape (s,), by the level of the measured readings."""
        return self.least_noise * self.levels([0.0 * x for x in self.measured]) if self.active else self.least_noise

    @property
    def _ratios(self) -> Array:
        zeros = np.zeros_like(self.noise_share)
        return np.divide(self.noise_share, self.least_noise, out=zeros, where=self.noise_share > 0.0)

    @property
    def active(self) -> bool:
        """Whether the noise of any output grows with its reading."""
        return bool(np.any(self.noise_share))

    def growth(self, errors: Sequence[Array]) -> list[Array]:
        """Return w at the computed readings, which are measured less errors."""
        readings = zip(self._ratios, self.measured, errors, strict=True)
        return [np.sqrt(1.0 + (ratio * (x - e)) ** 2) if ratio else np.ones_like(x) for ratio, x, e in readings]

    def levels(self, errors: Sequence[Array]) -> Array:
        """Return G of every signal, shape (s,)."""
        return np.exp(self._grouped_means([np.log(w) for w in self.growth(errors)]))

    def weigh(self, errors: Sequence[Array]) -> list[Array]:
        """Return the residuals G e / w."""
        rows = zip(self.levels(errors), self.growth(errors), errors, strict=True)
        return [level / w * e for level, w, e in rows]

    def weigh_slopes(self, errors: Sequence[Array], slopes: Sequence[Array]) -> list[Array]:
        """Return the derivatives of the residuals from those of the errors, shape (m, p) each."""
        rows = list(zip(self.levels(errors), self.growth(errors), self.measured, errors, slopes, strict=True))
        # Of log w, as what is computed falls where the error rises.
        by_log = [-((k / w) ** 2 * (x - e))[:, None] * j for k, (_, w, x, e, j) in zip(self._ratios, rows, strict=True)]
        means = self._grouped_means(by_log)
        pairs = zip(rows, by_log, means, strict=True)
        return [(g / w)[:, None] * (j + e[:, None] * (mean - log)) for (g, w, _, e, j), log, mean in pairs]

    def _grouped_means(self, values: Sequence[Array]) -> Array:
        """Return the mean of all values of its group for every signal."""
        count = np.bincount(self.groups, [len(v) for v in values])
        sums = np.array([np.sum(v, axis=0) for v in values])
        totals = np.zeros((len(count), *sums.shape[1:]))
        np.add.at(totals, self.groups, sums)
        return np.asarray((totals.T / np.maximum(count, 1)).T[self.groups])


@dataclass(eq=False)
class Residuals:
    """Residuals of every signal, shape (m,) each, at search variables z of the parameters, shape (p,).

    Attributes:
        scenario: Scenario with all other numbers.
        parameters: What is to be found.
        models: A model for each recording, or window of one.
        signals: All outputs, in the order of the models.
        accuracy: Of runs: ``plain``, the scenario's, ``fine``, or ``rough``, of which means over cycles are compared.
        exact: Whether all are of readings, in closed form; runs of motions have errors.
        growth: How noises grow with readings.
        likelihood: Likelihood of the residuals.
        maps: Every model with the map from values to its scenario and nuisance parameters.
        box: The least and the greatest z.
    """

    scenario: Scenario
    parameters: Parameters
    models: Sequence[RecordingModel]
    signals: Sequence[RecordedSignal]
    accuracy: str = "plain"

    def __post_init__(self) -> None:
        """Sort the signals by their noises and outputs."""
        self.exact = not any(signal.ordered for signal in self.signals)
        measured = [each.measured for each in self.signals]
        least, share = np.array([(each.least_noise, each.noise_share) for each in self.signals]).reshape(-1, 2).T
        self.growth = NoiseGrowth(measured, least, share, _noise_groups(self.signals))
        self.likelihood = Likelihood(
            self.growth.groups,
            self.growth.floor,
            numbered([(each.recording, each.name) for each in self.signals]),
            numbered([(each.shared_noise, each.shared_noise or each.name) for each in self.signals]),
            np.array([np.max(np.abs(each), initial=0.0) for each in measured]),
            np.array([each.ordered for each in self.signals]),
        )
        self.maps = list(zip(self.models, self.parameters.scenario_maps(), strict=True))
        self.box, self.feasible = self.parameters.box, self.parameters.feasible

    def subset(self, masks: Sequence[NDArray[np.bool_]]) -> Self:
        """Return those of some of the samples of every signal."""
        by_sample = ("measured", "rows", "instant", "load", "replicate")
        signals = [
            replace(signal, **{name: getattr(signal, name)[samples] for name in by_sample})
            for signal, samples in zip(self.signals, masks, strict=True)
        ]
        return replace(self, signals=signals, accuracy="plain")

    def with_accuracy(self, accuracy: str) -> Self:
        """Return the same, computed with smaller errors, or with larger ones and for means over some cycles of motions.

        The errors of plain runs make the likelihood of thousands of samples jump from z to z, by as much as a quarter
        of the rise at an interval's end. Where something rings, the likelihood has a minimum for every cycle by which a
        model is late; that of means over some cycles has few.
        """
        models = [model.with_tolerances(_TOLERANCES[accuracy]) for model in self.models]
        return replace(self, models=models, accuracy=accuracy)

    def residuals(self, z: Array) -> list[Array]:
        """Return measured less computed, where noise grows with readings over that growth.

        They are infinite where values do not go together or a motion fails.
        """
        errors = self.errors(z)
        grows = self.growth.active and all(np.isfinite(e).all() for e in errors)
        return self._averaged(self.growth.weigh(errors) if grows else errors)

    def slopes(self, z: Array) -> list[Array]:
        """Return the derivatives of the residuals by z, shape (m, p) each."""
        slopes = self.error_slopes(z)
        return self._averaged(self.growth.weigh_slopes(self.errors(z), slopes) if self.growth.active else slopes)

    def errors(self, z: Array) -> list[Array]:
        """Return the errors of every signal, measured less computed, shape (m,) each, or infinite ones."""
        values = self.parameters.values(z)
        try:
            pairs = [(model, scenario_map(values)) for model, scenario_map in self.maps]
        except InputError:
            return [np.full(len(s.measured), np.inf) for s in self.signals]
        # Closed forms do not release the GIL.
        by_model = map(_compute, pairs) if self.exact else in_threads(_compute, pairs)
        computed = [output for outputs in by_model for output in outputs]
        errors = [s.measured - c[s.rows] for s, c in zip(self.signals, computed, strict=True)]
        return errors if all(np.isfinite(e).all() for e in errors) else [np.full(len(e), np.inf) for e in errors]

    def error_slopes(self, z: Array) -> list[Array]:
        """Return the derivatives of measured less computed by z, shape (m, p) each."""
        values, logarithmic = self.parameters.values(z), self.parameters.logarithmic
        sizes = np.where(logarithmic, values, self.parameters.high - self.parameters.low)
        derivatives = [each for model, where in self.maps for each in model.slopes(where, values, sizes)]
        stretch = np.where(logarithmic, values, 1.0)
        return [-each[s.rows] * stretch for each, s in zip(derivatives, self.signals, strict=True)]

    def block_means(self, values: Sequence[Array]) -> list[Array]:
        """Return means of consecutive residuals of every signal, or of their slopes, as in rough searches."""
        outputs, count = self.likelihood.outputs, [len(signal.measured) for signal in self.signals]
        size = np.bincount(outputs, count)[outputs]
        share = np.minimum(size / max(_MEAN_COUNT, 2 * len(self.parameters.keys)), count)
        sizes = [max(int(n), 1) if s.ordered else 1 for s, n in zip(self.signals, share, strict=True)]
        pairs = zip(values, sizes, strict=True)
        return [e[: len(e) // n * n].reshape(-1, n, *e.shape[1:]).mean(axis=1) for e, n in pairs]

    def _averaged(self, values: list[Array]) -> list[Array]:
        return self.block_means(values) if self.accuracy == "rough" else values


def _compute(pair: tuple[RecordingModel, tuple[Scenario, dict[str, float]]]) -> list[Array]:
    """Return the outputs of a recording at a place."""
    model, place = pair
    return model.compute(*place)


def _noise_groups(signals: Sequence[RecordedSignal]) -> NDArray[np.intp]:
    """Return the number of the noise of every signal: that of its output, or one that several outputs share.

    Raises:
        InputError: If outputs share a noise, and differ in unit or in what is said of it.
    """
    first: dict[str, RecordedSignal] = {}
    for signal in signals:
        other = first.setdefault(signal.shared_noise, signal) if signal.shared_noise else signal
        for what in ("unit", "least_noise", "noise_share"):
            value, expected = getattr(signal, what), getattr(other, what)
            if value != expected:
                entry = f"identify.recordings.{signal.recording}.outputs.{signal.name}.noise"
                allowed = f"is shared with {other.recording}.{other.name}, whose {what} is {expected}, not {value}"
                raise InputError(entry, allowed, signal.shared_noise)
    return numbered([(each.shared_noise,) if each.shared_noise else (each.recording, each.name) for each in signals])
