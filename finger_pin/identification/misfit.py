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

from finger_pin.identification.estimate import Fit
from finger_pin.identification.intervals import information_of_bounds, inverse_within_bounds
from finger_pin.identification.likelihood import typical
from finger_pin.identification.problem import Problem
from finger_pin.identification.recordings import RecordedSignal, Recording
from finger_pin.typing import Array

# From which probability of chance on a model is said to miss something, and how many lags of correlation are fitted.
CHANCE, _LAGS = 0.01, 8


@dataclass(frozen=True, eq=False)
class Repeats:
    """Signals, or readings of one signal, that a model cannot tell apart.

    Attributes:
        signals: Their numbers: of motions all repeated runs, of readings one.
        scatter: Mean square of residuals about their mean, independent of any model.
        common: Mean square of what they share beyond that scatter, which the model misses; 0 if that may be chance.
        chance: Probability of as much under a model that misses nothing (F test).
    """

    signals: tuple[int, ...]
    scatter: float
    common: float
    chance: float


def sandwich(problem: Problem, minimum: Fit, spread: Array) -> Array:
    """Return the covariance of z with residuals correlated as they are, shape (p, p).

    The estimate weighs samples as if they were independent but for their share; its covariance H^-1 V H^-1 has V of
    the scores under the fitted correlation (Huber, 5th Berkeley Symposium, 1967): autoregressive over time, and with
    what the model misses shared by repeats.

    Args:
        problem: The problem that was fitted.
        minimum: Of the problem.
        spread: Covariance by the likelihood alone, H^-1, shape (p, p).
    """
    slopes = problem.slopes(minimum.z)
    scores = [w / n**2 * j for w, n, j in zip(minimum.weights, minimum.noise, slopes, strict=True)]
    total, together = information_of_bounds(problem, minimum), set[int]()
    for repeated in repeats(problem, minimum.residuals):
        if repeated.common == 0.0:
            continue
        together.update(repeated.signals)
        members = [problem.signals[k] for k in repeated.signals]
        # Where residuals are smaller than the least noise, that counts.
        grown = max(1.0, members[0].least_noise ** 2 / (repeated.common + repeated.scatter))
        if members[0].ordered:
            mean = np.mean([minimum.residuals[k] for k in repeated.signals], axis=0)
            shared = np.sum([scores[k] for k in repeated.signals], axis=0)
            total += grown * repeated.common * _correlated(shared, _process([mean]))
            apart = [minimum.residuals[k] - mean for k in repeated.signals]
            spread_apart = sum(_correlated(scores[k], _process(apart)) for k in repeated.signals)
            total += grown * repeated.scatter * spread_apart
        else:
            score, replicate = scores[repeated.signals[0]], members[0].replicate
            sums = np.zeros((replicate.max() + 1, score.shape[1]))
            np.add.at(sums, replicate, score)
            total += grown * repeated.common * sums.T @ sums + grown * repeated.scatter * score.T @ score
    for group in np.unique(problem.groups):
        single = [k for k in np.flatnonzero(problem.groups == group).tolist() if k not in together]
        process = _process([minimum.residuals[k] for k in single if problem.signals[k].ordered])
        total += sum(minimum.noise[k] ** 2 * _correlated(scores[k], process) for k in single)
    return np.asarray(spread @ total @ spread)


def jackknife(problem: Problem, minimum: Fit) -> Array:
    """Return the covariance of z by leaving out one setting at a time, shape (p, p); zero of less than three settings.

    Settings are the recordings or, of less than three, the loads of their readings. What a model misses is shared by
    the samples of a setting, and no noise of samples. The estimate without one follows from its information h and score
    s, by (H - h)^-1 s (Bell and McCaffrey, Survey Methodology 28, 2002); 1.96 deviations are as many as Student's t
    asks for with a degree of freedom for every setting but one.
    """
    by_load = len({signal.recording for signal in problem.signals}) < 3
    parts, scores = dict[tuple[str, float], Array](), dict[tuple[str, float], Array]()
    far = outliers(problem, minimum.residuals)
    usual = [np.where(ratio > 0.0, 0.0, e) for ratio, e in zip(far, minimum.residuals, strict=True)]
    by_signal = zip(problem.signals, minimum.weights, minimum.noise, usual, problem.slopes(minimum.z), strict=True)
    for signal, w, n, e, j in by_signal:
        load = np.nan_to_num(signal.load) if by_load and not signal.ordered else np.zeros(len(e))
        for each in np.unique(load):
            rows, setting = load == each, (signal.recording, float(each))
            parts[setting] = parts.get(setting, 0.0) + w / n**2 * j[rows].T @ j[rows]
            scores[setting] = scores.get(setting, 0.0) + w / n**2 * j[rows].T @ e[rows]
    count = len(parts)
    if count < 3:
        return np.zeros((len(minimum.z), len(minimum.z)))
    whole, mean = np.sum(list(parts.values()), axis=0), np.mean(list(scores.values()), axis=0)
    without = [inverse_within_bounds(problem, whole - parts[each]) @ (scores[each] - mean) for each in parts]
    share = (count - 1) / count * (student.ppf(0.975, count - 1) / 1.96) ** 2
    return np.asarray(share * np.transpose(without) @ without)


