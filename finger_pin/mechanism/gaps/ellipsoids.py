"""The gap between two ellipsoids, P_0 + M u and B u with |u| <= 1.

It is the largest distance of two parallel planes that touch them from outside: the maximum over unit vectors n, from B
towards M, of

    s(n) = n . P_0 - |M^T n| - |B n|.

The slope of s is the vector between the points at which the planes touch, x_M - x_B, and in the maximum s n. Of bodies
that overlap it is the shortest way out, as long as it is shorter than their radii of curvature.
"""

from __future__ import annotations

from typing import NamedTuple

from finger_pin.mechanism.gaps.ellipsoid import semi_axes
from finger_pin.mechanism.gaps.signed_distance import (
    GAP_OUT,
    GAP_SLOPE,
    POINT,
    SLOPE_WIDTH,
    SignedDistance,
    put_vector,
    vector_at,
)
from finger_pin.mechanism.gaps.tangents import POLE_TANGENTS, tangent, tangent_slope
from finger_pin.mechanism.gaps.vectors import (
    Symmetric,
    Triple,
    Triples,
    add,
    cross,
    divide,
    dot,
    inverse,
    norm,
    perpendicular_vectors,
    product,
    scale,
    subtract,
    unit_vector,
)
from finger_pin.typing import Pointer

_MOST_STEPS, _MOST_HALVINGS = 60, 40
# Newton's steps end below this angle, rad; and where the maximum is not sharp, they go as if it were by this part.
_LEAST_TURN, _LEAST_CURVATURE_SHARE = 1e-15, 1e-3


class _SemiAxes(NamedTuple):
    """Columns of the parameters, m: the third semi-axis of M, and those of B."""

    third: int
    x: int
    y: int
    z: int


_SEMI_AXIS = _SemiAxes(*range(4))


class _Support(NamedTuple):
    """Extent of a body along n, m, its farthest point from its centre, m, and the slope of that point by n, m."""

    extent: float
    point: Triple
    slope: Symmetric


class _Separation(NamedTuple):
    """The normal of the planes, M M^T and B B^T."""

    normal: Triple
    first: Symmetric
    second: Symmetric


def _squared(columns: Triples) -> Symmetric:
    """Return M M^T."""
    f, g, e = columns
    return Symmetric(
        f[0] * f[0] + g[0] * g[0] + e[0] * e[0],
        f[0] * f[1] + g[0] * g[1] + e[0] * e[1],
        f[0] * f[2] + g[0] * g[2] + e[0] * e[2],
        f[1] * f[1] + g[1] * g[1] + e[1] * e[1],
        f[1] * f[2] + g[1] * g[2] + e[1] * e[2],
        f[2] * f[2] + g[2] * g[2] + e[2] * e[2],
    )


def _support(square: Symmetric, n: Triple) -> _Support:
    x, y, z = product(square, n)
    far = (x * n[0] + y * n[1] + z * n[2]) ** 0.5
    x, y, z, shorter = x / far, y / far, z / far, 1.0 / far
    slope = Symmetric(
        shorter * (square.xx - x * x),
        shorter * (square.xy - x * y),
        shorter * (square.xz - x * z),
        shorter * (square.yy - y * y),
        shorter * (square.yz - y * z),
        shorter * (square.zz - z * z),
    )
    return _Support(far, (x, y, z), slope)


def _plane_distance(centre: Triple, first: Symmetric, second: Symmetric, n: Triple) -> float:
    """Return the distance of the planes across a direction."""
    return dot(n, centre) - dot(n, product(first, n)) ** 0.5 - dot(n, product(second, n)) ** 0.5


def _sharpness(s: Triple, t: Triple, first: Symmetric, second: Symmetric, gap: float) -> tuple[float, float, float]:
    """Return how sharp the maximum is along two directions across n: of the matrix ss, st, tt."""
    first_by_s, first_by_t = product(first, s), product(first, t)
    second_by_s, second_by_t = product(second, s), product(second, t)
    return (
        dot(s, first_by_s) + dot(s, second_by_s) + gap,
        dot(s, first_by_t) + dot(s, second_by_t),
        dot(t, first_by_t) + dot(t, second_by_t) + gap,
    )


def _unit(vector: Triple) -> Triple:
    far = norm(vector)
    return divide(vector, far) if far > 0.0 else (0.0, 0.0, 1.0)


