"""One shape for all: a rounded prism, of which half-space, sphere, box, cylinder and capsule are special cases.

Its core is a rectangle, widened by a rim, times an interval of z; a rounding is added all around. Everything follows
from a point's offset w from the nearest point of the core, which is a convex body: the distance |w|, its gradient
n = w / |w|, and, with the slope D = dw/dc (symmetric, D n = n), its Hessian (D - n n^T) / |w|. Of a segment c(t) =
P_0 + t e, the nearest point has e w(c(t)) = 0, or is an end. By the implicit function theorem, with H the Hessian of
the squared distance's half, D,

    dt = -(de w + e D dc) / (e D e)        at fixed t: dc = (1 - t) dP_0 + t dP_1

Distances are exact as long as A's segment is outside the core, and for points everywhere. A segment that reaches into
the core counts with its point there that is nearest to its middle: continuous, but less deep than the bodies are.
Normals of what is inside jump where the nearest face changes.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.mechanism.gaps.gap import Gap

# Draws the nearest point of a segment that runs along a face to its middle: e |e| t below what moves a distance.
_MIDDLE = 1e-10
_MOST_STEPS = 60


def prism_parameters(shape: str, sizes: Any) -> tuple[float, ...]:
    """Return half_x, half_y, rim, low, high, rounding of a shape, m.

    Args:
        shape: ``half_space`` (z <= 0), ``sphere``, ``box``, ``cylinder`` or ``capsule``, the last two along z, all
            others about the origin.
        sizes: None; radius; three sides; radius and length; radius and length without the ends; m.
    """
    if shape == "half_space":
        return np.inf, np.inf, 0.0, -np.inf, 0.0, 0.0
    if shape == "sphere":
        return 0.0, 0.0, 0.0, 0.0, 0.0, sizes[0]
    if shape == "box":
        return sizes[0] / 2.0, sizes[1] / 2.0, 0.0, -sizes[2] / 2.0, sizes[2] / 2.0, 0.0
    radius, length = sizes
    rim, rounding = (radius, 0.0) if shape == "cylinder" else (0.0, radius)
    return 0.0, 0.0, rim, -length / 2.0, length / 2.0, rounding


def _offset(x: float, y: float, z: float, p: Any) -> Any:
    """Return w of a point, and D as xx, xy, yy, zz."""
    u, v = x - min(max(x, -p[1]), p[1]), y - min(max(y, -p[2]), p[2])
    w = z - min(max(z, p[4]), p[5])
    # Where the core has no extent, the offset follows the point even if it is zero.
    along_x, along_y = 1.0 * (u != 0.0 or p[1] == 0.0), 1.0 * (v != 0.0 or p[2] == 0.0)
    along_z = 1.0 * (w != 0.0 or p[4] == p[5])
    if p[3] == 0.0:
        return u, v, w, along_x, 0.0, along_y, along_z
    radius = np.sqrt(u * u + v * v)
    if radius <= p[3]:
        return 0.0, 0.0, w, 0.0, 0.0, 0.0, along_z
    share, u_, v_ = 1.0 - p[3] / radius, u / radius, v / radius
    across = (1.0 - share) * u_ * v_
    xx, yy = share * along_x + (1.0 - share) * u_ * u_, share * along_y + (1.0 - share) * v_ * v_
    return share * u, share * v, w, xx, across, yy, along_z


def _inside(x: float, y: float, z: float, p: Any) -> Any:
    """Return a core point's signed distance from the surface, its gradient, and its Hessian as xx, xy, yy."""
    top, bottom = z - p[5], p[4] - z
    u, v = x - min(max(x, -p[1]), p[1]), y - min(max(y, -p[2]), p[2])
    radius = np.sqrt(u * u + v * v)
    side_x, side_y = abs(x) - p[1], abs(y) - p[2]
    side = (radius if radius > 0.0 else max(side_x, side_y)) - p[3]
    if side < max(top, bottom):
        return (top, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0) if top >= bottom else (bottom, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0)
    if radius > 0.0:
        u_, v_ = u / radius, v / radius
        along_x, along_y = 1.0 * (u != 0.0 or p[1] == 0.0), 1.0 * (v != 0.0 or p[2] == 0.0)
        return side, u_, v_, 0.0, (along_x - u_ * u_) / radius, -u_ * v_ / radius, (along_y - v_ * v_) / radius
    if side_x >= side_y:
        return side, (1.0 if x >= 0.0 else -1.0), 0.0, 0.0, 0.0, 0.0, 0.0
    return side, 0.0, (1.0 if y >= 0.0 else -1.0), 0.0, 0.0, 0.0, 0.0


def _nearest(y: Any, p: Any) -> Any:
    """Return t of the point of A's segment that is nearest: the root of a function that rises with t, or an end."""
    a, b, c = y[3] - y[0], y[4] - y[1], y[5] - y[2]
    middle = _MIDDLE * (a * a + b * b + c * c)
    if middle == 0.0:
        return 0.5
    t, low, high = 0.0, 0.0, 1.0
    first = 0.0
    for k in range(_MOST_STEPS):
        u, v, w, xx, xy, yy, zz = _offset(y[0] + t * a, y[1] + t * b, y[2] + t * c, p)
        rise = a * u + b * v + c * w + middle * (t - 0.5)
        if k == 0:
            if rise >= 0.0:
                return 0.0
            first, t = rise, 1.0
            continue
        if k == 1:
            if rise <= 0.0:
                return 1.0
            t = first / (first - rise)
            continue
        if rise > 0.0:
            high = t
        else:
            low = t
        new = t - rise / (a * a * xx + 2.0 * a * b * xy + b * b * yy + c * c * zz + middle)
        if abs(new - t) < 1e-15:
            return t
        t = new if low < new < high else 0.5 * (low + high)
    return t


