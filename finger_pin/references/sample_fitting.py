"""Reduction of the knots of dense samples, within their rounding.

Where samples are dense, the slope between them depends on their rounding more than on the signal: samples rounded to
1e-7 at 1 MHz have slopes that are wrong by 0.1 per second, which an integrator would follow with steps of microseconds.
A cubic that passes close to all samples of a longer stretch has the slope of the signal.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from finger_pin.typing import Array

Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]
# Intervals of the shortest stretches, which are not kept: what their cubics miss says how coarse samples are.
_SHORTEST_STRETCH = 16
# Intervals between the samples of a stretch that are asked: all of two of the shortest.
_CHECKED_INTERVALS = 2 * _SHORTEST_STRETCH
# Of the tolerance, what a cubic may miss of the smoothest samples; over what those of the shortest miss, of any others.
_LEAST_SHARE, _GROWTH = 0.01, 1.5
# Over what cubics of the shortest stretches miss by half, what any may.
_ROUNDING_FACTOR = 3.0
# What the numbers of a computer miss, over the range of a signal.
_PRECISION = 1e-14
# The longest gap within a stretch, of its length.
_MAX_GAP_SHARE = 0.25
# A smaller difference of slopes, over what the cubics miss, is rounding too.
_KINK_FACTOR = 16.0


class _Stretches(NamedTuple):
    """Stretches of equally many samples that follow each other, each with a cubic.

    Attributes:
        length: Number of intervals of each.
        fits: Mask of the cubics that pass close to their samples, shape (b,).
        error: Largest distance of a cubic from its samples, shape (b, k); infinite where no cubic was tried.
        value: Values at both ends, shape (2, b, k).
        slope: Slopes at both ends, shape (2, b, k), per second.
    """

    length: int
    fits: Flags
    error: Array
    value: Array
    slope: Array


def fit_samples(times: Array, values: Array, tolerance: float) -> tuple[Array, Array]:
    """Return knots, shape (n,), and coefficients of powers 5 to 0 of the time since the knot before, (6, n - 1, k).

    Stretches are doubled while a cubic passes about as close to their samples as the cubics of the shortest stretches
    do, or within a hundredth of the tolerance. Elsewhere, as with few samples, monotone cubics join all samples.

    Args:
        times: Of samples, shape (m,), s, increasing.
        values: Shape (m, k).
        tolerance: Largest error of a cubic at a sample, over the range of its signal; 0 for no such cubics.
    """
    # Imported only where it is needed, as it takes a while.
    from scipy.interpolate import PchipInterpolator

    span = np.ptp(values, axis=0)
    span = np.maximum(np.maximum(span, 1e-9 * np.max(np.abs(values), axis=0)), np.finfo(float).tiny)
    levels = _stretch_levels(times, (values - values[0]) / span, tolerance)
    start_index, end_index, error, end_values, slopes = _select_longest(levels)
    covered = np.zeros(len(times), dtype=np.int64)
    covered[start_index + 1] += 1
    covered[end_index] -= 1
    indices = np.flatnonzero(np.cumsum(covered) == 0)
    knots, heights, pieces = (times[indices], values[indices].copy(), np.searchsorted(indices, start_index))
    count = np.bincount(pieces, minlength=len(knots)) + np.bincount(pieces + 1, minlength=len(knots))
    heights[count > 0] = 0.0
    for side in range(2):
        heights[pieces + side] += (values[0] + end_values[side] * span) / count[pieces + side, None]
    # It inverts slopes, which may be almost zero.
    with np.errstate(over="ignore"):
        cubics = (
            PchipInterpolator(knots, heights).c if len(pieces) < len(knots) - 1 else np.zeros((4, 0, values.shape[1]))
        )
    coefficients = np.zeros((6, len(knots) - 1, values.shape[1]))
    coefficients[6 - len(cubics) :, : cubics.shape[1]] = cubics
    length, change = np.diff(knots)[pieces, None], np.diff(heights, axis=0)[pieces]
    start_slope, end_slope = _smooth_slopes(pieces, length, error, slopes) * span
    coefficients[2, pieces] = (start_slope + end_slope - 2.0 * change / length) / length**2
    coefficients[3, pieces] = (3.0 * change / length - 2.0 * start_slope - end_slope) / length
    coefficients[4, pieces], coefficients[5, pieces] = start_slope, heights[pieces]
    return knots, coefficients


def _stretch_levels(times: Array, values: Array, tolerance: float) -> list[_Stretches]:
    """Return stretches of the shortest length, of twice as many samples, and so on."""
    count = (len(times) - 1) // _SHORTEST_STRETCH if tolerance > 0.0 else 0
    levels = [_fit_cubics(times, values, _SHORTEST_STRETCH, np.ones(count, dtype=bool), tolerance)]
    error = levels[0].error[levels[0].fits]
    # A constant signal has the same rounding at all samples, which is not counted.
    rounding = np.array([np.median(each[each > _PRECISION]) if np.any(each > _PRECISION) else 0.0 for each in error.T])
    short_error = levels[0].error
    while levels[-1].fits.any():
        halves, count = levels[-1], len(levels[-1].fits) // 2
        both_fit: Flags = np.all(halves.fits[: 2 * count].reshape(count, 2), axis=1)
        short_error = short_error[: 2 * count].reshape(count, 2, values.shape[1]).max(axis=1)
        allowed = np.maximum(_GROWTH * short_error, _ROUNDING_FACTOR * rounding)
        allowed = np.minimum(np.maximum(_LEAST_SHARE * tolerance, allowed), tolerance)
        levels.append(_fit_cubics(times, values, 2 * halves.length, both_fit, allowed))
    return levels


def _fit_cubics(times: Array, values: Array, length: int, tried: Flags, allowed: Array | float) -> _Stretches:
    """Return stretches of a length with their cubics of least squares.

    Args:
        times: Shape (m,).
        values: Shape (m, k), over the range of each signal.
        length: Intervals of a stretch.
        tried: Mask of the stretches that are fitted, shape (b,).
        allowed: Largest error of a cubic, shape (b, k) or a number for all.
    """
    chosen, width = np.flatnonzero(tried), values.shape[1]
    samples = length * chosen[:, None] + np.arange(0, length + 1, max(length // _CHECKED_INTERVALS, 1))
    time = times[samples]
    span = time[:, -1:] - time[:, :1]
    x = 2.0 * (time - time[:, :1]) / span - 1.0
    basis = np.stack([np.ones_like(x), x, 1.5 * x * x - 0.5, 2.5 * x**3 - 1.5 * x], axis=-1)
    without_gaps = np.diff(time, axis=1).max(axis=1) <= _MAX_GAP_SHARE * span[:, 0]
    # Samples with gaps may not determine a cubic.
    basis[~without_gaps] = np.eye(samples.shape[1], 4)
    transposed = basis.transpose(0, 2, 1)
    factors = np.linalg.solve(transposed @ basis, transposed @ values[samples])
    error, fits = np.full((len(tried), width), np.inf), np.zeros(len(tried), dtype=bool)
    error[chosen] = np.max(np.abs(basis @ factors - values[samples]), axis=1)
    fits[chosen] = without_gaps
    fits &= np.all(error <= allowed, axis=1)
    value, slope = np.zeros((2, 2, len(tried), width))
    for side, end in enumerate((-1.0, 1.0)):
        value[side, chosen] = np.array([1.0, end, 1.0, end]) @ factors
        slope[side, chosen] = 2.0 / span * (np.array([0.0, 1.0, 3.0 * end, 6.0]) @ factors)
    return _Stretches(length, fits, error, value, slope)


def _select_longest(levels: list[_Stretches]) -> tuple[Indices, Indices, Array, Array, Array]:
    """Return the stretches that no longer one contains: first and last samples, errors, values and slopes."""
    masks = [np.zeros_like(levels[0].fits), *(level.fits.copy() for level in levels[1:])]
    for mask, longer in zip(masks[1:], levels[2:], strict=False):
        mask[: 2 * len(longer.fits)] &= ~np.repeat(longer.fits, 2)
    start = np.concatenate([level.length * np.flatnonzero(mask) for level, mask in zip(levels, masks, strict=True)])
    length = np.repeat([level.length for level in levels], [np.count_nonzero(mask) for mask in masks])
    order = np.argsort(start)
    error, value, slope = (
        np.concatenate([getattr(level, name)[..., mask, :] for level, mask in zip(levels, masks, strict=True)], axis=-2)
        for name in ("error", "value", "slope")
    )
    start, length = start[order], length[order]
    return start, start + length, error[order], value[:, order], slope[:, order]


def _smooth_slopes(pieces: Indices, length: Array, error: Array, slopes: Array) -> Array:
    """Return slopes, shape (2, b, k), equal in neighbouring stretches unless they differ by more than rounding.

    Args:
        pieces: Index of the piece of each stretch, shape (b,).
        length: Length of each, shape (b, 1), s.
        error: Error of the cubic of each, shape (b, k).
        slopes: Slopes of each cubic at both ends, shape (2, b, k).
    """
    if len(pieces) < 2:
        return slopes
    shared, joins = slopes.copy(), (np.diff(pieces) == 1)[:, None]
    weights = length[:-1], length[1:]
    mismatch = np.abs(slopes[1, :-1] - slopes[0, 1:]) * np.minimum(*weights)
    joins = joins & (mismatch <= _KINK_FACTOR * np.maximum(error[:-1], error[1:]))
    mean_slope = (weights[0] * slopes[1, :-1] + weights[1] * slopes[0, 1:]) / (weights[0] + weights[1])
    shared[1, :-1] = np.where(joins, mean_slope, slopes[1, :-1])
    shared[0, 1:] = np.where(joins, mean_slope, slopes[0, 1:])
    return shared
