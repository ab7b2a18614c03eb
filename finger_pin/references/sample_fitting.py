"""Reduction of the knots of dense samples, within their rounding.

Where samples are dense, the slope of what joins them says more of their rounding than of the signal: samples rounded to
1e-7 at 1 MHz have slopes that are wrong by 0.1 per second, which an integrator would follow with steps of microseconds.
A cubic that passes close to all samples of a longer stretch has the slope that they have together.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from finger_pin.typing import Array

Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]
# Intervals of the shortest stretches, which are not kept: what their cubics miss says how coarse samples are.
_SHORTEST = 16
# Intervals between the samples of a stretch that are asked: all of two of the shortest.
_ASKED = 2 * _SHORTEST
# Of the tolerance, what a cubic may miss of the smoothest samples; over what those of the shortest miss, of any others.
_EXACT, _MORE = 0.01, 1.5
# Over what cubics of the shortest stretches miss by half, what any may.
_USUAL = 3.0
# What the numbers of a computer miss, over the range of a signal.
_LEAST = 1e-14
# The longest gap within a stretch, of its length.
_GAP = 0.25
# A smaller difference of slopes, over what the cubics miss, is rounding too.
_KINK = 16.0


class _Stretches(NamedTuple):
    """Stretches of equally many samples that follow each other, each with a cubic.

    Attributes:
        length: Intervals of each.
        fits: Which cubics pass close to their samples, shape (b,).
        missed: By how much at most, shape (b, k); infinite where no cubic was tried.
        value: At both ends, shape (2, b, k).
        slope: Likewise, per second.
    """

    length: int
    fits: Flags
    missed: Array
    value: Array
    slope: Array


def thinned(times: Array, values: Array, tolerance: float) -> tuple[Array, Array]:
    """Return knots, shape (n,), and coefficients of powers 5 to 0 of the time since the knot before, (6, n - 1, k).

    Stretches are doubled as long as a cubic passes about as close to their samples as those of the shortest stretches
    do, or within a hundredth of the tolerance. Where none does, as of few samples, monotone cubics join all of them.

    Args:
        times: Of samples, shape (m,), s, increasing.
        values: Shape (m, k).
        tolerance: By how much a cubic may miss a sample at most, over the range of its signal; 0 for no such cubics.
    """
    # Importing it takes a while, which nobody without samples shall wait for.
    from scipy.interpolate import PchipInterpolator

    size = np.ptp(values, axis=0)
    size = np.maximum(np.maximum(size, 1e-9 * np.max(np.abs(values), axis=0)), np.finfo(float).tiny)
    levels = _doubled(times, (values - values[0]) / size, tolerance)
    begin, end, missed, ends, slopes = _longest(levels)
    kept = np.zeros(len(times), dtype=np.int64)
    kept[begin + 1] += 1
    kept[end] -= 1
    places = np.flatnonzero(np.cumsum(kept) == 0)
    knots, joined, first = times[places], values[places].copy(), np.searchsorted(places, begin)
    count = np.bincount(first, minlength=len(knots)) + np.bincount(first + 1, minlength=len(knots))
    joined[count > 0] = 0.0
    for side in range(2):
        joined[first + side] += (values[0] + ends[side] * size) / count[first + side, None]
    # Of slopes next to nothing it takes the inverse.
    with np.errstate(over="ignore"):
        cubics = (
            PchipInterpolator(knots, joined).c if len(first) < len(knots) - 1 else np.zeros((4, 0, values.shape[1]))
        )
    coefficients = np.zeros((6, len(knots) - 1, values.shape[1]))
    coefficients[6 - len(cubics) :, : cubics.shape[1]] = cubics
    length, change = np.diff(knots)[first, None], np.diff(joined, axis=0)[first]
    start, stop = _smooth(first, length, missed, slopes) * size
    coefficients[2, first] = (start + stop - 2.0 * change / length) / length**2
    coefficients[3, first] = (3.0 * change / length - 2.0 * start - stop) / length
    coefficients[4, first], coefficients[5, first] = start, joined[first]
    return knots, coefficients


def _doubled(times: Array, values: Array, tolerance: float) -> list[_Stretches]:
    """Return stretches of the shortest length, of twice as many samples, and so on."""
    count = (len(times) - 1) // _SHORTEST if tolerance > 0.0 else 0
    levels = [_fitted(times, values, _SHORTEST, np.ones(count, dtype=bool), tolerance)]
    missed = levels[0].missed[levels[0].fits]
    # Where a signal rests, all samples are rounded alike.
    rounding = np.array([np.median(each[each > _LEAST]) if np.any(each > _LEAST) else 0.0 for each in missed.T])
    coarse = levels[0].missed
    while levels[-1].fits.any():
        halves, count = levels[-1], len(levels[-1].fits) // 2
        both: Flags = np.all(halves.fits[: 2 * count].reshape(count, 2), axis=1)
        coarse = coarse[: 2 * count].reshape(count, 2, values.shape[1]).max(axis=1)
        within = np.minimum(np.maximum(_EXACT * tolerance, np.maximum(_MORE * coarse, _USUAL * rounding)), tolerance)
        levels.append(_fitted(times, values, 2 * halves.length, both, within))
    return levels


def _fitted(times: Array, values: Array, length: int, tried: Flags, within: Array | float) -> _Stretches:
    """Return stretches of a length with their cubics of least squares.

    Args:
        times: Shape (m,).
        values: Shape (m, k), over the range of each signal.
        length: Intervals of a stretch.
        tried: Which of them are tried, shape (b,).
        within: Largest miss of a cubic, shape (b, k) or a number for all.
    """
    chosen, width = np.flatnonzero(tried), values.shape[1]
    at = length * chosen[:, None] + np.arange(0, length + 1, max(length // _ASKED, 1))
    time = times[at]
    span = time[:, -1:] - time[:, :1]
    x = 2.0 * (time - time[:, :1]) / span - 1.0
    basis = np.stack([np.ones_like(x), x, 1.5 * x * x - 0.5, 2.5 * x**3 - 1.5 * x], axis=-1)
    whole = np.diff(time, axis=1).max(axis=1) <= _GAP * span[:, 0]
    # Samples with gaps may leave a cubic open.
    basis[~whole] = np.eye(at.shape[1], 4)
    turned = basis.transpose(0, 2, 1)
    factors = np.linalg.solve(turned @ basis, turned @ values[at])
    missed, fits = np.full((len(tried), width), np.inf), np.zeros(len(tried), dtype=bool)
    missed[chosen] = np.max(np.abs(basis @ factors - values[at]), axis=1)
    fits[chosen] = whole
    fits &= np.all(missed <= within, axis=1)
    value, slope = np.zeros((2, 2, len(tried), width))
    for side, way in enumerate((-1.0, 1.0)):
        value[side, chosen] = np.array([1.0, way, 1.0, way]) @ factors
        slope[side, chosen] = 2.0 / span * (np.array([0.0, 1.0, 3.0 * way, 6.0]) @ factors)
    return _Stretches(length, fits, missed, value, slope)


def _longest(levels: list[_Stretches]) -> tuple[Indices, Indices, Array, Array, Array]:
    """Return the stretches within no longer one: first and last samples, misses, values and slopes."""
    kept = [np.zeros_like(levels[0].fits), *(level.fits.copy() for level in levels[1:])]
    for mask, longer in zip(kept[1:], levels[2:], strict=False):
        mask[: 2 * len(longer.fits)] &= ~np.repeat(longer.fits, 2)
    begin = np.concatenate([level.length * np.flatnonzero(mask) for level, mask in zip(levels, kept, strict=True)])
    length = np.repeat([level.length for level in levels], [np.count_nonzero(mask) for mask in kept])
    order = np.argsort(begin)
    missed, value, slope = (
        np.concatenate([getattr(level, name)[..., mask, :] for level, mask in zip(levels, kept, strict=True)], axis=-2)
        for name in ("missed", "value", "slope")
    )
    begin, length = begin[order], length[order]
    return begin, begin + length, missed[order], value[:, order], slope[:, order]


def _smooth(first: Indices, length: Array, missed: Array, slopes: Array) -> Array:
    """Return slopes, shape (2, b, k), that neighbouring stretches share unless they differ by more than rounding does.

    Args:
        first: Index of the piece of each stretch, shape (b,).
        length: Of each, shape (b, 1), s.
        missed: By the cubic of each, shape (b, k).
        slopes: Of each cubic at both ends, shape (2, b, k).
    """
    if len(first) < 2:
        return slopes
    shared, near = slopes.copy(), (np.diff(first) == 1)[:, None]
    weights = length[:-1], length[1:]
    off = np.abs(slopes[1, :-1] - slopes[0, 1:]) * np.minimum(*weights)
    near = near & (off <= _KINK * np.maximum(missed[:-1], missed[1:]))
    both = (weights[0] * slopes[1, :-1] + weights[1] * slopes[0, 1:]) / (weights[0] + weights[1])
    shared[1, :-1] = np.where(near, both, slopes[1, :-1])
    shared[0, 1:] = np.where(near, both, slopes[0, 1:])
    return shared
