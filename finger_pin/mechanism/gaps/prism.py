"""Rounded prism, with half-space, sphere, box, cylinder and capsule as special cases.

Its core is a rectangle, widened by a rim, times an interval of z; a rounding is added all around. The core is convex.
Everything follows from a point's offset w from the nearest point of the core, or of one that is shrunk on all sides:
the distance |w|, its gradient n = w / |w|, and, with the slope D = dw/dx (symmetric, D n = n), its Hessian
(D - n n^T) / |w|.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from finger_pin.mechanism.gaps.vectors import Symmetric, Triple, divide, norm
from finger_pin.typing import Pointer

#: A half-space is a core so deep below its surface, m, with that rounding: what penetrates it stays outside the core.
HALF_SPACE_DEPTH = 1.0


class GapParameters(NamedTuple):
    """Columns of the parameters of a gap: first of a part, then of a prism; all but ``along`` in m.

    Attributes:
        radius: Rounding of the part.
        disc: Radius R of its disc, 0 for none.
        along: The largest s: 1 of a part with a length, else 0.
        third_semi_axis: Length c of an ellipsoid, 0 for other parts.
        half_x, half_y: Half sides of the core's rectangle.
        rim: Its widening.
        low, high: Ends of the core along z.
        rounding: Of the prism.
    """

    radius: int
    disc: int
    along: int
    third_semi_axis: int
    half_x: int
    half_y: int
    rim: int
    low: int
    high: int
    rounding: int


GAP = GapParameters(*range(len(GapParameters._fields)))


class Offset(NamedTuple):
    """A point's offset w from a core, m, and its slope D; of the latter, xz and yz are zero."""

    vector: Triple
    slope: Symmetric


class Surface(NamedTuple):
    """A point's distance from a core, m, its gradient n, and its Hessian, 1/m."""

    distance: float
    normal: Triple
    hessian: Symmetric


def prism_parameters(shape: str, sizes: Sequence[float], fillet: float = 0.0) -> tuple[float, ...]:
    """Return half_x, half_y, rim, low, high, rounding of a shape, m.

    Args:
        shape: ``half_space`` (z <= 0), ``sphere``, ``box``, ``cylinder`` or ``capsule``, the last two along z, all
            others about the origin.
        sizes: None at all; radius; three sides; radius and length; radius and length without the ends; m.
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


def inradius(p: Pointer) -> float:
    """Return the inradius of a core, m; 0 without thickness or end."""
    side = p[GAP.rim] if p[GAP.rim] > 0.0 else min(p[GAP.half_x], p[GAP.half_y])
    least = min(side, 0.5 * (p[GAP.high] - p[GAP.low]))
    return least if least < np.inf else 0.0


def offset(point: Triple, p: Pointer, shrinkage: float) -> Offset:
    """Return a point's offset from the core, shrunk on all sides."""
    x, y, z = point
    round_, half_x, half_y = p[GAP.rim] > 0.0, p[GAP.half_x], p[GAP.half_y]
    low, high = p[GAP.low] + shrinkage, p[GAP.high] - shrinkage
    if not round_:
        half_x, half_y = half_x - shrinkage, half_y - shrinkage
    u, v = x - min(max(x, -half_x), half_x), y - min(max(y, -half_y), half_y)
    w = z - min(max(z, low), high)
    # Where the core has no extent, the offset follows the point even if it is zero.
    along_x, along_y = 1.0 * (u != 0.0 or half_x == 0.0), 1.0 * (v != 0.0 or half_y == 0.0)
    along_z = 1.0 * (w != 0.0 or low == high)
    if not round_:
        return Offset((u, v, w), Symmetric(along_x, 0.0, 0.0, along_y, 0.0, along_z))
    rim, radius = p[GAP.rim] - shrinkage, np.sqrt(u * u + v * v)
    if radius <= rim:
        return Offset((0.0, 0.0, w), Symmetric(0.0, 0.0, 0.0, 0.0, 0.0, along_z))
    if radius == 0.0:
        return Offset((u, v, w), Symmetric(along_x, 0.0, 0.0, along_y, 0.0, along_z))
    share, outwards_x, outwards_y = 1.0 - rim / radius, u / radius, v / radius
    xx = share * along_x + (1.0 - share) * outwards_x * outwards_x
    xy = (1.0 - share) * outwards_x * outwards_y
    yy = share * along_y + (1.0 - share) * outwards_y * outwards_y
    return Offset((share * u, share * v, w), Symmetric(xx, xy, 0.0, yy, 0.0, along_z))


def surface(point: Triple, p: Pointer, shrinkage: float) -> Surface:
    """Return a point's distance from the shrunk core, and its slopes.

    Inside the core the gradient is a direction across it.
    """
    w, d = offset(point, p, shrinkage)
    far = norm(w)
    if far == 0.0:
        flat = p[GAP.rim] > shrinkage or (p[GAP.rim] == 0.0 and p[GAP.half_x] > shrinkage)
        return Surface(0.0, (0.0, 0.0, 1.0) if flat else (1.0, 0.0, 0.0), Symmetric(0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    n = divide(w, far)
    hessian = Symmetric(
        *((d.xx - n[0] * n[0]) / far, (d.xy - n[0] * n[1]) / far, -n[0] * n[2] / far),
        *((d.yy - n[1] * n[1]) / far, -n[1] * n[2] / far, (d.zz - n[2] * n[2]) / far),
    )
    return Surface(far, n, hessian)
