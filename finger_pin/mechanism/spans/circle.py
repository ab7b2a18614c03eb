"""A path around or inside a circle, in the plane of the circle: which way it goes, its length, and how they change.

In the plane, with the circle about the origin, the ends are at distances r_0 and r_1, and the path goes from one to the
other through an angle phi. Length and turn are functions of these three. Which way the path goes follows MuJoCo's
spatial tendons (computation chapter of its documentation; `mju_wrap` in engine_util_misc.c).
"""

from __future__ import annotations

import math
from typing import Any

#: Which way the path goes.
FREE, SHORT_WAY, LONG_WAY, INSIDE = range(4)
# Below this, a length or a radius is none, as in MuJoCo.
_TINY = 1e-15
# A root of the inside wrap is where Newton's steps end: twice as many as it ever took.
_MOST_STEPS = 50
# Merit of a path that crosses itself.
_CROSSING = 1e4


def way_of_path(r0: Any, r1: Any, angle: Any, radius: Any, along: Any, across: Any, has_side: Any, inside: Any) -> Any:
    """Return which way the path goes.

    Args:
        r0: Distance of the first end, m.
        r1: Distance of the second end, m.
        angle: Between them, in [0, pi], rad; the first end is at angle 0.
        radius: Of the circle, m.
        along: The side point towards the first end, m.
        across: The side point across it, on the side of the second end, m.
        has_side: Whether there is a side point.
        inside: Whether the path passes inside.
    """
    if radius < _TINY or r0 < _TINY or r1 < _TINY or min(r0, r1) < radius:
        return FREE
    x, y = r1 * math.cos(angle), r1 * math.sin(angle)
    span = (x - r0) ** 2 + y * y
    # Nearest point of the straight line between the ends.
    share = min(max(r0 * (r0 - x) / span, 0.0), 1.0) if span > _TINY else 0.0
    near_x, near_y = r0 + share * (x - r0), share * y
    apart = near_x * near_x + near_y * near_y > radius * radius
    if inside != 0.0:
        return INSIDE if min(r0, r1) > radius and (apart or share == 0.0 or share == 1.0) else FREE
    if span < _TINY or (apart and (has_side == 0.0 or along * near_x + across * near_y >= 0.0)):
        return FREE
    short = _merit(SHORT_WAY, r0, r1, angle, radius, along, across, has_side)
    long = _merit(LONG_WAY, r0, r1, angle, radius, along, across, has_side)
    if max(short, long) <= -_CROSSING:
        return FREE
    return LONG_WAY if long > short else SHORT_WAY


def _merit(way: Any, r0: Any, r1: Any, angle: Any, radius: Any, along: Any, across: Any, has_side: Any) -> Any:
    """Return how close the middle of a way is to the side point, or, without one, how short it is."""
    turning = 1.0 if way == SHORT_WAY else -1.0
    first = turning * math.acos(radius / r0)
    second = angle - turning * math.acos(radius / r1)
    x0, y0, x1, y1 = math.cos(first), math.sin(first), math.cos(second), math.sin(second)
    if _meet(r0, 0.0, radius * x0, radius * y0, r1 * math.cos(angle), r1 * math.sin(angle), radius * x1, radius * y1):
        return -_CROSSING
    if has_side == 0.0:
        return -(radius * radius) * ((x1 - x0) ** 2 + (y1 - y0) ** 2)
    middle = math.sqrt((x0 + x1) ** 2 + (y0 + y1) ** 2)
    return ((x0 + x1) * along + (y0 + y1) * across) / max(middle, _TINY)


def _meet(ax: Any, ay: Any, bx: Any, by: Any, cx: Any, cy: Any, dx: Any, dy: Any) -> Any:
    """Return whether the lines from a to b and from c to d cross."""
    area = (dy - cy) * (bx - ax) - (dx - cx) * (by - ay)
    if abs(area) < _TINY:
        return False
    one = ((dx - cx) * (ay - cy) - (dy - cy) * (ax - cx)) / area
    other = ((bx - ax) * (ay - cy) - (by - ay) * (ax - cx)) / area
    return 0.0 <= one <= 1.0 and 0.0 <= other <= 1.0


def path(way: Any, r0: Any, r1: Any, angle: Any, radius: Any) -> Any:
    """Return length and turn of a path, and their derivatives by r_0, r_1, phi.

    Returns:
        14 numbers: the length P, then P_0, P_1, P_phi, P_00, P_11, P_phiphi, P_01, P_0phi, P_1phi, then the turn T and
        T_0, T_1, T_phi.
    """
    if way == INSIDE:
        return _inside(r0, r1, angle, radius)
    return _around(r0, r1, angle if way == SHORT_WAY else 2.0 * math.pi - angle, radius)