def outliers(problem: Problem, residuals: Sequence[Array]) -> list[Array]:
    """Return residuals over the deviation of their median, by signal; zero for all but outliers.

    An outlier is less probable than chance among so many, and alone outweighs all others as they mostly are.
    """
    ratios, groups = [], problem.groups
    count = np.bincount(groups, [len(e) for e in residuals])[groups]
    for e, n, deviation in zip(residuals, count, typical(residuals, groups), strict=True):
        ratio = np.abs(e) / max(deviation, 1e-300)
        chance = 2.0 * n * student.sf(ratio, max(n - len(problem.keys), 1.0))
        ratios.append(np.where((chance < CHANCE) & (ratio**2 > n), ratio, 0.0))
    return ratios


def repeats(problem: Problem, residuals: Sequence[Array]) -> list[Repeats]:
    """Return the repeats among the signals, with residuals of all of them."""
    repeated, runs = [], list[list[int]]()
    recordings = {model.recording.name: model.recording for model in problem.models}
    for k, signal in enumerate(problem.signals):
        if signal.ordered:
            like = [run for run in runs if _are_repeats(problem.signals[run[0]], signal, recordings)]
            if like:
                like[0].append(k)
            else:
                runs.append([k])
        elif signal.replicate.max(initial=-1) + 1 < len(signal.measured):
            repeated.append(_of_readings(k, signal.replicate, residuals[k], len(problem.keys)))
    repeated += [_of_runs(tuple(run), [residuals[k] for k in run]) for run in runs if len(run) > 1]
    return repeated


def _are_repeats(one: RecordedSignal, other: RecordedSignal, recordings: Mapping[str, Recording]) -> bool:
    """Return whether two signals of motions are of the same output, read at the same times, of repeated runs."""
    same = one.name == other.name and np.array_equal(one.instant, other.instant)
    return same and recordings[one.recording].repeats(recordings[other.recording])


def scatter(values: Array, replicate: NDArray[np.intp]) -> float:
    """Return the mean square of readings about the mean of their replicates; not a number without any."""
    count = np.bincount(replicate)
    if len(count) == len(values):
        return math.nan
    mean = np.bincount(replicate, values) / count
    return float(np.sum((values - mean[replicate]) ** 2)) / (len(values) - len(count))


def _of_readings(k: int, replicate: NDArray[np.intp], residual: Array, parameters: int) -> Repeats:
    count = np.bincount(replicate)
    mean = np.bincount(replicate, residual) / count
    inner, outer = len(residual) - len(count), max(len(count) - parameters, 1)
    within = scatter(residual, replicate)
    between = float(np.sum(count * mean**2)) / outer
    chance = float(f_distribution.sf(between / max(within, 1e-300), outer, inner))
    common = max(between - within, 0.0) / float(np.mean(count))
    return Repeats((k,), within, common if chance < CHANCE else 0.0, chance)


def _of_runs(signals: tuple[int, ...], residuals: Sequence[Array]) -> Repeats:
    runs = len(residuals)
    mean = np.mean(residuals, axis=0)
    apart = [each - mean for each in residuals]
    within = sum(float(np.mean(each**2)) for each in apart) / (runs - 1)
    # Squares of what is correlated by rho count as (1 - rho^2) / (1 + rho^2) (Bartlett, J. Roy. Stat. Soc. B 8, 1946).
    square = sum(float(each @ each) for each in apart)
    rho = sum(float(each[1:] @ each[:-1]) for each in apart) / max(square, 1e-300)
    independent = max(len(mean) * (1.0 - rho**2) / (1.0 + rho**2), 1.0)
    between = runs * float(np.mean(mean**2))
    chance = float(f_distribution.sf(between / max(within, 1e-300), independent, (runs - 1) * independent))
    common = max(between - within, 0.0) / runs
    return Repeats(signals, within, common if chance < CHANCE else 0.0, chance)


def _process(residuals: Sequence[Array]) -> Array:
    """Return the autoregressive process of residuals, as a filter of white noise: numerator, then denominator.

    Its variance is one; its order is that of least BIC (Yule and Walker).
    """
    count = sum(map(len, residuals))
    lags = min(_LAGS, min(map(len, residuals), default=0) - 1)
    if lags < 1 or not any(each.any() for each in residuals):
        return np.array([1.0, 1.0])
    moments = np.array([sum(float(e[h:] @ e[: len(e) - h]) for e in residuals) for h in range(lags + 1)]) / count
    best, least = np.array([1.0, 1.0]), 0.0
    for order in range(1, lags + 1):
        ahead = solve_toeplitz(moments[:order] * np.append(1.0 + 1e-9, np.ones(order - 1)), moments[1 : order + 1])
        left = max(1.0 - float(ahead @ moments[1 : order + 1]) / moments[0], 1e-12)
        bic = count * np.log(left) + order * np.log(count)
        if bic < least:
            best, least = np.concatenate([[np.sqrt(left), 1.0], -ahead]), bic
    return best


def _correlated(score: Array, process: Array) -> Array:
    """Return B^T R B of scores B, shape (m, p), under a stationary process, shape (p, p)."""
    # What came before the first sample goes on in it: as many instants as there are samples tell it.
    reversed_scores = np.concatenate([score[::-1], np.zeros_like(score if len(process) > 2 else score[:0])])
    filtered = lfilter(process[:1], process[1:], reversed_scores, axis=0)
    return np.asarray(filtered.T @ filtered)
