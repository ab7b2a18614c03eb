"""Solids of a picture, fixed to links."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from finger_pin.description.primitives import KINDS, Geometry
from finger_pin.description.tree import Tree
from finger_pin.description.tree_parts import MATERIALS, TreeSolid
from finger_pin.exceptions import InputError
from finger_pin.mechanism.body_places import Placed, rotation
from finger_pin.typing import Array

# Sizes of Pinocchio's geometries, as `KINDS` has them, by the names of their classes.
_SIZES: dict[str, Callable[[Any], tuple[float, ...]]] = {
    "box": lambda shape: tuple((2.0 * shape.halfSide).tolist()),
    "cylinder": lambda shape: (shape.radius, 2.0 * shape.halfLength),
    "sphere": lambda shape: (shape.radius,),
    "ellipsoid": lambda shape: tuple(shape.radii),
}


@dataclass(frozen=True, eq=False)
class Visual:
    """A solid that is fixed to a link.

    Attributes:
        name: Of the solid.
        link: Index of the link, 0 for the base.
        geometry: Its shape, about the origin.
        placement: In the frame of the link.
        colour: Red, green, blue and opacity, 0 to 1.
    """

    name: str
    link: int
    geometry: Geometry
    placement: pin.SE3
    colour: tuple[float, float, float, float]


def body_visuals(tree: Tree, placed: Mapping[str | None, Placed]) -> tuple[Visual, ...]:
    """Return the solids of bodies, which have their places on joints."""
    meshes = {name: Geometry.mesh(*mesh.unpacked()) for name, mesh in tree.meshes.items()}
    times = Counter(key for body in tree.bodies.values() for key in body.solids)
    return tuple(
        visual
        for name, body in tree.bodies.items()
        for key, solid in body.solids.items()
        for visual in _visuals(
            key if times[key] == 1 else f"{name}_{key}",
            placed[name].joint,
            placed[name].frame,
            solid,
            meshes.get(solid.mesh or ""),
        )
    )


def _visuals(name: str, joint: int, frame: pin.SE3, solid: TreeSolid, mesh: Geometry | None) -> list[Visual]:
    """Return a solid as the geometries that it is drawn with."""
    place, colour = frame * pin.SE3(rotation(solid.orientation), np.array(solid.position)), MATERIALS[solid.material]
    return [
        Visual(
            f"{name}_{k}" if k else name, joint, shape, place * pin.SE3(np.eye(3), np.array([0.0, 0.0, height])), colour
        )
        for k, (shape, height) in enumerate(((mesh, 0.0),) if mesh else solid.parts)
    ]


def _geometry(solid: pin.GeometryObject) -> Geometry:
    """Return a geometry of Pinocchio as one of this package."""
    shape, kind = solid.geometry, type(solid.geometry).__name__.lower()
    if isinstance(shape, coal.BVHModelBase):
        faces = [[triangle[i] for i in range(3)] for triangle in map(shape.tri_indices, range(shape.num_tris))]
        return Geometry.mesh(np.asarray(shape.vertices()), np.array(faces, dtype=np.intp).reshape(-1, 3))
    if kind not in _SIZES:
        raise InputError(f"visual {solid.name}", f"must be one of {', '.join(_SIZES)}, or a mesh", kind)
    ((drawn, _),) = KINDS[kind].parts(_SIZES[kind](shape))
    return drawn


def model_visuals(solids: pin.GeometryModel | None, turns: Sequence[Array]) -> tuple[Visual, ...]:
    """Return the solids of a model of the user's own, whose frames were turned, each by a rotation."""
    visuals = []
    for solid in [] if solids is None else solids.geometryObjects:
        joint, (red, green, blue, opacity) = int(solid.parentJoint), map(float, solid.meshColor)
        placement = pin.SE3(turns[joint], np.zeros(3)).inverse() * solid.placement
        visuals.append(Visual(solid.name, joint, _geometry(solid), placement, (red, green, blue, opacity)))
    return tuple(visuals)
