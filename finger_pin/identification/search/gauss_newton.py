"""Minima: least squares with a noise for every signal, weighed by the number of its independent samples."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from finger_pin.identification.likelihood import Likelihood
from finger_pin.identification.search.objective import Objective
from finger_pin.typing import Array

# Rounds of weights, steps in a round, and consecutive trials that may fail.
_MAX_ROUNDS, _MAX_STEPS, _MAX_FAILURES = 5, 40, 3
# Gain of minus twice the log-likelihood that is not worth a step. A gain g leaves parameters within sqrt(g) of their
# standard deviation: one for means of motions, 0.2 for motions, 0.03 for those computed finely, none for closed forms.
_LEAST_GAIN = {"rough": 1.0, "plain": 0.05, "fine": 1e-3}
_GAIN_CLOSED = 1e-9
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
class _Criterion:
    """Minus twice the log-likelihood of residuals whose outliers count less by a loss.

    Attributes:
        likelihood: Of the residuals.
        loss: One of `LOSSES`.
        weights: Of the signals, shape (s,).
    """

    likelihood: Likelihood
    loss: str
    weights: Array

    def noise(self, residuals: Sequence[Array]) -> Array:
        """Return the noise of every signal, shape (s,); by the median where outliers count less."""
        return self.likelihood.noise(residuals, robust=self.loss != "linear")

    def value(self, residuals: Sequence[Array], scale: Array) -> float:
        """Return the criterion; where outliers count less the noise is that of the scale: an rms would be theirs."""
        weighted = self._weighed(residuals, scale)[0]
        if self.loss == "linear":
            return self.likelihood.minus_twice_log(weighted, self.weights)
        by_signal = zip(weighted, self.weights, scale, strict=True)
        return float(sum(w * (e @ e / s**2 + 2.0 * len(e) * math.log(s)) for e, w, s in by_signal))

    def system(self, residuals: Sequence[Array], slopes: Sequence[Array], scale: Array) -> Array:
        """Return weighed slopes beside residuals, triangular: shape (q, p + 1), q at most p + 1."""
        weighted, loss_slopes = self._weighed(residuals, scale)
        factors = np.sqrt(self.weights) / (self.likelihood.noise(weighted) if self.loss == "linear" else scale)
        rows = zip(factors, loss_slopes, slopes, weighted, strict=True)
        stacked = np.concatenate([f * np.column_stack([g[:, None] * j, e]) for f, g, j, e in rows])
        return np.asarray(np.linalg.qr(stacked, mode="r"))

    def _weighed(self, residuals: Sequence[Array], scale: Array) -> tuple[list[Array], list[Array]]:
        """Return the weighed residuals, the sum of whose squares counts, and their derivatives by the residuals."""
        if self.loss == "linear":
            return list(residuals), [np.ones(len(e)) for e in residuals]
        rho, growth = LOSSES[self.loss]
        weighted, factors = [], []
        for e, n in zip(residuals, scale, strict=True):
            u = np.maximum((e / n) ** 2, 1e-12)
            ratio = np.sqrt(rho(u) / u)
            weighted.append(ratio * e)
            factors.append(growth(u) / ratio)
        return weighted, factors


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
    objective: Objective[Any],
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
        objective: What to fit.
        start: Shape (p,).
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
    z = objective.feasible(z, free)
    residuals: Sequence[Array] = objective.residuals(z)
    if not all(np.isfinite(e).all() for e in residuals):
        # A failed integration is the worst of all minima.
        zeros = np.zeros(len(residuals))
        return Fit(z, residuals, zeros, zeros, zeros, math.inf, converged=False)
    least_gain = max(_GAIN_CLOSED if objective.exact else _LEAST_GAIN[objective.accuracy], least_gain)
    likelihood, converged = objective.likelihood, True
    criterion = _Criterion(likelihood, loss, np.ones(len(residuals)) if weights is None else weights)
    for k in range(_MAX_ROUNDS if free.any() else 0):
        previous = z
        z, residuals, slopes, converged = _descend(objective, criterion, z, residuals, free, slopes, scale, least_gain)
        if weights is not None or not converged or (k > 0 and z is previous):
            break
        criterion = _Criterion(likelihood, loss, likelihood.independence(residuals)[1])
    correlation, shares = likelihood.independence(residuals)
    criterion = _Criterion(likelihood, loss, shares if weights is None else weights)
    noise = criterion.noise(residuals)
    value = criterion.value(residuals, noise if scale is None else scale)
    return Fit(z, residuals, noise, correlation, criterion.weights, value, slopes, converged)


def fit_at(objective: Objective[Any], z: Array, weights: Array | None = None) -> Fit:
    """Return what a fit has at a place where nothing moves, shape (p,)."""
    return fit(objective, z, fixed=dict(enumerate(z)), weights=weights)


def fit_with_restarts(objective: Objective[Any], start: Array, loss: str = "linear") -> Fit:
    """Return the minimum reached from a start; restart entries without influence there at other values.

    An entry without a slope does not move, such as a friction below the floor of its law.
    """
    best, low = fit(objective, start, loss=loss), objective.box[0]
    for share in _RESTART_SHARES:
        if best.slopes is None or (influential := influential_entries(objective, best.slopes)).all():
            break
        restarted = fit(objective, np.where(influential, best.z, low + objective.width * share), loss=loss)
        best = best_of(objective, [best, restarted])
    return best


def influential_entries(objective: Objective[Any], slopes: Sequence[Array]) -> NDArray[np.bool_]:
    """Return a mask of the entries of z that influence a signal, by the slopes of the residuals, shape (p,)."""
    least = _LEAST_EFFECT * np.maximum(objective.likelihood.largest, 1e-300)
    effects = [np.any(np.abs(j) * objective.width > size, axis=0) for j, size in zip(slopes, least, strict=True)]
    return np.asarray(np.any(effects, axis=0))


def _descend(
    objective: Objective[Any],
    criterion: _Criterion,
    z: Array,
    residuals: Sequence[Array],
    free: NDArray[np.bool_],
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
    slopes, is_fine = objective.slopes(z) if slopes is None else list(slopes), objective.accuracy == "fine"
    updates_slopes = not (objective.exact or is_fine)
    jump = least_gain if objective.exact else max(least_gain, _LIKELIHOOD_JUMP)
    count = float(sum(w * len(e) for w, e in zip(criterion.weights, residuals, strict=True)))
    slope_error_gain = max(_LEAST_GAIN["rough"], 0.0 if is_fine else _SLOPE_ERROR_GAIN * count)
    for _ in range(_MAX_STEPS):
        noise = criterion.noise(residuals) if scale is None else scale
        step, predicted_gain = _step(objective, z, free, criterion.system(residuals, slopes, noise), radius)
        if predicted_gain < 0.0 and radius > _LEAST_RADIUS:
            # Limits that parameters set each other have cut it wrongly.
            radius *= _GAIN_RATIO
            continue
        if predicted_gain < least_gain:
            return z, residuals, slopes, True
        trial = objective.residuals(z + step)
        actual_gain = criterion.value(residuals, noise) - criterion.value(trial, noise)
        disagreement = predicted_gain - actual_gain if updates_slopes else abs(predicted_gain - actual_gain)
        ratio, tolerated = actual_gain / predicted_gain, 1.0 - _GAIN_RATIO if updates_slopes else _GAIN_RATIO
        slopes_hold = disagreement < tolerated * predicted_gain + jump
        if ratio > 0.0:
            previous = residuals
            z, residuals, failed = z + step, trial, 0
            radius = min(2.0 * radius, _RADIUS) if ratio > _GAIN_RATIO else radius
        elif slopes_are_current:
            failed += 1
            radius = _GAIN_RATIO * float(np.max(np.abs(step) / objective.width))
        if ratio <= 0.0 and predicted_gain < jump:
            return z, residuals, slopes, True
        if failed > (_MAX_FAILURES if predicted_gain > slope_error_gain else 0):
            return z, residuals, slopes, predicted_gain <= slope_error_gain
        if not slopes_hold and (ratio > 0.0 or not slopes_are_current):
            slopes, slopes_are_current = objective.slopes(z), True
        elif ratio > 0.0:
            slopes_are_current = False
            if updates_slopes:
                # Slopes that agree with the step and change the least.
                direction = step / objective.width**2
                direction /= step @ direction
                changes = zip(slopes, previous, trial, strict=True)
                slopes = [j + np.outer(after - before - j @ step, direction) for j, before, after in changes]
    return z, residuals, slopes, False


def _step(
    objective: Objective[Any], z: Array, free: NDArray[np.bool_], system: Array, radius: float
) -> tuple[Array, float]:
    """Return a step within the bounds, and the fall of -2 log L that it predicts to second order."""
    (low, high), width = objective.box, objective.width
    # Strictly apart, as `lsq_linear` asks: at a bound by what is lost when the step is added.
    lower = np.minimum(np.maximum((low - z) / width, -radius), -1e-12)
    upper = np.maximum(np.minimum((high - z) / width, radius), 1e-12)
    slopes, residuals, step = system[:, :-1] * width, system[:, -1], np.zeros(len(z))
    step[free] = lsq_linear(slopes[:, free], -residuals, (lower[free], upper[free]), method="bvls", tol=1e-12).x
    step = objective.feasible(np.clip(z + width * step, low, high), free) - z
    remaining = system[:, :-1] @ step + residuals
    return step, float(residuals @ residuals - remaining @ remaining)


def best_of(objective: Objective[Any], fits: Sequence[Fit]) -> Fit:
    """Return the minimum of least misfit with equal weights."""
    return min(fits, key=lambda candidate: objective.likelihood.minus_twice_log(candidate.residuals))


def information(objective: Objective[Any], minimum: Fit) -> Array:
    """Return the Fisher information of z at a minimum, shape (p, p)."""
    factors = minimum.weights / minimum.noise**2
    total: Array = sum(f * j.T @ j for f, j in zip(factors, objective.slopes(minimum.z), strict=True))
    return total
