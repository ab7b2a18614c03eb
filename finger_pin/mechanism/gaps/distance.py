"""The gap between a part of one body and another body, with its slopes.

A part is a point, a segment, a disc or a cylinder, with a rounding of its own; see `nearest`. The other body is a
rounded prism. By the implicit function theorem the nearest point moves so that it stays the minimum.

Distances are exact, to within what `nearest` takes off, as long as the part is outside of the prism's core, and for
points everywhere. A segment or a disc that reaches into the core counts with a point there that is near to its middle:
less deep than the bodies are. Normals of what is inside jump where the nearest face changes.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.mechanism.gaps.gap import Gap
from finger_pin.mechanism.gaps.nearest import ALONG, DISC, EPSILON, RADIUS, lowered, nearest
from finger_pin.mechanism.gaps.prism import NUMBERS, ROUNDING, offset, surface

# Tangents are turned from those of one direction, (2, 3, 6) / 7, to those of the normal, the short way. They jump only
# for its opposite, which is no normal of a face and lies on no plane of symmetry of a shape.
_POLE_X, _POLE_Y, _POLE_Z = 2.0 / 7.0, 3.0 / 7.0, 6.0 / 7.0
_FIRST_X, _FIRST_Y, _FIRST_Z = 3.0 / 7.0, -6.0 / 7.0, 2.0 / 7.0
_SECOND_X, _SECOND_Y, _SECOND_Z = 6.0 / 7.0, 2.0 / 7.0, -3.0 / 7.0
_LEAST = 1e-12


def _tangent(u: float, v: float, w: float, a: float, b: float, c: float, out: Any, at: int) -> None:
    """Write (a, b, c), a tangent of the pole, turned to the normal (u, v, w)."""
    share = (a * u + b * v + c * w) / max(1.0 + _POLE_X * u + _POLE_Y * v + _POLE_Z * w, _LEAST)
    out[at] = a - share * (u + _POLE_X)
    out[at + 1] = b - share * (v + _POLE_Y)
    out[at + 2] = c - share * (w + _POLE_Z)


def _tangent_slope(n: Any, u: float, v: float, w: float, a: float, b: float, c: float, out: Any, at: int) -> None:
    """Write the motion of a turned tangent under a motion (u, v, w) of the normal n into a column of ``out``."""
    whole = max(1.0 + _POLE_X * n[0] + _POLE_Y * n[1] + _POLE_Z * n[2], _LEAST)
    share = (a * n[0] + b * n[1] + c * n[2]) / whole
    change = (a * u + b * v + c * w - share * (_POLE_X * u + _POLE_Y * v + _POLE_Z * w)) / whole
    out[at] = -change * (n[0] + _POLE_X) - share * u
    out[at + 6] = -change * (n[1] + _POLE_Y) - share * v
    out[at + 12] = -change * (n[2] + _POLE_Z) - share * w


def _value(y: Any, p: Any, out: Any) -> None:
    s, r_x, r_y, r_z = nearest(y, p)
    x_, y_, z_ = y[0] + s * (y[3] - y[0]) + r_x, y[1] + s * (y[4] - y[1]) + r_y, y[2] + s * (y[5] - y[2]) + r_z
    far, u, v, w, _, _, _, _, _, _ = surface(x_, y_, z_, p)
    square = (r_x * r_x + r_y * r_y + r_z * r_z) / (p[DISC] * p[DISC]) if p[DISC] > 0.0 else 1.0
    out[0] = far + lowered(y, p, s, square) - p[ROUNDING] - p[RADIUS]
    out[1], out[2], out[3] = u, v, w
    back = p[RADIUS] + 0.5 * out[0]
    out[4], out[5], out[6] = x_ - back * u, y_ - back * v, z_ - back * w
    _tangent(u, v, w, _FIRST_X, _FIRST_Y, _FIRST_Z, out, 7)
    _tangent(u, v, w, _SECOND_X, _SECOND_Y, _SECOND_Z, out, 10)


def _turned(h: Any, x: float, y: float, z: float) -> Any:
    """Return the product of a Hessian, as xx, xy, xz, yy, yz, zz, and a vector."""
    return h[0] * x + h[1] * y + h[2] * z, h[1] * x + h[3] * y + h[4] * z, h[2] * x + h[4] * y + h[5] * z


def _dot(a: Any, b: Any) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _inverse(a: float, b: float, c: float, d: float, e: float, f: float) -> Any:
    """Return the inverse of a symmetric matrix, both as xx, xy, xz, yy, yz, zz."""
    aa, ab, ac = d * f - e * e, c * e - b * f, b * e - c * d
    whole = 1.0 / (a * aa + b * ab + c * ac)
    return aa * whole, ab * whole, ac * whole, (a * f - c * c) * whole, (b * c - a * e) * whole, (a * d - b * b) * whole


def _moving(y: Any, p: Any, s: float, r: Any, n: Any, h: Any) -> Any:
    """Return the directions in which the nearest point is free to move, and the inverse of its stiffness.

    The directions are e, a unit vector along r, and one across; those that are not free are zero.
    """
    e = (y[3] - y[0], y[4] - y[1], y[5] - y[2])
    length, size = np.sqrt(_dot(e, e)), np.sqrt(_dot(r, r))
    zero = (0.0, 0.0, 0.0)
    pull_s, pull_r = 2.0 * EPSILON * length, EPSILON * p[DISC]
    out, across, on_rim = zero, zero, False
    if p[DISC] > 0.0:
        on_rim = size > p[DISC] * (1.0 - 1e-13)
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
    stiff = pull_r / (p[DISC] * p[DISC]) if p[DISC] > 0.0 else 1.0
    bent = -_dot(out, n) / p[DISC] if on_rim else stiff
    free_s = p[ALONG] > 0.0 and 0.0 < s < p[ALONG] and length > 0.0
    if on_rim:
        out = zero
    along = e if free_s else zero
    h_out, h_across, h_along = (
        _turned(h, out[0], out[1], out[2]),
        _turned(h, across[0], across[1], across[2]),
        _turned(h, along[0], along[1], along[2]),
    )
    inverse = _inverse(
        _dot(out, h_out) + (1.0 if on_rim else stiff),
        _dot(out, h_across),
        _dot(out, h_along),
        _dot(across, h_across) + bent,
        _dot(across, h_along),
        _dot(along, h_along) + (pull_s if free_s else 1.0),
    )
    return along, out, across, inverse


def _slopes(y: Any, p: Any, out: Any) -> None:
    s, r_x, r_y, r_z = nearest(y, p)
    a, b, c = y[3] - y[0], y[4] - y[1], y[5] - y[2]
    x_, y_, z_ = y[0] + s * a + r_x, y[1] + s * b + r_y, y[2] + s * c + r_z
    w = offset(x_, y_, z_, p)
    far, u, v, w_, xx, xy, xz, yy, yz, zz = surface(x_, y_, z_, p)
    n, h, r = (u, v, w_), (xx, xy, xz, yy, yz, zz), (r_x, r_y, r_z)
    square = _dot(r, r) / (p[DISC] * p[DISC]) if p[DISC] > 0.0 else 1.0
    back = p[RADIUS] + 0.5 * (far + lowered(y, p, s, square) - p[ROUNDING] - p[RADIUS])
    length = np.sqrt(a * a + b * b + c * c)
    shorter = 1.0 / length if length > 0.0 else 0.0
    axis = (a * shorter, b * shorter, c * shorter)
    along, radial, across, inverse = _moving(y, p, s, r, n, h)
    # Inside the core the nearest point stays where it is.
    moves = w[0] != 0.0 or w[1] != 0.0 or w[2] != 0.0
    leaning = _dot(axis, n) * shorter
    for j in range(6):
        k, share, sign = (j, 1.0 - s, -1.0) if j < 3 else (j - 3, s, 1.0)
        # By the one component that moves, at constant s, and r turned with the axis.
        tilt = -sign * r[k] * shorter
        dx = share * (k == 0) + tilt * axis[0]
        dy = share * (k == 1) + tilt * axis[1]
        dz = share * (k == 2) + tilt * axis[2]
        if moves:
            d = _turned(h, dx, dy, dz)
            of_along = -_dot(along, d) - (sign * n[k] if along[0] != 0.0 or along[1] != 0.0 or along[2] != 0.0 else 0.0)
            of_radial = -_dot(radial, d) + sign * leaning * radial[k]
            of_across = -_dot(across, d) + sign * leaning * across[k]
            by_radial = inverse[0] * of_radial + inverse[1] * of_across + inverse[2] * of_along
            by_across = inverse[1] * of_radial + inverse[3] * of_across + inverse[4] * of_along
            by_along = inverse[2] * of_radial + inverse[4] * of_across + inverse[5] * of_along
            dx += by_radial * radial[0] + by_across * across[0] + by_along * along[0]
            dy += by_radial * radial[1] + by_across * across[1] + by_along * along[1]
            dz += by_radial * radial[2] + by_across * across[2] + by_along * along[2]
        du, dv, dw = _turned(h, dx, dy, dz)
        # The distance changes as the nearest point does at constant s and r: they minimise it.
        change = share * n[k] - sign * r[k] * leaning
        out[72 + j] = change
        out[j], out[6 + j], out[12 + j] = du, dv, dw
        out[18 + j] = dx - back * du - 0.5 * change * u
        out[24 + j] = dy - back * dv - 0.5 * change * v
        out[30 + j] = dz - back * dw - 0.5 * change * w_
        _tangent_slope(n, du, dv, dw, _FIRST_X, _FIRST_Y, _FIRST_Z, out, 36 + j)
        _tangent_slope(n, du, dv, dw, _SECOND_X, _SECOND_Y, _SECOND_Z, out, 54 + j)


#: The gap between a part of a body and a rounded prism; sizes of the latter from `prism_parameters`.
PRISM = Gap(name="rounded prism", parameters=("radius", "disc", "along", *NUMBERS), value=_value, slopes=_slopes)
