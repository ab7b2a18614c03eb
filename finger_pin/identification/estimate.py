"""The estimate: least squares with a noise for every signal, weighed by the number of its independent samples."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from finger_pin.identification.likelihood import minus_twice_likelihood, pooled_variance, robust_deviation
from finger_pin.identification.problem import Problem
from finger_pin.typing import Array

# Rounds of weights, steps in a round, and consecutive trials that may fail.
_MAX_ROUNDS, _MAX_STEPS, _MAX_FAILURES = 5, 40, 3
# Gain of minus twice the log-likelihood that is not worth a step. A gain g leaves parameters within sqrt(g) of their
# standard deviation: one for means of motions, 0.2 for motions, 0.03 for those computed finely, none for closed forms.
_GAIN_ROUGH, _GAIN, _GAIN_FINE, _GAIN_CLOSED = 1.0, 0.05, 1e-3, 1e-9
#: The same of refits beside an estimate, whose rise or shift counts: 1e-7 leaves 3e-4 of a standard deviation.
GAIN_REFIT = 1e-7
# Difference of minus twice the log-likelihood that errors of runs hide: half the 0.1 by which fine ones make it jump.
_LIKELIHOOD_JUMP = 0.05
# Largest step, and the least that limits of parameters on each other cut it to, part of a parameter's range.
_RADIUS, _LEAST_RADIUS = 0.3, 1e-6
# Ratio of actual to predicted gain above which slopes are kept; below it the radius is that part of the step (Nocedal
# and Wright, Numerical Optimization, algorithm 4.1).
_GAIN_RATIO = 0.25
# Gain per sample that errors of slopes alone predict: the square of their relative error, 0.01 to 0.03 in searches.
_SLOPE_ERROR_GAIN = 1e-3
# Least change of a signal over a parameter's bounds, part of its largest reading, that counts as influence; and the
# shares of the bounds at which searches restart parameters without any.
_LEAST_EFFECT, _RESTART_SHARES = 1e-9, (0.5, 0.9, 0.1)
#: Loss of a squared residual u, and its derivative, for outliers.
LOSSES: dict[str, tuple[Callable[[Array], Array], Callable[[Array], Array]]] = {
    "linear": (lambda u: u, np.ones_like),
    "soft_l1": (lambda u: 2.0 * (np.sqrt(1.0 + u) - 1.0), lambda u: 1.0 / np.sqrt(1.0 + u)),
    "huber": (lambda u: np.where(u > 1.0, 2.0 * np.sqrt(u) - 1.0, u), lambda u: 1.0 / np.sqrt(np.maximum(u, 1.0))),
    "cauchy": (np.log1p, lambda u: 1.0 / (1.0 + u)),
    "arctan": (np.arctan, lambda u: 1.0 / (1.0 + u * u)),
}


@dataclass(frozen=True, eq=False)
class Fit:
    """Minimum of the objective, and its noise.

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
    least_gain: float = 0.0,
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
        least_gain: Gain of minus twice the log-likelihood that is not worth a step, if more than that of estimates.
    """
    z, free = start.copy(), np.ones(len(start), dtype=bool)
    for k, value in (fixed or {}).items():
        z[k], free[k] = value, False
    z = problem.feasible(z, free)
    signal_weights = np.ones(len(problem.signals)) if weights is None else weights
    residuals: Sequence[Array] = problem.residuals(z)
    if not all(np.isfinite(e).all() for e in residuals):
        # A failed integration is the worst of all minima.
        zeros = np.zeros(len(residuals))
        return Fit(z, residuals, zeros, zeros, zeros, math.inf, converged=False)
    converged = True
    for k in range(_MAX_ROUNDS if free.any() else 0):
        previous = z
        z, residuals, slopes, converged = _descend(
            problem, z, residuals, free, signal_weights, loss, slopes, scale, max(_least_gain(problem), least_gain)
        )
        if weights is not None or not converged or (k > 0 and z is previous):
            break
        signal_weights = _independent(problem, residuals)[1]
    correlation, residual_shares = _independent(problem, residuals)
    signal_weights = residual_shares if weights is None else weights
    noise = _noise(problem, residuals, robust=loss != "linear")
    outlier_scale = noise if scale is None else scale
    objective = _objective(problem, _apply_loss(residuals, outlier_scale, loss)[0], signal_weights, outlier_scale, loss)
    return Fit(z, residuals, noise, correlation, signal_weights, objective, slopes, converged)


def fit_with_restarts(problem: Problem, start: Array, loss: str = "linear") -> Fit:
    """Return the minimum reached from a start; restart parameters without influence there at other values.

    A parameter without a slope does not move, such as a friction below the floor of its law.
    """
    best, (low, high) = fit(problem, start, loss=loss), problem.box
    for share in _RESTART_SHARES:
        if best.slopes is None or (influential := influential_parameters(problem, best.slopes)).all():
            break
        restarted = fit(problem, np.where(influential, best.z, low + (high - low) * share), loss=loss)
        best = best_of(problem, [best, restarted])
    return best


def influential_parameters(problem: Problem, slopes: Sequence[Array]) -> NDArray[np.bool_]:
    """Return a mask of the parameters that influence a signal, by the slopes of the residuals, shape (p,)."""
    width = np.subtract(*reversed(problem.box))
    sizes = [max(float(np.max(np.abs(signal.measured), initial=0.0)), 1e-300) for signal in problem.signals]
    pairs = zip(slopes, sizes, strict=True)
    return np.asarray(np.any([np.any(np.abs(j) * width > _LEAST_EFFECT * size, axis=0) for j, size in pairs], axis=0))


def _descend(
    problem: Problem,
    z: Array,
    residuals: Sequence[Array],
    free: NDArray[np.bool_],
    weights: Array,
    loss: str,
    slopes: Sequence[Array] | None,
    scale: Array | None,
    least_gain: float,
) -> tuple[Array, Sequence[Array], Sequence[Array], bool]:
    """Return the point of greatest likelihood, its residuals, the slopes of the last step, and convergence.

    Gauss-Newton steps in a trust region. A run costs less than its slopes, so slopes are recomputed only where a step
    does not gain what they predict. For motions, Broyden's update keeps them in agreement with the steps: over whole
    steps the small jumps of a motion matter less than in slopes at one point.
    """
    slopes_are_current, radius, failed = slopes is None, _RADIUS, 0
    slopes = problem.slopes(z) if slopes is None else list(slopes)
    updates_slopes = problem.has_motion and not problem.is_fine
    jump = max(least_gain, _LIKELIHOOD_JUMP) if problem.has_motion else least_gain
    count = float(sum(w * len(e) for w, e in zip(weights, residuals, strict=True)))
    slope_error_gain = max(_GAIN_ROUGH, 0.0 if problem.is_fine else _SLOPE_ERROR_GAIN * count)
    for _ in range(_MAX_STEPS):
        noise = _noise(problem, residuals, robust=loss != "linear") if scale is None else scale
        weighted, system = _triangular_system(problem, residuals, slopes, weights, noise, loss)
        step, predicted_gain = _step(problem, z, free, system, radius)
        if predicted_gain < 0.0 and radius > _LEAST_RADIUS:
            # Limits that parameters set each other have cut it wrongly.
            radius *= _GAIN_RATIO
            continue
        if predicted_gain < least_gain:
            return z, residuals, slopes, True
        trial = problem.residuals(z + step)
        weighted_pair = weighted, _apply_loss(trial, noise, loss)[0]
        sums = [_objective(problem, each, weights, noise, loss) for each in weighted_pair]
        actual_gain = sums[0] - sums[1]
        disagreement = predicted_gain - actual_gain if updates_slopes else abs(predicted_gain - actual_gain)
        ratio, tolerated = actual_gain / predicted_gain, 1.0 - _GAIN_RATIO if updates_slopes else _GAIN_RATIO
        slopes_hold = disagreement < tolerated * predicted_gain + jump
        if ratio > 0.0:
            previous = residuals
            z, residuals, failed = z + step, trial, 0
            radius = min(2.0 * radius, _RADIUS) if ratio > _GAIN_RATIO else radius
        elif slopes_are_current:
            failed += 1
            radius = _GAIN_RATIO * float(np.max(np.abs(step) / np.subtract(*reversed(problem.box))))
        if ratio <= 0.0 and predicted_gain < jump:
            return z, residuals, slopes, True
        if failed > (_MAX_FAILURES if predicted_gain > slope_error_gain else 0):
            return z, residuals, slopes, predicted_gain <= slope_error_gain
        if not slopes_hold and (ratio > 0.0 or not slopes_are_current):
            slopes, slopes_are_current = problem.slopes(z), True
        elif ratio > 0.0:
            slopes_are_current = False
            slopes = _broyden_update(problem, slopes, step, previous, trial) if updates_slopes else slopes
    return z, residuals, slopes, False


def _least_gain(problem: Problem) -> float:
    """Return the gain of minus twice the log-likelihood below which no step is made."""
    if not problem.has_motion:
        return _GAIN_CLOSED
    return _GAIN_FINE if problem.is_fine else _GAIN_ROUGH if problem.block_sizes else _GAIN


def _broyden_update(
    problem: Problem, slopes: Sequence[Array], step: Array, before: Sequence[Array], after: Sequence[Array]
) -> list[Array]:
    """Return slopes that agree with a step and change the least: Broyden's update."""
    direction = step / np.subtract(*problem.box) ** 2
    direction /= step @ direction
    return [j + np.outer(b - a - j @ step, direction) for j, a, b in zip(slopes, before, after, strict=True)]


