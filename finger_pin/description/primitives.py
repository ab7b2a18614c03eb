"""Primitive shapes: what each is called, which sizes it has, and what follows from them.

Solids are about their origin, round ones along z; a half-space is z < 0. All that draws, writes, weighs or touches a
primitive asks here.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import product
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from finger_pin.description.validation import MILLIMETRES, Description, problem, quantity, real, vector
from finger_pin.typing import Array

Triple = tuple[float, float, float]
Sizes = tuple[float, ...]


def _rim(radius: float, height: float) -> Array:
    turns = np.linspace(0.0, 2.0 * np.pi, 25)[:-1]
    return np.stack([radius * np.cos(turns), radius * np.sin(turns), np.full(len(turns), height)], axis=-1)


# Points whose hull is, or looks like, a geometry of unit size, shape (p, 3).
_UNIT_POINTS = {
    "box": 0.5 * np.array(list(product((-1.0, 1.0), repeat=3))),
    "cylinder": np.concatenate([_rim(1.0, -0.5), _rim(1.0, 0.5)]),
    "ball": np.concatenate([_rim(np.sin(polar), np.cos(polar)) for polar in np.linspace(0.0, np.pi, 13)]),
}


class Geometry(NamedTuple):
    """A solid about its origin that every view can draw.

    Attributes:
        kind: A ``box`` of unit sides, a ``cylinder`` of unit radius and length along z, a ``ball`` of unit radius, or a
            ``mesh``.
        scale: Factors of x, y and z, m; of a mesh 1.
        corners: Of a mesh, shape (v, 3), m.
        faces: Triangles of a mesh, indices of corners, shape (f, 3).
    """

    kind: str
    scale: Triple
    corners: Array = np.zeros((0, 3))
    faces: NDArray[np.integer[Any]] = np.zeros((0, 3), dtype=np.intp)

    @classmethod
    def mesh(cls, corners: Array, faces: NDArray[np.integer[Any]]) -> Self:
        """Return a surface of triangles."""
        return cls("mesh", (1.0, 1.0, 1.0), corners, faces)

    @property
    def points(self) -> Array:
        """Points whose hull is, or looks like, that of the solid, shape (p, 3), m."""
        return np.asarray(_UNIT_POINTS.get(self.kind, self.corners) * self.scale)


Parts = tuple[tuple[Geometry, float], ...]


class Kind(NamedTuple):
    """A kind of primitive; all functions take its sizes, m.

    Attributes:
        entries: Names of its sizes.
        reach: Largest distance of a point from the origin, m.
        half_sides: Of the box around it, m.
        axis_ends: Ends of its axes, shape (k, 3), m: of a capsule without its round ends.
        moments: Moments of inertia of even density about x, y and z, per mass, m2.
        parts: Geometries that it is drawn with, and the height of each along z, m.
        geom: MuJoCo's name of it; None if MuJoCo has none: models with it are not written.
        in_urdf: Whether a URDF has all geometries that it is drawn with; else it is left out of one.
    """

    entries: tuple[str, ...]
    reach: Callable[[Sizes], float]
    half_sides: Callable[[Sizes], Triple]
    axis_ends: Callable[[Sizes], Array]
    moments: Callable[[Sizes], Triple]
    parts: Callable[[Sizes], Parts]
    geom: str | None
    in_urdf: bool = True


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


def _cross(x: float, y: float, z: float) -> Array:
    """Return both ends of three axes about the origin, shape (6, 3)."""
    return np.concatenate([np.diag([x, y, z]), -np.diag([x, y, z])])


def _cylinder(sizes: Sizes) -> tuple[Geometry, float]:
    radius, length = sizes
    return Geometry("cylinder", (radius, radius, length)), 0.0


#: By name.
KINDS = {
    "half_space": Kind(
        (),
        reach=lambda _: math.inf,
        half_sides=lambda _: (math.inf,) * 3,
        axis_ends=lambda _: np.zeros((1, 3)),
        moments=lambda _: (0.0,) * 3,
        parts=lambda _: (),
        geom="plane",
    ),
    "sphere": Kind(
        ("radius",),
        reach=lambda sizes: sizes[0],
        half_sides=lambda sizes: (sizes[0],) * 3,
        axis_ends=lambda _: np.zeros((1, 3)),
        moments=lambda sizes: (0.4 * sizes[0] ** 2,) * 3,
        parts=lambda sizes: ((Geometry("ball", (sizes[0],) * 3), 0.0),),
        geom="sphere",
    ),
    "box": Kind(
        ("sides",),
        reach=lambda sizes: 0.5 * math.hypot(*sizes),
        half_sides=_halves,
        axis_ends=lambda sizes: _cross(*_halves(sizes)),
        moments=_box_moments,
        parts=lambda sizes: ((Geometry("box", _whole(sizes)), 0.0),),
        geom="box",
    ),
    "cylinder": Kind(
        ("radius", "length"),
        reach=lambda sizes: math.hypot(sizes[0], 0.5 * sizes[1]),
        half_sides=lambda sizes: (sizes[0], sizes[0], 0.5 * sizes[1]),
        axis_ends=lambda sizes: _cross(0.0, 0.0, 0.5 * sizes[1]),
        moments=_cylinder_moments,
        parts=lambda sizes: (_cylinder(sizes),),
        geom="cylinder",
    ),
    "capsule": Kind(
        ("radius", "length"),
        reach=lambda sizes: sizes[0] + 0.5 * sizes[1],
        half_sides=lambda sizes: (sizes[0], sizes[0], sizes[0] + 0.5 * sizes[1]),
        axis_ends=lambda sizes: _cross(0.0, 0.0, 0.5 * sizes[1]),
        moments=_capsule_moments,
        parts=lambda sizes: (
            _cylinder(sizes),
            *((Geometry("ball", (sizes[0],) * 3), share * sizes[1]) for share in (-0.5, 0.5)),
        ),
        geom="capsule",
    ),
    "ellipsoid": Kind(
        ("semi_axes",),
        reach=max,
        half_sides=_whole,
        axis_ends=lambda sizes: _cross(*sizes),
        moments=_ellipsoid_moments,
        parts=lambda sizes: ((Geometry("ball", _whole(sizes)), 0.0),),
        geom="ellipsoid",
        in_urdf=False,
    ),
}
#: Names of those that bodies can have: a half-space is no solid.
SOLIDS = tuple(name for name in KINDS if name != "half_space")


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
    def parts(self) -> Parts:
        """Geometries that it is drawn with, and their heights, m; none of a mesh or a half-space."""
        return KINDS[self.primitive].parts(self.sizes) if self.primitive in KINDS else ()

    @property
    def in_urdf(self) -> bool:
        """Whether a URDF has it; meshes are left out."""
        return self.primitive in KINDS and KINDS[self.primitive].in_urdf
