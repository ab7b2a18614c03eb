"""Intervals by the profile likelihood, and the directions in which a recording leaves the parameters free."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from finger_pin.identification.search.gauss_newton import GAIN_REFIT, Fit, fit, information
from finger_pin.identification.search.objective import Objective
from finger_pin.typing import Array

#: Rise of minus twice the log-likelihood at the ends of an interval: 95 % of chi-squared with one degree of freedom.
CHI2_95 = 3.841
#: Half the width of a 95 % band, in deviations.
NORMAL_95 = 1.96
# Relative error of the rise at an end: half of it is that of the half width, as its root is straight there.
# And the greatest number of refits in the search for an end.
_CHI2_TOLERANCE, _MAX_REFITS = 0.06, 8
# Fall of minus twice the log-likelihood above which a refit is another minimum: twice its jump of 0.1 by errors of fine
# runs.
_LOWER_MINIMUM_FALL = 0.2
#: Least degrees of freedom of a noise whose samples follow each other, and of what settings differ by.
LEAST_FREEDOM = 4.0


@dataclass(frozen=True, eq=False)
class ProfileBound:
    """One end of an interval.

    Attributes:
        end: z there; infinite where the recording does not close it within the bounds.
        path: Points of the profile, shape (k, 2): z and the rise of minus twice the likelihood.
        lower_minimum: A minimum below the one that the profile started from, if found.
    """

    end: float
    path: Array
    lower_minimum: Fit | None = None


def covariance(objective: Objective[Any], minimum: Fit) -> Array:
    """Return the linearised covariance of z, shape (p, p)."""
    return inverse_within_bounds(objective, information(objective, minimum))


def inverse_within_bounds(objective: Objective[Any], fisher_information: Array) -> Array:
    """Return the covariance of z by an information, shape (p, p); no direction is less sure than bounds are wide."""
    values, vectors, size = _directions(objective, fisher_information)
    return np.asarray((vectors / np.maximum(values, 1.0)) @ vectors.T * size)


def information_of_bounds(objective: Objective[Any], minimum: Fit) -> Array:
    """Return the information of z that bounds add to that of the recordings, shape (p, p)."""
    values, vectors, size = _directions(objective, information(objective, minimum))
    return np.asarray((vectors * np.maximum(1.0 - values, 0.0)) @ vectors.T / size)


def _directions(objective: Objective[Any], fisher_information: Array) -> tuple[Array, Array, Array]:
    """Return eigenvalues and eigenvectors of scaled information, and the products of ranges that scale it."""
    size = np.outer(objective.width, objective.width)
    return *np.linalg.eigh(fisher_information * size), size


@dataclass(frozen=True, eq=False)
class SmallSample:
    """Corrections for few readings, as for a regression: RSS / (n - p), and Student's t.

    Attributes:
        variance: Factors on the variance of every parameter for the same 95 % of a normal distribution, shape (p,).
        level: Rise of minus twice the likelihood at an end of each interval, shape (p,).
        noise: Factors on the noise of every signal, for 95 % of further readings, shape (s,).
        pooled_noise: The same on the mean square of the noises of a kind, for readings of other recordings, shape (s,).
    """

    variance: Array
    level: Array
    noise: Array
    pooled_noise: Array

    @classmethod
    def from_fit(cls, objective: Objective[Any], minimum: Fit, covariance: Array) -> Self:
        """Return the corrections at a minimum with a covariance by the likelihood alone.

        Each output has its samples less its effective number of parameters (the trace of its part of the information)
        as degrees of freedom, and a parameter the degrees of freedom of Satterthwaite (Biometrics Bulletin 2, 1946).
        """
        slopes, noises = objective.slopes(minimum.z), objective.likelihood.noises
        first = np.unique(noises, return_index=True)[1]
        parts = np.zeros((len(first), *covariance.shape))
        for group, w, n, j in zip(noises, minimum.weights, minimum.noise, slopes, strict=True):
            parts[group] += w / n**2 * j.T @ j
        effective_parameters = np.einsum("kl,glk->g", covariance, parts)
        counts = _sample_counts(noises, minimum, slopes)
        ratio, freedom_left = _corrections(counts, effective_parameters)
        variances = np.einsum("kl,glm,mk->gk", covariance, parts, covariance)
        corrected = variances * ratio[:, None]
        total, corrected_total = np.maximum([variances.sum(axis=0), corrected.sum(axis=0)], 1e-300)
        square_total = np.maximum(np.sum(corrected**2 / freedom_left[:, None], axis=0), 1e-300)
        freedom = np.maximum(corrected_total**2 / square_total, 1.0)
        factor, quantile = corrected_total / total, student.ppf(0.975, freedom)
        kinds, squares = objective.likelihood.kinds[first], minimum.noise[first] ** 2
        pooled = _pooled_corrections(counts, kinds, squares, effective_parameters)
        noise, pooled_noise = (np.sqrt(q / CHI2_95) * student.ppf(0.975, f) for q, f in ((ratio, freedom_left), pooled))
        return cls(
            factor * quantile**2 / CHI2_95,
            factor * freedom * np.log1p(quantile**2 / freedom),
            noise[noises],
            pooled_noise[noises],
        )


def _sample_counts(noises: NDArray[np.intp], minimum: Fit, slopes: Sequence[Array]) -> Array:
    """Return the numbers of samples of every noise, of those that count for a mean, and for a variance, shape (3, g).

    Of n samples that follow each other by rho fewer count: n (1 - rho) / (1 + rho) for a mean, and for parameters, and
    for a variance n (1 - rho^2) / (1 + rho^2) (Bartlett, J. Roy. Stat. Soc. B 8, 1946).
    """
    size = np.array([len(j) for j in slopes], dtype=float)
    shares = (1.0 - minimum.correlation**2) / (1.0 + minimum.correlation**2)
    counts = np.zeros((3, int(noises.max()) + 1))
    np.add.at(counts.T, noises, np.stack([size, size * minimum.weights, size * shares], axis=1))
    return counts


def _corrections(counts: Array, parameters: Array) -> tuple[Array, Array]:
    """Return factors on variances that parameters have lessened, and their degrees of freedom.

    What a model lacks is no noise that further recordings draw anew, though its correlation leaves few independent
    samples: parameters take at most half of these, and no fewer than four are left if there are as many samples, of
    which Student's t is 1.4 times that of many.
    """
    size, of_mean, of_variance = counts
    share, least_share = (1.0 - parameters / np.maximum(each, 1e-300) for each in (of_mean, size))
    share = np.maximum(share, np.minimum(0.5, np.maximum(least_share, 1.0 / np.maximum(size, 1.0))))
    least_freedom = np.maximum(np.minimum(LEAST_FREEDOM, size - parameters), 1.0)
    return 1.0 / share, np.maximum(of_variance * share, least_freedom)


def _pooled_corrections(
    counts: Array, kinds: NDArray[np.intp], squares: Array, parameters: Array
) -> tuple[Array, Array]:
    """Return the corrections of the mean of the variances of each kind, of recordings that were not fitted.

    Samples that follow each other are hardly more than one, so that one recording tells its noise badly: the mean of
    several has their degrees of freedom (Satterthwaite).
    """
    same_kind = (kinds[:, None] == kinds).astype(float)
    ratio, freedom = _corrections(np.array([same_kind @ each for each in counts]), same_kind @ parameters)
    square_total = same_kind @ (squares**2 / np.maximum(counts[2], 1e-300))
    unequal = (same_kind @ squares) ** 2 / (ratio * square_total)
    return ratio, np.maximum(unequal, np.minimum(LEAST_FREEDOM, freedom))


def profile(
    objective: Objective[Any],
    minimum: Fit,
    k: int,
    side: int,
    covariance: Array,
    loss: str = "linear",
    inflation: float = 1.0,
) -> ProfileBound:
    """Return the end of the interval of parameter k on one side, 2 (l* - l(p_k)) = 3.841 times an inflation.

    Args:
        objective: The objective that was fitted.
        minimum: Of the objective.
        k: Which parameter.
        side: 1 for the upper end, -1 for the lower.
        covariance: Covariance of z.
        loss: As for `fit`.
        inflation: Variance of the parameter over that by the likelihood (Pace, Salvan and Sartori, Statistica Sinica
            21, 2011), and over that of few readings; rises of the path are divided by it.
    """
    low, high = objective.box
    limit = high[k] if side > 0 else low[k]
    room = abs(limit - minimum.z[k])
    deviation = math.sqrt(max(inflation * covariance[k, k], 0.0))
    direction = covariance[:, k] / covariance[k, k] if covariance[k, k] > 0.0 else np.zeros(len(minimum.z))
    path = [(float(minimum.z[k]), 0.0)]
    distance = min(room, max(math.sqrt(CHI2_95) * deviation, 1e-6 * (high[k] - low[k])))
    inner, outer = (0.0, 0.0), (math.inf, math.inf)
    slopes: Sequence[Array] = objective.slopes(minimum.z)
    # The farthest place within the interval: refits start there, not from one beyond that may have failed.
    inner_fit, end = minimum, math.inf * side
    for _ in range(_MAX_REFITS if room > 1e-9 * (high[k] - low[k]) else 0):
        value = minimum.z[k] + side * distance
        guess = np.clip(inner_fit.z + direction * (value - inner_fit.z[k]), low, high)
        known = partial(fit, objective, weights=minimum.weights, scale=minimum.noise, loss=loss, least_gain=GAIN_REFIT)
        refit = partial(known, fixed={k: value})
        refitted = refit(guess, slopes=slopes)
        if not refitted.converged and math.isfinite(refitted.objective):
            refitted = refit(refitted.z)
        rise = (refitted.objective - minimum.objective) / inflation
        path.append((value, rise))
        if rise * inflation < -_LOWER_MINIMUM_FALL:
            return ProfileBound(end, np.array(path), refitted)
        if rise >= CHI2_95:
            # A refit that has not come to its end tells that the end is before it, not how near.
            outer = (distance, math.sqrt(rise) if refitted.converged else math.inf)
        else:
            inner, inner_fit, slopes = (distance, math.sqrt(max(rise, 0.0))), refitted, refitted.slopes or slopes
            if distance >= room * (1.0 - 1e-12):
                break
        crossing = _crossing(inner, outer)
        at_level = refitted.converged and abs(rise - CHI2_95) < _CHI2_TOLERANCE * CHI2_95
        if at_level or math.isfinite(outer[0]):
            end = minimum.z[k] + side * min(crossing, room)
        if at_level:
            break
        least_distance = 0.0 if math.isfinite(outer[0]) else max(1.2 * inner[0], 1e-6 * room)
        distance = min(room, max(crossing, least_distance))
    return ProfileBound(end, np.array(path))


def _crossing(inner: tuple[float, float], outer: tuple[float, float]) -> float:
    """Return the distance at which the root of the rise reaches that of the level, from points on either side."""
    target = math.sqrt(CHI2_95)
    if math.isinf(outer[1]) and math.isfinite(outer[0]):
        return 0.5 * (inner[0] + outer[0])
    if math.isinf(outer[0]):
        return inner[0] * min(4.0, target / max(inner[1], 1e-3))
    return inner[0] + (target - inner[1]) / (outer[1] - inner[1]) * (outer[0] - inner[0])
