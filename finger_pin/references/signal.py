"""Signals over time as arrays, for references, open-loop tensions and the force at the fingertip.

Every signal is a sinusoid about an offset, and on top of it a polynomial of degree five at most between knots that all
signals share, constant before the first knot and after the last.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from finger_pin.description.caching import cached_property
from finger_pin.description.signals import SignalSettings
from finger_pin.exceptions import InputError
from finger_pin.laws.input_functions import harmonic, harmonic_rate, quintic, quintic_curvature, quintic_rate
from finger_pin.references.polynomials import ORDER, combine_polynomials, polynomials
from finger_pin.references.sample_fitting import fit_samples
from finger_pin.typing import Array

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

Flags = NDArray[np.bool_]
# A signal that varies by less, of its size, is constant but for rounding.
_ROUNDING = 1e-9


class Harmonic(NamedTuple):
    """Columns: offset and amplitude in the unit of the signal, frequency, Hz, phase, rad, and begin, s: zero before."""

    offset: int
    amplitude: int
    frequency: int
    phase: int
    start: int


HARMONIC = Harmonic(*range(len(Harmonic._fields)))


@dataclass(frozen=True, eq=False)
class Signal:
    """k signals over time.

    Attributes:
        harmonics: Columns `HARMONIC`, shape (k, 5).
        knots: Shape (m,), s, increasing, at least two; the polynomials are constant outside.
        coefficients: Shape (6, m - 1, k): of the powers 5 to 0 of the time since the knot before, as scipy's `PPoly`.
    """

    harmonics: Array
    knots: Array
    coefficients: Array

    @classmethod
    def from_settings(cls, settings: Sequence[SignalSettings], tolerance: float = 0.0) -> Signal:
        """Return the signals that settings describe, k of them.

        Args:
            settings: Settings of each signal.
            tolerance: Largest error at dense samples, over the range of their signal (`sample_fitting`).
        """
        harmonics = [[each.offset, each.amplitude, each.frequency, each.phase, -np.inf] for each in settings]
        shape = len(settings), len(HARMONIC)
        return cls(np.reshape(harmonics, shape), *combine_polynomials(polynomials(settings, tolerance)))

    @classmethod
    def from_samples(
        cls, name: str, samples: tuple[ArrayLike, ArrayLike], columns: Sequence[str], tolerance: float = 0.0
    ) -> Signal:
        """Return signals through samples: monotone cubics, fewer of them for dense samples (`sample_fitting`).

        Args:
            name: Name of the argument, for messages.
            samples: Times, shape (m,), s, and values, shape (m, k).
            columns: Names of the k signals.
            tolerance: Largest error at dense samples, over the range of their signal.

        Raises:
            InputError: If the shapes differ from these, a number is not finite, or times do not increase.
        """
        try:
            times, values = (np.asarray(array, dtype=float) for array in samples)
        except (TypeError, ValueError):
            raise InputError(name, "must be a pair of arrays: times, and values with one row for each") from None
        shape, column_message = values.shape, f"one column for each of {', '.join(columns)}"
        if times.ndim != 1 or len(times) < 2 or shape != (len(times), len(columns)):
            message = f"{max(times.size, 2)} rows like the times, and {column_message}"
            raise InputError(name, f"times have shape {times.shape} and values {shape}; values must have {message}")
        if not (np.isfinite(times).all() and np.isfinite(values).all()):
            raise InputError(name, "times and values must be finite")
        if not np.all(np.diff(times) > 0.0):
            raise InputError(name, "times must increase")
        return cls(no_harmonics(len(columns)), *fit_samples(times, values, tolerance))

    @classmethod
    def from_held_values(cls, knots: Array, values: Array) -> Signal:
        """Return signals that are constant between knots, shape (m + 1,), s, with values of shape (m, k)."""
        coefficients = np.zeros((ORDER, *values.shape))
        coefficients[-1] = values
        return cls(no_harmonics(values.shape[1]), knots, coefficients)

    @classmethod
    def from_polynomials(cls, columns: Sequence[PPoly]) -> Signal:
        """Return the signals of piecewise polynomials of degree five at most."""
        return cls(no_harmonics(len(columns)), *combine_polynomials(columns))

    @classmethod
    def from_signals(cls, signals: Sequence[Signal]) -> Signal:
        """Return the functions of several signals one after the other."""
        from scipy.interpolate import PPoly

        columns = [PPoly(column.T, signal.knots) for signal in signals for column in signal.coefficients.T]
        return cls(np.concatenate([signal.harmonics for signal in signals]), *combine_polynomials(columns))

    @cached_property
    def is_harmonic(self) -> bool:
        """True if all signals are sinusoids."""
        return not self.coefficients.any()

    def at(self, time: Array | float) -> tuple[Array, Array]:
        """Return values and rates at one time, each of shape (k,), or at times of shape (m,), each (m, k)."""
        instant = np.asarray(time, dtype=float)[..., None]
        offset, amplitude, frequency, phase, start = self.harmonics.T
        started = instant >= start
        value = np.where(started, harmonic(instant, offset, amplitude, frequency, phase), 0.0)
        rate = np.where(started, harmonic_rate(instant, amplitude, frequency, phase), 0.0)
        if self.is_harmonic:
            return value, rate
        clipped = np.minimum(np.maximum(instant, self.knots[0]), self.knots[-1])
        piece = np.searchsorted(self.knots[1:-1], clipped, side="right")
        elapsed, factors = clipped - self.knots[piece], self.coefficients[:, piece[..., 0]]
        moving = (instant >= self.knots[0]) & (instant < self.knots[-1])
        return value + quintic(elapsed, *factors), rate + moving * quintic_rate(elapsed, *factors[:-1])

    def derivative(self, time: Array | float, order: int) -> Array:
        """Return a time derivative of a given order at one time, shape (k,), or at times of shape (m,), (m, k)."""
        instant = np.asarray(time, dtype=float)[..., None]
        offset, amplitude, frequency, phase, start = self.harmonics.T
        angular_frequency = 2.0 * np.pi * frequency
        value = (offset if order == 0 else 0.0) + amplitude * angular_frequency**order * np.sin(
            angular_frequency * instant + phase + 0.5 * np.pi * order
        )
        value = np.where(instant >= start, value, 0.0)
        if self.is_harmonic:
            return np.asarray(value)
        clipped = np.minimum(np.maximum(instant, self.knots[0]), self.knots[-1])
        piece = np.searchsorted(self.knots[1:-1], clipped, side="right")
        elapsed, factors = clipped - self.knots[piece], self.coefficients[:, piece[..., 0]]
        powers = np.arange(ORDER - 1, order - 1, -1)
        terms = [math.perm(int(n), order) * c * elapsed ** (n - order) for n, c in zip(powers, factors, strict=False)]
        moving = (instant >= self.knots[0]) & (instant < self.knots[-1])
        return np.asarray(value + sum(terms) * (moving | (order == 0)))

    def step_ends(self, tolerance: float) -> Array:
        """Return the knots at which an integrator's steps should end, shape (b,), s, in order.

        These are knots where a signal jumps, or its rate jumps by more than a tolerance over the shorter of the pieces
        beside it; and where it has bent so much since the last of them that a longer step might not see it: the
        integral of the root of |u''| is what keeps u within a distance of its chords (de Boor, A Practical Guide to
        Splines, chapter XII), here the root of the tolerance. Bends that displace u by less than the tolerance, such as
        those of rounded samples, do not count. So their number is that of the motion's bends, however many samples
        there are, and however coarsely they are rounded within the tolerance.

        Args:
            tolerance: Relative to the range of each signal.
        """
        starts = self.harmonics[:, HARMONIC.start]
        starts = np.unique(starts[np.isfinite(starts)])
        return starts if self.is_harmonic else np.union1d(starts, self._polynomial_step_ends(tolerance))

    def _polynomial_step_ends(self, tolerance: float) -> Array:
        """Return the knots of the polynomials at which steps should end."""
        length = np.diff(self.knots)[:, None]
        first, last = self.coefficients[-1], quintic(length, *self.coefficients)
        range_ = np.maximum(np.ptp(first, axis=0), np.ptp(last, axis=0))
        range_ = np.maximum(np.maximum(range_, _ROUNDING * np.max(np.abs(first), axis=0)), np.finfo(float).tiny)
        zeros = np.zeros((1, len(range_)))
        rates = np.concatenate([zeros, quintic_rate(length, *self.coefficients[:-1])])
        rates -= np.concatenate([self.coefficients[-2], zeros])
        next_length = np.concatenate([length, length[-1:]])
        kinks = np.abs(rates) * np.minimum(next_length, np.concatenate([length[:1], length]))
        jumps = np.zeros_like(kinks)
        jumps[1:-1] = np.abs(first[1:] - last[:-1])
        stops = np.maximum(jumps, kinks) > tolerance * range_
        # A value may deviate by the tolerance, and its neighbours by as much to the other side.
        bend_integral = self._bend_integral(np.concatenate([first, last[-1:]]), stops, 2.0 * tolerance * range_)
        bend_count = np.floor(np.cumsum(bend_integral, axis=0) / np.sqrt(2.0 * range_ * math.sqrt(tolerance)))
        stops[1:] |= np.diff(bend_count, axis=0, prepend=0.0) > 0.0
        return np.asarray(self.knots[np.any(stops, axis=1)])

    def _bend_integral(self, values: Array, is_step_end: Flags, least: Array) -> Array:
        """Return the integral of the root of |u''| over each piece, shape (m - 1, k), of bends above a least size.

        A bend counts that displaces u from a chord by more than a least distance: first within each piece, then at
        every knot between its neighbours, at every second between those, and so on. Where it counts on a short chord
        no longer one is checked. Other bends displace u by less than that on any chord.

        Args:
            values: At the knots, shape (m, k).
            is_step_end: Whether a knot ends a step anyway, shape (m, k).
            least: Distance from a chord, shape (k,), in the unit of each signal.
        """
        length = np.diff(self.knots)[:, None]
        order = np.arange(ORDER - 1, 1, -1)
        integral = np.zeros((len(length), values.shape[1]))
        powers = zip(order, self.coefficients, strict=False)
        pieces = sum((n * (n - 1) * np.abs(c) * length**n for n, c in powers if c.any()), integral) > 8.0 * least
        rows = np.flatnonzero(pieces.any(axis=1))
        span, factors = length[rows], self.coefficients[:-2, rows]
        for node, weight in ((0.11270166537925831, 5.0), (0.5, 8.0), (0.8872983346207417, 5.0)):
            integral[rows] += weight / 18.0 * span * np.sqrt(np.abs(quintic_curvature(node * span, *factors)))
        integral[~pieces] = 0.0
        is_step_end = is_step_end.copy()
        is_step_end[:-1] |= pieces
        is_step_end[1:] |= pieces
        times, stride = self.knots[:, None], 1
        while len(times) > 2:
            before, after = times[1:-1] - times[:-2], times[2:] - times[1:-1]
            distance = np.abs(values[1:-1] - (after * values[:-2] + before * values[2:]) / (before + after))
            new_bends = _with_neighbours(distance > least) & ~_with_neighbours(is_step_end)[1:-1]
            rows, columns = np.nonzero(new_bends)
            factor = (0.5 * (before + after) / np.sqrt(before * after))[rows, 0]
            integral[stride * (rows + 1) - 1, columns] += factor * np.sqrt(2.0 * distance[rows, columns])
            is_step_end[1:-1] |= new_bends
            times, values, is_step_end, stride = times[::2], values[::2], _with_neighbours(is_step_end)[::2], 2 * stride
        return integral

    def starting_at(self, start: float) -> Signal:
        """Return the signals with their time counted from a start, s."""
        if start == 0.0:
            return self
        harmonics = self.harmonics.copy()
        harmonics[:, HARMONIC.phase] += 2.0 * math.pi * harmonics[:, HARMONIC.frequency] * start
        harmonics[:, HARMONIC.start] -= start
        return replace(self, harmonics=harmonics, knots=self.knots - start)

    def delayed(self, delays: Array) -> Signal:
        """Return the signals after delays, shape (k,), s: u(t - d), and zero before t = d."""
        indices = np.flatnonzero(delays)
        if not indices.size:
            return self
        from scipy.interpolate import PPoly

        harmonics, columns = self.harmonics.copy(), []
        harmonics[:, HARMONIC.phase] -= 2.0 * math.pi * harmonics[:, HARMONIC.frequency] * delays
        harmonics[indices, HARMONIC.start] = delays[indices]
        for column, delay in zip(self.coefficients.T, delays, strict=True):
            # The zero piece up to the delay makes it a knot.
            columns += [PPoly(column.T, self.knots + delay), PPoly(np.zeros((1, 1)), np.array([delay - 1.0, delay]))]
        knots, coefficients = combine_polynomials(columns)
        coefficients = coefficients[:, :, ::2].copy()
        for k in indices:
            coefficients[:, knots[:-1] < delays[k], k] = 0.0
        return Signal(harmonics, knots, coefficients)


def no_harmonics(count: int) -> Array:
    """Return the sinusoids of signals that are polynomials alone, shape (count, 5)."""
    harmonics = np.zeros((count, len(HARMONIC)))
    harmonics[:, HARMONIC.start] = -np.inf
    return harmonics


def _with_neighbours(mask: Flags) -> Flags:
    """Return marks, shape (m, k), with the neighbours of all that are set."""
    widened = mask.copy()
    widened[1:] |= mask[:-1]
    widened[:-1] |= mask[1:]
    return widened