def _triangular_system(
    problem: Problem, residuals: Sequence[Array], slopes: Sequence[Array], weights: Array, scale: Array, loss: str
) -> tuple[Sequence[Array], Array]:
    """Return the weighed residuals, and slopes beside residuals, triangular: shape (q, p + 1), q at most p + 1."""
    weighted, loss_slopes = _apply_loss(residuals, scale, loss)
    factors = np.sqrt(weights) / (_noise(problem, weighted) if loss == "linear" else scale)
    rows = zip(factors, loss_slopes, slopes, weighted, strict=True)
    stacked = np.concatenate([f * np.column_stack([g[:, None] * j, e]) for f, g, j, e in rows])
    return weighted, np.asarray(np.linalg.qr(stacked, mode="r"))


def _objective(problem: Problem, weighted: Sequence[Array], weights: Array, scale: Array, loss: str) -> float:
    """Return minus twice the log-likelihood of weighed residuals.

    Where outliers count less their noise is that of the scale: an rms would be theirs.
    """
    if loss == "linear":
        return minus_twice_likelihood(weighted, weights, problem.noise_groups, problem.least_noise)
    by_signal = zip(weighted, weights, scale, strict=True)
    return float(sum(w * (e @ e / s**2 + 2.0 * len(e) * math.log(s)) for e, w, s in by_signal))


