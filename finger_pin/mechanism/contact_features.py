"""Contacts of two bodies: the parts of one that meet the whole other one, either way round.

A part is a convex piece of a body (a corner, an edge, a rim, a whole ellipsoid), and its contact is its distance from
the other body: a distance of two convex bodies. So it depends smoothly on how both are placed and changes by no more
than the material moves; its force does no work of its own, and its bristles stay with the material. Face on face, what
meets are the corners of either body on the other and the edges of both; edge on edge, the pair of edges that is
nearest; of a rolling cylinder, the lowest points of its rims.

Corners and edges of boxes and rims of cylinders are rounded by `fillet` where they meet boxes, cylinders and
ellipsoids; against all else they are sharp. So there is one way out of a contact even where two edges lie on each
other. `gaps.distance` says how roundings grow with the depth.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from finger_pin.description.primitives import KINDS
from finger_pin.mechanism.gaps import prism_parameters
from finger_pin.mechanism.solids import Solid
from finger_pin.typing import Array

# Fillets are this share of a body's least half-width, but at most so large, m.
_FILLET_SHARE, _LARGEST_FILLET = 0.1, 1e-3
# A face's pressure, if even, has its moment about the face's axis at two thirds of the radius.
_EVEN_PRESSURE_RADIUS = 2.0 / 3.0


@dataclass(frozen=True, eq=False)
class ContactPart:
    """A part of a body: a segment or a point, widened by a disc across it, and rounded; or an ellipsoid.

    Attributes:
        ends: P_0 and P_1 in the body's frame, shape (2, 3), m; of an ellipsoid its centre and the ends of two of its
            semi-axes, shape (3, 3).
        radius: Of its rounding, m.
        disc: Radius of the disc across P_1 - P_0, m; zero for none.
        along: 1 if it goes from P_0 to P_1, 0 if it is at P_0 alone.
        third: Third semi-axis of an ellipsoid, m.
    """

    ends: Array
    radius: float
    disc: float = 0.0
    along: float = 1.0
    third: float = 0.0

    @property
    def breadth(self) -> float:
        """Half width across P_1 - P_0, m; of an ellipsoid its longest semi-axis."""
        return (
            max(self.disc, *np.linalg.norm(self.ends - self.ends[0], axis=1), self.third) if self.third else self.disc
        )


def fillet(solid: Solid) -> float:
    """Return the radius with which a box's edges or a cylinder's rims are rounded, m; none of others."""
    if solid.shape not in _FACED:
        return 0.0
    return min(_FILLET_SHARE * min(KINDS[solid.shape].half_sides(solid.sizes)), _LARGEST_FILLET)


def solid_contacts(one: Solid, other: Solid) -> Iterator[tuple[Solid, ContactPart, Solid, tuple[float, ...]]]:
    """Yield all contacts of two solids: the body whose part touches, the part, the other body and its prism.

    An ellipsoid, the first one if both are, touches as a whole; of two the other one has no prism. A
    sphere or a capsule, likewise, touches with its axis.
    """
    for a, w in ((one, other), (other, one)):
        if w.shape == "half_space":
            prism = prism_parameters(w.shape, ())
            yield from ((a, part, w, prism) for part in _PARTS[a.shape](a, 0.0))
            return
    for a, w in ((one, other), (other, one)):
        if a.shape == "ellipsoid":
            prism = () if w.shape == a.shape else prism_parameters(w.shape, w.sizes, fillet(w))
            yield from ((a, part, w, prism) for part in _PARTS[a.shape](a, 0.0))
            return
    for a, w in ((one, other), (other, one)):
        if a.shape in ("sphere", "capsule"):
            prism = prism_parameters(w.shape, w.sizes)
            yield from ((a, part, w, prism) for part in _round(a, w.shape in _FACED))
            return
    for a, w in ((one, other), (other, one)):
        rounding, prism = fillet(a), prism_parameters(w.shape, w.sizes, fillet(w))
        parts = _PARTS[a.shape](a, rounding)
        parts += _edges(a, rounding) if a.shape == "box" else []
        if a.shape == w.shape == "cylinder" and a is one:
            parts += [_whole(a, rounding)]
        yield from ((a, part, w, prism) for part in parts)


def _round(solid: Solid, faces: bool) -> list[ContactPart]:
    """Return a sphere's or a capsule's axis, in two halves if it may lie on a face."""
    ends, radius = _axis(solid), solid.sizes[0]
    if solid.shape == "sphere" or not faces:
        return [ContactPart(ends, radius)]
    middle = ends.mean(axis=0)
    return [ContactPart(np.stack([middle, end]), radius) for end in ends]


def _ends(solid: Solid, rounding: float) -> list[ContactPart]:
    """Return a sphere's centre, or the ends of a capsule's axis; a far one only if the near one lies in another."""
    ends = _axis(solid)[1 if solid.shape == "sphere" or solid.joined else 0 :]
    return [ContactPart(np.stack([end, end]), solid.sizes[0] + rounding) for end in ends]


def _axis(solid: Solid) -> Array:
    half = 0.5 * (*solid.sizes, 0.0)[1]
    return np.array([[0.0, 0.0, -half], [0.0, 0.0, half]])


def _corners(solid: Solid, rounding: float) -> list[ContactPart]:
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=3))) * (0.5 * np.array(solid.sizes) - rounding)
    return [ContactPart(np.stack([corner, corner]), rounding) for corner in corners]


def _edges(solid: Solid, rounding: float) -> list[ContactPart]:
    half = 0.5 * np.array(solid.sizes) - rounding
    parts = []
    for axis in range(3):
        for signs in itertools.product((-1.0, 1.0), repeat=2):
            middle, along = np.insert(np.array(signs), axis, 0.0) * half, half * np.eye(3)[axis]
            parts.append(ContactPart(np.stack([middle - along, middle + along]), rounding))
    return parts


def _rims(solid: Solid, rounding: float) -> list[ContactPart]:
    """Return both rims of a cylinder, and three points of each face, which resist spinning on the spot."""
    radius, half = solid.sizes[0], 0.5 * solid.sizes[1] - rounding
    parts = []
    for side in (-half, half):
        parts.append(ContactPart(np.array([[0.0, 0.0, side], [0.0, 0.0, -side]]), rounding, radius - rounding, 0.0))
        for turn in 2.0 * np.pi * np.arange(3) / 3.0:
            stud = np.array(
                [_EVEN_PRESSURE_RADIUS * radius * np.cos(turn), _EVEN_PRESSURE_RADIUS * radius * np.sin(turn), side]
            )
            parts.append(ContactPart(np.stack([stud, stud]), rounding))
    return parts


def _ellipsoid(solid: Solid, rounding: float) -> list[ContactPart]:
    x, y, z = solid.sizes
    return [ContactPart(np.array([[0.0, 0.0, 0.0], [x, 0.0, 0.0], [0.0, y, 0.0]]), rounding, 0.0, 0.0, z)]


def _whole(solid: Solid, rounding: float) -> ContactPart:
    radius, half = solid.sizes[0] - rounding, 0.5 * solid.sizes[1] - rounding
    return ContactPart(np.array([[0.0, 0.0, -half], [0.0, 0.0, half]]), rounding, radius)


# The parts of a kind that meet a plane, and with a rounding, m, those of kinds with faces that meet each other.
_PARTS = {"sphere": _ends, "box": _corners, "cylinder": _rims, "capsule": _ends, "ellipsoid": _ellipsoid}
_FACED = ("box", "cylinder")
