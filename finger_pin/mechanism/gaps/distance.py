"""The gap between a part of one body and another body, with its slopes.

A part is a point, a segment, a disc or a cylinder, with a rounding of its own; see `nearest`. The other body is a
rounded prism. By the implicit function theorem the nearest point moves so that it stays the minimum.

Distances are exact, to within what `nearest` takes off, down to a level l, the part's core from the prism's, of half of
both roundings, l_0. Deeper, the prism's core shrinks on all sides as the part sinks in, and its rounding grows:

    |w| = l + c(u),    u = l_0 - l,    with w the offset from the core shrunk by c.

So the part stays outside of the core, faces are as deep as they are, and edges grow round with the depth: dc/du rises
from 0 to 2 over l_0, and falls to 0 again before all of the least half-width is taken. Levels are convex, and the
gradient of l is continuous: n / (1 + (S - 1) dc/du), where S = d|w|/dc is |n_x| + |n_y| + |n_z| for a box. Its length
is 1 over a face, and less beside an edge. Tangents are as long, so that friction keeps within its cone, and the work of
the force is the change of what the law stores.

Nearer to what is left of the core than half of the rounding there, |w| counts as (|w|^2 / b + b) / 2: the force goes to
zero where the way out turns round, as through the middle of a plate.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.mechanism.gaps.ellipsoid import is_inside, sliding
from finger_pin.mechanism.gaps.nearest import EPSILON, INSIDE, SignedDistance, nearest, regularisation
from finger_pin.mechanism.gaps.prism import GAP, GapParameters, inradius, offset, surface
from finger_pin.mechanism.gaps.vectors import cross, dot, inverse_matrix, turned

# Tangents are turned from those of one direction, (2, 3, 6) / 7, to those of the normal, the short way. They jump only
# for its opposite, which is no normal of a face and lies on no plane of symmetry of a shape.
_POLE_X, _POLE_Y, _POLE_Z = 2.0 / 7.0, 3.0 / 7.0, 6.0 / 7.0
#: Tangents of that direction.
POLE_TANGENT_1, POLE_TANGENT_2 = (3.0 / 7.0, -6.0 / 7.0, 2.0 / 7.0), (6.0 / 7.0, 2.0 / 7.0, -3.0 / 7.0)
_LEAST = 1e-12
# The level is iterated to this, m, in so many steps at most.
_LEVEL_ACCURACY, _MOST_STEPS = 1e-15, 40


def _offset_slopes(w: Any, p: Any) -> Any:
    """Return dw/dc, by the shrinking of the core, and its product with w / |w|."""
    a, b, c = np.sign(w[0]), np.sign(w[1]), np.sign(w[2])
    if p[GAP.rim] > 0.0:
        across = np.sqrt(w[0] * w[0] + w[1] * w[1])
        a, b = (w[0] / across, w[1] / across) if across > 0.0 else (0.0, 0.0)
    far = np.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    return a, b, c, ((a * w[0] + b * w[1] + c * w[2]) / far if far > 0.0 else 1.0)


def _nearest(y: Any, p: Any, sunk: float, blunt: float) -> Any:
    """Return the part's distance from the shrunk core, blunted, its slopes by |w| and by c, and s and r."""
    s, x, y_, z = nearest(y, p, sunk, blunt)
    w = offset(y[0] + s * (y[3] - y[0]) + x, y[1] + s * (y[4] - y[1]) + y_, y[2] + s * (y[5] - y[2]) + z, p, sunk)
    square = (x * x + y_ * y_ + z * z) / (p[GAP.disc] * p[GAP.disc]) if p[GAP.disc] > 0.0 else 1.0
    far = np.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    size, far = (1.0, far) if far >= blunt else (far / blunt, 0.5 * (far * far / blunt + blunt))
    if p[GAP.third] > 0.0 and is_inside(y, p[GAP.third], (x, y_, z)):
        size, far = 0.0, 0.5 * blunt
    return far + regularisation(y, p, s, square), size, _offset_slopes(w, p)[3], s, x, y_, z


def _ramps(start: float, most: float) -> Any:
    """Return the lengths over which dc/du rises and falls, its maximum, and its second zero."""
    rise = min(start, np.sqrt(0.5 * most * start))
    peak, fall = 2.0 * rise / start, max(rise, 0.5 * most)
    return rise, fall, peak, most / peak + 0.5 * (rise + fall)