def _separation(points: Pointer, p: Pointer) -> _Separation:
    centre = vector_at(points, POINT.first)
    first = _squared(semi_axes(points, p[_SEMI_AXIS.third]))
    x, y, z = p[_SEMI_AXIS.x], p[_SEMI_AXIS.y], p[_SEMI_AXIS.z]
    second = Symmetric(x * x, 0.0, 0.0, y * y, 0.0, z * z)
    both = Symmetric(first.xx + second.xx, first.xy, first.xz, first.yy + second.yy, first.yz, first.zz + second.zz)
    n = _unit(product(inverse(both), centre))
    gap = _plane_distance(centre, first, second, n)
    for _ in range(_MOST_STEPS):
        s, t = perpendicular_vectors(n)
        one, other = _support(first, n), _support(second, n)
        # From the point of the one to that of the other.
        apart = subtract(subtract(centre, one.point), other.point)
        ss, st, tt = _sharpness(s, t, one.slope, other.slope, dot(n, apart))
        # What turns no maximum into one: the least eigenvalue is lifted.
        least = 0.5 * (ss + tt) - (0.25 * (ss - tt) * (ss - tt) + st * st) ** 0.5
        lift = max(_LEAST_CURVATURE_SHARE * (abs(ss) + abs(tt)) - least, 0.0)
        ss, tt = ss + lift, tt + lift
        by_s, by_t, inverse_determinant = dot(s, apart), dot(t, apart), 1.0 / (ss * tt - st * st)
        a, b = (tt * by_s - st * by_t) * inverse_determinant, (ss * by_t - st * by_s) * inverse_determinant
        share, better = 1.0, gap
        for _ in range(_MOST_HALVINGS):
            turn_s, turn_t = share * a, share * b
            new = _unit(add(add(n, scale(turn_s, s)), scale(turn_t, t)))
            better = _plane_distance(centre, first, second, new)
            # Near the maximum only rounding tells.
            if better >= gap or turn_s * turn_s + turn_t * turn_t < 1e-14:
                n = new
                break
            share *= 0.5
        gap = better
        if abs(a) + abs(b) < _LEAST_TURN:
            break
    return _Separation(n, first, second)


def _value(points: Pointer, p: Pointer, out: Pointer) -> None:
    n, first, second = _separation(points, p)
    other = _support(second, n)
    gap = dot(n, vector_at(points, POINT.first)) - _support(first, n).extent - other.extent
    out[GAP_OUT.gap] = gap
    put_vector(n, out, GAP_OUT.normal)
    put_vector(add(other.point, scale(0.5 * gap, n)), out, GAP_OUT.point)
    put_vector(tangent(n, POLE_TANGENTS[0]), out, GAP_OUT.first_tangent)
    put_vector(tangent(n, POLE_TANGENTS[1]), out, GAP_OUT.second_tangent)


def _slopes(points: Pointer, p: Pointer, out: Pointer) -> None:
    n, first, second = _separation(points, p)
    one, other = _support(first, n), _support(second, n)
    gap = dot(n, vector_at(points, POINT.first)) - one.extent - other.extent
    s, t = perpendicular_vectors(n)
    ss, st, tt = _sharpness(s, t, one.slope, other.slope, gap)
    inverse_determinant = 1.0 / (ss * tt - st * st)
    for j in range(SLOPE_WIDTH):
        moved = unit_vector(j % 3)
        if j >= POINT.second:
            # The point at which a plane touches goes along, and on from there, as the body turns under the plane.
            along = cross(moved, one.point)
            moved = subtract(product(one.slope, cross(moved, n)), along)
        rises = dot(n, moved)
        by_s, by_t = dot(s, moved), dot(t, moved)
        a, b = (tt * by_s - st * by_t) * inverse_determinant, (ss * by_t - st * by_s) * inverse_determinant
        turning = add(scale(a, s), scale(b, t))
        point = add(product(other.slope, turning), scale(0.5, add(scale(rises, n), scale(gap, turning))))
        out[GAP_SLOPE.gap + j] = rises
        put_vector(turning, out, GAP_SLOPE.normal + j, SLOPE_WIDTH)
        put_vector(point, out, GAP_SLOPE.point + j, SLOPE_WIDTH)
        first_tangent, second_tangent = POLE_TANGENTS
        put_vector(tangent_slope(n, turning, 0.0, first_tangent), out, GAP_SLOPE.first_tangent + j, SLOPE_WIDTH)
        put_vector(tangent_slope(n, turning, 0.0, second_tangent), out, GAP_SLOPE.second_tangent + j, SLOPE_WIDTH)


#: The gap between a body's ellipsoid, seen as three points, and another one, by its semi-axes, m.
ELLIPSOIDS = SignedDistance(name="ellipsoids", parameters=_SemiAxes._fields, value=_value, slopes=_slopes)
