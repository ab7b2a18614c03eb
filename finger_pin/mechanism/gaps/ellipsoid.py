"""An ellipsoid as the part of a body: the ball |u| <= 1 drawn out to x = P_0 + M u."""

from __future__ import annotations

from typing import Any

from finger_pin.mechanism.gaps.vectors import cross, dot, inverse_matrix, perpendicular_vectors, size, turned

_MOST_STEPS = 60
# Weight, in parts of a quadratic function's own, of the way from where one is: what is undetermined stays there.
_INERTIA_SHARE = 1e-6
# So far inside the ball, or nearer, a point lies on its surface.
_ON_SURFACE = 1e-6


def semi_axes(y: Any, third: float) -> Any:
    """Return the columns of M, m: P_1 - P_0, P_2 - P_0, and a vector of a length across both."""
    f, g = (y[3] - y[0], y[4] - y[1], y[5] - y[2]), (y[6] - y[0], y[7] - y[1], y[8] - y[2])
    e = cross(f, g)
    longer = third / size(e)
    return f, g, (longer * e[0], longer * e[1], longer * e[2])


def on_ball(h: Any, start: Any) -> Any:
    """Return the minimum of u^T H u / 2 + g . u, convex, over |u| <= 1; of several nearly the one nearest to a start.

    ``h`` has H as xx, xy, xz, yy, yz, zz, then g.
    """
    pull, u, far = 0.0, (0.0, 0.0, 0.0), 0.0
    k = _INERTIA_SHARE * (h[0] + h[3] + h[5])
    xx, yy, zz = h[0] + k, h[3] + k, h[5] + k
    for _ in range(_MOST_STEPS):
        inverse = inverse_matrix(xx + pull, h[1], h[2], yy + pull, h[4], zz + pull)
        u = turned(inverse, k * start[0] - h[6], k * start[1] - h[7], k * start[2] - h[8])
        far = size(u)
        if far <= 1.0 + (1e-15 if pull > 0.0 else 0.0):
            break
        # Newton for 1 / |u| = 1, which is concave in the pull.
        bent = turned(inverse, u[0], u[1], u[2])
        pull += (far - 1.0) * far * far / dot(u, bent)
    shorter = 1.0 / far if pull > 0.0 or far > 1.0 else 1.0
    return shorter * u[0], shorter * u[1], shorter * u[2]


def is_inside(y: Any, third: float, r: Any) -> Any:
    """Return whether a point r from P_0 lies inside: there the bodies have more than a point in common."""
    f, g, e = semi_axes(y, third)
    return size((dot(r, f) / dot(f, f), dot(r, g) / dot(g, g), dot(r, e) / dot(e, e))) < 1.0 - _ON_SURFACE


def sliding(y: Any, third: float, n: Any, h: Any) -> Any:
    """Return the directions in which the nearest point slides on an ellipsoid, and its stiffness inverted.

    With the slope n and the Hessian H of what it minimises, |M^T n| u = -M^T n there. So it slides along M t for both t
    across u, against t^T M^T H M t + |M^T n|. The third direction is zero; so are all where there is no slope.
    """
    f, g, e = semi_axes(y, third)
    zero = (0.0, 0.0, 0.0)
    push = (dot(f, n), dot(g, n), dot(e, n))
    held = size(push)
    if held == 0.0:
        return zero, zero, zero, (1.0, 0.0, 0.0, 1.0, 0.0, 1.0)
    s, t = perpendicular_vectors(-push[0] / held, -push[1] / held, -push[2] / held)
    one, two = apply_matrix(f, g, e, s), apply_matrix(f, g, e, t)
    by_one, by_two = turned(h, one[0], one[1], one[2]), turned(h, two[0], two[1], two[2])
    stiff = inverse_matrix(dot(one, by_one) + held, dot(one, by_two), 0.0, dot(two, by_two) + held, 0.0, 1.0)
    return zero, one, two, stiff


def apply_matrix(f: Any, g: Any, e: Any, u: Any) -> Any:
    """Return M u."""
    return (
        u[0] * f[0] + u[1] * g[0] + u[2] * e[0],
        u[0] * f[1] + u[1] * g[1] + u[2] * e[1],
        u[0] * f[2] + u[1] * g[2] + u[2] * e[2],
    )
