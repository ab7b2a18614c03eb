"""An ellipsoid as the part of a body: the ball |u| <= 1 drawn out to x = P_0 + M u."""

from __future__ import annotations

from finger_pin.mechanism.gaps.signed_distance import POINT, part_axis, vector_at
from finger_pin.mechanism.gaps.vectors import (
    ZERO,
    Quadratic,
    Symmetric,
    Triple,
    Triples,
    cross,
    dot,
    inverse,
    norm,
    perpendicular_vectors,
    product,
    scale,
    subtract,
    weighted_sum,
)
from finger_pin.typing import Pointer

_MOST_STEPS = 60
# Weight, in parts of a quadratic function's own, of the way from where one is: what is undetermined stays there.
_INERTIA_SHARE = 1e-6
# So far inside the ball, or nearer, a point lies on its surface.
_ON_SURFACE = 1e-6


def semi_axes(points: Pointer, third_semi_axis: float) -> Triples:
    """Return the columns of M, m: P_1 - P_0, P_2 - P_0, and a vector of a length across both."""
    f, g = part_axis(points), subtract(vector_at(points, POINT.third), vector_at(points, POINT.first))
    e = cross(f, g)
    return f, g, scale(third_semi_axis / norm(e), e)


def minimum_on_ball(quadratic: Quadratic, start: Triple) -> Triple:
    """Return the minimum of a function, convex, over |u| <= 1; of several nearly the one nearest to a start."""
    h, gradient = quadratic
    pull, u, far = 0.0, ZERO, 0.0
    k = _INERTIA_SHARE * (h.xx + h.yy + h.zz)
    xx, yy, zz = h.xx + k, h.yy + k, h.zz + k
    for _ in range(_MOST_STEPS):
        inverted = inverse(Symmetric(xx + pull, h.xy, h.xz, yy + pull, h.yz, zz + pull))
        u = product(inverted, subtract(scale(k, start), gradient))
        far = norm(u)
        if far <= 1.0 + (1e-15 if pull > 0.0 else 0.0):
            break
        # Newton for 1 / |u| = 1, which is concave in the pull.
        pull += (far - 1.0) * far * far / dot(u, product(inverted, u))
    return scale(1.0 / far if pull > 0.0 or far > 1.0 else 1.0, u)


def is_inside(points: Pointer, third_semi_axis: float, r: Triple) -> bool:
    """Return whether a point r from P_0 lies inside: there the bodies have more than a point in common."""
    f, g, e = semi_axes(points, third_semi_axis)
    return norm((dot(r, f) / dot(f, f), dot(r, g) / dot(g, g), dot(r, e) / dot(e, e))) < 1.0 - _ON_SURFACE


def sliding(points: Pointer, third_semi_axis: float, n: Triple, h: Symmetric) -> tuple[Triples, Symmetric]:
    """Return the directions in which the nearest point slides on an ellipsoid, and its stiffness inverted.

    With the slope n and the Hessian H of what it minimises, |M^T n| u = -M^T n there. So it slides along M t for both t
    across u, against t^T M^T H M t + |M^T n|. The third direction is zero; so are all where there is no slope.
    """
    axes = semi_axes(points, third_semi_axis)
    f, g, e = axes
    push = (dot(f, n), dot(g, n), dot(e, n))
    held = norm(push)
    if held == 0.0:
        return (ZERO, ZERO, ZERO), Symmetric(1.0, 0.0, 0.0, 1.0, 0.0, 1.0)
    s, t = perpendicular_vectors((-push[0] / held, -push[1] / held, -push[2] / held))
    first, second = weighted_sum(s, axes), weighted_sum(t, axes)
    by_first, by_second = product(h, first), product(h, second)
    stiffness = Symmetric(
        *(dot(first, by_first) + held, dot(first, by_second), 0.0, dot(second, by_second) + held, 0.0, 1.0)
    )
    return (first, second, ZERO), inverse(stiffness)
