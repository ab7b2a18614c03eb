"""The pieces of a tendon's path through space: points, wraps and pulleys."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from finger_pin.description.primitives import Triple
from finger_pin.description.validation import (
    MILLIMETRES,
    Description,
    Name,
    choice,
    direction,
    problem,
    quantity,
    real,
    vector,
)

#: A place in a body's frame.
BODY_POINT = vector(3, -10.0, 10.0, MILLIMETRES)


class SidePoint(Description):
    """The side point of a wrap, carried by another body."""

    body: Name | None = Field(None, description="Body that carries it; the base if left out.")
    position: Annotated[Triple, BODY_POINT] = quantity((0.0, 0.0, 0.0), unit="m", source="design", doc="In its frame.")


class Waypoint(Description):
    """A piece of a tendon's path: a point, a cylinder or sphere that it may wrap, or a pulley that divides it."""

    kind: Annotated[
        Literal["point", "cylinder", "sphere", "pulley"], choice("point", "cylinder", "sphere", "pulley")
    ] = quantity(..., unit="1", source="design", doc="point, cylinder, sphere or pulley.")
    body: Name | None = Field(None, description="Body that carries it; the base if left out.")
    position: Annotated[Triple, BODY_POINT] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="Of the point, or the wrap's centre, in the body's frame."
    )
    orientation: Annotated[tuple[float, float, float, float], direction(4)] = quantity(
        (0.0, 0.0, 0.0, 1.0), unit="1", source="design", doc="Of a wrap in the body's frame; a cylinder's axis is z."
    )
    radius: Annotated[float, real(0.0, 1.0, hint=MILLIMETRES)] = quantity(
        0.0, unit="m", source="design", doc="Of a sphere or cylinder around which it wraps."
    )
    side: Annotated[Triple, BODY_POINT] | None = quantity(
        None, unit="m", source="design", doc="Side point of a wrap, in its frame; nearer than the radius: inside."
    )
    side_point: SidePoint | None = Field(
        None, description="In place of side: a side point that another body carries than the wrap's."
    )
    divisor: Annotated[float, real(0.0, 1e3, above=True)] = quantity(
        1.0, unit="1", source="design", doc="Of a pulley: the path after it counts as this much less."
    )

    @model_validator(mode="after")
    def _one_side(self) -> Self:
        if self.side is not None and self.side_point is not None:
            raise problem("side_point", "has no place beside side")
        return self

    def holds(self, point: Waypoint) -> bool:
        """Return whether a point lies inside of a wrap of the same body; False for another body's."""
        if point.body != self.body:
            return False
        x, y, z, w = self.orientation
        axis, away = np.array([x, y, z]), np.subtract(point.position, self.position)
        # Turned back into the frame of the wrap.
        local = away - 2.0 * w * np.cross(axis, away) + 2.0 * np.cross(axis, np.cross(axis, away))
        # On the surface, to rounding, it may wrap.
        return bool(np.linalg.norm(local[: 2 if self.kind == "cylinder" else 3]) < (1.0 - 1e-9) * self.radius)


def check_path(path: dict[str, Waypoint]) -> None:
    """Refuse a path that does not begin, end and go on with points, pulleys apart."""
    before: str | None = None
    for name, waypoint in path.items():
        wraps = waypoint.kind in ("cylinder", "sphere")
        if wraps and before != "point":
            raise problem(f"path.{name}", "a wrap stands between two points")
        if waypoint.kind == "pulley" and before not in (None, "point"):
            raise problem(f"path.{name}", "a pulley follows a point")
        if wraps and waypoint.radius <= 0.0:
            raise problem(f"path.{name}.radius", "must be above 0", waypoint.radius)
        before = waypoint.kind
    if path and before != "point":
        raise problem("path", "must end with a point")
    for point, wrap in points_inside_wraps(path):
        raise problem(f"path.{wrap}", f"the point {point} lies inside of it, where the path cannot wrap")


def points_inside_wraps(path: dict[str, Waypoint]) -> Iterator[tuple[str, str]]:
    """Yield the points of a path that lie inside of a neighbouring wrap on the same body, with the wrap."""
    for pair in pairwise(path):
        for point, wrap in (pair, pair[::-1]):
            wraps = path[wrap].kind in ("cylinder", "sphere") and path[point].kind == "point"
            if wraps and path[wrap].holds(path[point]):
                yield point, wrap
