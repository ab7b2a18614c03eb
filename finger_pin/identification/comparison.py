"""Comparison of laws: the same recordings under several, by BIC and by samples held out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.recordings.bench import IdentifySettings
from finger_pin.exceptions import InputError
from finger_pin.identification.estimate import Fit, fit
from finger_pin.identification.likelihood import minus_twice_likelihood
from finger_pin.identification.problem import Problem
from finger_pin.typing import Array

#: Name of the law that the scenario has as it stands.
DESCRIBED = "as described"
# Into how many parts one recording is cut.
_PARTS = 6
# Where in its range a key is started from that only another law has.
_SHARES = (0.9, 0.7, 0.5, 0.3)


@dataclass(frozen=True, eq=False)
class LawComparison:
    """Laws side by side; lists by law.

    Attributes:
        law: Names.
        parameters: Number of parameters found.
        bic: As by `bic`, under the weights of the scenario's own law.
        rms: Of residuals over the noise under the scenario's own law.
        held_out: The same of samples that the fit had not seen; not a number where nothing can be held out.
        estimate: By law, what was found, by key.
    """

    law: list[str]
    parameters: list[int]
    bic: list[float]
    rms: list[float]
    held_out: list[float]
    estimate: list[dict[str, float]]

    def plain(self) -> dict[str, Any]:
        """Return the comparison as plain lists, for JSON."""
        return asdict(self)

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> Self:
        """Read a table of `plain`."""
        return cls(**table)


def compare_laws(problem: Problem, settings: IdentifySettings, minimum: Fit) -> LawComparison:
    """Compare the scenario's law with the alternatives.

    Args:
        problem: Under the scenario's law.
        settings: With the other laws.
        minimum: That of the scenario's law, whose noise and weights count for all.
    """
    folds = _folds(problem)
    rows = []
    for name, law in [(DESCRIBED, problem), *other_laws(problem, settings).items()]:
        best = minimum if law is problem else _best(law, minimum.weights, _places(law, problem, minimum.z))
        value = bic(best.residuals, minimum.weights, law.asked, law.groups, law.least_noise)
        values = dict(zip(law.keys[: law.asked], law.values(best.z).tolist(), strict=False))
        out = _held_out(law, best, minimum, folds)
        rows.append((name, law.asked, value, _scaled_rms(best.residuals, minimum.noise), out, values))
    return LawComparison(*(list(column) for column in zip(*rows, strict=True)))


def bic(
    residuals: Sequence[Array], weights: Array, parameters: int, groups: NDArray[np.intp], least_noise: Array
) -> float:
    """Return k log n + sum of w n log(SSE / n); laws are comparable under the same weights w.

    Args:
        residuals: Of every signal.
        weights: Part of the samples that are independent, shape (s,).
        parameters: Number of parameters k.
        groups: Number of the output that every signal is of, shape (s,).
        least_noise: Least standard deviation of every signal, shape (s,).
    """
    size = float(sum(w * len(e) for e, w in zip(residuals, weights, strict=True)))
    return minus_twice_likelihood(residuals, weights, groups, least_noise) + parameters * math.log(max(size, 1.0))


def other_laws(problem: Problem, settings: IdentifySettings) -> dict[str, Problem]:
    """Return the problem under each of the other laws, by name.

    Raises:
        InputError: If an entry of a law is wrong.
    """
    return {name: _other(problem, name, each) for name, each in settings.compare.items()}


def _other(problem: Problem, name: str, law: Mapping[str, Any]) -> Problem:
    """Return the problem under another friction law, with its fixed keys and bounds."""
    bounds = {key: (float(a), float(b)) for key, a, b in zip(*_asked(problem), strict=True)}
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


def _asked(problem: Problem) -> tuple[Sequence[str], Array, Array]:
    """Return the keys that were asked for, without those of a recording, and their bounds."""
    return problem.keys[: problem.asked], problem.low[: problem.asked], problem.high[: problem.asked]


def _places(law: Problem, default: Problem, z: Array) -> list[Array]:
    """Return the starts of searches under a law: that of the scenario's law, further keys spread over their ranges."""
    low, high = law.box
    shared = [key in default.keys for key in law.keys]
    known = np.array([z[default.keys.index(key)] if key in default.keys else 0.0 for key in law.keys])
    shares = [0.5] if all(shared) else _SHARES
    return [np.clip(np.where(shared, known, low + (high - low) * share), low, high) for share in shares]


def _best(law: Problem, weights: Array, places: Sequence[Array]) -> Fit:
    return min((fit(law, place, weights=weights) for place in places), key=lambda minimum: minimum.objective)


def _folds(problem: Problem) -> list[list[NDArray[np.bool_]]]:
    """Return masks of samples that are held out in turn: recordings, windows, or readings of the same load."""
    names = list(dict.fromkeys(signal.recording for signal in problem.signals))
    if len(names) > 1:
        return [[np.full(len(s.measured), s.recording == name) for s in problem.signals] for name in names]
    if problem.moves:
        # The windows of one recording follow each other; samples of one window do not stand for themselves.
        groups = problem.groups.tolist()
        window = [groups[:k].count(group) for k, group in enumerate(groups)]
        parts = min(max(window) + 1, _PARTS)
        return [
            [np.full(len(s.measured), w % parts == part) for s, w in zip(problem.signals, window, strict=True)]
            for part in range(parts)
        ]
    groups = [np.unique(np.nan_to_num(signal.load), return_inverse=True)[1] % _PARTS for signal in problem.signals]
    return [[group == part for group in groups] for part in range(int(max(g.max() for g in groups)) + 1)]


def _held_out(law: Problem, best: Fit, reference: Fit, folds: Sequence[Sequence[NDArray[np.bool_]]]) -> float:
    squares, count = 0.0, 0
    for fold in folds if len(folds) > 1 else []:
        z = fit(law.subset([~each for each in fold]), best.z).z
        for e, mask, noise in zip(law.residuals(z), fold, reference.noise, strict=True):
            squares, count = squares + float(np.sum((e[mask] / noise) ** 2)), count + int(mask.sum())
    return math.sqrt(squares / count) if count else math.nan


def _scaled_rms(residuals: Sequence[Array], noise: Array) -> float:
    whole = np.concatenate([e / n for e, n in zip(residuals, noise, strict=True)])
    return float(np.sqrt(np.mean(whole * whole)))
