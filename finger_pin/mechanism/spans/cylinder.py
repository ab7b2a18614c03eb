"""A span that may wrap about the z axis of its frame: a helix between tangents, of the same pitch, or a point inside.

Seen along z, the path is one around a circle of length P; unrolled, it is a straight line: L^2 = P^2 + (z_1 - z_0)^2.
"""

from __future__ import annotations

import math
from typing import Any

from finger_pin.mechanism.spans.circle import FREE, INSIDE, path, way_of_path
from finger_pin.mechanism.spans.span import WRAP, WrapSegment, side_point, straight_slopes, straight_value
from finger_pin.mechanism.spans.sphere import curvatures, directions, gradient


def _plane(y: Any, p: Any) -> Any:
    """Return the way of the path, both points in the plane, their distances, the angle between them, the normal."""
    a, b = (y[0], y[1], 0.0), (y[3], y[4], 0.0)
    r0, r1 = math.sqrt(a[0] ** 2 + a[1] ** 2), math.sqrt(b[0] ** 2 + b[1] ** 2)
    area = a[0] * b[1] - a[1] * b[0]
    sense = -1.0 if area < 0.0 else 1.0
    angle = math.atan2(abs(area), a[0] * b[0] + a[1] * b[1])
    sx, sy, _, inside = side_point(y, p)
    along = (sx * a[0] + sy * a[1]) / max(r0, 1e-300)
    across = sense * (sy * a[0] - sx * a[1]) / max(r0, 1e-300)
    side = way_of_path(r0, r1, angle, p[0], along, across, p[4], inside)
    return side, a, b, r0, r1, angle, (0.0, 0.0, sense)


def _turned(side: Any, turn: Any, flat: Any) -> Any:
    """Return the turn of a path in space, of that in the plane and of P / L, and its derivatives by both."""
    if side != INSIDE:
        return turn * flat, flat, turn
    half, rest = math.sin(0.5 * turn), math.cos(0.5 * turn)
    share = 2.0 / math.sqrt(max(1.0 - (flat * half) ** 2, 1e-300))
    return 2.0 * math.asin(min(flat * half, 1.0)), share * flat * 0.5 * rest, share * half


def cylinder_value(y: Any, p: Any, out: Any) -> None:
    """Fill in length, turn and pull."""
    side, a, b, r0, r1, angle, normal = _plane(y, p)
    if side == FREE:
        straight_value(y, p, out)
        return
    wrap = path(side, r0, r1, angle, p[0])
    pull = gradient(wrap.by_r0, wrap.by_r1, wrap.by_angle, r0, r1, directions(a, b, r0, r1, normal, side))
    rise = y[5] - y[2]
    length = math.sqrt(wrap.length**2 + rise**2)
    flat = wrap.length / length
    out[0] = length
    out[1] = _turned(side, wrap.turn, flat)[0]
    for i in range(6):
        out[2 + i] = flat * pull[i]
    out[4] = -rise / length
    out[7] = rise / length


def cylinder_slopes(y: Any, p: Any, out: Any) -> None:
    """Fill in the slopes of turn and pull."""
    side, a, b, r0, r1, angle, normal = _plane(y, p)
    if side == FREE:
        straight_slopes(y, p, out)
        return
    wrap = path(side, r0, r1, angle, p[0])
    frame = directions(a, b, r0, r1, normal, side)
    flat_pull = gradient(wrap.by_r0, wrap.by_r1, wrap.by_angle, r0, r1, frame)
    flat_turn = gradient(wrap.turn_by_r0, wrap.turn_by_r1, wrap.turn_by_angle, r0, r1, frame)
    curvatures(wrap, 0.0, math.cos(angle), r0, r1, frame, out)
    length = math.sqrt(wrap.length**2 + (y[5] - y[2]) ** 2)
    flat, steep = wrap.length / length, (y[5] - y[2]) / length
    _, by_turn, by_flat = _turned(side, wrap.turn, flat)
    for i in range(6):
        up = 1.0 * (i == 5) - 1.0 * (i == 2)
        pull = flat * flat_pull[i] + steep * up
        out[i] = by_turn * flat_turn[i] + by_flat * (flat_pull[i] - flat * pull) / length
        for j in range(6):
            rise = 1.0 * (j == 5) - 1.0 * (j == 2)
            other = flat * flat_pull[j] + steep * rise
            spread = (flat_pull[i] * flat_pull[j] + up * rise - pull * other) / length
            out[6 + 6 * i + j] = flat * out[6 + 6 * i + j] + spread


#: About the z axis.
CYLINDER = WrapSegment("cylinder", WRAP, cylinder_value, cylinder_slopes)
