"""Primitive shapes: what each is called, which sizes it has, and what follows from them.

Solids are about their origin, round ones along z; a half-space is z < 0. All that draws, writes, weighs or touches a
primitive asks here.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Any, ClassVar, NamedTuple, Self

from pydantic import model_validator

from finger_pin.description.validation import MILLIMETRES, Description, problem, quantity, real, vector

Triple = tuple[float, float, float]
Sizes = tuple[float, ...]


class Part(NamedTuple):
    """A box, cylinder, sphere or ellipsoid that a primitive is drawn with.

    Attributes:
        kind: Of the four.
        sizes: As `Kind.entries` of that kind has them, m.
        height: Of its centre, along z, m.
    """

    kind: str
    sizes: Sizes
    height: float = 0.0


class Kind(NamedTuple):
    """A kind of primitive; all functions take its sizes, m.

    Attributes:
        entries: Names of its sizes.
        reach: Largest distance of a point from the origin, m.
        half_sides: Of the box around it, m.
        half_axis: Of the ends of its axes from the origin, m: of a capsule without its round ends.
        moments: Moments of inertia of even density about x, y and z, per mass, m2.
        parts: It is drawn with.
    """

    entries: tuple[str, ...]
    reach: Callable[[Sizes], float]
    half_sides: Callable[[Sizes], Triple]
    half_axis: Callable[[Sizes], Triple]
    moments: Callable[[Sizes], Triple]
    parts: Callable[[Sizes], tuple[Part, ...]]


def _capsule_moments(sizes: Sizes) -> Triple:
    """Return those of a cylinder and two halves of a ball, whose mass centres are 3/8 of the radius from its ends."""
    radius, length = sizes
    ball = 4.0 * radius / (4.0 * radius + 3.0 * length)
    middle = 1.0 - ball
    across = middle * (3.0 * radius**2 + length**2) / 12.0
    across += ball * (0.4 * radius**2 + length**2 / 4.0 + 3.0 * length * radius / 8.0)
    return across, across, middle * radius**2 / 2.0 + ball * 0.4 * radius**2


def _box_moments(sizes: Sizes) -> Triple:
    x, y, z = (side * side / 12.0 for side in sizes)
    return y + z, z + x, x + y


def _ellipsoid_moments(sizes: Sizes) -> Triple:
    x, y, z = (axis * axis / 5.0 for axis in sizes)
    return y + z, z + x, x + y


def _cylinder_moments(sizes: Sizes) -> Triple:
    radius, length = sizes
    across = (3.0 * radius**2 + length**2) / 12.0
    return across, across, radius**2 / 2.0


def _halves(sizes: Sizes) -> Triple:
    x, y, z = (0.5 * side for side in sizes)
    return x, y, z


def _whole(sizes: Sizes) -> Triple:
    x, y, z = sizes
    return x, y, z


#: By name.
KINDS = {
    "half_space": Kind(
        (),
        reach=lambda _: math.inf,
        half_sides=lambda _: (math.inf,) * 3,
        half_axis=lambda _: (0.0,) * 3,
        moments=lambda _: (0.0,) * 3,
        parts=lambda _: (),
    ),
    "sphere": Kind(
        ("radius",),
        reach=lambda sizes: sizes[0],
        half_sides=lambda sizes: (sizes[0],) * 3,
        half_axis=lambda _: (0.0,) * 3,
        moments=lambda sizes: (0.4 * sizes[0] ** 2,) * 3,
        parts=lambda sizes: (Part("sphere", sizes),),
    ),
    "box": Kind(
        ("sides",),
        reach=lambda sizes: 0.5 * math.hypot(*sizes),
        half_sides=_halves,
        half_axis=_halves,
        moments=_box_moments,
        parts=lambda sizes: (Part("box", sizes),),
    ),
    "cylinder": Kind(
        ("radius", "length"),
        reach=lambda sizes: math.hypot(sizes[0], 0.5 * sizes[1]),
        half_sides=lambda sizes: (sizes[0], sizes[0], 0.5 * sizes[1]),
        half_axis=lambda sizes: (0.0, 0.0, 0.5 * sizes[1]),
        moments=_cylinder_moments,
        parts=lambda sizes: (Part("cylinder", sizes),),
    ),
    "capsule": Kind(
        ("radius", "length"),
        reach=lambda sizes: sizes[0] + 0.5 * sizes[1],
        half_sides=lambda sizes: (sizes[0], sizes[0], sizes[0] + 0.5 * sizes[1]),
        half_axis=lambda sizes: (0.0, 0.0, 0.5 * sizes[1]),
        moments=_capsule_moments,
        parts=lambda sizes: (
            Part("cylinder", sizes),
            *(Part("sphere", sizes[:1], sign * sizes[1]) for sign in (-0.5, 0.5)),
        ),
    ),
    "ellipsoid": Kind(
        ("semi_axes",),
        reach=max,
        half_sides=_whole,
        half_axis=_whole,
        moments=_ellipsoid_moments,
        parts=lambda sizes: (Part("ellipsoid", sizes),),
    ),
}


class Sized(Description):
    """A primitive shape with its sizes; the entry that names its kind is that of a subclass.

    Attributes:
        kind_entry: Name of that entry.
    """

    kind_entry: ClassVar[str] = "shape"

    radius: Annotated[float, real(0.0, 10.0, above=True, hint=MILLIMETRES)] | None = quantity(
        None, unit="m", source="design", doc="Of a sphere, cylinder or capsule."
    )
    length: Annotated[float, real(0.0, 10.0, above=True, hint=MILLIMETRES)] | None = quantity(
        None, unit="m", source="design", doc="Of a cylinder; of a capsule without its round ends; along z."
    )
    sides: Annotated[Triple, vector(3, 1e-9, 10.0, MILLIMETRES)] | None = quantity(
        None, unit="m", source="design", doc="Of a box, along x, y and z."
    )
    semi_axes: Annotated[Triple, vector(3, 1e-9, 10.0, MILLIMETRES)] | None = quantity(
        None, unit="m", source="design", doc="Of an ellipsoid, along x, y and z."
    )

    @model_validator(mode="after")
    def _sized(self) -> Self:
        own, key = self._entries, self.kind_entry
        for entry in ("radius", "length", "sides", "semi_axes"):
            size, needed = getattr(self, entry), entry in own
            if size is None and needed:
                raise problem(entry, f'is missing: {key} = "{self.primitive}" needs {", ".join(own)}')
            if size is not None and not needed:
                kinds = ", ".join(name for name, each in KINDS.items() if entry in each.entries)
                raise problem(entry, f'is for {kinds}, not for {key} = "{self.primitive}"', size)
        return self

    @property
    def primitive(self) -> str:
        """Its kind, a key of `KINDS`, or mesh."""
        kind: str = getattr(self, self.kind_entry)
        return kind

    @property
    def _entries(self) -> tuple[str, ...]:
        return KINDS[self.primitive].entries if self.primitive in KINDS else ()

    @property
    def sizes(self) -> Sizes:
        """Its sizes in the order of `Kind.entries`, m."""
        sizes: list[Any] = [getattr(self, name) for name in self._entries]
        return sizes[0] if sizes and isinstance(sizes[0], tuple) else tuple(sizes)

    @property
    def parts(self) -> tuple[Part, ...]:
        """Parts that are drawn of it; none of a mesh or a half-space."""
        return KINDS[self.primitive].parts(self.sizes) if self.primitive in KINDS else ()
