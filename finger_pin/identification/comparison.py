"""Comparison of laws: the same recordings under several, by BIC and by samples held out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.recordings.bench import IdentifySettings
from finger_pin.exceptions import InputError
from finger_pin.identification.likelihood import Likelihood
from finger_pin.identification.parameters.parameters import Parameters
from finger_pin.identification.residuals.residuals import Residuals
from finger_pin.identification.search.gauss_newton import Fit, fit
from finger_pin.identification.search.objective import Objective
from finger_pin.typing import Array

#: Name of the scenario's unchanged law.
SCENARIO_LAW = "as described"
# Number of folds of a single recording in cross-validation.
_MAX_FOLDS = 6
# Starts of a key that only the alternative law has, as shares of its range.
_START_SHARES = (0.9, 0.7, 0.5, 0.3)


def compare_laws(objective: Objective[Residuals], settings: IdentifySettings, minimum: Fit) -> dict[str, list[Any]]:
    """Compare the scenario's law with the alternatives.

    Args:
        objective: Under the scenario's law.
        settings: With the other laws.
        minimum: That of the scenario's law, whose noise and weights count for all.

    Returns:
        By law: names, ``law``; numbers of ``parameters`` found; ``bic`` under the weights of the scenario's own law;
        ``rms`` of residuals over the noise under that law, and ``held_out`` the same of held-out samples in
        cross-validation, not a number with a single fold.
    """
    folds = _folds(objective.function)
    comparison: dict[str, list[Any]] = {name: [] for name in ("law", "parameters", "bic", "rms", "held_out")}
    others = other_laws(objective.function, settings).items()
    for name, law in [(SCENARIO_LAW, objective), *((name, Objective(law, objective.stop)) for name, law in others)]:
        best = minimum if law is objective else _best_fit(law, objective.function, minimum)
        scaled = np.concatenate([e / n for e, n in zip(best.residuals, minimum.noise, strict=True)])
        count = len(law.function.parameters.bounds)
        value = bic(law.likelihood, best.residuals, minimum.weights, count)
        rms = float(np.sqrt(np.mean(scaled * scaled)))
        row = (name, count, value, rms, _held_out_rms(law, best, minimum, folds))
        for column, each in zip(comparison.values(), row, strict=True):
            column.append(each)
    return comparison


def bic(likelihood: Likelihood, residuals: Sequence[Array], weights: Array, parameters: int) -> float:
    """Return k log n + sum of w n log(SSE / n); laws are comparable under the same weights w.

    Args:
        likelihood: Of the residuals.
        residuals: Of every signal.
        weights: Part of the samples that are independent, shape (s,).
        parameters: Number of parameters k.
    """
    size = float(sum(w * len(e) for e, w in zip(residuals, weights, strict=True)))
    return likelihood.minus_twice_log(residuals, weights) + parameters * math.log(max(size, 1.0))


def other_laws(function: Residuals, settings: IdentifySettings) -> dict[str, Residuals]:
    """Return the residuals under each of the other laws, with its fixed keys and bounds, by name."""
    laws = {}
    for name, entries in settings.compare.items():
        bounds, fixed, entry = function.parameters.bounds.copy(), dict[str, float](), f"identify.compare.{name}"
        for key, value in entries.items():
            if isinstance(value, int | float) and not isinstance(value, bool):
                fixed[key] = float(value)
                bounds.pop(key, None)
            elif isinstance(value, list | tuple) and len(value) == 2 and value[0] < value[1]:
                bounds[key] = (float(value[0]), float(value[1]))
            else:
                raise InputError(f"{entry}.{key}", "must be a number, or the least and the greatest", value)
        try:
            laws[name] = replace(function, parameters=Parameters(bounds, function.models, fixed))
        except InputError as error:
            raise InputError(entry, str(error)) from None
    return laws


def _best_fit(law: Objective[Residuals], default: Residuals, minimum: Fit) -> Fit:
    """Return the fit of a law from starts with shared keys at the default's minimum, others over their ranges."""
    (low, high), known = law.box, dict(zip(default.parameters.keys, minimum.z.tolist(), strict=True))
    keys = law.function.parameters.keys
    shared, values = np.array([key in known for key in keys], dtype=bool), [known.get(key, 0.0) for key in keys]
    shares = [0.5] if shared.all() else _START_SHARES
    starts = (np.clip(np.where(shared, values, low + (high - low) * share), low, high) for share in shares)
    return min((fit(law, start, weights=minimum.weights) for start in starts), key=lambda each: each.objective)


def _folds(function: Residuals) -> list[list[NDArray[np.bool_]]]:
    """Return masks of samples that are held out in turn: recordings, windows, or readings of the same load."""
    names = list(dict.fromkeys(signal.recording for signal in function.signals))
    if len(names) > 1:
        return [[np.full(len(s.measured), s.recording == name) for s in function.signals] for name in names]
    if not function.exact:
        # The windows of one recording follow each other; samples of one window do not stand for themselves.
        groups = function.likelihood.outputs.tolist()
        window = [groups[:k].count(group) for k, group in enumerate(groups)]
        parts = min(max(window) + 1, _MAX_FOLDS)
        return [
            [np.full(len(s.measured), w % parts == part) for s, w in zip(function.signals, window, strict=True)]
            for part in range(parts)
        ]
    groups = [np.unique(np.nan_to_num(signal.load), return_inverse=True)[1] % _MAX_FOLDS for signal in function.signals]
    return [[group == part for group in groups] for part in range(int(max(g.max() for g in groups)) + 1)]


def _held_out_rms(
    law: Objective[Residuals], best: Fit, reference: Fit, folds: Sequence[Sequence[NDArray[np.bool_]]]
) -> float:
    squares, count = 0.0, 0
    for fold in folds if len(folds) > 1 else []:
        z = fit(Objective(law.function.subset([~each for each in fold]), law.stop), best.z).z
        for e, mask, noise in zip(law.residuals(z), fold, reference.noise, strict=True):
            squares, count = squares + float(np.sum((e[mask] / noise) ** 2)), count + int(mask.sum())
    return math.sqrt(squares / count) if count else math.nan
