"""Functions of time, compiled: sinusoids and piecewise polynomials, with their derivatives."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from finger_pin.core.addresses.spatial import sine_cosine
from finger_pin.core.jit import Layers, Matrix, Vector, inlined, njit_inline
from finger_pin.laws.input_functions import quintic
from finger_pin.references.signal import HARMONIC

_quintic = inlined(quintic)


class SignalTable(NamedTuple):
    """k functions of time: a sinusoid about an offset each, plus a piecewise polynomial on shared knots.

    Attributes:
        harmonics: Columns `HARMONIC`, shape (k, 5).
        knots: Shape (m,); m = 0 without polynomials. Outside, these keep their value.
        coefficients: Of (t - knot)^(5 - i), shape (6, m - 1, k).
    """

    harmonics: Matrix
    knots: Vector
    coefficients: Layers


def no_signal() -> SignalTable:
    """Return a signal of no functions."""
    return SignalTable(np.zeros((0, len(HARMONIC))), np.zeros(0), np.zeros((6, 0, 0)))


@njit_inline
def _piece(signal: SignalTable, time: float) -> tuple[int, float]:
    """Return the piece that a time is in, and the time since its knot, both clipped to the knots.

    The search begins where even knots would have it, and doubles its stride until the time is between: samples at even
    times are found at once, however many, and others by bisection.
    """
    knots = signal.knots
    last = knots.size - 2
    inside = min(max(time, knots[0]), knots[last + 1])
    low = int((inside - knots[0]) / (knots[last + 1] - knots[0]) * last)
    high, stride = low, 1
    while low > 0 and knots[low] > inside:
        high, low = low - 1, max(low - stride, 0)
        stride *= 2
    while high < last and knots[high + 1] <= inside:
        low, high = high + 1, min(high + stride, last)
        stride *= 2
    while low < high:
        middle = (low + high + 1) // 2
        if knots[middle] <= inside:
            low = middle
        else:
            high = middle - 1
    return low, inside - knots[low]


@njit_inline
def signal_values(signal: SignalTable, time: float, out: Vector) -> None:
    """Fill the values of the functions."""
    table = signal.harmonics
    for j in range(table.shape[0]):
        begun = time >= table[j, HARMONIC.start]
        out[j] = table[j, HARMONIC.offset] if begun else 0.0
        if begun and table[j, HARMONIC.amplitude] != 0.0:
            out[j] += (
                table[j, HARMONIC.amplitude]
                * sine_cosine(2.0 * np.pi * table[j, HARMONIC.frequency] * time + table[j, HARMONIC.phase])[0]
            )
    if signal.knots.size > 0:
        piece, since = _piece(signal, time)
        for j in range(table.shape[0]):
            c = signal.coefficients[:, piece, j]
            out[j] += _quintic(since, c[0], c[1], c[2], c[3], c[4], c[5])


@njit_inline
def signal_derivative(signal: SignalTable, j: int, time: float, order: int) -> float:
    """Return a time derivative of function j, of order 0 to 3."""
    table, knots = signal.harmonics, signal.knots
    circular = 2.0 * np.pi * table[j, HARMONIC.frequency]
    value = (
        table[j, HARMONIC.amplitude]
        * circular**order
        * np.sin(circular * time + table[j, HARMONIC.phase] + 0.5 * np.pi * order)
    )
    if order == 0:
        value += table[j, HARMONIC.offset]
    if time < table[j, HARMONIC.start]:
        value = 0.0
    if knots.size > 0 and (order == 0 or knots[0] <= time < knots[knots.size - 1]):
        piece, since = _piece(signal, time)
        polynomial = 0.0
        for power in range(5, order - 1, -1):
            factor = signal.coefficients[5 - power, piece, j]
            for n in range(order):
                factor *= power - n
            polynomial = polynomial * since + factor
        value += polynomial
    return value


@njit_inline
def signal_derivatives(signal: SignalTable, time: float, order: int, out: Vector) -> None:
    """Fill a time derivative of the functions, as many as the buffer holds."""
    for j in range(min(out.size, signal.harmonics.shape[0])):
        out[j] = signal_derivative(signal, j, time, order)
