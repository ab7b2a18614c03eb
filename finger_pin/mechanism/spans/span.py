"""Spans: the piece of a tendon's path between two points, and its slopes by their motion."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar


@dataclass(frozen=True)
class WrapSegment:
    """Segment of a path between two points of bodies, in the frame of a third.

    Its functions take plain numbers, allocate nothing, and are run by Python and by the compiler.

    Attributes:
        name: For messages.
        parameters: Names of its numbers; ``p`` holds them in this order.
        value: (y, p, out) -> None; y are 6 numbers, the two points in the span's frame, m, and 3 of a side point.
            Into out go the length, m, the angle by which the path turns along the wrap, rad, and 6 numbers pull =
            d length / d y.
        slopes: (y, p, out) -> None; into out go 6 numbers d turn / d y, 1/m, and 36 numbers d pull / d y, 1/m, row by
            row.
    """

    name: str
    parameters: tuple[str, ...]
    value: Callable[[Any, Any, Any], None]
    slopes: Callable[[Any, Any, Any], None]
    columns: ClassVar[int] = 1


#: Numbers of a wrap: its radius, m; the side point, m; whether there is one; whether the path passes inside. A side
#: point that another body carries is a third point in y, and inside if it is nearer than the radius.
WRAP = ("radius", "side_x", "side_y", "side_z", "has_side", "inside")
#: Points no farther apart are at one place, m: the leg between them has no direction.
COINCIDENT = 1e-9
#: What ``has_side`` is for a side point in y.
SIDE_ON_OTHER_BODY = 2.0


def side_point(y: Any, p: Any) -> Any:
    """Return the side point, seen from the wrap, and whether the path passes inside."""
    if p[4] != SIDE_ON_OTHER_BODY:
        return p[1], p[2], p[3], p[5]
    inside = y[6] * y[6] + y[7] * y[7] + y[8] * y[8] < p[0] * p[0]
    return y[6], y[7], y[8], 1.0 if inside else 0.0


def straight_value(y: Any, p: Any, out: Any) -> None:
    """Fill in length, no turn, and pull; no pull between coincident points."""
    length = math.sqrt((y[3] - y[0]) ** 2 + (y[4] - y[1]) ** 2 + (y[5] - y[2]) ** 2)
    share = 1.0 / length if length > COINCIDENT else 0.0
    out[0] = length
    out[1] = 0.0
    for i in range(3):
        out[5 + i] = share * (y[3 + i] - y[i])
        out[2 + i] = -out[5 + i]


def straight_slopes(y: Any, p: Any, out: Any) -> None:
    """Fill in the slopes: (I - d d^T) / length, for the direction d."""
    length = math.sqrt((y[3] - y[0]) ** 2 + (y[4] - y[1]) ** 2 + (y[5] - y[2]) ** 2)
    share = 1.0 / length if length > COINCIDENT else 0.0
    for i in range(3):
        out[i] = 0.0
        out[3 + i] = 0.0
        for j in range(3):
            across = share * (1.0 * (i == j) - share * share * (y[3 + i] - y[i]) * (y[3 + j] - y[j]))
            out[6 + 6 * i + j] = across
            out[9 + 6 * i + j] = -across
            out[24 + 6 * i + j] = -across
            out[27 + 6 * i + j] = across


#: The distance of the points.
STRAIGHT = WrapSegment("straight", (), straight_value, straight_slopes)
