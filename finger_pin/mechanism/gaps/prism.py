"""Rounded prism, with half-space, sphere, box, cylinder and capsule as special cases.

Its core is a rectangle, widened by a rim, times an interval of z; a rounding is added all around. The core is convex.
Everything follows from a point's offset w from the nearest point of the core, or of one that is shrunk on all sides:
the distance |w|, its gradient n = w / |w|, and, with the slope D = dw/dx (symmetric, D n = n), its Hessian
(D - n n^T) / |w|.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

#: A half-space is a core so deep below its surface, m, with that rounding: what penetrates it stays outside the core.
HALF_SPACE_DEPTH = 1.0


class GapParameters(NamedTuple):
    """Places of the parameters of a gap: of a part its rounding, R, the largest s, 0 or 1, and c, then of a prism."""

    radius: int
    disc: int
    along: int
    third: int
    half_x: int
    half_y: int
    rim: int
    low: int
    high: int
    rounding: int


GAP = GapParameters(*range(len(GapParameters._fields)))


def prism_parameters(shape: str, sizes: Any, fillet: float = 0.0) -> tuple[float, ...]:
    """Return half_x, half_y, rim, low, high, rounding of a shape, m.

    Args:
        shape: ``half_space`` (z <= 0), ``sphere``, ``box``, ``cylinder`` or ``capsule``, the last two along z, all
            others about the origin.
        sizes: None; radius; three sides; radius and length; radius and length without the ends; m.
        fillet: Radius with which edges of a box, or the rims of a cylinder, are rounded, m.
    """
    if shape == "half_space":
        return np.inf, np.inf, 0.0, -np.inf, -HALF_SPACE_DEPTH, HALF_SPACE_DEPTH
    if shape == "sphere":
        return 0.0, 0.0, 0.0, 0.0, 0.0, sizes[0]
    if shape == "box":
        x, y, z = (side / 2.0 - fillet for side in sizes)
        return x, y, 0.0, -z, z, fillet
    radius, length = sizes
    if shape == "capsule":
        return 0.0, 0.0, 0.0, -length / 2.0, length / 2.0, radius
    return 0.0, 0.0, radius - fillet, fillet - length / 2.0, length / 2.0 - fillet, fillet


def inradius(p: Any) -> Any:
    """Return the inradius of a core, m; 0 without thickness or end."""
    side = p[GAP.rim] if p[GAP.rim] > 0.0 else min(p[GAP.half_x], p[GAP.half_y])
    least = min(side, 0.5 * (p[GAP.high] - p[GAP.low]))
    return least if least < np.inf else 0.0


def offset(x: float, y: float, z: float, p: Any, sunk: float) -> Any:
    """Return w of a point from the core, shrunk by ``sunk`` on all sides, and D as xx, xy, yy, zz."""
    round_, half_x, half_y, low, high = (
        p[GAP.rim] > 0.0,
        p[GAP.half_x],
        p[GAP.half_y],
        p[GAP.low] + sunk,
        p[GAP.high] - sunk,
    )
    if not round_:
        half_x, half_y = half_x - sunk, half_y - sunk
    u, v = x - min(max(x, -half_x), half_x), y - min(max(y, -half_y), half_y)
    w = z - min(max(z, low), high)
    # Where the core has no extent, the offset follows the point even if it is zero.
    along_x, along_y = 1.0 * (u != 0.0 or half_x == 0.0), 1.0 * (v != 0.0 or half_y == 0.0)
    along_z = 1.0 * (w != 0.0 or low == high)
    if not round_:
        return u, v, w, along_x, 0.0, along_y, along_z
    rim, radius = p[GAP.rim] - sunk, np.sqrt(u * u + v * v)
    if radius <= rim:
        return 0.0, 0.0, w, 0.0, 0.0, 0.0, along_z
    if radius == 0.0:
        return u, v, w, along_x, 0.0, along_y, along_z
    share, u_, v_ = 1.0 - rim / radius, u / radius, v / radius
    across = (1.0 - share) * u_ * v_
    xx, yy = share * along_x + (1.0 - share) * u_ * u_, share * along_y + (1.0 - share) * v_ * v_
    return share * u, share * v, w, xx, across, yy, along_z


def surface(x: float, y: float, z: float, p: Any, sunk: float) -> Any:
    """Return a point's distance from the shrunk core, its gradient, and its Hessian as xx, xy, xz, yy, yz, zz.

    Inside the core the gradient is a direction across it.
    """
    u, v, w, xx, xy, yy, zz = offset(x, y, z, p, sunk)
    far = np.sqrt(u * u + v * v + w * w)
    if far == 0.0:
        flat = p[GAP.rim] > sunk or (p[GAP.rim] == 0.0 and p[GAP.half_x] > sunk)
        return (0.0, (0.0 if flat else 1.0), 0.0, (1.0 if flat else 0.0), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
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
