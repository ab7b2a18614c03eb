"""Solids of a picture, fixed to links."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from finger_pin.description.meshes import Mesh
from finger_pin.description.tree import Tree
from finger_pin.description.tree_parts import MATERIALS, TreeSolid
from finger_pin.mechanism.body_places import Placed, rotation
from finger_pin.typing import Array

_COAL = {"box": coal.Box, "sphere": coal.Sphere, "cylinder": coal.Cylinder, "ellipsoid": coal.Ellipsoid}


@dataclass(frozen=True)
class Visual:
    """A solid that is fixed to a link.

    Attributes:
        name: Of the solid.
        link: Index of the link, 0 for the base.
        shape: Geometry of Pinocchio: a box, a cylinder, a sphere or a mesh.
        placement: In the frame of the link.
        colour: Red, green, blue and opacity, 0 to 1.
    """

    name: str
    link: int
    shape: Any
    placement: pin.SE3
    colour: tuple[float, float, float, float]


def body_visuals(tree: Tree, placed: Mapping[str | None, Placed]) -> tuple[Visual, ...]:
    """Return the solids of bodies, which have their places on joints."""
    meshes = {name: _surface(mesh) for name, mesh in tree.meshes.items()}
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


def _surface(mesh: Mesh) -> coal.BVHModelBase:
    points, faces = mesh.unpacked()
    bvh = coal.BVHModelOBBRSS()
    bvh.beginModel(len(faces), len(points))
    bvh.addVertices(points)
    bvh.addTriangles(faces.astype(np.uint64))
    bvh.endModel()
    return bvh


def _visuals(
    name: str, joint: int, frame: pin.SE3, solid: TreeSolid, surface: coal.BVHModelBase | None
) -> list[Visual]:
    """Return a solid as boxes, cylinders, spheres, an ellipsoid, or its surface, if it is a mesh."""
    place, colour = frame * pin.SE3(rotation(solid.orientation), np.array(solid.position)), MATERIALS[solid.material]
    if surface is not None:
        return [Visual(name, joint, surface, place, colour)]
    return [
        Visual(
            f"{name}_{k}" if k else name,
            joint,
            _COAL[part.kind](*part.sizes),
            place * pin.SE3(np.eye(3), np.array([0.0, 0.0, part.height])),
            colour,
        )
        for k, part in enumerate(solid.parts)
    ]


def model_visuals(solids: pin.GeometryModel | None, turns: Sequence[Array]) -> tuple[Visual, ...]:
    """Return the solids of a model of the user's own, whose frames were turned, each by a rotation."""
    visuals = []
    for solid in [] if solids is None else solids.geometryObjects:
        joint, (red, green, blue, opacity) = int(solid.parentJoint), map(float, solid.meshColor)
        placement = pin.SE3(turns[joint], np.zeros(3)).inverse() * solid.placement
        visuals.append(Visual(solid.name, joint, solid.geometry, placement, (red, green, blue, opacity)))
    return tuple(visuals)