def _surface(x: float, y: float, z: float, p: Any) -> Any:
    """Return a point's distance from the core, its gradient, and its Hessian as xx, xy, xz, yy, yz, zz."""
    u, v, w, xx, xy, yy, zz = _offset(x, y, z, p)
    far = np.sqrt(u * u + v * v + w * w)
    if far == 0.0:
        far, u, v, w, xx, xy, yy = _inside(x, y, z, p)
        return far, u, v, w, xx, xy, 0.0, yy, 0.0, 0.0
    u, v, w = u / far, v / far, w / far
    return (
        far,
        u,
        v,
        w,
        (xx - u * u) / far,
        (xy - u * v) / far,
        -u * w / far,
        (yy - v * v) / far,
        -v * w / far,
        (zz - w * w) / far,
    )


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
    """Write how a turned tangent moves when the normal n[1:4] moves by (u, v, w), into a column of ``out``."""
    whole = max(1.0 + _POLE_X * n[1] + _POLE_Y * n[2] + _POLE_Z * n[3], _LEAST)
    share = (a * n[1] + b * n[2] + c * n[3]) / whole
    change = (a * u + b * v + c * w - share * (_POLE_X * u + _POLE_Y * v + _POLE_Z * w)) / whole
    out[at] = -change * (n[1] + _POLE_X) - share * u
    out[at + 6] = -change * (n[2] + _POLE_Y) - share * v
    out[at + 12] = -change * (n[3] + _POLE_Z) - share * w


def _value(y: Any, p: Any, out: Any) -> None:
    t = _nearest(y, p)
    x_, y_, z_ = y[0] + t * (y[3] - y[0]), y[1] + t * (y[4] - y[1]), y[2] + t * (y[5] - y[2])
    far, u, v, w, _, _, _, _, _, _ = _surface(x_, y_, z_, p)
    out[0] = far - p[6] - p[0]
    out[1], out[2], out[3] = u, v, w
    back = p[0] + 0.5 * out[0]
    out[4], out[5], out[6] = x_ - back * u, y_ - back * v, z_ - back * w
    _tangent(u, v, w, _FIRST_X, _FIRST_Y, _FIRST_Z, out, 7)
    _tangent(u, v, w, _SECOND_X, _SECOND_Y, _SECOND_Z, out, 10)


def _slopes(y: Any, p: Any, out: Any) -> None:
    t = _nearest(y, p)
    a, b, c = y[3] - y[0], y[4] - y[1], y[5] - y[2]
    x_, y_, z_ = y[0] + t * a, y[1] + t * b, y[2] + t * c
    ox, oy, oz, dxx, dxy, dyy, dzz = _offset(x_, y_, z_, p)
    far, u, v, w, xx, xy, xz, yy, yz, zz = _surface(x_, y_, z_, p)
    n = (0.0, u, v, w)
    back = p[0] + 0.5 * (far - p[6] - p[0])
    # e D, and how fast the function rises whose root t is.
    ex, ey, ez = a * dxx + b * dxy, a * dxy + b * dyy, c * dzz
    rise = ex * a + ey * b + ez * c + _MIDDLE * (a * a + b * b + c * c)
    free = 0.0 < t < 1.0 and rise > 0.0
    for j in range(6):
        r, weight, sign = (j, 1.0 - t, -1.0) if j < 3 else (j - 3, t, 1.0)
        dx, dy, dz = weight * (r == 0), weight * (r == 1), weight * (r == 2)
        if free:
            # e and w, by the one component that moves.
            along, offset, pull = (a, ox, ex) if r == 0 else ((b, oy, ey) if r == 1 else (c, oz, ez))
            step = -(sign * (offset + 2.0 * _MIDDLE * along * (t - 0.5)) + weight * pull) / rise
            dx, dy, dz = dx + a * step, dy + b * step, dz + c * step
        du, dv, dw = xx * dx + xy * dy + xz * dz, xy * dx + yy * dy + yz * dz, xz * dx + yz * dy + zz * dz
        change = u * dx + v * dy + w * dz
        out[72 + j] = change
        out[j], out[6 + j], out[12 + j] = du, dv, dw
        out[18 + j] = dx - back * du - 0.5 * change * u
        out[24 + j] = dy - back * dv - 0.5 * change * v
        out[30 + j] = dz - back * dw - 0.5 * change * w
        _tangent_slope(n, du, dv, dw, _FIRST_X, _FIRST_Y, _FIRST_Z, out, 36 + j)
        _tangent_slope(n, du, dv, dw, _SECOND_X, _SECOND_Y, _SECOND_Z, out, 54 + j)


#: The gap between a capsule or a sphere and a rounded prism; sizes of the latter from `prism_parameters`.
PRISM = Gap(
    name="rounded prism",
    parameters=("radius", "half_x", "half_y", "rim", "low", "high", "rounding"),
    value=_value,
    slopes=_slopes,
)