def _step(problem: Problem, z: Array, free: NDArray[np.bool_], system: Array, radius: float) -> tuple[Array, float]:
    """Return a step within the bounds, and the fall of -2 log L that it predicts to second order."""
    low, high = problem.box
    width = high - low
    # Strictly apart, as `lsq_linear` asks: at a bound by what is lost when the step is added.
    lower = np.minimum(np.maximum((low - z) / width, -radius), -1e-12)
    upper = np.maximum(np.minimum((high - z) / width, radius), 1e-12)
    slopes, residuals, step = system[:, :-1] * width, system[:, -1], np.zeros(len(z))
    step[free] = lsq_linear(slopes[:, free], -residuals, (lower[free], upper[free]), method="bvls", tol=1e-12).x
    step = problem.feasible(np.clip(z + width * step, low, high), free) - z
    remaining = system[:, :-1] @ step + residuals
    return step, float(residuals @ residuals - remaining @ remaining)


def _apply_loss(residuals: Sequence[Array], scale: Array, loss: str) -> tuple[list[Array], list[Array]]:
    """Return the weighed residuals, the sum of their squares, and their derivatives by the residuals."""
    if loss == "linear":
        return list(residuals), [np.ones(len(e)) for e in residuals]
    rho, growth = LOSSES[loss]
    weighted, factors = [], []
    for e, n in zip(residuals, scale, strict=True):
        u = np.maximum((e / n) ** 2, 1e-12)
        ratio = np.sqrt(rho(u) / u)
        weighted.append(ratio * e)
        factors.append(growth(u) / ratio)
    return weighted, factors


def best_of(problem: Problem, fits: Sequence[Fit]) -> Fit:
    """Return the minimum of least misfit with equal weights."""
    equal_weights, noise = np.ones(len(problem.signals)), (problem.noise_groups, problem.least_noise)
    return min(fits, key=lambda candidate: minus_twice_likelihood(candidate.residuals, equal_weights, *noise))


def information(problem: Problem, minimum: Fit) -> Array:
    """Return the Fisher information of z at a minimum, shape (p, p)."""
    factors = minimum.weights / minimum.noise**2
    total: Array = sum(f * j.T @ j for f, j in zip(factors, problem.slopes(minimum.z), strict=True))
    return total


def _noise(problem: Problem, residuals: Sequence[Array], robust: bool = False) -> Array:
    """Return the rms of the residuals of every output, or that of their median; never below its least, or rounding."""
    groups = problem.noise_groups
    count, square = pooled_variance(residuals, np.ones(len(residuals)), groups)
    rms = robust_deviation(residuals, groups) if robust else np.where(count > 0.0, np.sqrt(square), 1.0)[groups]
    rounding = [1e-9 * max(float(np.max(np.abs(s.measured), initial=0.0)), 1e-9) for s in problem.signals]
    return np.maximum(rms, np.maximum(problem.least_noise, rounding))


def _independent(problem: Problem, residuals: Sequence[Array]) -> tuple[Array, Array]:
    """Return the correlation of neighbouring residuals of every output, and the share that is independent."""
    groups, rho = problem.groups, np.zeros(len(residuals))
    for group in np.unique(groups):
        places = np.flatnonzero(groups == group).tolist()
        ordered = [k for k in places if problem.signals[k].ordered and len(residuals[k]) > 2]
        squares = sum(float(residuals[k] @ residuals[k]) for k in ordered)
        products = sum(float(residuals[k][1:] @ residuals[k][:-1]) for k in ordered)
        count = sum(len(residuals[k]) for k in ordered)
        rho[groups == group] = np.clip(products / squares, 0.0, 1.0 - 2.0 / count) if squares > 0.0 else 0.0
    return rho, (1.0 - rho) / (1.0 + rho)
