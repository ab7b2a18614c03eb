"""Spans whose length is a polynomial of one coordinate of their points: couplings, loops and weights act along them."""

from __future__ import annotations

import math
from typing import Any

from finger_pin.description.tree_parts import MOST_POWER
from finger_pin.mechanism.spans.span import WrapSegment

_PARAMETERS = tuple(f"power_{k}" for k in range(MOST_POWER + 1))


def _horner(p: Any, x: Any) -> Any:
    """Return a polynomial and its first two derivatives at x."""
    value, slope, bend = 0.0, 0.0, 0.0
    for k in range(MOST_POWER, -1, -1):
        bend = bend * x + 2.0 * slope
        slope = slope * x + value
        value = value * x + p[k]
    return value, slope, bend


def _angle(y: Any) -> Any:
    """Return the first point's angle about z, from x, and its derivatives by x and y."""
    square = y[0] * y[0] + y[1] * y[1]
    return math.atan2(y[1], y[0]), -y[1] / square, y[0] / square


def angle_value(y: Any, p: Any, out: Any) -> None:
    """Fill in a polynomial of the first point's angle about z, no turn, and pull."""
    angle, across, along = _angle(y)
    value, slope, _ = _horner(p, angle)
    for i in range(8):
        out[i] = 0.0
    out[0] = value
    out[2] = slope * across
    out[3] = slope * along


def angle_slopes(y: Any, p: Any, out: Any) -> None:
    """Fill in the slopes of turn, zero, and of pull."""
    angle, across, along = _angle(y)
    _, slope, bend = _horner(p, angle)
    for i in range(42):
        out[i] = 0.0
    out[6] = bend * across * across - 2.0 * slope * across * along
    out[7] = bend * across * along + slope * (across * across - along * along)
    out[12] = out[7]
    out[13] = bend * along * along + 2.0 * slope * across * along


def rise_value(y: Any, p: Any, out: Any) -> None:
    """Fill in a polynomial of the second point's height above the first, along z, no turn, and pull."""
    value, slope, _ = _horner(p, y[5] - y[2])
    for i in range(8):
        out[i] = 0.0
    out[0] = value
    out[4] = -slope
    out[7] = slope


def rise_slopes(y: Any, p: Any, out: Any) -> None:
    """Fill in the slopes of turn, zero, and of pull."""
    _, _, bend = _horner(p, y[5] - y[2])
    for i in range(42):
        out[i] = 0.0
    out[20] = bend
    out[23] = -bend
    out[38] = -bend
    out[41] = bend


#: Of the angle by which a point has turned about the z axis, from -pi to pi.
ANGLE = WrapSegment("polynomial of an angle", _PARAMETERS, angle_value, angle_slopes)
#: Of the distance of two points along the z axis.
RISE = WrapSegment("polynomial of a rise", _PARAMETERS, rise_value, rise_slopes)
