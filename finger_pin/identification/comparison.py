"""Comparison of laws: the same recordings under several, by BIC and by samples held out."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.recordings.bench import IdentifySettings
from finger_pin.exceptions import InputError
from finger_pin.identification.estimate import Fit, fit
from finger_pin.identification.likelihood import minus_twice_likelihood
from finger_pin.identification.problem import Problem
from finger_pin.typing import Array

#: Name of the scenario's unchanged law.
SCENARIO_LAW = "as described"
# Number of folds of a single recording in cross-validation.
_MAX_FOLDS = 6
# Starts of a key that only the alternative law has, as shares of its range.
_START_SHARES = (0.9, 0.7, 0.5, 0.3)


@dataclass(frozen=True, eq=False)
class LawComparison:
    """Results of the compared laws; lists by law.

    Attributes:
        law: Names.
        parameters: Number of parameters found.
        bic: As by `bic`, under the weights of the scenario's own law.
        rms: Of residuals over the noise under the scenario's own law.
        held_out: The same of held-out samples in cross-validation; not a number with a single fold.
        estimate: Estimates by key, for each law.
    """

    law: list[str]
    parameters: list[int]
    bic: list[float]
    rms: list[float]
    held_out: list[float]
    estimate: list[dict[str, float]]


def compare_laws(problem: Problem, settings: IdentifySettings, minimum: Fit) -> LawComparison:
    """Compare the scenario's law with the alternatives.

    Args:
        problem: Under the scenario's law.
        settings: With the other laws.
        minimum: That of the scenario's law, whose noise and weights count for all.
    """
    folds = _folds(problem)
    rows = []
    for name, law in [(SCENARIO_LAW, problem), *other_laws(problem, settings).items()]:
        best = minimum if law is problem else _best_fit(law, problem, minimum)
        value = bic(best.residuals, minimum.weights, law.requested_count, law.noise_groups, law.least_noise)
        values = dict(zip(law.keys[: law.requested_count], law.values(best.z).tolist(), strict=False))
        held_out = _held_out_rms(law, best, minimum, folds)
        scaled = np.concatenate([e / n for e, n in zip(best.residuals, minimum.noise, strict=True)])
        rms = float(np.sqrt(np.mean(scaled * scaled)))
        rows.append((name, law.requested_count, value, rms, held_out, values))
    return LawComparison(*(list(column) for column in zip(*rows, strict=True)))


def bic(
    residuals: Sequence[Array], weights: Array, parameters: int, groups: NDArray[np.intp], least_noise: Array
) -> float:
    """Return k log n + sum of w n log(SSE / n); laws are comparable under the same weights w.

    Args:
        residuals: Of every signal.
        weights: Part of the samples that are independent, shape (s,).
        parameters: Number of parameters k.
        groups: Number of the noise of every signal, shape (s,).
        least_noise: Least standard deviation of every signal, shape (s,).
    """
    size = float(sum(w * len(e) for e, w in zip(residuals, weights, strict=True)))
    return minus_twice_likelihood(residuals, weights, groups, least_noise) + parameters * math.log(max(size, 1.0))


def other_laws(problem: Problem, settings: IdentifySettings) -> dict[str, Problem]:
    """Return the problem under each of the other laws, by name."""
    return {name: _alternative(problem, name, each) for name, each in settings.compare.items()}


def _alternative(problem: Problem, name: str, law: Mapping[str, Any]) -> Problem:
    """Return the problem under another friction law, with its fixed keys and bounds."""
    ends = zip(problem.keys, problem.low.tolist(), problem.high.tolist(), strict=True)
    bounds = {key: (low, high) for key, low, high in itertools.islice(ends, problem.requested_count)}
    fixed: dict[str, float] = {}
    for key, value in law.items():
        if isinstance(value, int | float) and not isinstance(value, bool):
            fixed[key] = float(value)
            bounds.pop(key, None)
        elif isinstance(value, list | tuple) and len(value) == 2 and value[0] < value[1]:
            bounds[key] = (float(value[0]), float(value[1]))
        else:
            raise InputError(f"identify.compare.{name}.{key}", "must be a number, or the least and the greatest", value)
    low, high = np.array(list(bounds.values())).T if bounds else np.zeros((2, 0))
    try:
        return Problem(problem.scenario, tuple(bounds), low, high, problem.models, problem.signals, fixed, problem.stop)
    except InputError as error:
        raise InputError(f"identify.compare.{name}", str(error)) from None


def _best_fit(law: Problem, default: Problem, minimum: Fit) -> Fit:
    """Return the fit of a law from starts with shared keys at the default's minimum, others over their ranges."""
    (low, high), z = law.box, minimum.z
    shared = [key in default.keys for key in law.keys]
    shared_values = np.array([z[default.keys.index(key)] if key in default.keys else 0.0 for key in law.keys])
    shares = [0.5] if all(shared) else _START_SHARES
    starts = (np.clip(np.where(shared, shared_values, low + (high - low) * share), low, high) for share in shares)
    return min((fit(law, start, weights=minimum.weights) for start in starts), key=lambda each: each.objective)


def _folds(problem: Problem) -> list[list[NDArray[np.bool_]]]:
    """Return masks of samples that are held out in turn: recordings, windows, or readings of the same load."""
    names = list(dict.fromkeys(signal.recording for signal in problem.signals))
    if len(names) > 1:
        return [[np.full(len(s.measured), s.recording == name) for s in problem.signals] for name in names]
    if problem.has_motion:
        # The windows of one recording follow each other; samples of one window do not stand for themselves.
        groups = problem.groups.tolist()
        window = [groups[:k].count(group) for k, group in enumerate(groups)]
        parts = min(max(window) + 1, _MAX_FOLDS)
        return [
            [np.full(len(s.measured), w % parts == part) for s, w in zip(problem.signals, window, strict=True)]
            for part in range(parts)
        ]
    groups = [np.unique(np.nan_to_num(signal.load), return_inverse=True)[1] % _MAX_FOLDS for signal in problem.signals]
    return [[group == part for group in groups] for part in range(int(max(g.max() for g in groups)) + 1)]


def _held_out_rms(law: Problem, best: Fit, reference: Fit, folds: Sequence[Sequence[NDArray[np.bool_]]]) -> float:
    squares, count = 0.0, 0
    for fold in folds if len(folds) > 1 else []:
        z = fit(law.subset([~each for each in fold]), best.z).z
        for e, mask, noise in zip(law.residuals(z), fold, reference.noise, strict=True):
            squares, count = squares + float(np.sum((e[mask] / noise) ** 2)), count + int(mask.sum())
    return math.sqrt(squares / count) if count else math.nan
