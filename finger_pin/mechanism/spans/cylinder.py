"""A span that may wrap about the z axis of its frame: a helix between tangents, of the same pitch, or a point inside.

Seen along z, the path is one around a circle of length P; unrolled, it is a straight line: L^2 = P^2 + (z_1 - z_0)^2.
"""

from __future__ import annotations

import math

from finger_pin.mechanism.gaps.signed_distance import POINT, SLOPE_WIDTH
from finger_pin.mechanism.spans.circle import FREE, INSIDE, path, way_of_path
from finger_pin.mechanism.spans.span import (
    SPAN_OUT,
    SPAN_SLOPE,
    WRAP,
    WrapParameters,
    WrapSegment,
    side_point,
    straight_slopes,
    straight_value,
)
from finger_pin.mechanism.spans.sphere import WrapPlane, curvatures, end_directions, length_gradient, turn_gradient
from finger_pin.typing import Pointer


def _plane(points: Pointer, p: Pointer) -> WrapPlane:
    a = (points[POINT.first], points[POINT.first + 1], 0.0)
    b = (points[POINT.second], points[POINT.second + 1], 0.0)
    r0, r1 = math.sqrt(a[0] ** 2 + a[1] ** 2), math.sqrt(b[0] ** 2 + b[1] ** 2)
    area = a[0] * b[1] - a[1] * b[0]
    sense = -1.0 if area < 0.0 else 1.0
    angle = math.atan2(abs(area), a[0] * b[0] + a[1] * b[1])
    x, y, _, inside = side_point(points, p)
    along = (x * a[0] + y * a[1]) / max(r0, 1e-300)
    across = sense * (y * a[0] - x * a[1]) / max(r0, 1e-300)
    way = way_of_path(r0, r1, angle, p[WRAP.radius], along, across, p[WRAP.has_side], inside)
    return WrapPlane(way, a, b, r0, r1, angle, (0.0, 0.0, sense))


def _turn_in_space(way: int, turn: float, flat: float) -> tuple[float, float, float]:
    """Return the turn of a path in space, of that in the plane and of P / L, and its derivatives by both."""
    if way != INSIDE:
        return turn * flat, flat, turn
    half, rest = math.sin(0.5 * turn), math.cos(0.5 * turn)
    share = 2.0 / math.sqrt(max(1.0 - (flat * half) ** 2, 1e-300))
    return 2.0 * math.asin(min(flat * half, 1.0)), share * flat * 0.5 * rest, share * half


def _rise(points: Pointer) -> float:
    """Return z_1 - z_0."""
    return points[POINT.second + 2] - points[POINT.first + 2]


def _rise_slope(i: int) -> float:
    """Return the derivative of the rise by a coordinate of the points."""
    return 1.0 * (i == POINT.second + 2) - 1.0 * (i == POINT.first + 2)


def cylinder_value(points: Pointer, p: Pointer, out: Pointer) -> None:
    """Fill in length, turn and pull."""
    plane = _plane(points, p)
    if plane.way == FREE:
        straight_value(points, p, out)
        return
    wrap = path(plane.way, plane.r0, plane.r1, plane.angle, p[WRAP.radius])
    pull, rise = length_gradient(wrap, plane, end_directions(plane)), _rise(points)
    length = math.sqrt(wrap.length**2 + rise**2)
    flat = wrap.length / length
    out[SPAN_OUT.length] = length
    out[SPAN_OUT.turn] = _turn_in_space(plane.way, wrap.turn, flat)[0]
    for i in range(SLOPE_WIDTH):
        out[SPAN_OUT.first_pull + i] = flat * pull[i]
    out[SPAN_OUT.first_pull + 2] = -rise / length
    out[SPAN_OUT.second_pull + 2] = rise / length


def cylinder_slopes(points: Pointer, p: Pointer, out: Pointer) -> None:
    """Fill in the slopes of turn and pull."""
    plane = _plane(points, p)
    if plane.way == FREE:
        straight_slopes(points, p, out)
        return
    wrap = path(plane.way, plane.r0, plane.r1, plane.angle, p[WRAP.radius])
    frame = end_directions(plane)
    flat_pull, flat_turn = length_gradient(wrap, plane, frame), turn_gradient(wrap, plane, frame)
    curvatures(wrap, 0.0, plane, frame, out)
    length = math.sqrt(wrap.length**2 + _rise(points) ** 2)
    flat, steep = wrap.length / length, _rise(points) / length
    _, by_turn, by_flat = _turn_in_space(plane.way, wrap.turn, flat)
    for i in range(SLOPE_WIDTH):
        up = _rise_slope(i)
        pull = flat * flat_pull[i] + steep * up
        out[SPAN_SLOPE.turn + i] = by_turn * flat_turn[i] + by_flat * (flat_pull[i] - flat * pull) / length
        for j in range(SLOPE_WIDTH):
            other_up = _rise_slope(j)
            other_pull = flat * flat_pull[j] + steep * other_up
            spread = (flat_pull[i] * flat_pull[j] + up * other_up - pull * other_pull) / length
            # The components of both pulls follow one another.
            column = SPAN_SLOPE.first_pull + SLOPE_WIDTH * i + j
            out[column] = flat * out[column] + spread


#: About the z axis.
CYLINDER = WrapSegment("cylinder", WrapParameters._fields, cylinder_value, cylinder_slopes)
