"""Rigid bodies as meshcat commands: the visuals of the URDF, and a groove for every winding."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator
from typing import Any

import coal
import numpy as np
from numpy.typing import ArrayLike

from finger_pin.exceptions import InputError
from finger_pin.mechanism.geometry import TendonGeometry
from finger_pin.typing import Array

ROOT = "/finger_pin"
Command = dict[str, Any]

#: Opacity of solids and grooves, so that the tendons show inside.
SOLID_OPACITY = 0.28
GROOVE_COLOUR = (0.55, 0.62, 0.72)

# Three.js runs its cylinders along y, URDF along z.
Y_TO_Z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def link_names(geometry: TendonGeometry) -> list[str]:
    """Return the names under which the base and the links stand in the scene."""
    return ["base", *(f"{name}_link" for name in geometry.description.joints)]


def solid_commands(
    geometry: TendonGeometry, tube_radius: float, root: str = ROOT, colour: tuple[float, ...] | None = None
) -> Iterator[Command]:
    """Yield meshcat's ``set_object`` command for every solid; each hangs below the link that carries it.

    Args:
        geometry: The finger and its tendons.
        tube_radius: Radius with which tendons are drawn, m; grooves are smaller by as much.
        root: Path below which the links hang.
        colour: Of all solids, red, green and blue; by default each has its own.
    """
    links = link_names(geometry)
    for visual in geometry.visuals:
        placement = visual.placement
        shape, rotation = primitive(visual.name, visual.shape)
        visual_colour, opacity = visual.colour[:3], visual.colour[3] * SOLID_OPACITY
        path = f"{root}/{links[visual.link]}/{visual.name}"
        yield mesh(path, shape, placement.rotation @ rotation, placement.translation, colour or visual_colour, opacity)
    thickness = 0.8 * geometry.lanes.spacing
    for pulley in geometry.pulleys:
        path = f"{root}/{links[pulley.joint]}/groove_{pulley.tendon}"
        shape = cylinder(max(abs(pulley.radius) - tube_radius, 0.5 * tube_radius), thickness)
        rotation, position = pulley.frame @ Y_TO_Z, pulley.offset * pulley.frame[:, 2]
        yield mesh(path, shape, rotation, position, colour or GROOVE_COLOUR, SOLID_OPACITY)


def root_command(rotation: Array) -> Command:
    """Return meshcat's ``set_transform`` command that turns the base frame into the frame of the scene."""
    return {"type": "set_transform", "path": ROOT, "matrix": pose_matrix(rotation, np.zeros(3))}


def primitive(name: str, shape: Any) -> tuple[Command, Array]:
    """Return meshcat's geometry for one of Pinocchio, and the rotation between them; of an ellipsoid a stretch, too."""
    kind = type(shape).__name__.lower()
    if is_mesh(shape):
        return _mesh_geometry(shape), np.eye(3)
    if kind == "cylinder":
        return drawn(kind, (shape.radius, 2.0 * shape.halfLength))
    if kind == "sphere":
        return drawn(kind, (shape.radius,))
    if kind == "ellipsoid":
        return drawn(kind, shape.radii)
    if kind == "box":
        return drawn(kind, 2.0 * np.asarray(shape.halfSide))
    raise InputError(f"visual {name}", "must be a box, a cylinder, a sphere, an ellipsoid or a mesh", kind)


def drawn(kind: str, sizes: ArrayLike) -> tuple[Command, Array]:
    """Return meshcat's geometry for a part of a primitive, and the rotation between them, or the stretch."""
    numbers = np.asarray(sizes, dtype=float).tolist()
    if kind == "cylinder":
        return cylinder(*numbers), Y_TO_Z
    if kind == "ellipsoid":
        return ball(1.0), np.diag(numbers)
    return (ball if kind == "sphere" else box)(*numbers), np.eye(3)


def is_mesh(shape: Any) -> bool:
    """Return whether a geometry of Pinocchio is a mesh."""
    return isinstance(shape, coal.BVHModelBase)


def _mesh_geometry(shape: Any) -> Command:
    """Return a mesh by its corners, which its faces share."""
    faces = [triangle[i] for triangle in map(shape.tri_indices, range(shape.num_tris)) for i in range(3)]
    corners = np.round(np.asarray(shape.vertices()), 5)
    attributes = {"position": {"itemSize": 3, "type": "Float32Array", "array": corners.ravel().tolist()}}
    return {
        "type": "BufferGeometry",
        "data": {"attributes": attributes, "index": {"type": "Uint32Array", "array": faces}},
    }


def cylinder(radius: float, height: float) -> Command:
    """Return meshcat's geometry of a cylinder along y."""
    return {
        "type": "CylinderGeometry",
        "radiusTop": radius,
        "radiusBottom": radius,
        "height": height,
        "radialSegments": 48,
    }


def mesh(
    path: str, shape: Command, rotation: Array, translation: Array, colour: tuple[float, ...], opacity: float
) -> Command:
    """Return meshcat's ``set_object`` command for a translucent solid."""
    red, green, blue = (round(255 * float(component)) for component in colour)
    material = {
        "type": "MeshPhongMaterial",
        "color": (red << 16) + (green << 8) + blue,
        "shininess": 30,
        "transparent": True,
        "opacity": float(opacity),
        "depthWrite": False,
        # Flat shading shows edges where corners have no normals.
        "flatShading": shape["type"] == "BufferGeometry",
    }
    return set_object(path, "Mesh", shape, material, pose_matrix(rotation, translation))


def set_object(path: str, kind: str, shape: Command, material: Command, matrix: list[float] | None = None) -> Command:
    """Return meshcat's ``set_object`` command for a geometry with a material; without a matrix it is not moved."""
    shape, material = {"uuid": f"{path}:geometry", **shape}, {"uuid": f"{path}:material", **material}
    ids = {"geometry": shape["uuid"], "material": material["uuid"], "matrix": matrix or np.eye(4).ravel().tolist()}
    scene = {"metadata": {"version": 4.5, "type": "Object"}, "geometries": [shape], "materials": [material]}
    return {"type": "set_object", "path": path, "object": {**scene, "object": {"uuid": path, "type": kind, **ids}}}


def box(x: float, y: float, z: float) -> Command:
    """Return meshcat's geometry of a box."""
    return {"type": "BoxGeometry", "width": x, "height": y, "depth": z}


def ball(radius: float) -> Command:
    """Return meshcat's geometry of a sphere."""
    return {"type": "SphereGeometry", "radius": radius, "widthSegments": 40, "heightSegments": 28}


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


def encode(values: ArrayLike, kind: str) -> str:
    """Return numbers as the page reads them: of a kind such as ``<f4``, in base64."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")
