"""Misfit of a model: correlation of residuals, lack of fit beyond the scatter of repeats, covariance under both."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter
from scipy.stats import f as f_distribution
from scipy.stats import t as student

from finger_pin.identification.intervals import information_of_bounds
from finger_pin.identification.residuals.recordings import RecordedSignal, Recording
from finger_pin.identification.residuals.residuals import Residuals
from finger_pin.identification.search.gauss_newton import Fit
from finger_pin.identification.search.objective import Objective
from finger_pin.typing import Array

# Probability below which a misfit is significant, and the greatest order of the autoregression of residuals.
SIGNIFICANCE, _MAX_LAGS = 0.01, 8


@dataclass(frozen=True, eq=False)
class Repeats:
    """Signals, or readings of one signal, that a model cannot tell apart.

    Attributes:
        signals: Indices of the signals: all repeated runs of a motion, or one signal of readings.
        scatter: Mean square of residuals about their mean, independent of any model.
        shared_misfit: Mean square of the residual that they share beyond that scatter; 0 if that may be chance.
        p_value: Probability of such a misfit under a correct model (F test).
    """

    signals: tuple[int, ...]
    scatter: float
    shared_misfit: float
    p_value: float


def sandwich_covariance(objective: Objective[Residuals], minimum: Fit, covariance: Array) -> Array:
    """Return the covariance of z with residuals correlated as they are, shape (p, p).

    The estimate weighs samples as if they were independent but for their share; its covariance H^-1 V H^-1 has V of
    the scores under the fitted correlation (Huber, 5th Berkeley Symposium, 1967): autoregressive over time, and with
    what the model misses shared by repeats.

    Args:
        objective: The objective that was fitted.
        minimum: Of the objective.
        covariance: Covariance by the likelihood alone, H^-1, shape (p, p).
    """
    slopes, function, outputs = objective.slopes(minimum.z), objective.function, objective.likelihood.outputs
    scores = [w / n**2 * j for w, n, j in zip(minimum.weights, minimum.noise, slopes, strict=True)]
    total, repeated_signals = information_of_bounds(objective, minimum), set[int]()
    for repeated in repeats(function, minimum.residuals):
        if repeated.shared_misfit == 0.0:
            continue
        repeated_signals.update(repeated.signals)
        members = [function.signals[k] for k in repeated.signals]
        # Residuals below the least noise count as that noise.
        floor_factor = max(1.0, members[0].least_noise ** 2 / (repeated.shared_misfit + repeated.scatter))
        shared_square, scatter_square = floor_factor * repeated.shared_misfit, floor_factor * repeated.scatter
        if members[0].ordered:
            mean = np.mean([minimum.residuals[k] for k in repeated.signals], axis=0)
            shared = np.sum([scores[k] for k in repeated.signals], axis=0)
            total += shared_square * _correlated_information(shared, _autoregression([mean]))
            deviations = [minimum.residuals[k] - mean for k in repeated.signals]
            process = _autoregression(deviations)
            total += scatter_square * sum(_correlated_information(scores[k], process) for k in repeated.signals)
        else:
            score, replicate = scores[repeated.signals[0]], members[0].replicate
            sums = np.zeros((replicate.max() + 1, score.shape[1]))
            np.add.at(sums, replicate, score)
            total += shared_square * sums.T @ sums + scatter_square * score.T @ score
    for group in np.unique(outputs):
        unrepeated = [k for k in np.flatnonzero(outputs == group).tolist() if k not in repeated_signals]
        autoregression = _autoregression([minimum.residuals[k] for k in unrepeated if function.signals[k].ordered])
        total += sum(minimum.noise[k] ** 2 * _correlated_information(scores[k], autoregression) for k in unrepeated)
    return np.asarray(covariance @ total @ covariance)


def outliers(function: Residuals, residuals: Sequence[Array]) -> list[Array]:
    """Return residuals over the deviation of their median, by signal; zero for all but outliers.

    An outlier is less probable than chance among so many, and alone outweighs all others as they mostly are.
    """
    ratios, noises = [], function.likelihood.noises
    count = np.bincount(noises, [len(e) for e in residuals])[noises]
    for e, n, deviation in zip(residuals, count, function.likelihood.deviation(residuals), strict=True):
        ratio = np.abs(e) / max(deviation, 1e-300)
        p_value = 2.0 * n * student.sf(ratio, max(n - len(function.parameters.keys), 1.0))
        ratios.append(np.where((p_value < SIGNIFICANCE) & (ratio**2 > n), ratio, 0.0))
    return ratios


def repeats(function: Residuals, residuals: Sequence[Array]) -> list[Repeats]:
    """Return the repeated runs and readings among the signals, with their misfit."""
    repeated, runs = [], list[list[int]]()
    recordings = {model.recording.name: model.recording for model in function.models}
    for k, signal in enumerate(function.signals):
        if signal.ordered:
            matching = [run for run in runs if _are_repeated_runs(function.signals[run[0]], signal, recordings)]
            if matching:
                matching[0].append(k)
            else:
                runs.append([k])
        elif signal.replicate.max(initial=-1) + 1 < len(signal.measured):
            repeated.append(_reading_repeats(k, signal.replicate, residuals[k], len(function.parameters.keys)))
    repeated += [_run_repeats(tuple(run), [residuals[k] for k in run]) for run in runs if len(run) > 1]
    return repeated


def _are_repeated_runs(first: RecordedSignal, second: RecordedSignal, recordings: Mapping[str, Recording]) -> bool:
    """Return whether two signals of motions are of the same output, read at the same times, of repeated runs."""
    same_output = first.name == second.name and np.array_equal(first.instant, second.instant)
    return same_output and recordings[first.recording].repeats(recordings[second.recording])


def scatter(values: Array, replicate: NDArray[np.intp]) -> float:
    """Return the mean square of readings about the mean of their replicates; not a number without any."""
    count = np.bincount(replicate)
    if len(count) == len(values):
        return math.nan
    mean = np.bincount(replicate, values) / count
    return float(np.sum((values - mean[replicate]) ** 2)) / (len(values) - len(count))


def _reading_repeats(k: int, replicate: NDArray[np.intp], residual: Array, parameters: int) -> Repeats:
    count = np.bincount(replicate)
    mean = np.bincount(replicate, residual) / count
    inner_freedom, outer_freedom = len(residual) - len(count), max(len(count) - parameters, 1)
    within = scatter(residual, replicate)
    between = float(np.sum(count * mean**2)) / outer_freedom
    return _repeats((k,), within, between, float(np.mean(count)), outer_freedom, inner_freedom)


def _run_repeats(signals: tuple[int, ...], residuals: Sequence[Array]) -> Repeats:
    runs = len(residuals)
    mean = np.mean(residuals, axis=0)
    deviations = [each - mean for each in residuals]
    within = sum(float(np.mean(each**2)) for each in deviations) / (runs - 1)
    # Squares of what is correlated by rho count as (1 - rho^2) / (1 + rho^2) (Bartlett, J. Roy. Stat. Soc. B 8, 1946).
    square = sum(float(each @ each) for each in deviations)
    rho = sum(float(each[1:] @ each[:-1]) for each in deviations) / max(square, 1e-300)
    independent = max(len(mean) * (1.0 - rho**2) / (1.0 + rho**2), 1.0)
    between = runs * float(np.mean(mean**2))
    return _repeats(signals, within, between, runs, independent, (runs - 1) * independent)


def _repeats(signals: tuple[int, ...], within: float, between: float, count: float, *freedoms: float) -> Repeats:
    """Return repeats with mean squares within groups of some size and between them, by the F test."""
    p_value = float(f_distribution.sf(between / max(within, 1e-300), *freedoms))
    shared_misfit = max(between - within, 0.0) / count
    return Repeats(signals, within, shared_misfit if p_value < SIGNIFICANCE else 0.0, p_value)


def _autoregression(residuals: Sequence[Array]) -> Array:
    """Return the autoregressive process of residuals, as a filter of white noise: numerator, then denominator.

    Its variance is one; its order is that of least BIC (Yule and Walker).
    """
    count = sum(map(len, residuals))
    lags = min(_MAX_LAGS, min(map(len, residuals), default=0) - 1)
    if lags < 1 or not any(each.any() for each in residuals):
        return np.array([1.0, 1.0])
    moments = np.array([sum(float(e[h:] @ e[: len(e) - h]) for e in residuals) for h in range(lags + 1)]) / count
    best_filter, least_bic = np.array([1.0, 1.0]), 0.0
    for order in range(1, lags + 1):
        column, lagged = moments[:order] * np.append(1.0 + 1e-9, np.ones(order - 1)), moments[1 : order + 1]
        coefficients = solve_toeplitz(column, lagged)
        innovation_variance = max(1.0 - float(coefficients @ lagged) / moments[0], 1e-12)
        bic = count * np.log(innovation_variance) + order * np.log(count)
        if bic < least_bic:
            best_filter, least_bic = np.concatenate([[np.sqrt(innovation_variance), 1.0], -coefficients]), bic
    return best_filter


def _correlated_information(score: Array, autoregression: Array) -> Array:
    """Return B^T R B of scores B, shape (m, p), under a stationary process, shape (p, p)."""
    # The process also reaches back before the first sample, by as many instants as there are samples.
    reversed_scores = np.concatenate([score[::-1], np.zeros_like(score if len(autoregression) > 2 else score[:0])])
    filtered = lfilter(autoregression[:1], autoregression[1:], reversed_scores, axis=0)
    return np.asarray(filtered.T @ filtered)
