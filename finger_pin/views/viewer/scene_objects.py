"""Objects around a finger, forces and friction cones of closed contacts, and forces that a fingertip can exert."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import pinocchio as pin
import xarray as xr
from scipy.spatial.transform import Rotation

from finger_pin.analysis import ForcePolytope
from finger_pin.description.objects import Object
from finger_pin.description.primitives import KINDS, Geometry
from finger_pin.mechanism.geometry import LinkPoses
from finger_pin.simulation.frames import read_scene
from finger_pin.typing import Array
from finger_pin.views.viewer.solids import (
    ARROW_LENGTH,
    ROOT,
    SOLID_OPACITY,
    Command,
    Solid,
    buffer_geometry,
    newton_length,
    pose_command,
    set_object,
)

_FIXED_COLOUR, _FREE_COLOUR = (0.45, 0.52, 0.62), (0.95, 0.72, 0.25)
#: Thickness of the plate that is drawn for a half-space, and how far it reaches, in parts of the finger's length.
_PLATE_THICKNESS, _PLATE_RADIUS = 0.015, 0.35
#: Slant of the largest friction cone, in parts of the finger's length: about the width of a finger.
_CONE_SLANT = 0.05


@dataclass(frozen=True, eq=False)
class SceneObjects:
    """Objects around a finger, and contacts, in the frames of a page.

    Attributes:
        by_name: The objects.
        moving: Names of those that move: the free ones, and all on a palm that moves.
        poses: Their poses, x, y, z and quaternion x, y, z, w, shape (m, k, 7).
        contacts: Point, m, force on the second body, N, and normal of every contact, shape (m, c, 9).
        steepness: mu of every contact, shape (c,): the most friction over the normal force that there was.
        size: Length of the finger, m.
        middle: Middle of the finger, shape (3,), m.
    """

    by_name: dict[str, Object]
    moving: tuple[str, ...]
    poses: Array
    contacts: Array
    steepness: Array
    size: float
    middle: Array

    @classmethod
    def from_result(
        cls, result: xr.Dataset, time: Array, size: float, middle: Array, palm: LinkPoses | None = None
    ) -> SceneObjects | None:
        """Read the contacts and objects of a result at the frames' times; None if it has none.

        Args:
            result: Dataset that `simulate` returned or saved.
            time: Of the frames, shape (m,), s.
            size: Length of the finger, m.
            middle: Middle of the finger, shape (3,), m.
            palm: Poses of a palm that moves, at those times; objects and contacts are seen from it.
        """
        if "contact_force" not in result:
            return None
        objects = dict(read_scene(result.attrs).objects)
        level, normal = np.asarray(result["contact_level"]), np.asarray(result["contact_normal_force"])
        steepness = np.max(np.divide(level, normal, out=np.zeros_like(level), where=normal > 1e-6), axis=0)
        frames, closed = np.searchsorted(np.asarray(result["time"]), time), np.flatnonzero(steepness > 0.0)
        vectors = [
            np.asarray(result[f"contact_{name}"])[np.ix_(frames, closed)] for name in ("point", "force", "normal")
        ]
        poses_by_name = {
            name: np.broadcast_to(item.pose, (len(time), 7)) for name, item in objects.items() if palm is not None
        }
        if "object_position" in result:
            free_poses = [np.asarray(result[f"object_{name}"])[frames] for name in ("position", "orientation")]
            names = np.asarray(result["object"]).tolist()
            poses_by_name |= dict(zip(names, np.moveaxis(np.concatenate(free_poses, axis=-1), 1, 0), strict=True))
        poses = np.stack(list(poses_by_name.values()), axis=1) if poses_by_name else np.zeros((len(time), 0, 7))
        if palm is not None:
            rotated = [np.einsum("mij,mcj->mci", palm.rotation, item) for item in (*vectors, poses[..., :3])]
            is_closed = np.any(vectors[1], axis=-1, keepdims=True)
            vectors = [rotated[0] + palm.translation[:, None] * is_closed, *rotated[1:3]]
            turns = np.repeat(palm.rotation, poses.shape[1], axis=0)
            orientations = (Rotation.from_matrix(turns) * Rotation.from_quat(poses[..., 3:].reshape(-1, 4))).as_quat()
            positions = rotated[3] + palm.translation[:, None]
            poses = np.concatenate([positions, orientations.reshape(*poses.shape[:2], 4)], axis=-1)
            for index, name in enumerate(poses_by_name):
                if objects[name].frame == "world":
                    poses[:, index] = objects[name].pose
        contacts = np.concatenate(vectors, axis=-1)
        return cls(objects, tuple(poses_by_name), poses, contacts, steepness[steepness > 0.0], size, middle)

    def header(self) -> dict[str, Any]:
        """Return their part of the page's header."""
        length = self._force_scale()
        return {
            "free": [f"object_{name}" for name in self.moving],
            "steepness": np.round(self.steepness, 4).tolist(),
            "length": length,
            "cone": _CONE_SLANT * self.size,
            "note": f"contact forces, {1e3 * length:.4g} mm per N, in their friction cones",
        }

    def frames(self) -> dict[str, Array]:
        """Return the frames for the page."""
        return {"object": self.poses.astype("<f4"), "contact": self.contacts.astype("<f4")}

    def points_in_view(self) -> Array:
        """Return places of free objects and contacts, and corners of fixed ones, near the finger, shape (m, 3)."""
        free = [index for index, name in enumerate(self.moving) if self.by_name[name].mass is not None]
        positions = self.poses[:, free, :3].reshape(-1, 3)
        points = self.contacts[np.any(self.contacts[..., 3:6] != 0.0, axis=-1)][:, :3]
        corners = [_box_corners(each) for each in self.by_name.values() if each.mass is None and each.sizes]
        candidates = np.concatenate([positions[::10], points[::10], *corners])
        return np.asarray(candidates[np.linalg.norm(candidates - self.middle, axis=1) < 1.2 * self.size])

    def commands(self) -> Iterator[Command]:
        """Yield meshcat's commands for all objects, each at its start."""
        for name, scene_object in self.by_name.items():
            yield from (solid.command() for solid in self.solids(name))
            yield self._placement(name, scene_object.pose)

    def frame(self, index: int) -> Iterator[Command]:
        """Yield meshcat's commands that move objects to their places in a frame."""
        for name, pose in zip(self.moving, self.poses[index], strict=True):
            yield self._placement(name, pose)

    def object_poses(self, name: str) -> Array:
        """Return poses of an object in all frames, shape (m, 7)."""
        if name in self.moving:
            return np.asarray(self.poses[:, self.moving.index(name)])
        scene_object = self.by_name[name]
        return np.tile(scene_object.pose, (len(self.poses), 1))

    def arrows(self) -> Array:
        """Return both ends of the arrow of every contact's force in all frames, shape (m, c, 2, 3), m."""
        points, force = self.contacts[..., :3], self.contacts[..., 3:6]
        return np.stack([points, points + self._force_scale() * force], axis=-2)

    def _force_scale(self) -> float:
        return newton_length(
            ARROW_LENGTH * self.size, float(np.max(np.linalg.norm(self.contacts[..., 3:6], axis=-1), initial=0.0))
        )

    @staticmethod
    def _placement(name: str, pose: Array) -> Command:
        return pose_command(f"object_{name}", pin.Quaternion(pose[3:]).toRotationMatrix(), pose[:3])

    def solids(self, name: str) -> Iterator[Solid]:
        """Yield the solids of an object, whose frame is ``object_<name>``."""
        scene_object = self.by_name[name]
        colour = _FIXED_COLOUR if scene_object.mass is None else _FREE_COLOUR
        parts = scene_object.parts
        if scene_object.shape == "half_space":
            side, thickness = 2.0 * _PLATE_RADIUS * self.size, _PLATE_THICKNESS * self.size
            parts = ((Geometry("box", (side, side, thickness)), -0.5 * thickness),)
        for index, (shape, height) in enumerate(parts):
            centre = np.array([0.0, 0.0, height])
            if scene_object.shape == "half_space":
                # The part of the plane nearest to the finger.
                rotation = pin.Quaternion(scene_object.quaternion).toRotationMatrix()
                centre[:2] = (rotation.T @ (self.middle - scene_object.position))[:2]
            pose = np.eye(3), centre
            yield Solid(f"object_{name}", f"part{index}", shape, *pose, colour, 1.6 * SOLID_OPACITY)


