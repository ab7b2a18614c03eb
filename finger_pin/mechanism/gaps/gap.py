"""Gaps: distances of parts of one body from the shape of another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar


@dataclass(frozen=True)
class Gap:
    """The distance between a part of body A, seen as two points, and the shape of body W, in the frame of that shape.

    A positive distance is the true one or a lower bound of it, and it changes by no more than the points of both bodies
    move against each other: it is Lipschitz 1 in the motion of their material. Both are convex, and the plane across
    the normal has each on its own side. Detection in time rests on all three. The normal is the distance's gradient,
    wherever it is negative too, so that the work of a force along it is that of the distance.

    Attributes:
        name: For messages.
        parameters: Names of its numbers; ``p`` holds them in this order.
        value: (y, p, out). y has both points of A's part, such as the ends of a capsule's axis, twice the same for a
            sphere, shape (6,), m. Fills out[0] with the signed distance, negative for penetration, m; out[1:4] with the
            normal from W towards A, a unit vector but deep in an edge; out[4:7] with the contact point, midway between
            the surfaces, m; out[7:10] and out[10:13] with two tangents as long, right-handed with the normal.
        slopes: (y, p, out). Fills out[:72] with d(out[1:13])/dy, 12 x 6 row by row, and out[72:78] with
            d(distance)/dy, for motions that keep the points' distance.
    """

    name: str
    parameters: tuple[str, ...]
    value: Callable[..., Any]
    slopes: Callable[..., Any]
    columns: ClassVar[int] = 3
