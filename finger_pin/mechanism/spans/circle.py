"""A path around or inside a circle, in its plane: direction, length, turn, and their derivatives.

In the plane, with the circle about the origin, the ends are at distances r_0 and r_1, and the path goes from one to the
other through an angle phi. Length and turn are functions of these three. Which way the path goes is as in MuJoCo 4.
"""

from __future__ import annotations

import math
from typing import NamedTuple

#: Which way the path goes.
FREE, SHORT_WAY, LONG_WAY, INSIDE = range(4)
# Below this, a length or a radius is none, as in MuJoCo.
_LENGTH_ROUNDING = 1e-15
#: Distance below the surface, in parts of the radius, within which a point lies on it, and the path may wrap.
ON_CIRCLE = 1e-9
# Least length of a tangent that derivatives see, in parts of the radius.
_LEAST_TANGENT = 1e-6
_MOST_STEPS = 50


class CirclePath(NamedTuple):
    """Length P and turn T of a path, with their derivatives by r_0, r_1 and phi."""

    length: float
    by_r0: float
    by_r1: float
    by_angle: float
    by_r0_r0: float
    by_r1_r1: float
    by_angle_angle: float
    by_r0_r1: float
    by_r0_angle: float
    by_r1_angle: float
    turn: float
    turn_by_r0: float
    turn_by_r1: float
    turn_by_angle: float


def way_of_path(
    r0: float, r1: float, angle: float, radius: float, along: float, across: float, has_side: float, inside: float
) -> int:
    """Return the direction of the path around the circle.

    A path wraps if, on its way, the ends are further apart than where their tangents meet the circle. With a side
    point its way is through the direction of that point; without one it is the shorter. Inside, it has to be drawn to
    the circle unless the straight line meets it.

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
    if radius < _LENGTH_ROUNDING or min(r0, r1) < (1.0 - ON_CIRCLE) * radius:
        return FREE
    touching = math.acos(min(radius / r0, 1.0)) + math.acos(min(radius / r1, 1.0))
    if inside != 0.0:
        if min(r0, r1) <= radius:
            return FREE
        return INSIDE if angle < touching else FREE
    # Where what is opposite to the side point lies between the ends, the way is the long one.
    long = has_side != 0.0 and math.atan2(across, along) < angle - math.pi
    if long:
        return LONG_WAY if 2.0 * math.pi - angle > touching else FREE
    return SHORT_WAY if angle > touching else FREE


def path(way: int, r0: float, r1: float, angle: float, radius: float) -> CirclePath:
    """Return length and turn of a path, and their derivatives."""
    if way == INSIDE:
        return _inside(r0, r1, angle, radius)
    return _around(max(r0, radius), max(r1, radius), angle if way == SHORT_WAY else 2.0 * math.pi - angle, radius)


def _around(r0: float, r1: float, angle: float, radius: float) -> CirclePath:
    """Return the path around the circle: two tangents and the arc between them, as `path` does."""
    h0, h1 = math.sqrt((r0 - radius) * (r0 + radius)), math.sqrt((r1 - radius) * (r1 + radius))
    turn = angle - math.acos(radius / r0) - math.acos(radius / r1)
    length = h0 + h1 + radius * turn
    # A point on the circle itself has no second derivative.
    h0, h1 = max(h0, _LEAST_TANGENT * radius), max(h1, _LEAST_TANGENT * radius)
    by0, by1 = -radius / (r0 * h0), -radius / (r1 * h1)
    return CirclePath(
        *(length, h0 / r0, h1 / r1, radius),
        *(radius * radius / (h0 * r0 * r0), radius * radius / (h1 * r1 * r1), 0.0, 0.0, 0.0, 0.0),
        *(turn, by0, by1, 1.0),
    )


def _inside(r0: float, r1: float, angle: float, radius: float) -> CirclePath:
    """Return `path` of two lines with the least sum that meet on the circle, at equal angles to its normal.

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
    return CirclePath(
        *(d0 + d1, by_r0, by_r1, by_psi),
        *((1.0 - by_r0 * by_r0) / d0 + mixed0 * psi_0, (1.0 - by_r1 * by_r1) / d1 - mixed1 * psi_1),
        *(bend0 * psi_angle, mixed0 * psi_1, mixed0 * psi_angle, mixed1 * (1.0 - psi_angle)),
        math.pi - 2.0 * slant,
        *(-2.0 * (slant_r + slant_psi * psi_0), -2.0 * slant_psi * psi_1, -2.0 * slant_psi * psi_angle),
    )


def _meeting(r0: float, r1: float, angle: float, radius: float) -> float:
    """Return the zero psi of dP/dpsi, which rises: Newton's steps, halved if they leave the bracket."""
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
