"""A span that may wrap about the origin of its frame: an arc of a great circle between tangents, or a point inside."""

from __future__ import annotations

import math
from typing import Any

from finger_pin.mechanism.spans.circle import FREE, LONG_WAY, path, way_of_path
from finger_pin.mechanism.spans.plane import crossed, curvatures, directions, gradient
from finger_pin.mechanism.spans.span import WRAP, Span, side_point
from finger_pin.mechanism.spans.straight import straight_slopes, straight_value


def _plane(y: Any, p: Any) -> Any:
    """Return the way of the path, both points, their distances, the angle between them and the plane's normal."""
    a, b = (y[0], y[1], y[2]), (y[3], y[4], y[5])
    r0, r1 = math.sqrt(a[0] ** 2 + a[1] ** 2 + a[2] ** 2), math.sqrt(b[0] ** 2 + b[1] ** 2 + b[2] ** 2)
    nx, ny, nz = crossed(a, b)
    area = math.sqrt(nx**2 + ny**2 + nz**2)
    angle = math.atan2(area, a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
    if area <= 1e-15 * r0 * r1:
        # Points in line: any plane will do; this is MuJoCo's.
        second = abs(a[1]) > abs(a[0]) and abs(a[1]) > abs(a[2])
        third = abs(a[2]) > abs(a[0]) and abs(a[2]) > abs(a[1])
        nx, ny, nz = crossed(a, (1.0 * (second or third), 1.0 * (not second), 1.0 * (not third)))
        area = max(math.sqrt(nx**2 + ny**2 + nz**2), 1e-300)
    normal = (nx / area, ny / area, nz / area)
    sx, sy, sz, inside = side_point(y, p)
    along = (sx * a[0] + sy * a[1] + sz * a[2]) / max(r0, 1e-300)
    tx, ty, tz = crossed(normal, a)
    across = (sx * tx + sy * ty + sz * tz) / max(r0, 1e-300)
    way = way_of_path(r0, r1, angle, p[0], along, across, p[4], inside)
    return way, a, b, r0, r1, angle, normal


def sphere_value(y: Any, p: Any, out: Any) -> None:
    """Fill in length, turn and pull."""
    way, a, b, r0, r1, angle, normal = _plane(y, p)
    if way == FREE:
        straight_value(y, p, out)
        return
    found = path(way, r0, r1, angle, p[0])
    pull = gradient(found[1], found[2], found[3], r0, r1, directions(a, b, r0, r1, normal, way))
    out[0] = found[0]
    out[1] = found[10]
    for i in range(6):
        out[2 + i] = pull[i]


def sphere_slopes(y: Any, p: Any, out: Any) -> None:
    """Fill in the slopes of turn and pull."""
    way, a, b, r0, r1, angle, normal = _plane(y, p)
    if way == FREE:
        straight_slopes(y, p, out)
        return
    found = path(way, r0, r1, angle, p[0])
    frame = directions(a, b, r0, r1, normal, way)
    turn = gradient(found[11], found[12], found[13], r0, r1, frame)
    for i in range(6):
        out[i] = turn[i]
    sine = max(math.sin(angle), 1e-300) * (-1.0 if way == LONG_WAY else 1.0)
    curvatures(found, sine, math.cos(angle), r0, r1, frame, out)


#: About the origin.
SPHERE = Span("sphere", WRAP, sphere_value, sphere_slopes)
