"""A palm as data: its size, and its path in the world."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, field_validator, model_validator

from finger_pin.description.recordings.series import Series, series
from finger_pin.description.signals import SignalSettings
from finger_pin.description.validation import Description, Name, problem, quantity, real, suggestion, vector

_MILLIMETRES = " m (is it in millimetres?)"
#: A place on the palm.
PLACE = vector(3, -2.0, 2.0, _MILLIMETRES)
#: The coordinates of a palm's path: place, m, and roll, pitch and yaw, rad, in the world.
PATH = ("x", "y", "z", "roll", "pitch", "yaw")
_COORDINATE = real(-12.5, 12.5)


class PathSignal(SignalSettings):
    """A coordinate of the palm over time: m for x, y, z, rad for roll, pitch, yaw."""

    offset: Annotated[float, _COORDINATE] = quantity(0.0, unit="m or rad", source="chosen", doc="Mean.")
    amplitude: Annotated[float, _COORDINATE] = quantity(0.0, unit="m or rad", source="chosen", doc="Half the swing.")
    height: Annotated[float, _COORDINATE] | None = quantity(None, unit="m or rad", source="chosen", doc="Of none.")
    values: Annotated[tuple[float, ...] | Series, series(-12.5, 12.5)] | None = quantity(
        None, unit="m or rad", source="chosen", doc="At the points or samples."
    )

    @model_validator(mode="after")
    def _accelerates(self) -> Self:
        if self.kind in ("step", "ramp"):
            raise problem("kind", "must be one of sine, points, samples: a palm has an acceleration", self.kind)
        return self


_AT_REST = PathSignal()


class Palm(Description):
    """The palm, on which fingers stand: the base frame of the hand, at rest or moved along a path."""

    size: Annotated[tuple[float, float, float], vector(3, 0.0, 2.0, _MILLIMETRES)] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="Sides of the box that is drawn; zero for none."
    )
    centre: Annotated[tuple[float, float, float], PLACE] = quantity(
        (0.0, 0.0, 0.0), unit="m", source="design", doc="Of the box, in the palm's frame."
    )
    path: dict[Name, PathSignal] | None = Field(
        None, description="Where the palm is in the world over time, by x, y, z, roll, pitch and yaw; at rest without."
    )

    @field_validator("path")
    @classmethod
    def _coordinates(cls, value: dict[str, PathSignal] | None) -> dict[str, PathSignal] | None:
        for name in value or {}:
            if name not in PATH:
                hint = suggestion(name, PATH)
                raise problem(name, f"no such coordinate; there are {', '.join(PATH)}{hint}")
        return value

    def on_path(self, name: str) -> PathSignal:
        """Return a coordinate of the path, by default zero."""
        return (self.path or {}).get(name, _AT_REST)
