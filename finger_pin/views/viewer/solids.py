"""Solids of the scene: the visuals of the URDF, a groove for every winding, and meshcat's commands for them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import coal
import numpy as np
from numpy.typing import NDArray

from finger_pin.exceptions import InputError
from finger_pin.mechanism.geometry import TendonGeometry
from finger_pin.typing import Array

ROOT = "/finger_pin"
Command = dict[str, Any]

#: Opacity of solids and grooves, so that the tendons show inside.
SOLID_OPACITY = 0.28
_GROOVE_COLOUR = (0.55, 0.62, 0.72)
# Three.js runs its cylinders along y, others along z.
_Y_TO_Z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


@dataclass(frozen=True, eq=False)
class Solid:
    """A translucent solid that is fixed to a frame of the scene.

    Attributes:
        frame: Name of the frame: the base, a link or an object.
        name: Of the solid.
        kind: Box, cylinder, sphere, ellipsoid or mesh.
        sizes: As `description.primitives.Part` has them, m; none of a mesh.
        rotation: Shape (3, 3), from the solid to the frame; cylinders are along z.
        translation: Shape (3,), m, in the frame.
        colour: Red, green and blue, 0 to 1.
        opacity: 0 to 1.
        corners: Of a mesh, shape (v, 3), m.
        faces: Triangles of a mesh, indices of corners, shape (f, 3).
    """

    frame: str
    name: str
    kind: str
    sizes: tuple[float, ...]
    rotation: Array
    translation: Array
    colour: tuple[float, float, float]
    opacity: float
    corners: Array = field(default_factory=lambda: np.zeros((0, 3)))
    faces: NDArray[np.intp] = field(default_factory=lambda: np.zeros((0, 3), dtype=np.intp))

    def command(self, root: str = ROOT, colour: tuple[float, float, float] | None = None) -> Command:
        """Return meshcat's ``set_object`` command.

        Args:
            root: Path below which the frame stands.
            colour: In place of the solid's own, if given.
        """
        rotation = self.rotation
        if self.kind == "cylinder":
            rotation = rotation @ _Y_TO_Z
        elif self.kind == "ellipsoid":
            # A ball, stretched along its axes.
            rotation = rotation * np.array(self.sizes)
        red, green, blue = (round(255 * float(component)) for component in colour or self.colour)
        material = {
            "type": "MeshPhongMaterial",
            "color": (red << 16) + (green << 8) + blue,
            "shininess": 30,
            "transparent": True,
            "opacity": self.opacity,
            "depthWrite": False,
            # Flat shading shows edges where corners have no normals.
            "flatShading": self.kind == "mesh",
        }
        path = f"{root}/{self.frame}/{self.name}"
        return set_object(path, "Mesh", self._geometry(), material, pose_matrix(rotation, self.translation))

    def _geometry(self) -> Command:
        if self.kind == "box":
            return {"type": "BoxGeometry", **dict(zip(("width", "height", "depth"), self.sizes, strict=True))}
        if self.kind == "cylinder":
            radius, height = self.sizes
            ends = {"radiusTop": radius, "radiusBottom": radius}
            return {"type": "CylinderGeometry", **ends, "height": height, "radialSegments": 48}
        if self.kind == "mesh":
            corners = np.round(self.corners, 5).ravel().tolist()
            attributes = {"position": {"itemSize": 3, "type": "Float32Array", "array": corners}}
            index = {"type": "Uint32Array", "array": self.faces.ravel().tolist()}
            return {"type": "BufferGeometry", "data": {"attributes": attributes, "index": index}}
        radius = 1.0 if self.kind == "ellipsoid" else self.sizes[0]
        return {"type": "SphereGeometry", "radius": radius, "widthSegments": 40, "heightSegments": 28}


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
        kind, sizes = _primitive(visual.name, visual.shape)
        mesh = _surface(visual.shape) if kind == "mesh" else ()
        opacity = float(visual.colour[3] * SOLID_OPACITY)
        pose = placement.rotation, placement.translation
        yield Solid(links[visual.link], visual.name, kind, sizes, *pose, colour, opacity, *mesh)
    for tendon, arc in geometry.arcs:
        sizes = (max(abs(arc.radius) - tube_radius, 0.5 * tube_radius), 0.8 * geometry.lanes.spacing)
        pose, name = (arc.frame, arc.lane * arc.frame[:, 2]), f"groove_{tendon}"
        yield Solid(links[arc.joint], name, "cylinder", sizes, *pose, _GROOVE_COLOUR, SOLID_OPACITY)


def root_command(rotation: Array) -> Command:
    """Return meshcat's ``set_transform`` command that turns the base frame into the frame of the scene."""
    return {"type": "set_transform", "path": ROOT, "matrix": pose_matrix(rotation, np.zeros(3))}


def _primitive(name: str, shape: Any) -> tuple[str, tuple[float, ...]]:
    """Return the kind and the sizes of a geometry of Pinocchio."""
    kind = type(shape).__name__.lower()
    if isinstance(shape, coal.BVHModelBase):
        return "mesh", ()
    if kind == "cylinder":
        return kind, (shape.radius, 2.0 * shape.halfLength)
    if kind == "sphere":
        return kind, (shape.radius,)
    if kind == "ellipsoid":
        return kind, tuple(shape.radii)
    if kind == "box":
        return kind, tuple((2.0 * shape.halfSide).tolist())
    raise InputError(f"visual {name}", "must be a box, a cylinder, a sphere, an ellipsoid or a mesh", kind)


def _surface(shape: Any) -> tuple[Array, NDArray[np.intp]]:
    """Return the corners and the faces of a mesh of Pinocchio."""
    faces = [[triangle[i] for i in range(3)] for triangle in map(shape.tri_indices, range(shape.num_tris))]
    return np.asarray(shape.vertices()), np.array(faces, dtype=np.intp).reshape(-1, 3)


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
