"""Refits without one recording or load each: how far they move the parameters, and how badly they predict the rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear
from scipy.stats import t as student

from finger_pin.identification.intervals import LEAST_FREEDOM, NORMAL_95, inverse_within_bounds
from finger_pin.identification.misfit import outliers
from finger_pin.identification.residuals.residuals import Residuals
from finger_pin.identification.search.gauss_newton import GAIN_REFIT, Fit, fit, fit_at, information
from finger_pin.identification.search.objective import Objective
from finger_pin.typing import Array

#: Masks of the samples of every signal that a setting has.
Setting = list[NDArray[np.bool_]]
# Least number of settings that tell how much they differ: a load alone says little.
_LEAST_RECORDINGS, _LEAST_LOADS = 2, 3
# Most settings, of motions and of readings, that are left out by a full refit; of more a single step tells each one.
_MAX_MOTION_REFITS, _MAX_READING_REFITS = 4, 16
# Least number of independent samples that a refit counts.
_LEAST_COUNT = 20.0


@dataclass(frozen=True, eq=False)
class CrossValidation:
    """Refits without one setting each.

    Attributes:
        settings: Samples of each setting, by name; r of them.
        estimates: z without each setting, shape (r, p).
        residuals: Of all samples of every signal under each refit, shape (r, m) each.
    """

    settings: Mapping[str, Setting]
    estimates: Array
    residuals: Sequence[Array]

    def band_factors(self, objective: Objective[Residuals], minimum: Fit, noise: Array, covariance: Array) -> Array:
        """Return factors on the bands of every signal, shape (s,), by which they hold 95 % of what was left out.

        Every setting counts the same, whatever its number of samples. No factor is below 1.

        Args:
            objective: The objective that was fitted.
            minimum: Of the objective.
            noise: Deviation of further readings of every signal, shape (s,).
            covariance: Of z, by the likelihood, shape (p, p).
        """
        kinds, slopes = objective.likelihood.kinds, objective.slopes(minimum.z)
        factors = np.ones(len(kinds))
        for kind in np.unique(kinds):
            members, ratios, weights = np.flatnonzero(kinds == kind), list[Array](), list[Array]()
            for k in members.tolist():
                variance = noise[k] ** 2 + parameter_variance(slopes[k], covariance, self.residuals[k])
                for errors, setting in zip(self.residuals[k], self.settings.values(), strict=True):
                    ratios.append(np.abs(errors[setting[k]]) / (NORMAL_95 * np.sqrt(variance[setting[k]])))
                    count = sum(np.count_nonzero(setting[other]) for other in members)
                    weights.append(np.full(len(ratios[-1]), 1.0 / max(count, 1)))
            quantile = _weighted_quantile(np.concatenate(ratios), np.concatenate(weights), 0.95)
            factors[members] = max(1.0, quantile)
        return factors


def shift_deviations(objective: Objective[Residuals], minimum: Fit, settings: Mapping[str, Setting]) -> Array:
    """Return the standard deviations by noise alone of the shifts of z without each setting, shape (r, p).

    Of an efficient estimate they are those of the variance without the setting less that with it (Hausman,
    Econometrica 46, 1978); zero where the setting tells nothing.
    """
    slopes, whole = objective.slopes(minimum.z), information(objective, minimum)
    variance, rows = np.diag(inverse_within_bounds(objective, whole)), list[Array]()
    for setting in settings.values():
        columns = zip(minimum.weights / minimum.noise**2, slopes, setting, strict=True)
        part = sum(factor * j[mask].T @ j[mask] for factor, j, mask in columns)
        rows.append(np.diag(inverse_within_bounds(objective, whole - part)) - variance)
    return np.sqrt(np.maximum(rows, 0.0))


def parameter_variance(slopes: Array, covariance: Array, refitted: Array) -> Array:
    """Return the variance of predictions by the parameters, shape (m,): the larger of two.

    One is that of slopes and the covariance, the other (r - 1) / r times the sum of squared differences of r refits
    without a setting each (the jackknife; Tukey, Ann. Math. Stat. 29, 1958). Of that 1.96 deviations are as many as
    Student's t asks for with a degree of freedom for every setting but one, and no fewer than `LEAST_FREEDOM`: errors
    of what was left out say more than a t of one or two.

    Args:
        slopes: Derivatives of the predictions by z, shape (m, p).
        covariance: Of z, by the likelihood, shape (p, p).
        refitted: Predictions under each refit, or their errors, shape (r, m); r may be 0.
    """
    variance: Array = np.sum(slopes @ covariance * slopes, axis=1)
    count = len(refitted)
    if count < 2:
        return variance
    factor = student.ppf(0.975, max(count - 1, LEAST_FREEDOM)) / NORMAL_95
    return np.asarray(np.maximum(variance, factor**2 * (count - 1) * np.var(refitted, axis=0)))


def find_settings(function: Residuals) -> dict[str, Setting]:
    """Return the settings by name: recordings or, of less than three, loads of their readings; none of too few."""
    recordings = dict.fromkeys(signal.recording for signal in function.signals)
    by_load = len(recordings) < 3 and function.exact
    loads = [np.nan_to_num(s.load) if by_load else np.zeros(len(s.measured)) for s in function.signals]
    pairs = dict.fromkeys(
        (signal.recording, float(level))
        for signal, load in zip(function.signals, loads, strict=True)
        for level in np.unique(load)
    )
    if len(pairs) < (_LEAST_LOADS if by_load else _LEAST_RECORDINGS):
        return {}
    return {
        f"{recording} at {level:.4g} N" if by_load else recording: [
            (load == level) & (signal.recording == recording)
            for signal, load in zip(function.signals, loads, strict=True)
        ]
        for recording, level in pairs
    }


def refit_without(
    objective: Objective[Residuals], minimum: Fit, settings: Mapping[str, Setting], name: str, loss: str
) -> Fit:
    """Return the minimum without a setting, within the bounds, with the residuals of all samples there.

    Args:
        objective: The objective that was fitted.
        minimum: Of the objective.
        settings: All settings.
        name: The setting that is left out.
        loss: As for `fit`.
    """
    ratios = outliers(objective.function, minimum.residuals)
    kept = [~out & (ratio == 0.0) for out, ratio in zip(settings[name], ratios, strict=True)]
    all_slopes = objective.slopes(minimum.z)
    slopes = [j[rows] for j, rows in zip(all_slopes, kept, strict=True)]
    if len(settings) > (_MAX_READING_REFITS if objective.exact else _MAX_MOTION_REFITS):
        z = _step(objective, minimum, kept, slopes)
        if objective.exact:
            return replace(minimum, z=z, residuals=shifted_errors(minimum.residuals, all_slopes, z - minimum.z))
    else:
        subset = Objective(objective.function.subset(kept), objective.stop)
        # Of few independent samples no step would be worth its run, and the refit would stay where it starts.
        count = sum(w * np.count_nonzero(rows) for w, rows in zip(minimum.weights, kept, strict=True))
        weights = minimum.weights * max(1.0, _LEAST_COUNT / count)
        z = fit(subset, minimum.z, weights=weights, loss=loss, slopes=slopes, least_gain=GAIN_REFIT).z
        objective.evaluations += subset.evaluations
    return fit_at(objective, z, minimum.weights)


def shifted_errors(errors: Sequence[Array], slopes: Sequence[Array], shift: Array) -> list[Array]:
    """Return the errors of every signal after a shift of z, shape (m,) each, to first order."""
    return [e + j @ shift for e, j in zip(errors, slopes, strict=True)]


def refitted_errors(
    function: Residuals, z: Array, errors: Sequence[Array], places: Sequence[Array]
) -> list[list[Array]]:
    """Return the errors of every signal at the places of refits, of many of readings to first order as their refits.

    Args:
        function: Of the signals.
        z: The estimate.
        errors: At the estimate, of every signal, shape (m,) each.
        places: z of every refit; one where a motion fails is left out.
    """
    if function.exact and len(places) > _MAX_READING_REFITS:
        slopes = function.error_slopes(z)
        return [shifted_errors(errors, slopes, place - z) for place in places]
    computed = [function.errors(place) for place in places]
    return [each for each in computed if all(np.isfinite(e).all() for e in each)]


def _step(objective: Objective[Residuals], minimum: Fit, kept: Setting, slopes: Sequence[Array]) -> Array:
    """Return the place to which a step of Gauss and Newton leads with some of the samples, within the bounds."""
    low, high = objective.box
    rows = zip(np.sqrt(minimum.weights) / minimum.noise, slopes, minimum.residuals, kept, strict=True)
    stacked = np.concatenate([factor * np.column_stack([j, e[mask]]) for factor, j, e, mask in rows])
    lower, upper = np.minimum(low - minimum.z, -1e-12), np.maximum(high - minimum.z, 1e-12)
    step = lsq_linear(stacked[:, :-1], -stacked[:, -1], (lower, upper), method="bvls").x
    return objective.feasible(np.clip(minimum.z + step, low, high))


def _weighted_quantile(values: Array, weights: Array, share: float) -> float:
    """Return the least value below or at which a share of the weights lies; 0 without values."""
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, share * total[-1])]) if len(values) else 0.0
