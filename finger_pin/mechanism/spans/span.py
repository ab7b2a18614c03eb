"""Spans: the piece of a tendon's path between two points, and its slopes by their motion."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from finger_pin.mechanism.gaps.signed_distance import POINT, SLOPE_WIDTH
from finger_pin.typing import Pointer


class SpanColumns(NamedTuple):
    """First columns of a span's numbers: length, turn, and the pull on both points, x, y and z each."""

    length: int
    turn: int
    first_pull: int
    second_pull: int


class SpanSlopeColumns(NamedTuple):
    """First columns of a span's slopes, `SLOPE_WIDTH` each: of the turn, and of the pulls' components one by one."""

    turn: int
    first_pull: int
    second_pull: int


class WrapParameters(NamedTuple):
    """Columns of the parameters of a wrap.

    Attributes:
        radius: Of the wrap, m.
        side_x, side_y, side_z: The side point, m. One that another body carries is a third point, and inside if it is
            nearer than the radius.
        has_side: Whether there is one.
        inside: Whether the path passes inside.
    """

    radius: int
    side_x: int
    side_y: int
    side_z: int
    has_side: int
    inside: int


SPAN_OUT = SpanColumns(0, 1, 2, 5)
SPAN_SLOPE = SpanSlopeColumns(0, SLOPE_WIDTH, 4 * SLOPE_WIDTH)
#: How many numbers a span has, and how many slopes.
SPAN_OUT_SIZE, SPAN_SLOPE_SIZE = SPAN_OUT.second_pull + 3, SPAN_SLOPE.second_pull + 3 * SLOPE_WIDTH
WRAP = WrapParameters(*range(len(WrapParameters._fields)))
#: Points no farther apart are at one place, m: the leg between them has no direction.
COINCIDENT = 1e-9
#: What ``has_side`` is for a side point that is the third point.
SIDE_ON_OTHER_BODY = 2.0


@dataclass(frozen=True)
class WrapSegment:
    """Segment of a path between two points of bodies, in the frame of a third.

    Its functions take plain numbers, allocate nothing, and are run by Python and by the compiler.

    Attributes:
        name: For messages.
        parameters: Names of its numbers; ``p`` holds them in this order.
        value: (points, p, out) -> None; the points are two in the span's frame and a side point, in columns `POINT`, m.
            Into the columns `SPAN_OUT` go the length, m, the angle by which the path turns along the wrap, rad, and
            the pulls, the derivatives of the length by both points.
        slopes: (points, p, out) -> None; into the columns `SPAN_SLOPE` go the derivatives of turn and pulls by the
            coordinates of both points, 1/m.
    """

    name: str
    parameters: tuple[str, ...]
    value: Callable[[Pointer, Pointer, Pointer], None]
    slopes: Callable[[Pointer, Pointer, Pointer], None]
    columns: ClassVar[int] = 1


def side_point(points: Pointer, p: Pointer) -> tuple[float, float, float, float]:
    """Return the side point, seen from the wrap, and whether the path passes inside."""
    if p[WRAP.has_side] != SIDE_ON_OTHER_BODY:
        return p[WRAP.side_x], p[WRAP.side_y], p[WRAP.side_z], p[WRAP.inside]
    x, y, z = points[POINT.third], points[POINT.third + 1], points[POINT.third + 2]
    inside = x * x + y * y + z * z < p[WRAP.radius] * p[WRAP.radius]
    return x, y, z, 1.0 if inside else 0.0


def clear(out: Pointer, size: int) -> None:
    """Set numbers to zero."""
    for i in range(size):
        out[i] = 0.0


def _distance(points: Pointer) -> float:
    x0, y0, z0 = points[POINT.first], points[POINT.first + 1], points[POINT.first + 2]
    x1, y1, z1 = points[POINT.second], points[POINT.second + 1], points[POINT.second + 2]
    return math.sqrt((x1 - x0) ** 2 + (y1 - y0) ** 2 + (z1 - z0) ** 2)


def straight_value(points: Pointer, p: Pointer, out: Pointer) -> None:
    """Fill in length, no turn, and pull; no pull between coincident points."""
    length = _distance(points)
    share = 1.0 / length if length > COINCIDENT else 0.0
    out[SPAN_OUT.length] = length
    out[SPAN_OUT.turn] = 0.0
    for i in range(3):
        pull = share * (points[POINT.second + i] - points[POINT.first + i])
        out[SPAN_OUT.second_pull + i] = pull
        out[SPAN_OUT.first_pull + i] = -pull


def straight_slopes(points: Pointer, p: Pointer, out: Pointer) -> None:
    """Fill in the slopes: (I - d d^T) / length, for the direction d."""
    length = _distance(points)
    share = 1.0 / length if length > COINCIDENT else 0.0
    clear(out, SLOPE_WIDTH)
    for i in range(3):
        axis_i = points[POINT.second + i] - points[POINT.first + i]
        first, second = SPAN_SLOPE.first_pull + SLOPE_WIDTH * i, SPAN_SLOPE.second_pull + SLOPE_WIDTH * i
        for j in range(3):
            axis_j = points[POINT.second + j] - points[POINT.first + j]
            across = share * (1.0 * (i == j) - share * share * axis_i * axis_j)
            out[first + POINT.first + j] = across
            out[first + POINT.second + j] = -across
            out[second + POINT.first + j] = -across
            out[second + POINT.second + j] = across


#: The distance of the points.
STRAIGHT = WrapSegment("straight", (), straight_value, straight_slopes)
