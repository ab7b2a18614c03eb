"""Piecewise polynomials of the kinds of signals: steps, ramps, points, half cosines, samples, holds, shared knots."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from finger_pin.description.signals import SignalSettings
from finger_pin.references.sample_fitting import fit_samples
from finger_pin.typing import Array

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

#: Number of coefficients of a polynomial, of degree five.
ORDER = 6
# Quintic pieces of half a period of a cosine: they miss it by (pi / 32)^6 / 92160 = 1e-11 of its height.
_COSINE_PIECES = 32


def polynomials(settings: Sequence[SignalSettings], tolerance: float) -> list[PPoly | None]:
    """Return the polynomials that the kinds of signals add to the sinusoids, or None."""
    pieces = [None if each.kind == "samples" else _polynomial(each) for each in settings]
    sampled = [index for index, each in enumerate(settings) if each.kind == "samples"]
    while sampled:
        from scipy.interpolate import PPoly

        # Signals with the same times are fitted together.
        times = settings[sampled[0]].times
        same_times = [index for index in sampled if settings[index].times == times]
        values = np.transpose([np.asarray(settings[index].values) for index in same_times])
        knots, coefficients = fit_samples(np.asarray(times), values, tolerance)
        for column, index in enumerate(same_times):
            pieces[index] = PPoly(coefficients[:, :, column], knots)
        sampled = [index for index in sampled if index not in same_times]
    return pieces


def _polynomial(settings: SignalSettings) -> PPoly | None:
    """Return the polynomial that a kind without samples adds to the sinusoid, or None."""
    if settings.times is None and settings.time is None:
        return None
    from scipy.interpolate import PPoly

    if settings.times is not None:
        times, values = np.array(settings.times), np.array(settings.values)
        if settings.kind == "cosine":
            return _half_cosines(times, values)
        if settings.kind == "hold":
            return PPoly(values[None], np.append(times, times[-1] + 1.0))
        length, change = np.diff(times), np.diff(values)
        zeros = np.zeros_like(change)
        terms = [6.0 / length**5, -15.0 / length**4, 10.0 / length**3]
        return PPoly(np.array([*(change * term for term in terms), zeros, zeros, values[:-1]]), times)
    start, height = settings.time or 0.0, settings.height or 0.0
    if settings.duration is None:
        return PPoly(np.array([[0.0, height]]), np.array([start - 1.0, start, start + 1.0]))
    return PPoly(np.array([[height / settings.duration], [0.0]]), np.array([start, start + settings.duration]))


def _half_cosines(times: Array, values: Array) -> PPoly:
    """Return half periods of a cosine between points, as quintic Hermite pieces."""
    from scipy.interpolate import BPoly, PPoly

    phase = np.linspace(0.0, np.pi, _COSINE_PIECES + 1)
    knots, pieces = [], []
    for start, length, value, half in zip(times[:-1], np.diff(times), values[:-1], 0.5 * np.diff(values), strict=True):
        angular_frequency = np.pi / length
        shape = (1.0 - np.cos(phase), angular_frequency * np.sin(phase), angular_frequency**2 * np.cos(phase))
        derivatives = half * np.column_stack(shape)
        derivatives[:, 0] += value
        knots.append(start + phase / angular_frequency)
        pieces.append(PPoly.from_bernstein_basis(BPoly.from_derivatives(knots[-1], derivatives)).c)
    ends = [piece_knots[:-1] for piece_knots in knots]
    return PPoly(np.concatenate(pieces, axis=1), np.append(np.concatenate(ends), times[-1]))


def combine_polynomials(columns: Sequence[PPoly | None]) -> tuple[Array, Array]:
    """Return knots, shape (m,), and coefficients, shape (6, m - 1, k), of polynomials about shared knots."""
    breakpoints = [piecewise.x for piecewise in columns if piecewise is not None]
    if not breakpoints:
        return np.array([0.0, 1.0]), np.zeros((ORDER, 1, len(columns)))
    if all(np.array_equal(piecewise, breakpoints[0]) for piecewise in breakpoints):
        coefficients = np.zeros((ORDER, len(breakpoints[0]) - 1, len(columns)))
        for index, polynomial in enumerate(columns):
            if polynomial is not None:
                coefficients[ORDER - len(polynomial.c) :, :, index] = polynomial.c
        return breakpoints[0], coefficients
    knots = np.unique(np.concatenate(breakpoints))
    start, middle = knots[:-1], 0.5 * (knots[:-1] + knots[1:])
    coefficients = np.zeros((ORDER, len(start), len(columns)))
    for column, polynomial in enumerate(columns):
        if polynomial is None:
            continue
        powers = np.vstack([np.zeros((ORDER - len(polynomial.c), len(polynomial.x) - 1)), polynomial.c])[::-1]
        piece = np.clip(np.searchsorted(polynomial.x, middle) - 1, 0, len(polynomial.x) - 2)
        # Outside its knots a signal is constant; inside, its piece is expanded about the shared knot.
        elapsed = np.clip(start, polynomial.x[0], polynomial.x[-1]) - polynomial.x[piece]
        inside = (middle > polynomial.x[0]) & (middle < polynomial.x[-1])
        for power in range(ORDER):
            terms = [math.comb(n, power) * powers[n, piece] * elapsed ** (n - power) for n in range(power, ORDER)]
            coefficients[ORDER - 1 - power, :, column] = sum(terms) * (inside | (power == 0))
    return knots, coefficients
