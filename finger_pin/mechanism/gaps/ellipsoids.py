"""The gap between two ellipsoids, P_0 + M u and B u with |u| <= 1.

It is the largest distance of two parallel planes that touch them from outside: the maximum over unit vectors n, from B
towards M, of

    s(n) = n . P_0 - |M^T n| - |B n|.

The slope of s is the vector between the points at which the planes touch, x_M - x_B, and in the maximum s n. Of bodies
that overlap it is the shortest way out, as long as it is shorter than their radii of curvature.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from finger_pin.mechanism.gaps.distance import POLE_TANGENT_1, POLE_TANGENT_2, tangent, tangent_slope
from finger_pin.mechanism.gaps.ellipsoid import semi_axes
from finger_pin.mechanism.gaps.nearest import SignedDistance
from finger_pin.mechanism.gaps.vectors import cross, dot, inverse_matrix, perpendicular_vectors, size, turned

_MOST_STEPS, _MOST_HALVINGS = 60, 40
# Newton's steps end below this angle, rad; and where the maximum is not sharp, they go as if it were by this part.
_LEAST_TURN, _LEAST_CURVATURE_SHARE = 1e-15, 1e-3


class _Parameters(NamedTuple):
    """Places of the numbers: the third semi-axis of M, and those of B."""

    third: int
    x: int
    y: int
    z: int


_PARAMETERS = _Parameters(*range(4))


def _squared(f: Any, g: Any, e: Any) -> Any:
    """Return M M^T."""
    return (
        f[0] * f[0] + g[0] * g[0] + e[0] * e[0],
        f[0] * f[1] + g[0] * g[1] + e[0] * e[1],
        f[0] * f[2] + g[0] * g[2] + e[0] * e[2],
        f[1] * f[1] + g[1] * g[1] + e[1] * e[1],
        f[1] * f[2] + g[1] * g[2] + e[1] * e[2],
        f[2] * f[2] + g[2] * g[2] + e[2] * e[2],
    )


def _support(square: Any, n: Any) -> Any:
    """Return the extent of a body along n, its farthest point from its centre, and the slope of that point by n."""
    x, y, z = turned(square, n[0], n[1], n[2])
    far = (x * n[0] + y * n[1] + z * n[2]) ** 0.5
    x, y, z, shorter = x / far, y / far, z / far, 1.0 / far
    slope = (
        shorter * (square[0] - x * x),
        shorter * (square[1] - x * y),
        shorter * (square[2] - x * z),
        shorter * (square[3] - y * y),
        shorter * (square[4] - y * z),
        shorter * (square[5] - z * z),
    )
    return far, (x, y, z), slope


def _between(centre: Any, one: Any, two: Any, n: Any) -> Any:
    """Return the distance of the planes across a direction."""
    return dot(n, centre) - dot(n, turned(one, n[0], n[1], n[2])) ** 0.5 - dot(n, turned(two, n[0], n[1], n[2])) ** 0.5


def _bent(s: Any, t: Any, one: Any, two: Any, gap: float) -> Any:
    """Return how sharp the maximum is along two directions across n: of the matrix ss, st, tt."""
    by_s = turned(one, s[0], s[1], s[2])
    by_t = turned(one, t[0], t[1], t[2])
    and_s, and_t = turned(two, s[0], s[1], s[2]), turned(two, t[0], t[1], t[2])
    return dot(s, by_s) + dot(s, and_s) + gap, dot(s, by_t) + dot(s, and_t), dot(t, by_t) + dot(t, and_t) + gap


def _unit(x: float, y: float, z: float) -> Any:
    far = size((x, y, z))
    return (x / far, y / far, z / far) if far > 0.0 else (0.0, 0.0, 1.0)


def _normal(y: Any, p: Any) -> Any:
    """Return n, and M M^T and B B^T."""
    f, g, e = semi_axes(y, p[_PARAMETERS.third])
    one, centre = _squared(f, g, e), (y[0], y[1], y[2])
    two = (
        p[_PARAMETERS.x] * p[_PARAMETERS.x],
        0.0,
        0.0,
        p[_PARAMETERS.y] * p[_PARAMETERS.y],
        0.0,
        p[_PARAMETERS.z] * p[_PARAMETERS.z],
    )
    both = inverse_matrix(one[0] + two[0], one[1], one[2], one[3] + two[3], one[4], one[5] + two[5])
    x, y_, z = turned(both, y[0], y[1], y[2])
    n = _unit(x, y_, z)
    gap = _between(centre, one, two, n)
    for _ in range(_MOST_STEPS):
        s, t = perpendicular_vectors(n[0], n[1], n[2])
        _, first_support, slope = _support(one, n)
        _, second_support, other = _support(two, n)
        between_supports = (
            centre[0] - first_support[0] - second_support[0],
            centre[1] - first_support[1] - second_support[1],
            centre[2] - first_support[2] - second_support[2],
        )
        ss, st, tt = _bent(s, t, slope, other, dot(n, between_supports))
        # What turns no maximum into one: the least eigenvalue is lifted.
        least = 0.5 * (ss + tt) - (0.25 * (ss - tt) * (ss - tt) + st * st) ** 0.5
        lift = max(_LEAST_CURVATURE_SHARE * (abs(ss) + abs(tt)) - least, 0.0)
        ss, tt = ss + lift, tt + lift
        by_s, by_t, inverse_determinant = dot(s, between_supports), dot(t, between_supports), 1.0 / (ss * tt - st * st)
        a, b = (tt * by_s - st * by_t) * inverse_determinant, (ss * by_t - st * by_s) * inverse_determinant
        share, better = 1.0, gap
        for _ in range(_MOST_HALVINGS):
            a_, b_ = share * a, share * b
            new = _unit(n[0] + a_ * s[0] + b_ * t[0], n[1] + a_ * s[1] + b_ * t[1], n[2] + a_ * s[2] + b_ * t[2])
            better = _between(centre, one, two, new)
            # Near the maximum only rounding tells.
            if better >= gap or a_ * a_ + b_ * b_ < 1e-14:
                n = new
                break
            share *= 0.5
        gap = better
        if abs(a) + abs(b) < _LEAST_TURN:
            break
    return n, one, two


def _value(y: Any, p: Any, out: Any) -> None:
    n, one, two = _normal(y, p)
    far, _, _ = _support(one, n)
    second_level, second_support, _ = _support(two, n)
    out[0] = dot(n, (y[0], y[1], y[2])) - far - second_level
    tangent(n[0], n[1], n[2], POLE_TANGENT_1, out, 7)
    tangent(n[0], n[1], n[2], POLE_TANGENT_2, out, 10)
    for i in range(3):
        out[1 + i], out[4 + i] = n[i], second_support[i] + 0.5 * out[0] * n[i]


def _slopes(y: Any, p: Any, out: Any) -> None:
    n, one, two = _normal(y, p)
    first_level, first_support, by_n = _support(one, n)
    second_level, _, by_other = _support(two, n)
    gap = dot(n, (y[0], y[1], y[2])) - first_level - second_level
    s, t = perpendicular_vectors(n[0], n[1], n[2])
    ss, st, tt = _bent(s, t, by_n, by_other, gap)
    inverse_determinant = 1.0 / (ss * tt - st * st)
    for j in range(6):
        unit = (1.0 * (j % 3 == 0), 1.0 * (j % 3 == 1), 1.0 * (j % 3 == 2))
        moved = unit
        if j > 2:
            # The point at which a plane touches goes along, and on from there, as the body turns under the plane.
            a, b, c = cross(unit, first_support)
            d, e, f = cross(unit, n)
            d, e, f = turned(by_n, d, e, f)
            moved = (d - a, e - b, f - c)
        rises = dot(n, moved)
        by_s, by_t = dot(s, moved), dot(t, moved)
        a, b = (tt * by_s - st * by_t) * inverse_determinant, (ss * by_t - st * by_s) * inverse_determinant
        turning = (a * s[0] + b * t[0], a * s[1] + b * t[1], a * s[2] + b * t[2])
        slid = turned(by_other, turning[0], turning[1], turning[2])
        out[72 + j] = rises
        for i in range(3):
            out[6 * i + j] = turning[i]
            out[18 + 6 * i + j] = slid[i] + 0.5 * (rises * n[i] + gap * turning[i])
        tangent_slope(n, turning, 0.0, POLE_TANGENT_1, out, 36 + j)
        tangent_slope(n, turning, 0.0, POLE_TANGENT_2, out, 54 + j)


#: The gap between a body's ellipsoid, seen as three points, and another one, by its semi-axes, m.
ELLIPSOIDS = SignedDistance(name="ellipsoids", parameters=_Parameters._fields, value=_value, slopes=_slopes)
