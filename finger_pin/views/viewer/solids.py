"""Solids of the scene: the visuals of the URDF, a groove for every winding, and meshcat's commands for them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from finger_pin.description.primitives import Geometry
from finger_pin.mechanism.geometry import TendonGeometry
from finger_pin.typing import Array

ROOT = "/finger_pin"
Command = dict[str, Any]

#: Opacity of solids and grooves, so that the tendons show inside.
SOLID_OPACITY = 0.28
_GROOVE_COLOUR = (0.55, 0.62, 0.72)
_CYLINDER = {"type": "CylinderGeometry", "radiusTop": 1.0, "radiusBottom": 1.0, "height": 1.0, "radialSegments": 48}
# Three.js's geometries of unit size, and their rotations: its cylinders are along y.
_GEOMETRIES: dict[str, tuple[Command, Array]] = {
    "box": ({"type": "BoxGeometry", "width": 1.0, "height": 1.0, "depth": 1.0}, np.eye(3)),
    "cylinder": (_CYLINDER, np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])),
    "ball": ({"type": "SphereGeometry", "radius": 1.0, "widthSegments": 40, "heightSegments": 28}, np.eye(3)),
}


@dataclass(frozen=True, eq=False)
class Solid:
    """A translucent solid that is fixed to a frame of the scene.

    Attributes:
        frame: Name of the frame: the base, a link or an object.
        name: Of the solid.
        geometry: Its shape, about the origin.
        rotation: Shape (3, 3), from the solid to the frame; cylinders are along z.
        translation: Shape (3,), m, in the frame.
        colour: Red, green and blue, 0 to 1.
        opacity: 0 to 1.
    """

    frame: str
    name: str
    geometry: Geometry
    rotation: Array
    translation: Array
    colour: tuple[float, float, float]
    opacity: float

    def command(self, root: str = ROOT, colour: tuple[float, float, float] | None = None) -> Command:
        """Return meshcat's ``set_object`` command.

        Args:
            root: Path below which the frame stands.
            colour: In place of the solid's own, if given.
        """
        shape, turn = _GEOMETRIES.get(self.geometry.kind) or (_mesh(self.geometry), np.eye(3))
        red, green, blue = (round(255 * float(component)) for component in colour or self.colour)
        material = {
            "type": "MeshPhongMaterial",
            "color": (red << 16) + (green << 8) + blue,
            "shininess": 30,
            "transparent": True,
            "opacity": self.opacity,
            "depthWrite": False,
            # Flat shading shows edges where corners have no normals.
            "flatShading": self.geometry.kind == "mesh",
        }
        path = f"{root}/{self.frame}/{self.name}"
        matrix = pose_matrix((self.rotation * np.array(self.geometry.scale)) @ turn, self.translation)
        return set_object(path, "Mesh", shape, material, matrix)


def _mesh(shape: Geometry) -> Command:
    corners = np.round(shape.corners, 5).ravel().tolist()
    attributes = {"position": {"itemSize": 3, "type": "Float32Array", "array": corners}}
    index = {"type": "Uint32Array", "array": shape.faces.ravel().tolist()}
    return {"type": "BufferGeometry", "data": {"attributes": attributes, "index": index}}


def link_names(geometry: TendonGeometry) -> list[str]:
    """Return the names under which the base and the links stand in the scene."""
    return ["base", *(f"{name}_link" for name in geometry.description.joints)]


def link_solids(geometry: TendonGeometry, tube_radius: float) -> Iterator[Solid]:
    """Yield the solids of the base and the links, and grooves.

    Args:
        geometry: The finger and its tendons.
        tube_radius: Radius with which tendons are drawn, m; grooves are smaller by as much.
    """
    links = link_names(geometry)
    for visual in geometry.visuals:
        placement, colour = visual.placement, visual.colour[:3]
        opacity = float(visual.colour[3] * SOLID_OPACITY)
        pose = placement.rotation, placement.translation
        yield Solid(links[visual.link], visual.name, visual.geometry, *pose, colour, opacity)
    for tendon, arc in geometry.arcs:
        radius = max(abs(arc.radius) - tube_radius, 0.5 * tube_radius)
        shape = Geometry("cylinder", (radius, radius, 0.8 * geometry.lanes.spacing))
        pose, name = (arc.frame, arc.lane * arc.frame[:, 2]), f"groove_{tendon}"
        yield Solid(links[arc.joint], name, shape, *pose, _GROOVE_COLOUR, SOLID_OPACITY)


def root_command(rotation: Array) -> Command:
    """Return meshcat's ``set_transform`` command that turns the base frame into the frame of the scene."""
    return {"type": "set_transform", "path": ROOT, "matrix": pose_matrix(rotation, np.zeros(3))}


def set_object(path: str, kind: str, shape: Command, material: Command, matrix: list[float] | None = None) -> Command:
    """Return meshcat's ``set_object`` command for a geometry with a material; without a matrix it is not moved."""
    shape, material = {"uuid": f"{path}:geometry", **shape}, {"uuid": f"{path}:material", **material}
    ids = {"geometry": shape["uuid"], "material": material["uuid"], "matrix": matrix or np.eye(4).ravel().tolist()}
    scene = {"metadata": {"version": 4.5, "type": "Object"}, "geometries": [shape], "materials": [material]}
    return {"type": "set_object", "path": path, "object": {**scene, "object": {"uuid": path, "type": kind, **ids}}}


def pose_matrix(rotation: Array, translation: Array) -> list[float]:
    """Return a pose as meshcat has it: 16 numbers, column by column."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation
    numbers: list[float] = matrix.T.ravel().tolist()
    return numbers


def newton_length(longest: float, strongest: float) -> float:
    """Return the length that stands for a newton, m: 1, 2 or 5 times a power of ten, so that no force is too long."""
    if strongest <= 0.0:
        return longest
    limit = longest / strongest
    decade = 10.0 ** math.floor(math.log10(limit))
    return max(step * decade for step in (1.0, 2.0, 5.0) if step * decade <= limit * (1.0 + 1e-9))
