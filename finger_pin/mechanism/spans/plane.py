"""From a circle in its plane to points in space: derivatives of length and turn by the points."""

from __future__ import annotations

from typing import Any

from finger_pin.mechanism.spans.circle import LONG_WAY


def crossed(a: Any, b: Any) -> Any:
    """Return the vector product of two triples."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def directions(a: Any, b: Any, r0: Any, r1: Any, normal: Any, way: Any) -> Any:
    """Return unit vectors at both ends: outwards at the first, along the path's turn there; the same at the second."""
    sense = -1.0 if way == LONG_WAY else 1.0
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


def curvatures(found: Any, sine: Any, cosine: Any, r0: Any, r1: Any, frame: Any, out: Any) -> None:
    """Fill in the 36 second derivatives of the length by both points, from out[6] on.

    Args:
        found: Length, turn and derivatives, from `path`.
        sine: Of phi; 0 for a plane that does not turn with the points.
        cosine: Of phi.
        r0: Distance of the first end, m.
        r1: Distance of the second end, m.
        frame: Unit vectors at both ends, from `directions`.
        out: Filled in.
    """
    u, t, v, s = frame
    by0, by1, by_angle, d00, d11, daa, d01, d0a, d1a = found[1:10]
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
