"""Signed distances: where the numbers stand that their functions are given, and those that they fill in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from finger_pin.mechanism.gaps.vectors import Triple, subtract
from finger_pin.typing import Pointer


class PointColumns(NamedTuple):
    """First columns of the points of a gap or a span, x, y and z each, m."""

    first: int
    second: int
    third: int


class GapColumns(NamedTuple):
    """First columns of a gap's numbers: the gap, where a span has its length, and vectors, x, y and z each."""

    gap: int
    normal: int
    point: int
    first_tangent: int
    second_tangent: int


class GapSlopeColumns(NamedTuple):
    """First columns of a gap's slopes, `SLOPE_WIDTH` each: of the components of its vectors one by one, of the gap."""

    normal: int
    point: int
    first_tangent: int
    second_tangent: int
    gap: int


#: Slopes of a number: by x, y and z of the first point, and of the second.
SLOPE_WIDTH = 6
POINT = PointColumns(0, 3, 6)
GAP_OUT = GapColumns(0, 1, 4, 7, 10)
GAP_SLOPE = GapSlopeColumns(0, 3 * SLOPE_WIDTH, 6 * SLOPE_WIDTH, 9 * SLOPE_WIDTH, 12 * SLOPE_WIDTH)
#: How many numbers a gap has, and how many slopes; a span has fewer.
GAP_OUT_SIZE, GAP_SLOPE_SIZE = GAP_OUT.second_tangent + 3, GAP_SLOPE.gap + SLOPE_WIDTH


def vector_at(numbers: Pointer, column: int) -> Triple:
    """Return the vector that begins in a column."""
    return numbers[column], numbers[column + 1], numbers[column + 2]


def part_axis(points: Pointer) -> Triple:
    """Return the vector from the first point to the second."""
    return subtract(vector_at(points, POINT.second), vector_at(points, POINT.first))


def put_vector(vector: Triple, out: Pointer, column: int, stride: int = 1) -> None:
    """Fill in a vector that begins in a column; of slopes, `SLOPE_WIDTH` lie between its components."""
    out[column], out[column + stride], out[column + 2 * stride] = vector


@dataclass(frozen=True)
class SignedDistance:
    """The distance between a part of body A, seen as two points, and the shape of body W, in the frame of that shape.

    A positive distance is the true one or a lower bound of it, and it changes by no more than the points of both bodies
    move against each other: it is Lipschitz 1 in the motion of their material. Both are convex, and the plane across
    the normal has each on its own side. Detection in time rests on all three. The normal is the distance's gradient,
    wherever it is negative too, so that the work of a force along it is that of the distance.

    Attributes:
        name: For messages.
        parameters: Names of its numbers; ``p`` holds them in this order.
        value: (points, p, out). The points are those of A's part, such as the ends of a capsule's axis, twice the same
            for a sphere, or three of an ellipsoid, in columns `POINT`, m. Fills the columns `GAP_OUT` with the signed
            distance, negative for penetration, m; with the normal from W towards A, a unit vector but deep in an edge;
            with the contact point, midway between the surfaces, m; and with two tangents as long, right-handed with
            the normal.
        slopes: (points, p, out). Fills the columns `GAP_SLOPE` with the derivatives of all these by the coordinates of
            the first two points, for motions that keep the points' distance. Of three points, by the velocity of the
            first and the angular velocity of A instead.
    """

    name: str
    parameters: tuple[str, ...]
    value: Callable[[Pointer, Pointer, Pointer], None]
    slopes: Callable[[Pointer, Pointer, Pointer], None]
    columns: ClassVar[int] = 4
