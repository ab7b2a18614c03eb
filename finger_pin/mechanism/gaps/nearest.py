"""The point of a body's part that is nearest to a prism's core.

A part is x = P_0 + s e + r, with s in [0, along], e = P_1 - P_0 and r in the plane across e, |r| <= R: a point, a
segment, a disc, or a cylinder. Or it is an ellipsoid, P_0 + M u with |u| <= 1, of semi-axes P_1 - P_0, P_2 - P_0, and
one of length c across them. The nearest point minimises a convex function,

    F = |w(x)| + kappa_s (s - 1/2)^2 / 2 + kappa_r |r / R|^2 / 2,      kappa_s = 2 epsilon |e|,  kappa_r = epsilon R.

The last two terms matter only where a part lies along a face to within epsilon rad: they draw the point to its middle,
so that it moves smoothly from end to end while the part tilts. What they add at most is taken off the distance: it is
exact at the ends and on the rim, and at most epsilon (|e| / 4 + R / 2) too low between them. An ellipsoid needs none.

F is iterated: |w| <= (|w|^2 / |w_0| + |w_0|) / 2, and |w|^2 is a quadratic function as long as the nearest face, edge
or corner stays the same. Its minimum over a disc times an interval, or over a ball, has a closed form but for one root.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from finger_pin.mechanism.gaps.ellipsoid import apply_matrix, on_ball, semi_axes
from finger_pin.mechanism.gaps.prism import GAP, offset
from finger_pin.mechanism.gaps.vectors import perpendicular_vectors

# Radians within which a part lies along a face.
EPSILON = 1e-5
#: Nearer to the core than this at least |w| is flattened, m.
INSIDE = 1e-9
_MOST_STEPS = 60
# By so much a step along a line lessens the slope of F.
_SLOPE_REDUCTION = 0.1
_ROUNDING = 1e-9


def regularisation(y: Any, p: Any, s: float, square: float) -> Any:
    """Return the regularisation that pulls to the middle in |w|, less its maximum; ``square`` is |r / R|^2."""
    a, b, c = y[3] - y[0], y[4] - y[1], y[5] - y[2]
    along = EPSILON * np.sqrt(a * a + b * b + c * c)
    return p[GAP.along] * along * ((s - 0.5) * (s - 0.5) - 0.25) + 0.5 * EPSILON * p[GAP.disc] * (square - 1.0)


def _on_segment(y: Any, p: Any, sunk: float, blunt: float) -> Any:
    """Return s of the nearest point of a segment: the root of a function that rises with s, or an end."""
    a, b, c = y[3] - y[0], y[4] - y[1], y[5] - y[2]
    pull = 2.0 * EPSILON * np.sqrt(a * a + b * b + c * c)
    if pull == 0.0 or p[GAP.along] == 0.0:
        return 0.0
    s, low, high, first = 0.0, 0.0, 1.0, 0.0
    for k in range(_MOST_STEPS):
        u, v, w, xx, xy, yy, zz = offset(y[0] + s * a, y[1] + s * b, y[2] + s * c, p, sunk)
        far = max(np.sqrt(u * u + v * v + w * w), blunt)
        closing = a * u + b * v + c * w
        rise = closing + pull * far * (s - 0.5)
        if k == 0:
            if rise >= 0.0:
                return 0.0
            first, s = rise, 1.0
            continue
        if k == 1:
            if rise <= 0.0:
                return 1.0
            s = first / (first - rise)
            continue
        if rise > 0.0:
            high = s
        else:
            low = s
        slope = a * a * xx + 2.0 * a * b * xy + b * b * yy + c * c * zz
        slope += pull * (far + (s - 0.5) * closing / far)
        new = s - rise / max(slope, pull * INSIDE)
        if abs(new - s) < 1e-15:
            return s
        s = new if low < new < high else 0.5 * (low + high)
    return s


def _on_disc(a: float, b: float, c: float, d: float, e: float) -> Any:
    """Return the minimum of (a u^2 + 2 b u v + c v^2) / 2 + d u + e v, convex, over u^2 + v^2 <= 1."""
    pull, u, v = 0.0, 0.0, 0.0
    for _ in range(_MOST_STEPS):
        one, other = a + pull, c + pull
        inverse = 1.0 / (one * other - b * b)
        u, v = (b * e - other * d) * inverse, (b * d - one * e) * inverse
        size = np.sqrt(u * u + v * v)
        if size <= 1.0 + (1e-15 if pull > 0.0 else 0.0):
            break
        # Newton for 1 / |u| = 1, which is concave in the pull.
        bent = (other * u * u - 2.0 * b * u * v + one * v * v) * inverse
        pull += (size - 1.0) * size * size / bent
    size = np.sqrt(u * u + v * v)
    return (u / size, v / size) if pull > 0.0 or size > 1.0 else (u, v)


def _model(h: Any, u: float, v: float, s: float) -> Any:
    return (
        0.5 * (h[0] * u * u + h[3] * v * v + h[5] * s * s)
        + h[1] * u * v
        + h[2] * u * s
        + h[4] * v * s
        + h[6] * u
        + h[7] * v
        + h[8] * s
    )


def _minimum(h: Any, along: float) -> Any:
    """Return u, v, s of the minimum of a quadratic function, convex, over a disc times [0, along]."""
    if along > 0.0:
        free = 1.0 / h[5]
        u, v = _on_disc(
            h[0] - h[2] * h[2] * free,
            h[1] - h[2] * h[4] * free,
            h[3] - h[4] * h[4] * free,
            h[6] - h[2] * h[8] * free,
            h[7] - h[4] * h[8] * free,
        )
        s = -(h[8] + h[2] * u + h[4] * v) * free
        if 0.0 <= s <= along:
            return u, v, s
        u, v = _on_disc(h[0], h[1], h[3], h[6] + h[2] * along, h[7] + h[4] * along)
        u_, v_ = _on_disc(h[0], h[1], h[3], h[6], h[7])
        if _model(h, u, v, along) < _model(h, u_, v_, 0.0):
            return u, v, along
        return u_, v_, 0.0
    u, v = _on_disc(h[0], h[1], h[3], h[6], h[7])
    return u, v, 0.0


def _bilinear_form(f: Any, g: Any, d: Any) -> Any:
    """Return f^T D g, D as xx, xy, yy, zz."""
    return f[0] * (d[0] * g[0] + d[1] * g[1]) + f[1] * (d[1] * g[0] + d[2] * g[1]) + f[2] * d[3] * g[2]


def _place(y: Any, frame: Any, u: float, v: float, s: float) -> Any:
    f, g, e = frame
    return (
        y[0] + s * e[0] + u * f[0] + v * g[0],
        y[1] + s * e[1] + u * f[1] + v * g[1],
        y[2] + s * e[2] + u * f[2] + v * g[2],
    )


def _quadratic_expansion(
    y: Any, p: Any, sunk: float, blunt: float, frame: Any, pulls: Any, u: float, v: float, s: float
) -> Any:
    """Return F |w| about a point of a part as a quadratic function: its second slopes, then its first ones at 0."""
    f, g, e = frame
    x, y_, z = _place(y, frame, u, v, s)
    w = offset(x, y_, z, p, sunk)
    d = (w[3], w[4], w[5], w[6])
    far = max(np.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]), blunt)
    fd, gd, ed = _bilinear_form(f, f, d), _bilinear_form(g, g, d), _bilinear_form(e, e, d)
    fg, fe, ge = _bilinear_form(f, g, d), _bilinear_form(f, e, d), _bilinear_form(g, e, d)
    return (
        fd + pulls[1] * far,
        fg,
        fe,
        gd + pulls[1] * far,
        ge,
        ed + pulls[0] * far,
        f[0] * w[0] + f[1] * w[1] + f[2] * w[2] - fd * u - fg * v - fe * s,
        g[0] * w[0] + g[1] * w[1] + g[2] * w[2] - fg * u - gd * v - ge * s,
        e[0] * w[0] + e[1] * w[1] + e[2] * w[2] - fe * u - ge * v - ed * s - 0.5 * pulls[0] * far,
    )


def _line_search(y: Any, p: Any, sunk: float, blunt: float, frame: Any, pulls: Any, start: Any, step: Any) -> Any:
    """Return the share of a step at which F is about least: of a small rising slope, or the whole step."""
    f, g, e = frame
    x, y_, z = (
        step[0] * f[0] + step[1] * g[0] + step[2] * e[0],
        step[0] * f[1] + step[1] * g[1] + step[2] * e[1],
        step[0] * f[2] + step[1] * g[2] + step[2] * e[2],
    )
    low, high, below, above, share, first, side = 0.0, 1.0, -1.0, 1.0, 1.0, -1.0, 0
    for k in range(_MOST_STEPS):
        u, v, s = start[0] + share * step[0], start[1] + share * step[1], start[2] + share * step[2]
        a, b, c = _place(y, frame, u, v, s)
        w = offset(a, b, c, p, sunk)
        far = max(np.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]), blunt)
        rise = (x * w[0] + y_ * w[1] + z * w[2]) / far
        rise += pulls[1] * (u * step[0] + v * step[1]) + pulls[0] * (s - 0.5) * step[2]
        if k == 0:
            if rise <= 0.0:
                return 1.0
            above, share = rise, 0.0
            continue
        if k == 1:
            if above <= -_SLOPE_REDUCTION * rise or rise >= 0.0:
                return 1.0
            below = first = rise
        # The rule of false position after Illinois.
        elif rise > 0.0:
            high, above, below = share, rise, (0.5 * below if side > 0 else below)
            side = 1
        else:
            low, below, above = share, rise, (0.5 * above if side < 0 else above)
            side = -1
        if k > 1 and abs(rise) <= -_SLOPE_REDUCTION * first:
            break
        share = (low * above - high * below) / (above - below)
    return share


def _is_in_core(x: Any, p: Any, sunk: float, blunt: float) -> Any:
    """Return whether a point is in the shrunk core: nothing is nearer."""
    w = offset(x[0], x[1], x[2], p, sunk)
    return w[0] * w[0] + w[1] * w[1] + w[2] * w[2] < _ROUNDING * _ROUNDING * blunt * blunt


def nearest(y: Any, p: Any, sunk: float, blunt: float) -> Any:
    """Return s and r of the point nearest to the shrunk core of a part whose points are y; 0 and r of an ellipsoid.

    Up to a distance ``blunt``, m, |w| counts as (|w|^2 / blunt + blunt) / 2, so that the point is unique inside too.
    """
    whole, along, pulls = p[GAP.third] > 0.0, p[GAP.along], (0.0, 0.0)
    if whole:
        f, g, e = semi_axes(y, p[GAP.third])
    elif p[GAP.disc] == 0.0:
        return _on_segment(y, p, sunk, blunt), 0.0, 0.0, 0.0
    else:
        e, big = (y[3] - y[0], y[4] - y[1], y[5] - y[2]), p[GAP.disc]
        length = np.sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2])
        f, g = perpendicular_vectors(e[0] / length, e[1] / length, e[2] / length)
        f, g = (big * f[0], big * f[1], big * f[2]), (big * g[0], big * g[1], big * g[2])
        pulls = (2.0 * EPSILON * length, EPSILON * big)
    u, v, s, size = 0.0, 0.0, 0.5 * along, 1.0
    for _ in range(_MOST_STEPS):
        if whole and _is_in_core(_place(y, (f, g, e), u, v, s), p, sunk, blunt):
            break
        h = _quadratic_expansion(y, p, sunk, blunt, (f, g, e), pulls, u, v, s)
        d_u, d_v, d_s = on_ball(h, (u, v, s)) if whole else _minimum(h, along)
        d_u, d_v, d_s = d_u - u, d_v - v, d_s - s
        before, size = size, abs(d_u) + abs(d_v) + abs(d_s)
        # Steps that no longer shrink are those of rounding.
        if size < 1e-14 or (size < _ROUNDING and size > 0.5 * before):
            break
        share = _line_search(y, p, sunk, blunt, (f, g, e), pulls, (u, v, s), (d_u, d_v, d_s))
        u, v, s = u + share * d_u, v + share * d_v, s + share * d_s
    if whole:
        x, y_, z = apply_matrix(f, g, e, (u, v, s))
        return 0.0, x, y_, z
    return s, u * f[0] + v * g[0], u * f[1] + v * g[1], u * f[2] + v * g[2]


@dataclass(frozen=True)
class SignedDistance:
    """The distance between a part of body A, seen as two points, and the shape of body W, in the frame of that shape.

    A positive distance is the true one or a lower bound of it, and it changes by no more than the points of both bodies
    move against each other: it is Lipschitz 1 in the motion of their material. Both are convex, and the plane across
    the normal has each on its own side. Detection in time rests on all three. The normal is the distance's gradient,
    wherever it is negative too, so that the work of a force along it is that of the distance.

    Attributes:
        name: For messages.
        parameters: Names of its numbers; ``p`` holds them in this order.
        value: (y, p, out). y has the points of A's part, such as the ends of a capsule's axis, twice the same for a
            sphere, or three of an ellipsoid, shape (6,) or (9,), m. Fills out[0] with the signed distance, negative for
            penetration, m; out[1:4] with the normal from W towards A, a unit vector but deep in an edge; out[4:7] with
            the contact point, midway between the surfaces, m; out[7:10] and out[10:13] with two tangents as long,
            right-handed with the normal.
        slopes: (y, p, out). Fills out[:72] with d(out[1:13])/dy, 12 x 6 row by row, and out[72:78] with
            d(distance)/dy, for motions that keep the points' distance. Of three points, by the velocity of the first
            and the angular velocity of A instead of y.
    """

    name: str
    parameters: tuple[str, ...]
    value: Callable[..., Any]
    slopes: Callable[..., Any]
    columns: ClassVar[int] = 4
