"""A span that may wrap about the origin of its frame: an arc of a great circle between tangents, or a point inside."""

from __future__ import annotations

import math
from typing import Any

from finger_pin.mechanism.spans.circle import FREE, LONG_WAY, path, way_of_path
from finger_pin.mechanism.spans.span import WRAP, WrapSegment, side_point, straight_slopes, straight_value


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
    side = way_of_path(r0, r1, angle, p[0], along, across, p[4], inside)
    return side, a, b, r0, r1, angle, normal


def sphere_value(y: Any, p: Any, out: Any) -> None:
    """Fill in length, turn and pull."""
    side, a, b, r0, r1, angle, normal = _plane(y, p)
    if side == FREE:
        straight_value(y, p, out)
        return
    wrap = path(side, r0, r1, angle, p[0])
    pull = gradient(wrap.by_r0, wrap.by_r1, wrap.by_angle, r0, r1, directions(a, b, r0, r1, normal, side))
    out[0] = wrap.length
    out[1] = wrap.turn
    for i in range(6):
        out[2 + i] = pull[i]


def sphere_slopes(y: Any, p: Any, out: Any) -> None:
    """Fill in the slopes of turn and pull."""
    side, a, b, r0, r1, angle, normal = _plane(y, p)
    if side == FREE:
        straight_slopes(y, p, out)
        return
    wrap = path(side, r0, r1, angle, p[0])
    frame = directions(a, b, r0, r1, normal, side)
    turn = gradient(wrap.turn_by_r0, wrap.turn_by_r1, wrap.turn_by_angle, r0, r1, frame)
    for i in range(6):
        out[i] = turn[i]
    sine = max(math.sin(angle), 1e-300) * (-1.0 if side == LONG_WAY else 1.0)
    curvatures(wrap, sine, math.cos(angle), r0, r1, frame, out)


#: About the origin.
SPHERE = WrapSegment("sphere", WRAP, sphere_value, sphere_slopes)


def crossed(a: Any, b: Any) -> Any:
    """Return the vector product of two triples."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def directions(a: Any, b: Any, r0: Any, r1: Any, normal: Any, side: Any) -> Any:
    """Return unit vectors at both ends: outwards at the first, along the path's turn there; the same at the second."""
    sense = -1.0 if side == LONG_WAY else 1.0
    u, v = (a[0] / r0, a[1] / r0, a[2] / r0), (b[0] / r1, b[1] / r1, b[2] / r1)
    along = (sense * normal[0], sense * normal[1], sense * normal[2])
    return u, crossed(along, u), v, crossed(along, v)


def gradient(by0: Any, by1: Any, by_angle: Any, r0: Any, r1: Any, frame: Any) -> Any:
    """Return the 6 derivatives by both points of a function of r_0, r_1 and phi, of its derivatives by these."""
    u, t, v, s = frame
    g, k = by_angle / r0, by_angle / r1
    return (
        *(by0 * u[0] - g * t[0], by0 * u[1] - g * t[1], by0 * u[2] - g * t[2]),
        *(by1 * v[0] + k * s[0], by1 * v[1] + k * s[1], by1 * v[2] + k * s[2]),
    )


def curvatures(wrap: Any, sine: Any, cosine: Any, r0: Any, r1: Any, frame: Any, out: Any) -> None:
    """Fill in the 36 second derivatives of the length by both points, from out[6] on.

    Args:
        wrap: Length, turn and derivatives, from `path`.
        sine: Of phi; 0 for a plane that does not turn with the points.
        cosine: Of phi.
        r0: Distance of the first end, m.
        r1: Distance of the second end, m.
        frame: Unit vectors at both ends, from `directions`.
        out: Filled in.
    """
    u, t, v, s = frame
    _, by0, by1, by_angle, d00, d11, daa, d01, d0a, d1a, _, _, _, _ = wrap
    n = crossed(u, t)
    # Where the plane turns, points that leave it lengthen the arc; phi -> 0 has a limit.
    turning = sine != 0.0
    lift = by_angle / sine if abs(sine) > 1e-9 else daa
    n00 = (by0 / r0 + lift * cosine / r0**2) if turning else 0.0
    n11 = (by1 / r1 + lift * cosine / r1**2) if turning else 0.0
    n01 = -lift / (r0 * r1) if turning else 0.0
    t00, m00 = by0 / r0 + daa / r0**2, by_angle / r0**2 - d0a / r0
    s11, m11 = by1 / r1 + daa / r1**2, d1a / r1 - by_angle / r1**2
    for i in range(3):
        for j in range(3):
            out[6 + 6 * i + j] = d00 * u[i] * u[j] + m00 * (u[i] * t[j] + t[i] * u[j]) + t00 * t[i] * t[j]
            out[6 + 6 * i + j] += n00 * n[i] * n[j]
            out[27 + 6 * i + j] = d11 * v[i] * v[j] + m11 * (v[i] * s[j] + s[i] * v[j]) + s11 * s[i] * s[j]
            out[27 + 6 * i + j] += n11 * n[i] * n[j]
            both = d01 * u[i] * v[j] + d0a / r1 * u[i] * s[j] - d1a / r0 * t[i] * v[j]
            both += n01 * n[i] * n[j] - daa / (r0 * r1) * t[i] * s[j]
            out[9 + 6 * i + j] = both
            out[24 + 6 * j + i] = both
