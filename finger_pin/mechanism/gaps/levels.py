"""Levels: distances of a part's core from a prism's, extended so that parts may sink in.

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

from typing import NamedTuple

import numpy as np

from finger_pin.mechanism.gaps.ellipsoid import is_inside
from finger_pin.mechanism.gaps.nearest import INSIDE, nearest, point_of_part, regularisation
from finger_pin.mechanism.gaps.prism import GAP, inradius, offset
from finger_pin.mechanism.gaps.vectors import Triple, dot, norm
from finger_pin.typing import Pointer

# The level is iterated to this, m, in so many steps at most.
_LEVEL_ACCURACY, _MOST_STEPS = 1e-15, 40


class _Distance(NamedTuple):
    """Distance of a part from the shrunk core, blunted, m; its slopes by |w| and by c; s and r of the nearest point."""

    distance: float
    by_offset: float
    spread: float
    s: float
    r: Triple


class _Shrinkage(NamedTuple):
    """The shrinkage c of the core, m, with dc/du and d2c/du2."""

    depth: float
    rate: float
    bend: float


class Level(NamedTuple):
    """The level of a part's core, and where it is nearest.

    Attributes:
        level: l, m.
        by_offset: Its slope by |w|.
        flatness: The slope of that by |w| where l is flattened, else 0, 1/m.
        shrinkage: c, and its slopes.
        s, r: The nearest point, see `nearest`.
    """

    level: float
    by_offset: float
    flatness: float
    shrinkage: _Shrinkage
    s: float
    r: Triple


def offset_slopes(w: Triple, p: Pointer) -> tuple[Triple, float]:
    """Return dw/dc, by the shrinking of the core, and its product with w / |w|."""
    a, b, c = np.sign(w[0]), np.sign(w[1]), np.sign(w[2])
    if p[GAP.rim] > 0.0:
        across = np.sqrt(w[0] * w[0] + w[1] * w[1])
        a, b = (w[0] / across, w[1] / across) if across > 0.0 else (0.0, 0.0)
    far = norm(w)
    return (a, b, c), (dot((a, b, c), w) / far if far > 0.0 else 1.0)


def _distance(points: Pointer, p: Pointer, shrinkage: float, blunt: float) -> _Distance:
    s, r = nearest(points, p, shrinkage, blunt)
    w, _ = offset(point_of_part(points, s, r), p, shrinkage)
    square = dot(r, r) / (p[GAP.disc] * p[GAP.disc]) if p[GAP.disc] > 0.0 else 1.0
    far = norm(w)
    by_offset, far = (1.0, far) if far >= blunt else (far / blunt, 0.5 * (far * far / blunt + blunt))
    if p[GAP.third_semi_axis] > 0.0 and is_inside(points, p[GAP.third_semi_axis], r):
        by_offset, far = 0.0, 0.5 * blunt
    return _Distance(far + regularisation(points, p, s, square), by_offset, offset_slopes(w, p)[1], s, r)


class _Ramps(NamedTuple):
    """Lengths over which dc/du rises and falls, m, its maximum, and its second zero, m."""

    rise: float
    fall: float
    peak: float
    end: float


def _ramps(start: float, most: float) -> _Ramps:
    rise = min(start, np.sqrt(0.5 * most * start))
    peak, fall = 2.0 * rise / start, max(rise, 0.5 * most)
    return _Ramps(rise, fall, peak, most / peak + 0.5 * (rise + fall))


def _shrinkage_at(u: float, start: float, most: float) -> _Shrinkage:
    rise, fall, peak, end = _ramps(start, most)
    if u >= end:
        return _Shrinkage(most, 0.0, 0.0)
    if u < rise:
        return _Shrinkage(u * u / start, 2.0 * u / start, 2.0 / start)
    if u < end - fall:
        return _Shrinkage(peak * (u - 0.5 * rise), peak, 0.0)
    return _Shrinkage(most - 0.5 * peak * (end - u) * (end - u) / fall, peak * (end - u) / fall, -peak / fall)


def level_of_core(points: Pointer, p: Pointer) -> Level:
    """Return the level of a part's core."""
    start, most = 0.5 * (p[GAP.radius] + p[GAP.rounding]), inradius(p)
    blunt = max((0.5 if most == 0.0 else 0.25) * start, INSIDE)
    shrinkage = _Shrinkage(0.0, 0.0, 0.0)
    near = _distance(points, p, 0.0, blunt)
    if near.distance >= start or most == 0.0 or start == 0.0:
        flatness = 1.0 / blunt if near.by_offset < 1.0 else 0.0
        return Level(near.distance, near.by_offset, flatness, shrinkage, near.s, near.r)
    end = _ramps(start, most).end
    # What is asked for is the root of a function of u that rises; where the core is reached, only its far end is known.
    low, high, u = 0.0, np.inf, start - near.distance if near.by_offset == 1.0 else end
    for _ in range(_MOST_STEPS):
        u = min(u, end)
        shrinkage = _shrinkage_at(u, start, most)
        least = max(0.5 * (start - end + most), INSIDE) if u == end else blunt
        near = _distance(points, p, shrinkage.depth, least)
        excess = near.distance - shrinkage.depth - start + u
        if u == end and excess <= 0.0:
            flatness = 1.0 / least if near.by_offset < 1.0 else 0.0
            return Level(near.distance - most, near.by_offset, flatness, _Shrinkage(most, 0.0, 0.0), near.s, near.r)
        step = excess / (1.0 + (near.spread - 1.0) * shrinkage.rate)
        if abs(step) < _LEVEL_ACCURACY:
            break
        low, high = (low, u) if excess > 0.0 else (u, high)
        # By Newton, or by halves where that leaves what is known of the root.
        u = u - step if near.by_offset == 1.0 and low < u - step < high else min(0.5 * (low + high), end)
    by_offset = 1.0 / (1.0 + (near.spread - 1.0) * shrinkage.rate)
    return Level(start - u, by_offset, 0.0, shrinkage, near.s, near.r)
