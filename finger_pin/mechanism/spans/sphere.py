"""A span that may wrap about the origin of its frame: an arc of a great circle between tangents, or a point inside."""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

from finger_pin.mechanism.gaps.signed_distance import POINT, SLOPE_WIDTH, vector_at
from finger_pin.mechanism.gaps.vectors import Triple, cross, divide, dot, scale
from finger_pin.mechanism.spans.circle import FREE, LONG_WAY, CirclePath, path, way_of_path
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
from finger_pin.typing import Pointer

#: Derivatives by both points.
Gradient: TypeAlias = tuple[float, float, float, float, float, float]


class WrapPlane(NamedTuple):
    """The plane of a path through the centre of a wrap.

    Attributes:
        way: Which way the path goes, from `way_of_path`.
        a, b: Both points, m.
        r0, r1: Their distances from the centre, m.
        angle: Between them, rad.
        normal: Of the plane.
    """

    way: int
    a: Triple
    b: Triple
    r0: float
    r1: float
    angle: float
    normal: Triple


class EndDirections(NamedTuple):
    """Unit vectors at both ends: outwards at the first, along the path's turn there; the same at the second."""

    outwards: Triple
    onwards: Triple
    second_outwards: Triple
    second_onwards: Triple


def _plane(points: Pointer, p: Pointer) -> WrapPlane:
    a, b = vector_at(points, POINT.first), vector_at(points, POINT.second)
    r0, r1 = _length(a), _length(b)
    normal = cross(a, b)
    area = _length(normal)
    angle = math.atan2(area, dot(a, b))
    if area <= 1e-15 * r0 * r1:
        # Points in line: any plane will do; this is MuJoCo's.
        second = abs(a[1]) > abs(a[0]) and abs(a[1]) > abs(a[2])
        third = abs(a[2]) > abs(a[0]) and abs(a[2]) > abs(a[1])
        normal = cross(a, (1.0 * (second or third), 1.0 * (not second), 1.0 * (not third)))
        area = max(_length(normal), 1e-300)
    normal = divide(normal, area)
    x, y, z, inside = side_point(points, p)
    along, across = dot((x, y, z), a) / max(r0, 1e-300), dot((x, y, z), cross(normal, a)) / max(r0, 1e-300)
    way = way_of_path(r0, r1, angle, p[WRAP.radius], along, across, p[WRAP.has_side], inside)
    return WrapPlane(way, a, b, r0, r1, angle, normal)


def _length(a: Triple) -> float:
    return math.sqrt(a[0] ** 2 + a[1] ** 2 + a[2] ** 2)


def sphere_value(points: Pointer, p: Pointer, out: Pointer) -> None:
    """Fill in length, turn and pull."""
    plane = _plane(points, p)
    if plane.way == FREE:
        straight_value(points, p, out)
        return
    wrap = path(plane.way, plane.r0, plane.r1, plane.angle, p[WRAP.radius])
    frame = end_directions(plane)
    pull = length_gradient(wrap, plane, frame)
    out[SPAN_OUT.length] = wrap.length
    out[SPAN_OUT.turn] = wrap.turn
    for i in range(SLOPE_WIDTH):
        out[SPAN_OUT.first_pull + i] = pull[i]


def sphere_slopes(points: Pointer, p: Pointer, out: Pointer) -> None:
    """Fill in the slopes of turn and pull."""
    plane = _plane(points, p)
    if plane.way == FREE:
        straight_slopes(points, p, out)
        return
    wrap = path(plane.way, plane.r0, plane.r1, plane.angle, p[WRAP.radius])
    frame = end_directions(plane)
    turn = turn_gradient(wrap, plane, frame)
    for i in range(SLOPE_WIDTH):
        out[SPAN_SLOPE.turn + i] = turn[i]
    sine = max(math.sin(plane.angle), 1e-300) * (-1.0 if plane.way == LONG_WAY else 1.0)
    curvatures(wrap, sine, plane, frame, out)


