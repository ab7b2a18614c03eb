"""The gap between a part of one body and another body, with its slopes.

A part is a point, a segment, a disc or a cylinder, with a rounding of its own; see `nearest`. The other body is a
rounded prism. The gap is the level of the part's core, see `levels`, less both roundings. By the implicit function
theorem the nearest point moves so that it stays the minimum.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from finger_pin.mechanism.gaps.ellipsoid import sliding
from finger_pin.mechanism.gaps.levels import Level, level_of_core, offset_slopes
from finger_pin.mechanism.gaps.nearest import EPSILON, point_of_part
from finger_pin.mechanism.gaps.prism import GAP, GapParameters, offset, surface
from finger_pin.mechanism.gaps.signed_distance import (
    GAP_OUT,
    GAP_SLOPE,
    POINT,
    SLOPE_WIDTH,
    SignedDistance,
    part_axis,
    put_vector,
)
from finger_pin.mechanism.gaps.tangents import POLE_TANGENTS, tangent, tangent_slope
from finger_pin.mechanism.gaps.vectors import (
    ZERO,
    Symmetric,
    Triple,
    Triples,
    add,
    cross,
    divide,
    dot,
    inverse,
    norm,
    product,
    scale,
    subtract,
    unit_vector,
    weighted_sum,
)
from finger_pin.typing import Pointer


def _value(points: Pointer, p: Pointer, out: Pointer) -> None:
    level = level_of_core(points, p)
    nearest_point = point_of_part(points, level.s, level.r)
    unit = surface(nearest_point, p, level.shrinkage.depth).normal
    gap = level.level - p[GAP.rounding] - p[GAP.radius]
    normal, back = scale(level.by_offset, unit), p[GAP.radius] + 0.5 * gap
    out[GAP_OUT.gap] = gap
    put_vector(normal, out, GAP_OUT.normal)
    put_vector(subtract(nearest_point, scale(back, normal)), out, GAP_OUT.point)
    put_vector(scale(level.by_offset, tangent(unit, POLE_TANGENTS[0])), out, GAP_OUT.first_tangent)
    put_vector(scale(level.by_offset, tangent(unit, POLE_TANGENTS[1])), out, GAP_OUT.second_tangent)


def _free_directions(
    points: Pointer, p: Pointer, s: float, r: Triple, n: Triple, h: Symmetric
) -> tuple[Triples, Symmetric]:
    """Return the directions in which the nearest point is free to move, and the inverse of its stiffness.

    The directions are a unit vector along r, one across, and e; those that are not free are zero.
    """
    axis, disc = part_axis(points), p[GAP.disc]
    length = norm(axis)
    along_pull, radial_pull = 2.0 * EPSILON * length, EPSILON * disc
    radial, across, on_rim = ZERO, ZERO, False
    if disc > 0.0:
        size = norm(r)
        on_rim = size > disc * (1.0 - 1e-13)
        if size > 0.0:
            radial = divide(r, size)
        else:
            least = abs(axis[0]) <= abs(axis[1])
            size = np.sqrt(axis[2] * axis[2] + (axis[1] * axis[1] if least else axis[0] * axis[0]))
            radial = (0.0, axis[2] / size, -axis[1] / size) if least else (-axis[2] / size, 0.0, axis[0] / size)
        across = divide(cross(axis, radial), length)
    # In units of r and s: the disc's pull is kappa_r / R^2 per m; on its rim the circle's curvature stands for that.
    stiff = radial_pull / (disc * disc) if disc > 0.0 else 1.0
    bent = -dot(radial, n) / disc if on_rim else stiff
    is_along_free = p[GAP.along] > 0.0 and 0.0 < s < p[GAP.along] and length > 0.0
    if on_rim:
        radial = ZERO
    along = axis if is_along_free else ZERO
    h_radial, h_across, h_along = product(h, radial), product(h, across), product(h, along)
    stiffness = Symmetric(
        dot(radial, h_radial) + (1.0 if on_rim else stiff),
        dot(radial, h_across),
        dot(radial, h_along),
        dot(across, h_across) + bent,
        dot(across, h_along),
        dot(along, h_along) + (along_pull if is_along_free else 1.0),
    )
    return (radial, across, along), inverse(stiffness)


class _Motion(NamedTuple):
    """The motion of the nearest point by one coordinate of the points, at constant s, with r turned with the axis.

    Attributes:
        velocity: Of the point.
        swing: That of the normal as an ellipsoid sees it, which moves as a whole.
        sign: With which the coordinate turns the axis.
        component: Which of x, y and z the coordinate is.
        change: How far the distance changes: s and r minimise it.
    """

    velocity: Triple
    swing: Triple
    sign: float
    component: int
    change: float


def _nearest_point_motion(
    column: int, level: Level, n: Triple, axis: Triple, inverse_length: float, is_ellipsoid: bool
) -> _Motion:
    r = level.r
    k, share, sign = (column, 1.0 - level.s, -1.0) if column < POINT.second else (column - POINT.second, level.s, 1.0)
    unit = unit_vector(k)
    if is_ellipsoid and column >= POINT.second:
        velocity = cross(unit, r)
        return _Motion(velocity, cross(unit, n), sign, k, dot(n, velocity))
    tilt = -sign * r[k] * inverse_length
    velocity = (share * (k == 0) + tilt * axis[0], share * (k == 1) + tilt * axis[1], share * (k == 2) + tilt * axis[2])
    return _Motion(velocity, ZERO, sign, k, share * n[k] - sign * r[k] * (dot(axis, n) * inverse_length))


def _slopes(points: Pointer, p: Pointer, out: Pointer) -> None:
    level = level_of_core(points, p)
    by_offset, flatness, rate = level.by_offset, level.flatness, level.shrinkage.rate
    axis = part_axis(points)
    nearest_point = point_of_part(points, level.s, level.r)
    far, unit, h = surface(nearest_point, p, level.shrinkage.depth)
    n = unit
    w, d = offset(nearest_point, p, level.shrinkage.depth)
    if flatness > 0.0:
        # What the point minimises goes as |w|^2.
        flatness = flatness if by_offset > 0.0 else 0.0
        n = scale(flatness, w)
        h = Symmetric(flatness * d.xx, flatness * d.xy, 0.0, flatness * d.yy, 0.0, flatness * d.zz)
    back = p[GAP.radius] + 0.5 * (level.level - p[GAP.rounding] - p[GAP.radius])
    length, is_ellipsoid = norm(axis), p[GAP.third_semi_axis] > 0.0
    inverse_length = 1.0 / length if length > 0.0 and not is_ellipsoid else 0.0
    direction = scale(inverse_length, axis)
    free, compliance = (
        sliding(points, p[GAP.third_semi_axis], n, h)
        if is_ellipsoid
        else _free_directions(points, p, level.s, level.r, n, h)
    )
    radial, across, along = free
    leaning = dot(direction, n) * inverse_length
    # The motion of the normal at one place, by c.
    sinking, turning, spread = ZERO, ZERO, 1.0
    if rate > 0.0:
        sinking, spread = offset_slopes(w, p)
        turning = divide(subtract(sinking, scale(spread, unit)), far)
    for j in range(SLOPE_WIDTH):
        velocity, swing, sign, k, change = _nearest_point_motion(j, level, n, direction, inverse_length, is_ellipsoid)
        shrinks = -rate * by_offset * change
        turned = add(product(h, velocity), scale(shrinks, turning))
        pushes_along = -dot(along, turned) - (
            sign * n[k] if along[0] != 0.0 or along[1] != 0.0 or along[2] != 0.0 else 0.0
        )
        pushes_radial = dot(radial, swing) - dot(radial, turned) + sign * leaning * radial[k]
        pushes_across = dot(across, swing) - dot(across, turned) + sign * leaning * across[k]
        slid = product(compliance, (pushes_radial, pushes_across, pushes_along))
        velocity = add(velocity, weighted_sum(slid, free))
        turned = add(product(h, velocity), scale(shrinks, turning))
        if flatness > 0.0:
            slope, growing = change, dot(unit, turned)
            turned = subtract(turned, scale(growing, unit))
        else:
            slope = by_offset * change
            growing = (
                by_offset * by_offset * ((spread - 1.0) * level.shrinkage.bend * slope - rate * dot(sinking, turned))
            )
            turned = scale(by_offset, turned)
        normal = add(turned, scale(growing, unit))
        point = subtract(subtract(velocity, scale(back, normal)), scale(0.5 * slope * by_offset, unit))
        out[GAP_SLOPE.gap + j] = slope
        put_vector(normal, out, GAP_SLOPE.normal + j, SLOPE_WIDTH)
        put_vector(point, out, GAP_SLOPE.point + j, SLOPE_WIDTH)
        first, second = POLE_TANGENTS
        put_vector(tangent_slope(unit, turned, growing, first), out, GAP_SLOPE.first_tangent + j, SLOPE_WIDTH)
        put_vector(tangent_slope(unit, turned, growing, second), out, GAP_SLOPE.second_tangent + j, SLOPE_WIDTH)


#: The gap between a part of a body and a rounded prism; sizes of the latter from `prism_parameters`.
PRISM = SignedDistance(name="rounded prism", parameters=GapParameters._fields, value=_value, slopes=_slopes)
