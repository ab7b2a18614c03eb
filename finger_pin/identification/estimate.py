"""The estimate: least squares with a noise for every signal, weighed by the number of its independent samples."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from finger_pin.identification.likelihood import minus_twice_likelihood, pooled, typical
from finger_pin.identification.problem import Problem
from finger_pin.typing import Array

# Rounds of weights, steps in a round, and trials in a row that may fail.
_ROUNDS, _STEPS, _FAILS = 5, 40, 3
# Gain of minus twice the log-likelihood that is not worth a step. A gain g leaves parameters within sqrt(g) of their
# standard deviation: one for means of motions, 0.2 for motions, 0.03 for those computed finely, none for closed forms.
_GAIN_ROUGH, _GAIN, _GAIN_FINE, _GAIN_CLOSED = 1.0, 0.05, 1e-3, 1e-9
# Difference of minus twice the log-likelihood that errors of runs hide: half the 0.1 by which fine ones make it jump.
_JUMP = 0.05
# Largest step, and the least that limits of parameters on each other cut it to, part of a parameter's range.
_RADIUS, _LEAST_RADIUS = 0.3, 1e-6
# Ratio of gained to promised from which on slopes are kept; below it the radius is that part of the step (Nocedal and
# Wright, Numerical Optimization, algorithm 4.1).
_RATIO = 0.25
# Gain per sample that errors of slopes promise: slopes that searches ask for err by 0.01 to 0.03, and this is squared.
_FEIGNED = 1e-3
# Part of the largest reading that a parameter must move, all over its bounds, to be felt by a signal; and the shares of
# the bounds at which searches go on for parameters that nothing feels where one has ended.
_FELT, _SHARES = 1e-9, (0.5, 0.9, 0.1)
#: What a squared residual u counts for where outliers are to count less, and how fast that grows.
LOSSES: dict[str, tuple[Callable[[Array], Array], Callable[[Array], Array]]] = {
    "linear": (lambda u: u, np.ones_like),
    "soft_l1": (lambda u: 2.0 * (np.sqrt(1.0 + u) - 1.0), lambda u: 1.0 / np.sqrt(1.0 + u)),
    "huber": (lambda u: np.where(u > 1.0, 2.0 * np.sqrt(u) - 1.0, u), lambda u: 1.0 / np.sqrt(np.maximum(u, 1.0))),
    "cauchy": (np.log1p, lambda u: 1.0 / (1.0 + u)),
    "arctan": (np.arctan, lambda u: 1.0 / (1.0 + u * u)),
}


@dataclass(frozen=True, eq=False)
class Fit:
    """A minimum.

    Attributes:
        z: Search variables, shape (p,).
        residuals: Of every signal.
        noise: rms of the residuals of every signal, shape (s,); where outliers count less, that of their median.
        correlation: Of neighbouring residuals, shape (s,).
        weights: Part of the samples that are independent, (1 - rho) / (1 + rho), shape (s,) (Bartlett).
        objective: Sum of w n log(SSE / n), outliers as they count.
        slopes: Of every signal's residuals, those of the last step, which need not be of here; none without steps.
        converged: Whether steps have come to their end.
    """

    z: Array
    residuals: Sequence[Array]
    noise: Array
    correlation: Array
    weights: Array
    objective: float
    slopes: Sequence[Array] | None = None
    converged: bool = True


def fit(
    problem: Problem,
    start: Array,
    *,
    fixed: Mapping[int, float] | None = None,
    weights: Array | None = None,
    loss: str = "linear",
    slopes: Sequence[Array] | None = None,
    scale: Array | None = None,
) -> Fit:
    """Return the minimum that is reached from a start.

    Args:
        problem: The problem to fit.
        start: Shape (p,), transformed.
        fixed: Entries of z that stay as they are.
        weights: Of the signals; by default they follow from the residuals at the end.
        loss: One of `LOSSES`, for outliers.
        slopes: Of the residuals near the start, to step with as long as they serve; by default those at the start.
        scale: Beyond which residuals are outliers, of the signals; by default their noise.
    """
    z, free = start.copy(), np.ones(len(start), dtype=bool)
    for k, value in (fixed or {}).items():
        z[k], free[k] = value, False
    z = problem.feasible(z, free)
    shares = np.ones(len(problem.signals)) if weights is None else weights
    residuals: Sequence[Array] = problem.residuals(z)
    if not all(np.isfinite(e).all() for e in residuals):
        # What cannot be integrated there is the worst of all minima.
        nothing = np.zeros(len(residuals))
        return Fit(z, residuals, nothing, nothing, nothing, math.inf, converged=False)
    ended = True
    for k in range(_ROUNDS if free.any() else 0):
        before = z
        z, residuals, slopes, ended = _descend(problem, z, residuals, free, shares, loss, slopes, scale)
        if weights is not None or not ended or (k > 0 and z is before):
            break
        shares = _independent(problem, residuals)[1]
    correlation, independent = _independent(problem, residuals)
    shares = independent if weights is None else weights
    noise = _noise(problem, residuals, robust=loss != "linear")
    used = noise if scale is None else scale
    objective = _objective(problem, _counted(residuals, used, loss)[0], shares, used, loss)
    return Fit(z, residuals, noise, correlation, shares, objective, slopes, ended)


def fit_off_flats(problem: Problem, start: Array, loss: str = "linear") -> Fit:
    """Return the minimum that is reached from a start, and from beside it where nothing feels some parameters.

    No step moves what has no slope there, such as a friction below the floor of its law.
    """
    best, (low, high) = fit(problem, start, loss=loss), problem.box
    for share in _SHARES:
        flat = np.zeros(len(start), dtype=bool) if best.slopes is None else ~felt(problem, best.slopes)
        if not flat.any():
            break
        beside = fit(problem, np.where(flat, low + (high - low) * share, best.z), loss=loss)
        best = best_of(problem, [best, beside])
    return best


def felt(problem: Problem, slopes: Sequence[Array]) -> NDArray[np.bool_]:
    """Return which parameters move a signal where residuals have some slopes, shape (p,)."""
    width = np.subtract(*reversed(problem.box))
    sizes = [max(float(np.max(np.abs(signal.measured), initial=0.0)), 1e-300) for signal in problem.signals]
    pairs = zip(slopes, sizes, strict=True)
    return np.asarray(np.any([np.any(np.abs(j) * width > _FELT * size, axis=0) for j, size in pairs], axis=0))


def _descend(
    problem: Problem,
    z: Array,
    residuals: Sequence[Array],
    free: NDArray[np.bool_],
    shares: Array,
    loss: str,
    slopes: Sequence[Array] | None,
    scale: Array | None,
) -> tuple[Array, Sequence[Array], Sequence[Array], bool]:
    """Return the place of the greatest likelihood, its residuals, the slopes of the last step, and success.

    Steps are those of Gauss and Newton in a box of trust. A run costs less than its slopes: these are made anew only
    where a step does not gain what they promise. Of motions they are bent to agree with it while far from the end: over
    whole steps the little leaps of a motion count less than in slopes at one place.
    """
    fresh, radius, failed = slopes is None, _RADIUS, 0
    slopes = problem.slopes(z) if slopes is None else list(slopes)
    gain, bending = _least_gain(problem), problem.moves and not problem.finely
    jump = max(gain, _JUMP) if problem.moves else gain
    count = float(sum(w * len(e) for w, e in zip(shares, residuals, strict=True)))
    feigned = max(_GAIN_ROUGH, 0.0 if problem.finely else _FEIGNED * count)
    for _ in range(_STEPS):
        noise = _noise(problem, residuals, robust=loss != "linear") if scale is None else scale
        met, system = _normal(problem, residuals, slopes, shares, noise, loss)
        move, promised = _step(problem, z, free, system, radius)
        if promised < 0.0 and radius > _LEAST_RADIUS:
            # Limits that parameters set each other have cut it wrongly.
            radius *= _RATIO
            continue
        if promised < gain:
            return z, residuals, slopes, True
        there = problem.residuals(z + move)
        both = met, _counted(there, noise, loss)[0]
        sums = [_objective(problem, each, shares, noise, loss) for each in both]
        gained = sums[0] - sums[1]
        away = promised - gained if bending else abs(promised - gained)
        ratio, served = gained / promised, away < (1.0 - _RATIO if bending else _RATIO) * promised + jump
        if ratio > 0.0:
            before = residuals
            z, residuals, failed = z + move, there, 0
            radius = min(2.0 * radius, _RADIUS) if ratio > _RATIO else radius
        elif fresh:
            failed += 1
            radius = _RATIO * float(np.max(np.abs(move) / np.subtract(*reversed(problem.box))))
        if ratio <= 0.0 and promised < jump:
            return z, residuals, slopes, True
        if failed > (_FAILS if promised > feigned else 0):
            return z, residuals, slopes, promised <= feigned
        if not served and (ratio > 0.0 or not fresh):
            slopes, fresh = problem.slopes(z), True
        elif ratio > 0.0:
            slopes, fresh = _bent(problem, slopes, move, before, there) if bending else slopes, False
    return z, residuals, slopes, False


def _least_gain(problem: Problem) -> float:
    """Return the gain of minus twice the log-likelihood below which no step is made."""
    if not problem.moves:
        return _GAIN_CLOSED
    return _GAIN_FINE if problem.finely else _GAIN_ROUGH if problem.means else _GAIN


def _bent(
    problem: Problem, slopes: Sequence[Array], move: Array, before: Sequence[Array], after: Sequence[Array]
) -> list[Array]:
    """Return the slopes that agree with a step, and change the least (Broyden)."""
    low, high = problem.box
    way = move / (high - low) ** 2
    way /= move @ way
    return [j + np.outer(b - a - j @ move, way) for j, a, b in zip(slopes, before, after, strict=True)]


def _normal(
    problem: Problem, residuals: Sequence[Array], slopes: Sequence[Array], shares: Array, scale: Array, loss: str
) -> tuple[Sequence[Array], Array]:
    """Return the weighed residuals, and slopes beside residuals, triangular: shape (q, p + 1), q at most p + 1."""
    met, growth = _counted(residuals, scale, loss)
    factors = np.sqrt(shares) / (_noise(problem, met) if loss == "linear" else scale)
    rows = zip(factors, growth, slopes, met, strict=True)
    whole = np.concatenate([f * np.column_stack([g[:, None] * j, e]) for f, g, j, e in rows])
    return met, np.asarray(np.linalg.qr(whole, mode="r"))


def _objective(problem: Problem, counted: Sequence[Array], shares: Array, scale: Array, loss: str) -> float:
    """Return minus twice the log-likelihood of weighed residuals.

    Where outliers count less their noise is that of the scale: an rms would be theirs.
    """
    if loss == "linear":
        return minus_twice_likelihood(counted, shares, problem.groups, problem.least_noise)
    by_signal = zip(counted, shares, scale, strict=True)
    return float(sum(w * (e @ e / s**2 + 2.0 * len(e) * math.log(s)) for e, w, s in by_signal))


def _step(problem: Problem, z: Array, free: NDArray[np.bool_], system: Array, radius: float) -> tuple[Array, float]:
    """Return a step within the bounds, and the fall of -2 log L that it predicts to second order."""
    low, high = problem.box
    width = high - low
    # Strictly apart, as `lsq_linear` asks: at a bound by what is lost when the step is added.
    least = np.minimum(np.maximum((low - z) / width, -radius), -1e-12)
    most = np.maximum(np.minimum((high - z) / width, radius), 1e-12)
    slopes, residuals, move = system[:, :-1] * width, system[:, -1], np.zeros(len(z))
    move[free] = lsq_linear(slopes[:, free], -residuals, (least[free], most[free]), method="bvls", tol=1e-12).x
    move = problem.feasible(np.clip(z + width * move, low, high), free) - z
    left = system[:, :-1] @ move + residuals
    return move, float(residuals @ residuals - left @ left)


def _counted(residuals: Sequence[Array], scale: Array, loss: str) -> tuple[list[Array], list[Array]]:
    """Return the weighed residuals, the sum of their squares, and their derivatives by the residuals."""
    if loss == "linear":
        return list(residuals), [np.ones(len(e)) for e in residuals]
    rho, growth = LOSSES[loss]
    counted, factors = [], []
    for e, n in zip(residuals, scale, strict=True):
        u = np.maximum((e / n) ** 2, 1e-12)
        ratio = np.sqrt(rho(u) / u)
        counted.append(ratio * e)
        factors.append(growth(u) / ratio)
    return counted, factors


def best_of(problem: Problem, fits: Sequence[Fit]) -> Fit:
    """Return the minimum of least misfit with equal weights."""
    equal_weights, noise = np.ones(len(problem.signals)), (problem.groups, problem.least_noise)
    return min(fits, key=lambda candidate: minus_twice_likelihood(candidate.residuals, equal_weights, *noise))


def information(problem: Problem, minimum: Fit) -> Array:
    """Return the Fisher information of z at a minimum, shape (p, p)."""
    slopes = problem.slopes(minimum.z)
    factors = minimum.weights / minimum.noise**2
    total: Array = sum(f * j.T @ j for f, j in zip(factors, slopes, strict=True))
    return total


def _noise(problem: Problem, residuals: Sequence[Array], robust: bool = False) -> Array:
    """Return the rms of the residuals of every output, or that of their median; never below its least, or rounding."""
    groups = problem.groups
    count, square = pooled(residuals, np.ones(len(residuals)), groups)
    rms = typical(residuals, groups) if robust else np.where(count > 0.0, np.sqrt(square), 1.0)[groups]
    rounding = [1e-9 * max(float(np.max(np.abs(s.measured), initial=0.0)), 1e-9) for s in problem.signals]
    return np.maximum(rms, np.maximum(problem.least_noise, rounding))


def _independent(problem: Problem, residuals: Sequence[Array]) -> tuple[Array, Array]:
    """Return the correlation of neighbouring residuals of every output, and the share that is independent."""
    groups, rho = problem.groups, np.zeros(len(residuals))
    for group in np.unique(groups):
        places = np.flatnonzero(groups == group).tolist()
        ordered = [k for k in places if problem.signals[k].ordered and len(residuals[k]) > 2]
        size = sum(float(residuals[k] @ residuals[k]) for k in ordered)
        together = sum(float(residuals[k][1:] @ residuals[k][:-1]) for k in ordered)
        count = sum(len(residuals[k]) for k in ordered)
        rho[groups == group] = np.clip(together / size, 0.0, 1.0 - 2.0 / count) if size > 0.0 else 0.0
    return rho, (1.0 - rho) / (1.0 + rho)
