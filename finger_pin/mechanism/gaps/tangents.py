"""Tangents of a surface, turned from those of one direction, the pole, to those of the normal, the short way.

They jump only for the direction opposite to the pole, which is no normal of a face and lies on no plane of symmetry of
a shape.
"""

from __future__ import annotations

from finger_pin.mechanism.gaps.vectors import Triple, dot

_POLE: Triple = (2.0 / 7.0, 3.0 / 7.0, 6.0 / 7.0)
#: Tangents of the pole.
POLE_TANGENTS: tuple[Triple, Triple] = ((3.0 / 7.0, -6.0 / 7.0, 2.0 / 7.0), (6.0 / 7.0, 2.0 / 7.0, -3.0 / 7.0))
_LEAST = 1e-12


def tangent(n: Triple, of_pole: Triple) -> Triple:
    """Return a tangent of the pole, turned to the normal."""
    share = dot(of_pole, n) / max(1.0 + _POLE[0] * n[0] + _POLE[1] * n[1] + _POLE[2] * n[2], _LEAST)
    return (
        of_pole[0] - share * (n[0] + _POLE[0]),
        of_pole[1] - share * (n[1] + _POLE[1]),
        of_pole[2] - share * (n[2] + _POLE[2]),
    )


def tangent_slope(n: Triple, turning: Triple, growing: float, of_pole: Triple) -> Triple:
    """Return the motion of a tangent, as the normal turns by ``turning`` and it grows in proportion by ``growing``."""
    whole = max(1.0 + _POLE[0] * n[0] + _POLE[1] * n[1] + _POLE[2] * n[2], _LEAST)
    share = dot(of_pole, n) / whole
    change = dot(of_pole, turning) / whole + growing * share
    change -= share * dot(_POLE, turning) / whole
    return (
        growing * of_pole[0] - change * (n[0] + _POLE[0]) - share * turning[0],
        growing * of_pole[1] - change * (n[1] + _POLE[1]) - share * turning[1],
        growing * of_pole[2] - change * (n[2] + _POLE[2]) - share * turning[2],
    )