def _shrunk(u: float, start: float, most: float) -> Any:
    """Return c, dc/du and d2c/du2."""
    rise, fall, peak, end = _ramps(start, most)
    if u >= end:
        return most, 0.0, 0.0
    if u < rise:
        return u * u / start, 2.0 * u / start, 2.0 / start
    if u < end - fall:
        return peak * (u - 0.5 * rise), peak, 0.0
    return most - 0.5 * peak * (end - u) * (end - u) / fall, peak * (end - u) / fall, -peak / fall


def _level_of_core(y: Any, p: Any) -> Any:
    """Return the level l; its slope by |w|; c; dc/du and d2c/du2; that slope's own where l is flat, else 0; s and r."""
    start, most = 0.5 * (p[GAP.radius] + p[GAP.rounding]), inradius(p)
    blunt = max((0.5 if most == 0.0 else 0.25) * start, INSIDE)
    far, size, spread, s, x, y_, z = _nearest(y, p, 0.0, blunt)
    if far >= start or most == 0.0 or start == 0.0:
        return far, size, 0.0, 0.0, 0.0, (1.0 / blunt if size < 1.0 else 0.0), s, x, y_, z
    end = _ramps(start, most)[3]
    # What is asked for is the root of a function of u that rises; where the core is reached, only its far end is known.
    low, high, u, sunk, rate, bend = 0.0, np.inf, start - far if size == 1.0 else end, 0.0, 0.0, 0.0
    for _ in range(_MOST_STEPS):
        u = min(u, end)
        sunk, rate, bend = _shrunk(u, start, most)
        least = max(0.5 * (start - end + most), INSIDE) if u == end else blunt
        far, size, spread, s, x, y_, z = _nearest(y, p, sunk, least)
        excess = far - sunk - start + u
        if u == end and excess <= 0.0:
            return far - most, size, most, 0.0, 0.0, (1.0 / least if size < 1.0 else 0.0), s, x, y_, z
        step = excess / (1.0 + (spread - 1.0) * rate)
        if abs(step) < _LEVEL_ACCURACY:
            break
        low, high = (low, u) if excess > 0.0 else (u, high)
        # By Newton, or by halves where that leaves what is known of the root.
        u = u - step if size == 1.0 and low < u - step < high else min(0.5 * (low + high), end)
    return start - u, 1.0 / (1.0 + (spread - 1.0) * rate), sunk, rate, bend, 0.0, s, x, y_, z


def tangent(u: float, v: float, w: float, of_pole: Any, out: Any, at: int) -> None:
    """Write a tangent of the pole, turned to the normal (u, v, w)."""
    a, b, c = of_pole
    share = (a * u + b * v + c * w) / max(1.0 + _POLE_X * u + _POLE_Y * v + _POLE_Z * w, _LEAST)
    out[at] = a - share * (u + _POLE_X)
    out[at + 1] = b - share * (v + _POLE_Y)
    out[at + 2] = c - share * (w + _POLE_Z)


def tangent_slope(n: Any, moved: Any, growing: float, of_pole: Any, out: Any, at: int) -> None:
    """Write the derivative of a tangent by a motion of the normal n into a column of ``out``."""
    a, b, c = of_pole
    whole = max(1.0 + _POLE_X * n[0] + _POLE_Y * n[1] + _POLE_Z * n[2], _LEAST)
    share = (a * n[0] + b * n[1] + c * n[2]) / whole
    change = (a * moved[0] + b * moved[1] + c * moved[2]) / whole + growing * share
    change -= share * (_POLE_X * moved[0] + _POLE_Y * moved[1] + _POLE_Z * moved[2]) / whole
    out[at] = growing * a - change * (n[0] + _POLE_X) - share * moved[0]
    out[at + 6] = growing * b - change * (n[1] + _POLE_Y) - share * moved[1]
    out[at + 12] = growing * c - change * (n[2] + _POLE_Z) - share * moved[2]