def _around(r0: Any, r1: Any, angle: Any, radius: Any) -> Any:
    """Return `path` of two tangents and the arc between them."""
    # A point on the circle itself has no second derivative.
    h0 = max(math.sqrt(max(r0 * r0 - radius * radius, 0.0)), 1e-12 * radius)
    h1 = max(math.sqrt(max(r1 * r1 - radius * radius, 0.0)), 1e-12 * radius)
    turn = angle - math.acos(min(radius / r0, 1.0)) - math.acos(min(radius / r1, 1.0))
    if turn < 0.0:
        turn += 2.0 * math.pi
    by0, by1 = -radius / (r0 * h0), -radius / (r1 * h1)
    length = h0 + h1 + radius * turn
    return (
        *(length, h0 / r0, h1 / r1, radius),
        *(radius * radius / (h0 * r0 * r0), radius * radius / (h1 * r1 * r1), 0.0, 0.0, 0.0, 0.0),
        *(turn, by0, by1, 1.0),
    )


def _inside(r0: Any, r1: Any, angle: Any, radius: Any) -> Any:
    """Return `path` of two lines that meet on the circle where their sum is least: both meet its normal alike.

    With f(r, psi) the distance of an end from the point psi further on the circle, P = f(r_0, psi) + f(r_1, phi - psi)
    and dP/dpsi = 0. So psi does not enter the first derivatives of P; its own follow from those of dP/dpsi.
    """
    psi = _meeting(r0, r1, angle, radius)
    c0, s0, c1, s1 = math.cos(psi), math.sin(psi), math.cos(angle - psi), math.sin(angle - psi)
    d0 = math.sqrt((r0 - radius * c0) ** 2 + (radius * s0) ** 2)
    d1 = math.sqrt((r1 - radius * c1) ** 2 + (radius * s1) ** 2)
    by_r0, by_r1 = (r0 - radius * c0) / d0, (r1 - radius * c1) / d1
    by_psi, by_rest = r0 * radius * s0 / d0, r1 * radius * s1 / d1
    mixed0, mixed1 = (radius * s0 - by_r0 * by_psi) / d0, (radius * s1 - by_r1 * by_rest) / d1
    bend0, bend1 = (r0 * radius * c0 - by_psi * by_psi) / d0, (r1 * radius * c1 - by_rest * by_rest) / d1
    stiff = max(bend0 + bend1, 1e-12 * radius)
    psi_0, psi_1, psi_angle = -mixed0 / stiff, mixed1 / stiff, bend1 / stiff
    # Angle between the first line and the circle's normal, and its derivatives.
    slant = math.atan2(r0 * s0, r0 * c0 - radius)
    slant_r, slant_psi = -radius * s0 / (d0 * d0), (r0 * r0 - radius * r0 * c0) / (d0 * d0)
    return (
        *(d0 + d1, by_r0, by_r1, by_psi),
        *((1.0 - by_r0 * by_r0) / d0 + mixed0 * psi_0, (1.0 - by_r1 * by_r1) / d1 - mixed1 * psi_1),
        *(bend0 * psi_angle, mixed0 * psi_1, mixed0 * psi_angle, mixed1 * (1.0 - psi_angle)),
        math.pi - 2.0 * slant,
        *(-2.0 * (slant_r + slant_psi * psi_0), -2.0 * slant_psi * psi_1, -2.0 * slant_psi * psi_angle),
    )


def _meeting(r0: Any, r1: Any, angle: Any, radius: Any) -> Any:
    """Return psi where dP/dpsi, which rises, is zero: Newton's steps, halved where they leave the bracket."""
    low, high = max(0.0, angle - math.acos(radius / r1)), min(angle, math.acos(radius / r0))
    psi = 0.5 * (low + high)
    for _ in range(_MOST_STEPS):
        rest = angle - psi
        d0 = math.sqrt(r0 * r0 + radius * radius - 2.0 * r0 * radius * math.cos(psi))
        d1 = math.sqrt(r1 * r1 + radius * radius - 2.0 * r1 * radius * math.cos(rest))
        rise0, rise1 = r0 * radius * math.sin(psi) / d0, r1 * radius * math.sin(rest) / d1
        error = rise0 - rise1
        stiff = (r0 * radius * math.cos(psi) - rise0**2) / d0 + (r1 * radius * math.cos(rest) - rise1**2) / d1
        if error > 0.0:
            high = psi
        else:
            low = psi
        new = psi - error / stiff if stiff > 0.0 else low
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - psi) <= 1e-16 * angle:
            return new
        psi = new
    return psi
