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

from typing import NamedTuple

import numpy as np

from finger_pin.mechanism.gaps.ellipsoid import minimum_on_ball, semi_axes
from finger_pin.mechanism.gaps.prism import GAP, offset
from finger_pin.mechanism.gaps.signed_distance import POINT, part_axis, vector_at
from finger_pin.mechanism.gaps.vectors import (
    ZERO,
    Quadratic,
    Symmetric,
    Triple,
    Triples,
    divide,
    dot,
    norm,
    perpendicular_vectors,
    scale,
    subtract,
    weighted_sum,
)
from finger_pin.typing import Pointer

# Radians within which a part lies along a face.
EPSILON = 1e-5
#: Nearer to the core than this at least |w| is flattened, m.
INSIDE = 1e-9
_MOST_STEPS = 60
# By so much a step along a line lessens the slope of F.
_SLOPE_REDUCTION = 0.1
_ROUNDING = 1e-9


class _Pulls(NamedTuple):
    """Second slopes of the terms that draw the point to the middle, by s and by r / R, m."""

    along: float
    radial: float


def regularisation(points: Pointer, p: Pointer, s: float, square: float) -> float:
    """Return the regularisation that pulls to the middle in |w|, less its maximum; ``square`` is |r / R|^2."""
    along = EPSILON * norm(part_axis(points))
    return p[GAP.along] * along * ((s - 0.5) * (s - 0.5) - 0.25) + 0.5 * EPSILON * p[GAP.disc] * (square - 1.0)


def point_of_part(points: Pointer, s: float, r: Triple) -> Triple:
    """Return P_0 + s e + r."""
    start, axis = vector_at(points, POINT.first), part_axis(points)
    return start[0] + s * axis[0] + r[0], start[1] + s * axis[1] + r[1], start[2] + s * axis[2] + r[2]


def _on_segment(points: Pointer, p: Pointer, shrinkage: float, blunt: float) -> float:
    """Return s of the nearest point of a segment: the root of a function that rises with s, or an end."""
    axis = part_axis(points)
    a, b, c = axis
    pull = 2.0 * EPSILON * norm(axis)
    if pull == 0.0 or p[GAP.along] == 0.0:
        return 0.0
    s, low, high, first = 0.0, 0.0, 1.0, 0.0
    for k in range(_MOST_STEPS):
        x, y, z = points[POINT.first] + s * a, points[POINT.first + 1] + s * b, points[POINT.first + 2] + s * c
        w, d = offset((x, y, z), p, shrinkage)
        far = max(norm(w), blunt)
        closing = dot(axis, w)
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
        slope = a * a * d.xx + 2.0 * a * b * d.xy + b * b * d.yy + c * c * d.zz
        slope += pull * (far + (s - 0.5) * closing / far)
        new = s - rise / max(slope, pull * INSIDE)
        if abs(new - s) < 1e-15:
            return s
        s = new if low < new < high else 0.5 * (low + high)
    return s


def _minimum_on_disc(a: float, b: float, c: float, d: float, e: float) -> tuple[float, float]:
    """Return the minimum of (a u^2 + 2 b u v + c v^2) / 2 + d u + e v, convex, over u^2 + v^2 <= 1."""
    pull, u, v = 0.0, 0.0, 0.0
    for _ in range(_MOST_STEPS):
        pulled_a, pulled_c = a + pull, c + pull
        inverse = 1.0 / (pulled_a * pulled_c - b * b)
        u, v = (b * e - pulled_c * d) * inverse, (b * d - pulled_a * e) * inverse
        size = np.sqrt(u * u + v * v)
        if size <= 1.0 + (1e-15 if pull > 0.0 else 0.0):
            break
        # Newton for 1 / |u| = 1, which is concave in the pull.
        bent = (pulled_c * u * u - 2.0 * b * u * v + pulled_a * v * v) * inverse
        pull += (size - 1.0) * size * size / bent
    size = np.sqrt(u * u + v * v)
    return (u / size, v / size) if pull > 0.0 or size > 1.0 else (u, v)


def _quadratic_value(quadratic: Quadratic, u: float, v: float, s: float) -> float:
    h, g = quadratic
    return (
        0.5 * (h.xx * u * u + h.yy * v * v + h.zz * s * s)
        + h.xy * u * v
        + h.xz * u * s
        + h.yz * v * s
        + g[0] * u
        + g[1] * v
        + g[2] * s
    )


def _minimum(quadratic: Quadratic, along: float) -> Triple:
    """Return u, v, s of the minimum of a function, convex, over a disc times [0, along]."""
    h, g = quadratic
    if along > 0.0:
        free = 1.0 / h.zz
        u, v = _minimum_on_disc(
            h.xx - h.xz * h.xz * free,
            h.xy - h.xz * h.yz * free,
            h.yy - h.yz * h.yz * free,
            g[0] - h.xz * g[2] * free,
            g[1] - h.yz * g[2] * free,
        )
        s = -(g[2] + h.xz * u + h.yz * v) * free
        if 0.0 <= s <= along:
            return u, v, s
        u, v = _minimum_on_disc(h.xx, h.xy, h.yy, g[0] + h.xz * along, g[1] + h.yz * along)
        start_u, start_v = _minimum_on_disc(h.xx, h.xy, h.yy, g[0], g[1])
        if _quadratic_value(quadratic, u, v, along) < _quadratic_value(quadratic, start_u, start_v, 0.0):
            return u, v, along
        return start_u, start_v, 0.0
    u, v = _minimum_on_disc(h.xx, h.xy, h.yy, g[0], g[1])
    return u, v, 0.0