def _value(y: Any, p: Any, out: Any) -> None:
    level, size, sunk, _, _, _, s, r_x, r_y, r_z = _level_of_core(y, p)
    x_, y_, z_ = y[0] + s * (y[3] - y[0]) + r_x, y[1] + s * (y[4] - y[1]) + r_y, y[2] + s * (y[5] - y[2]) + r_z
    _, u, v, w, _, _, _, _, _, _ = surface(x_, y_, z_, p, sunk)
    out[0] = level - p[GAP.rounding] - p[GAP.radius]
    tangent(u, v, w, POLE_TANGENT_1, out, 7)
    tangent(u, v, w, POLE_TANGENT_2, out, 10)
    for i in range(7, 13):
        out[i] *= size
    out[1], out[2], out[3] = size * u, size * v, size * w
    back = p[GAP.radius] + 0.5 * out[0]
    out[4], out[5], out[6] = x_ - back * out[1], y_ - back * out[2], z_ - back * out[3]


def _free_directions(y: Any, p: Any, s: float, r: Any, n: Any, h: Any) -> Any:
    """Return the directions in which the nearest point is free to move, and the inverse of its stiffness.

    The directions are e, a unit vector along r, and one across; those that are not free are zero.
    """
    e = (y[3] - y[0], y[4] - y[1], y[5] - y[2])
    length, size = np.sqrt(dot(e, e)), np.sqrt(dot(r, r))
    zero = (0.0, 0.0, 0.0)
    pull_s, pull_r = 2.0 * EPSILON * length, EPSILON * p[GAP.disc]
    out, across, on_rim = zero, zero, False
    if p[GAP.disc] > 0.0:
        on_rim = size > p[GAP.disc] * (1.0 - 1e-13)
        if size > 0.0:
            out = (r[0] / size, r[1] / size, r[2] / size)
        else:
            least = abs(e[0]) <= abs(e[1])
            size = np.sqrt(e[2] * e[2] + (e[1] * e[1] if least else e[0] * e[0]))
            out = (0.0, e[2] / size, -e[1] / size) if least else (-e[2] / size, 0.0, e[0] / size)
        across = (
            (e[1] * out[2] - e[2] * out[1]) / length,
            (e[2] * out[0] - e[0] * out[2]) / length,
            (e[0] * out[1] - e[1] * out[0]) / length,
        )
    # In units of r and s: the disc's pull is kappa_r / R^2 per m; on its rim the circle's curvature stands for that.
    stiff = pull_r / (p[GAP.disc] * p[GAP.disc]) if p[GAP.disc] > 0.0 else 1.0
    bent = -dot(out, n) / p[GAP.disc] if on_rim else stiff
    free_s = p[GAP.along] > 0.0 and 0.0 < s < p[GAP.along] and length > 0.0
    if on_rim:
        out = zero
    along = e if free_s else zero
    h_out, h_across, h_along = (
        turned(h, out[0], out[1], out[2]),
        turned(h, across[0], across[1], across[2]),
        turned(h, along[0], along[1], along[2]),
    )
    inverse = inverse_matrix(
        dot(out, h_out) + (1.0 if on_rim else stiff),
        dot(out, h_across),
        dot(out, h_along),
        dot(across, h_across) + bent,
        dot(across, h_along),
        dot(along, h_along) + (pull_s if free_s else 1.0),
    )
    return along, out, across, inverse


def _nearest_point_motion(j: int, s: float, r: Any, n: Any, axis: Any, shorter: float, whole: bool) -> Any:
    """Return the motion of the nearest point by one component of y, at constant s, with r turned with the axis.

    An ellipsoid moves as a whole, and what turns it turns the normal as it sees it. That is returned too, and the sign
    with which a component turns the axis, its place k, and how far the distance changes: s and r minimise it.
    """
    k, share, sign = (j, 1.0 - s, -1.0) if j < 3 else (j - 3, s, 1.0)
    if whole and j > 2:
        swing = (1.0 * (k == 0), 1.0 * (k == 1), 1.0 * (k == 2))
        moved = cross(swing, r)
        return moved, cross(swing, n), sign, k, dot(n, moved)
    tilt = -sign * r[k] * shorter
    moved = share * (k == 0) + tilt * axis[0], share * (k == 1) + tilt * axis[1], share * (k == 2) + tilt * axis[2]
    return moved, (0.0, 0.0, 0.0), sign, k, share * n[k] - sign * r[k] * (dot(axis, n) * shorter)