#: About the origin.
SPHERE = WrapSegment("sphere", WrapParameters._fields, sphere_value, sphere_slopes)


def end_directions(plane: WrapPlane) -> EndDirections:
    """Return the directions at both ends of a path."""
    u, v = divide(plane.a, plane.r0), divide(plane.b, plane.r1)
    axis = scale(-1.0 if plane.way == LONG_WAY else 1.0, plane.normal)
    return EndDirections(u, cross(axis, u), v, cross(axis, v))


def length_gradient(wrap: CirclePath, plane: WrapPlane, frame: EndDirections) -> Gradient:
    """Return the derivatives of a path's length in the plane by both points."""
    return _gradient(wrap.by_r0, wrap.by_r1, wrap.by_angle, plane, frame)


def turn_gradient(wrap: CirclePath, plane: WrapPlane, frame: EndDirections) -> Gradient:
    """Return the derivatives of a path's turn in the plane by both points, 1/m."""
    return _gradient(wrap.turn_by_r0, wrap.turn_by_r1, wrap.turn_by_angle, plane, frame)


def _gradient(by_r0: float, by_r1: float, by_angle: float, plane: WrapPlane, frame: EndDirections) -> Gradient:
    u, t, v, s = frame
    g, k = by_angle / plane.r0, by_angle / plane.r1
    return (
        *(by_r0 * u[0] - g * t[0], by_r0 * u[1] - g * t[1], by_r0 * u[2] - g * t[2]),
        *(by_r1 * v[0] + k * s[0], by_r1 * v[1] + k * s[1], by_r1 * v[2] + k * s[2]),
    )


def curvatures(wrap: CirclePath, sine: float, plane: WrapPlane, frame: EndDirections, out: Pointer) -> None:
    """Fill in the second derivatives of the length by both points, as slopes of the pulls.

    Args:
        wrap: Length, turn and derivatives, from `path`.
        sine: Of phi; 0 for a plane that does not turn with the points.
        plane: Of the path.
        frame: Its `end_directions`.
        out: Filled in.
    """
    u, t, v, s = frame
    r0, r1, cosine = plane.r0, plane.r1, math.cos(plane.angle)
    _, by0, by1, by_angle, d00, d11, daa, d01, d0a, d1a, _, _, _, _ = wrap
    n = cross(u, t)
    # Where the plane turns, points that leave it lengthen the arc; phi -> 0 has a limit.
    turning = sine != 0.0
    lift = by_angle / sine if abs(sine) > 1e-9 else daa
    n00 = (by0 / r0 + lift * cosine / r0**2) if turning else 0.0
    n11 = (by1 / r1 + lift * cosine / r1**2) if turning else 0.0
    n01 = -lift / (r0 * r1) if turning else 0.0
    t00, m00 = by0 / r0 + daa / r0**2, by_angle / r0**2 - d0a / r0
    s11, m11 = by1 / r1 + daa / r1**2, d1a / r1 - by_angle / r1**2
    for i in range(3):
        first, second = SPAN_SLOPE.first_pull + SLOPE_WIDTH * i, SPAN_SLOPE.second_pull + SLOPE_WIDTH * i
        for j in range(3):
            same = d00 * u[i] * u[j] + m00 * (u[i] * t[j] + t[i] * u[j]) + t00 * t[i] * t[j]
            out[first + POINT.first + j] = same + n00 * n[i] * n[j]
            same = d11 * v[i] * v[j] + m11 * (v[i] * s[j] + s[i] * v[j]) + s11 * s[i] * s[j]
            out[second + POINT.second + j] = same + n11 * n[i] * n[j]
            both = d01 * u[i] * v[j] + d0a / r1 * u[i] * s[j] - d1a / r0 * t[i] * v[j]
            both += n01 * n[i] * n[j] - daa / (r0 * r1) * t[i] * s[j]
            out[first + POINT.second + j] = both
            out[SPAN_SLOPE.second_pull + SLOPE_WIDTH * j + POINT.first + i] = both