def _bilinear_form(f: Triple, g: Triple, d: Symmetric) -> float:
    """Return f^T D g, for the slope D of an offset."""
    return f[0] * (d.xx * g[0] + d.xy * g[1]) + f[1] * (d.xy * g[0] + d.yy * g[1]) + f[2] * d.zz * g[2]


def _place(points: Pointer, frame: Triples, place: Triple) -> Triple:
    """Return the point of a part at (u, v, s)."""
    start, (f, g, e), (u, v, s) = vector_at(points, POINT.first), frame, place
    return (
        start[0] + s * e[0] + u * f[0] + v * g[0],
        start[1] + s * e[1] + u * f[1] + v * g[1],
        start[2] + s * e[2] + u * f[2] + v * g[2],
    )


def _quadratic_expansion(
    points: Pointer, p: Pointer, shrinkage: float, blunt: float, frame: Triples, pulls: _Pulls, place: Triple
) -> Quadratic:
    """Return F |w| about a point of a part as a quadratic function of (u, v, s)."""
    (f, g, e), (u, v, s) = frame, place
    w, d = offset(_place(points, frame, place), p, shrinkage)
    far = max(norm(w), blunt)
    fd, gd, ed = _bilinear_form(f, f, d), _bilinear_form(g, g, d), _bilinear_form(e, e, d)
    fg, fe, ge = _bilinear_form(f, g, d), _bilinear_form(f, e, d), _bilinear_form(g, e, d)
    gradient = (
        dot(f, w) - fd * u - fg * v - fe * s,
        dot(g, w) - fg * u - gd * v - ge * s,
        dot(e, w) - fe * u - ge * v - ed * s - 0.5 * pulls.along * far,
    )
    return Quadratic(
        Symmetric(fd + pulls.radial * far, fg, fe, gd + pulls.radial * far, ge, ed + pulls.along * far), gradient
    )


def _line_search(
    points: Pointer,
    p: Pointer,
    shrinkage: float,
    blunt: float,
    frame: Triples,
    pulls: _Pulls,
    start: Triple,
    step: Triple,
) -> float:
    """Return the share of a step at which F is about least: of a small rising slope, or the whole step."""
    motion = weighted_sum(step, frame)
    low, high, below, above, share, first, side = 0.0, 1.0, -1.0, 1.0, 1.0, -1.0, 0
    for k in range(_MOST_STEPS):
        place = (start[0] + share * step[0], start[1] + share * step[1], start[2] + share * step[2])
        u, v, s = place
        w, _ = offset(_place(points, frame, place), p, shrinkage)
        rise = dot(motion, w) / max(norm(w), blunt)
        rise += pulls.radial * (u * step[0] + v * step[1]) + pulls.along * (s - 0.5) * step[2]
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


def _is_in_core(point: Triple, p: Pointer, shrinkage: float, blunt: float) -> bool:
    """Return whether a point is in the shrunk core: nothing is nearer."""
    w, _ = offset(point, p, shrinkage)
    return dot(w, w) < _ROUNDING * _ROUNDING * blunt * blunt


def nearest(points: Pointer, p: Pointer, shrinkage: float, blunt: float) -> tuple[float, Triple]:
    """Return s and r of a part's point nearest to the shrunk core; 0 and r from P_0 of an ellipsoid.

    Up to a distance ``blunt``, m, |w| counts as (|w|^2 / blunt + blunt) / 2, so that the point is unique inside too.
    """
    is_ellipsoid, along, pulls = p[GAP.third_semi_axis] > 0.0, p[GAP.along], _Pulls(0.0, 0.0)
    if is_ellipsoid:
        frame = semi_axes(points, p[GAP.third_semi_axis])
    elif p[GAP.disc] == 0.0:
        return _on_segment(points, p, shrinkage, blunt), ZERO
    else:
        axis, disc = part_axis(points), p[GAP.disc]
        length = norm(axis)
        f, g = perpendicular_vectors(divide(axis, length))
        frame = (scale(disc, f), scale(disc, g), axis)
        pulls = _Pulls(2.0 * EPSILON * length, EPSILON * disc)
    place, size = (0.0, 0.0, 0.5 * along), 1.0
    for _ in range(_MOST_STEPS):
        if is_ellipsoid and _is_in_core(_place(points, frame, place), p, shrinkage, blunt):
            break
        quadratic = _quadratic_expansion(points, p, shrinkage, blunt, frame, pulls, place)
        new = minimum_on_ball(quadratic, place) if is_ellipsoid else _minimum(quadratic, along)
        step = subtract(new, place)
        before, size = size, abs(step[0]) + abs(step[1]) + abs(step[2])
        # Steps that no longer shrink are those of rounding.
        if size < 1e-14 or (size < _ROUNDING and size > 0.5 * before):
            break
        share = _line_search(points, p, shrinkage, blunt, frame, pulls, place, step)
        place = (place[0] + share * step[0], place[1] + share * step[1], place[2] + share * step[2])
    if is_ellipsoid:
        return 0.0, weighted_sum(place, frame)
    (u, v, s), (f, g, _) = place, frame
    return s, (u * f[0] + v * g[0], u * f[1] + v * g[1], u * f[2] + v * g[2])