def _box_corners(scene_object: Object) -> Array:
    """Return the corners of the box around a fixed object, shape (8, 3), m."""
    half_sides = KINDS[scene_object.shape].half_sides(scene_object.sizes)
    rotation = pin.Quaternion(scene_object.quaternion).toRotationMatrix()
    corners = np.array(list(product((-1.0, 1.0), repeat=3))) * half_sides
    return np.asarray(corners @ rotation.T + scene_object.position)


_PATH = f"{ROOT}/forces"
_COLOUR, _RIM_COLOUR, _OPACITY = 0xFFB347, 0xFFD9A0, 0.22
#: Largest extent of the drawn set, in parts of the finger's length.
_SIZE_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class ForceSet:
    """A force polytope at a scale.

    Attributes:
        polytope: The forces, N.
        scale: Length that stands for a newton, m/N: 1, 2 or 5 times a power of ten.
    """

    polytope: ForcePolytope
    scale: float

    @classmethod
    def from_polytope(cls, polytope: ForcePolytope, length: float) -> ForceSet:
        """Choose a scale at which the set is at most half as large as a finger of some length, m."""
        extent = float(np.max(np.linalg.norm(polytope.vertices, axis=1)))
        return cls(polytope, newton_length(_SIZE_SHARE * length, extent) if extent > 0.0 else 1.0)

    @property
    def corners(self) -> Array:
        """The vertices, shape (v, 3), m, base frame."""
        return np.asarray(self.polytope.tip + self.scale * self.polytope.vertices)

    @property
    def note(self) -> str:
        """The legend of the drawing, for the panel."""
        return f"forces at the tip, {1e3 * self.scale:.4g} mm per N"

    def commands(self) -> Iterator[Command]:
        """Yield meshcat's commands: the body, if there is one, its edges, and its origin, the fingertip."""
        triangles = self.polytope.triangles()
        if len(triangles):
            normals = np.repeat(_normals(self.polytope.vertices[triangles]), 3, axis=0)
            body = {"position": self.corners[triangles].reshape(-1, 3), "normal": normals}
            # Both sides, without hiding what is inside.
            material = {"type": "MeshPhongMaterial", "color": _COLOUR, "opacity": _OPACITY, "side": 2, "shininess": 20}
            yield _object(f"{_PATH}/body", "Mesh", body, material)
        edges = self.corners[np.array(self.polytope.ridges(), dtype=int).reshape(-1, 2)]
        rim = {"type": "LineBasicMaterial", "color": _RIM_COLOUR, "opacity": 0.9}
        yield _object(f"{_PATH}/edges", "LineSegments", {"position": edges.reshape(-1, 3)}, rim)


def _normals(triangles: Array) -> Array:
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300))


def _object(path: str, kind: str, attributes: dict[str, Array], material: Command) -> Command:
    return set_object(path, kind, buffer_geometry(attributes), {"transparent": True, "depthWrite": False, **material})
