"""Spans whose length is a polynomial of one coordinate of their points: couplings, loops and weights act along them."""

from __future__ import annotations

import math

from finger_pin.description.tree_couplings import MOST_POWER
from finger_pin.mechanism.gaps.signed_distance import POINT, SLOPE_WIDTH
from finger_pin.mechanism.spans.span import SPAN_OUT, SPAN_OUT_SIZE, SPAN_SLOPE, SPAN_SLOPE_SIZE, WrapSegment, clear
from finger_pin.typing import Pointer

_PARAMETERS = tuple(f"power_{k}" for k in range(MOST_POWER + 1))


def _horner(p: Pointer, x: float) -> tuple[float, float, float]:
    """Return a polynomial and its first two derivatives at x."""
    value, slope, bend = 0.0, 0.0, 0.0
    for k in range(MOST_POWER, -1, -1):
        bend = bend * x + 2.0 * slope
        slope = slope * x + value
        value = value * x + p[k]
    return value, slope, bend


def _angle(points: Pointer) -> tuple[float, float, float]:
    """Return the first point's angle about z, from x, and its derivatives by x and y."""
    x, y = points[POINT.first], points[POINT.first + 1]
    square = x * x + y * y
    return math.atan2(y, x), -y / square, x / square


def _rise(points: Pointer) -> float:
    """Return the second point's height above the first."""
    return points[POINT.second + 2] - points[POINT.first + 2]


def angle_value(points: Pointer, p: Pointer, out: Pointer) -> None:
    """Fill in a polynomial of the first point's angle about z, no turn, and pull."""
    angle, by_x, by_y = _angle(points)
    value, slope, _ = _horner(p, angle)
    clear(out, SPAN_OUT_SIZE)
    out[SPAN_OUT.length] = value
    out[SPAN_OUT.first_pull] = slope * by_x
    out[SPAN_OUT.first_pull + 1] = slope * by_y


def angle_slopes(points: Pointer, p: Pointer, out: Pointer) -> None:
    """Fill in the slopes of turn, zero, and of pull."""
    angle, by_x, by_y = _angle(points)
    _, slope, bend = _horner(p, angle)
    clear(out, SPAN_SLOPE_SIZE)
    pull_x = SPAN_SLOPE.first_pull
    pull_y = pull_x + SLOPE_WIDTH
    out[pull_x] = bend * by_x * by_x - 2.0 * slope * by_x * by_y
    out[pull_x + 1] = bend * by_x * by_y + slope * (by_x * by_x - by_y * by_y)
    out[pull_y] = out[pull_x + 1]
    out[pull_y + 1] = bend * by_y * by_y + 2.0 * slope * by_x * by_y


def rise_value(points: Pointer, p: Pointer, out: Pointer) -> None:
    """Fill in a polynomial of the second point's height above the first, along z, no turn, and pull."""
    value, slope, _ = _horner(p, _rise(points))
    clear(out, SPAN_OUT_SIZE)
    out[SPAN_OUT.length] = value
    out[SPAN_OUT.first_pull + 2] = -slope
    out[SPAN_OUT.second_pull + 2] = slope


def rise_slopes(points: Pointer, p: Pointer, out: Pointer) -> None:
    """Fill in the slopes of turn, zero, and of pull."""
    _, _, bend = _horner(p, _rise(points))
    clear(out, SPAN_SLOPE_SIZE)
    first_z, second_z = SPAN_SLOPE.first_pull + 2 * SLOPE_WIDTH, SPAN_SLOPE.second_pull + 2 * SLOPE_WIDTH
    out[first_z + POINT.first + 2] = bend
    out[first_z + POINT.second + 2] = -bend
    out[second_z + POINT.first + 2] = -bend
    out[second_z + POINT.second + 2] = bend


#: Of the angle by which a point has turned about the z axis, from -pi to pi.
ANGLE = WrapSegment("polynomial of an angle", _PARAMETERS, angle_value, angle_slopes)
#: Of the distance of two points along the z axis.
RISE = WrapSegment("polynomial of a rise", _PARAMETERS, rise_value, rise_slopes)