def _slopes(y: Any, p: Any, out: Any) -> None:
    level, size, sunk, rate, bend, flat, s, r_x, r_y, r_z = _level_of_core(y, p)
    a, b, c = y[3] - y[0], y[4] - y[1], y[5] - y[2]
    x_, y_, z_ = y[0] + s * a + r_x, y[1] + s * b + r_y, y[2] + s * c + r_z
    far, u, v, w, xx, xy, xz, yy, yz, zz = surface(x_, y_, z_, p, sunk)
    unit, n, h, r = (u, v, w), (u, v, w), (xx, xy, xz, yy, yz, zz), (r_x, r_y, r_z)
    if flat > 0.0:
        # What the point minimises goes as |w|^2.
        u_, v_, w_, xx, xy, yy, zz = offset(x_, y_, z_, p, sunk)
        flat = flat if size > 0.0 else 0.0
        n, h = (flat * u_, flat * v_, flat * w_), (flat * xx, flat * xy, 0.0, flat * yy, 0.0, flat * zz)
    back = p[GAP.radius] + 0.5 * (level - p[GAP.rounding] - p[GAP.radius])
    length = np.sqrt(a * a + b * b + c * c)
    whole = p[GAP.third] > 0.0
    shorter = 1.0 / length if length > 0.0 and not whole else 0.0
    axis = (a * shorter, b * shorter, c * shorter)
    along, radial, across, inverse = sliding(y, p[GAP.third], n, h) if whole else _free_directions(y, p, s, r, n, h)
    leaning = dot(axis, n) * shorter
    # The motion of the normal at one place, by c.
    sinking, turning, spread = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0
    if rate > 0.0:
        f, g, k, spread = _offset_slopes(offset(x_, y_, z_, p, sunk), p)
        sinking, turning = (f, g, k), ((f - spread * u) / far, (g - spread * v) / far, (k - spread * w) / far)
    for j in range(6):
        (dx, dy, dz), swung, sign, k, change = _nearest_point_motion(j, s, r, n, axis, shorter, whole)
        shrinks = -rate * size * change
        d = turned(h, dx, dy, dz)
        d = (d[0] + shrinks * turning[0], d[1] + shrinks * turning[1], d[2] + shrinks * turning[2])
        of_along = -dot(along, d) - (sign * n[k] if along[0] != 0.0 or along[1] != 0.0 or along[2] != 0.0 else 0.0)
        of_radial = dot(radial, swung) - dot(radial, d) + sign * leaning * radial[k]
        of_across = dot(across, swung) - dot(across, d) + sign * leaning * across[k]
        by_radial = inverse[0] * of_radial + inverse[1] * of_across + inverse[2] * of_along
        by_across = inverse[1] * of_radial + inverse[3] * of_across + inverse[4] * of_along
        by_along = inverse[2] * of_radial + inverse[4] * of_across + inverse[5] * of_along
        dx += by_radial * radial[0] + by_across * across[0] + by_along * along[0]
        dy += by_radial * radial[1] + by_across * across[1] + by_along * along[1]
        dz += by_radial * radial[2] + by_across * across[2] + by_along * along[2]
        du, dv, dw = turned(h, dx, dy, dz)
        moved = (du + shrinks * turning[0], dv + shrinks * turning[1], dw + shrinks * turning[2])
        if flat > 0.0:
            slope, growing = change, dot(unit, moved)
            moved = (moved[0] - growing * u, moved[1] - growing * v, moved[2] - growing * w)
        else:
            slope = size * change
            growing = size * size * ((spread - 1.0) * bend * slope - rate * dot(sinking, moved))
            moved = (size * moved[0], size * moved[1], size * moved[2])
        du, dv, dw = moved[0] + growing * u, moved[1] + growing * v, moved[2] + growing * w
        out[72 + j] = slope
        out[j], out[6 + j], out[12 + j] = du, dv, dw
        out[18 + j] = dx - back * du - 0.5 * slope * size * u
        out[24 + j] = dy - back * dv - 0.5 * slope * size * v
        out[30 + j] = dz - back * dw - 0.5 * slope * size * w
        tangent_slope(unit, moved, growing, POLE_TANGENT_1, out, 36 + j)
        tangent_slope(unit, moved, growing, POLE_TANGENT_2, out, 54 + j)


#: The gap between a part of a body and a rounded prism; sizes of the latter from `prism_parameters`.
PRISM = SignedDistance(name="rounded prism", parameters=GapParameters._fields, value=_value, slopes=_slopes)
