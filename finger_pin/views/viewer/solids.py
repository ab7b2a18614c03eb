"""Solids and colours, the same on the page, in films, in meshcat's window and in the playground."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.primitives import Geometry
from finger_pin.mechanism.geometry import TendonGeometry
from finger_pin.typing import Array

#: Below this tension a tendon is drawn loose, wholly at none, N.
SLACK_TENSION = 0.05
# Colours of tensions, red, green and blue, from none to the largest: the upper three quarters of viridis, which is
# perceptually uniform and safe for colour-blind readers; its darkest quarter would vanish on a dark background.
_TENSION_COLOURS = (
    *((0.230, 0.322, 0.546), (0.207, 0.372, 0.553), (0.186, 0.419, 0.557), (0.167, 0.464, 0.558)),
    *((0.149, 0.508, 0.557), (0.132, 0.552, 0.553), (0.121, 0.596, 0.544), (0.125, 0.640, 0.527)),
    *((0.158, 0.684, 0.502), (0.220, 0.726, 0.466), (0.304, 0.765, 0.420), (0.404, 0.800, 0.363)),
    *((0.516, 0.831, 0.294), (0.637, 0.857, 0.217), (0.762, 0.876, 0.137), (0.886, 0.892, 0.095)),
    (0.993, 0.906, 0.144),
)
_SLACK_COLOUR = (0.62, 0.64, 0.67)
# Of a cord without a known tension, which no tension has.
_CORD_COLOUR = (0.93, 0.9, 0.82)
#: The same for the page.
PAGE_COLOURS = {"tension": _TENSION_COLOURS, "slack": _SLACK_COLOUR, "cord": _CORD_COLOUR}
#: Of the arrow of a contact's force, at both ends: that of the page, which no tension has.
FORCE_COLOUR = np.tile(np.array([0xFF, 0x5A, 0x5A]) / 255.0, (2, 1))


def looseness(tension: Array) -> Array:
    """Return how loose a tendon is drawn at a tension, N: 0 if it is taut, 1 at no tension."""
    return np.clip(1.0 - tension / SLACK_TENSION, 0.0, 1.0)


def tension_colours(tension: Array, scale: float) -> Array:
    """Return the colour of tensions, shape (..., 3): the upper part of viridis up to a scale, N; grey when loose."""
    place = np.clip(tension / scale, 0.0, 1.0) * (len(_TENSION_COLOURS) - 1)
    channels = np.array(_TENSION_COLOURS).T
    taut = np.stack([np.interp(place, np.arange(len(channel)), channel) for channel in channels], axis=-1)
    return np.asarray(taut + looseness(tension)[..., None] * (np.array(_SLACK_COLOUR) - taut))


def strand_colours(tension: Array, scale: float) -> Array:
    """Return the colours of strands, shape (s + 1, 3), the last of which is that of cords without a known tension.

    Args:
        tension: Shape (s,), N.
        scale: As for `tension_colours`.
    """
    return np.concatenate([tension_colours(tension, scale), [_CORD_COLOUR]])


def tension_scale(tension: float) -> float:
    """Return the upper end of a legend of tensions, N: its quarters are short numbers."""
    if not tension > 0.0:
        return 1.0
    decade = 10.0 ** math.floor(math.log10(tension))
    return float(next(step * decade for step in (1, 2, 4, 6, 8, 10) if step * decade >= tension * (1.0 - 1e-9)))


ROOT = "/finger_pin"
#: From the finger to the camera, in the scene, where z is up; the page's oblique view.
CAMERA_DIRECTION = np.array([0.42, -1.0, 0.5])
#: Length of the longest arrow of a force, in parts of the finger's length.
ARROW_LENGTH = 0.22
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
        shape, turn = _GEOMETRIES.get(self.geometry.kind, ({}, np.eye(3)))
        if not shape:
            shape = buffer_geometry({"position": np.round(self.geometry.corners, 5)}, self.geometry.faces)
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


def buffer_geometry(attributes: dict[str, Array], faces: NDArray[Any] | None = None) -> Command:
    """Return three.js's geometry of vertices, shape (..., 3), such as ``position``, and of triangles of them."""
    buffers = {
        name: {"itemSize": 3, "type": "Float32Array", "array": values.ravel().tolist()}
        for name, values in attributes.items()
    }
    index = {} if faces is None else {"index": {"type": "Uint32Array", "array": faces.ravel().tolist()}}
    return {"type": "BufferGeometry", "data": {"attributes": buffers, **index}}


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


def pose_command(name: str, rotation: Array, translation: Array) -> Command:
    """Return meshcat's ``set_transform`` command for the pose of a frame below the scene's root, or of the root."""
    path = f"{ROOT}/{name}" if name else ROOT
    return {"type": "set_transform", "path": path, "matrix": pose_matrix(rotation, translation)}


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
