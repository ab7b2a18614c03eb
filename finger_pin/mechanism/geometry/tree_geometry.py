"""A hand that is given as a tree, in space: its solids, and its tendons along their paths."""

from __future__ import annotations

import math
from collections.abc import Sequence

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from finger_pin.description.finger import FingerDescription
from finger_pin.description.meshes import Mesh
from finger_pin.description.tree_parts import TreeSolid
from finger_pin.mechanism.geometry.fingers import Pulley, Visual
from finger_pin.mechanism.geometry.lateral_offsets import Lanes, joint_axes
from finger_pin.mechanism.geometry.tendon_geometry import LinkPoses, TendonPath
from finger_pin.mechanism.path_elements import PathElement, PathTerm
from finger_pin.mechanism.shapes import MATERIALS
from finger_pin.mechanism.spans import CYLINDER, STRAIGHT
from finger_pin.mechanism.tendon_paths import rotation
from finger_pin.mechanism.tree_mechanism import build_body
from finger_pin.typing import Array

# Points of a stretch that may wrap.
_POINTS = 12
# Of the extent of a hand: distance between neighbouring tendons, and width of a link.
_SPACING, _WIDTH = 0.012, 0.06


class TreeGeometry:
    """The geometry of a tree that is drawn; see `TendonGeometry`.

    Attributes:
        description: Description that it was built from.
        model: Pinocchio model.
        lanes: Distance between tendons, for their width, and a joint to look along.
        pulleys: None.
        visuals: The solids.
        tips: The fingertip: index of the joint, and place in its frame, shape (3,), m.
        size: Largest distance of the bodies from the base, about, m.
        first_seen: First link that the camera must have in view: the base may be far away.
        widths: Of the links, about, m.
    """

    first_seen = 1

    def __init__(self, description: FingerDescription) -> None:
        """Place the solids of a description with a tree."""
        self.description = description
        body, routes = build_body(description)
        self.model = body.model
        frames = [self.model.frames[tip] for tip in body.tips]
        self.tips = tuple((int(tip.parentJoint), np.array(tip.placement.translation)) for tip in frames)
        meshes = {name: _surface(each) for name, each in description.tree.meshes.items()}
        self.visuals = tuple(
            visual
            for name, each in description.tree.bodies.items()
            for key, solid in each.solids.items()
            for visual in _visuals(
                f"{name}_{key}",
                routes.placed[name].joint,
                routes.placed[name].frame,
                solid,
                meshes.get(solid.mesh or ""),
            )
        )
        driven = {tendon.along: name for name, tendon in description.tendons.items() if tendon.along is not None}
        # Those that motors pull come first; the others are cords of springs, ranges and actuators of the tree.
        ordered = [*driven, *(name for name in routes.routes if name not in driven)]
        # Further branches behind pulleys have a dot and a number after the name.
        self._branches = [
            (f"{driven.get(along, along)}{f'.{number}' if number else ''}", branch)
            for along in ordered
            for number, branch in enumerate(_branches(routes.routes[along].legs))
        ]
        still = self.poses(np.zeros(self.model.nq))
        paths = self.paths(np.zeros(self.model.nq), poses=still)
        points = np.concatenate([still.translation[self.first_seen :], *(path.points for path in paths)])
        self.size = float(np.linalg.norm(points, axis=1).max()) or 0.1
        extent = float(np.ptp(points, axis=0).max()) or self.size
        self.widths: tuple[float, ...] = (_WIDTH * extent,)
        axes = joint_axes(self.model)
        along = np.where(axes.any(axis=1), np.abs(axes @ np.array(description.gravity)), np.inf)
        self.lanes = Lanes({}, _SPACING * extent, ((1 + int(np.argmin(along)),),), _WIDTH * extent)
        self.pulleys: tuple[Pulley, ...] = ()

    def poses(self, joint_position: ArrayLike, palm: LinkPoses | None = None) -> LinkPoses:
        """Return the poses of the bodies at theta, shape (..., n), rad; a tree has no ``palm`` that moves."""
        assert palm is None
        q = np.asarray(joint_position, dtype=float)
        data, matrices = self.model.createData(), []
        for position in np.ascontiguousarray(q.reshape(-1, self.model.nq)):
            pin.forwardKinematics(self.model, data, position)
            matrices.append(np.array([placement.homogeneous for placement in data.oMi]))
        placed = np.array(matrices).reshape(*q.shape[:-1], self.model.njoints, 4, 4)
        return LinkPoses(placed[..., :3, :3], placed[..., :3, 3])

    def paths(
        self, joint_position: ArrayLike, slack: ArrayLike | None = None, poses: LinkPoses | None = None
    ) -> tuple[TendonPath, ...]:
        """Return the paths of the tendons that motors pull, then those of other cords, a branch each; none sags.

        Further branches behind pulleys have a dot and a number after the name.
        """
        poses = self.poses(joint_position) if poses is None else poses
        leading = poses.translation.shape[:-2]
        rotations, places = poses.rotation.reshape(-1, self.model.njoints, 3, 3), poses.translation
        places = places.reshape(-1, self.model.njoints, 3)
        paths: list[TendonPath] = []
        for name, legs in self._branches:
            points = np.array([_path(legs, *each) for each in zip(rotations, places, strict=True)])
            distal = np.zeros(points.shape[1], dtype=bool)
            paths.append(TendonPath(name, points.reshape(*leading, *points.shape[1:]), distal))
        return tuple(paths)


def _branches(legs: Sequence[PathTerm]) -> list[list[PathTerm]]:
    """Return the parts of a path that hang together: behind a pulley it goes on elsewhere."""
    branches: list[list[PathTerm]] = []
    for leg in legs:
        if branches and leg.follows:
            branches[-1].append(leg)
        else:
            branches.append([leg])
    return branches


def _path(legs: Sequence[PathTerm], rotations: Array, places: Array) -> Array:
    """Return the points of a path at one posture, shape (P, 3)."""
    return np.concatenate([_stretch(leg.piece, rotations, places) for leg in legs])


def _stretch(piece: PathElement, rotations: Array, places: Array) -> Array:
    first, second, *side = (rotations[end.joint] @ end.point + places[end.joint] for end in piece.ends)
    if piece.shape is STRAIGHT:
        return np.array([first, second])
    turned = rotations[piece.joint] @ piece.frame.rotation
    origin = rotations[piece.joint] @ piece.frame.translation + places[piece.joint]
    a, b = (first - origin) @ turned, (second - origin) @ turned
    out = np.zeros(8)
    sides = [(each - origin) @ turned for each in side]
    piece.shape.value(np.concatenate([a, b, *sides]), piece.parameters, out)
    if out[1] == 0.0:
        return np.linspace(first, second, _POINTS)
    start, end = _touch(piece, a, -out[2:5]), _touch(piece, b, out[5:8] * -1.0)
    arc = _arc(piece, start, end, -out[2:5], out[1])
    return np.asarray(np.concatenate([[a], arc, [b]]) @ turned.T + origin)


def _touch(piece: PathElement, point: Array, direction: Array) -> Array:
    """Return the meeting point of the straight part from a point with the wrap."""
    flat = np.array([1.0, 1.0, 0.0]) if piece.shape is CYLINDER else np.ones(3)
    a, d = point * flat, direction * flat
    square, half = d @ d, a @ d
    spread = max(half * half - square * (a @ a - piece.parameters[0] ** 2), 0.0)
    return np.asarray(point + (-half - math.sqrt(spread)) / square * direction)


def _arc(piece: PathElement, start: Array, end: Array, direction: Array, turn: float) -> Array:
    """Return points between two points of a wrap, about the axis that the path turns about."""
    flat = np.array([1.0, 1.0, 0.0]) if piece.shape is CYLINDER else np.ones(3)
    share = np.linspace(0.0, 1.0, _POINTS - 2)
    if np.linalg.norm(end - start) < 1e-9:
        return np.tile(start, (len(share), 1))
    axis = np.cross(start * flat, direction * flat)
    axis /= np.linalg.norm(axis)
    angle = turn / np.linalg.norm(direction * flat)
    turned = np.array([pin.AngleAxis(angle * each, axis).matrix() @ (start * flat) for each in share])
    # Along a cylinder the path rises evenly.
    return np.asarray(turned + np.outer(share, (end - start) * (1.0 - flat)) + start * (1.0 - flat))


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
    """Return a solid as boxes, cylinders, spheres and its surface, if it is a mesh."""
    place = frame * pin.SE3(rotation(solid.orientation), np.array(solid.position))
    colour = MATERIALS["shell"]
    if surface is not None:
        return [Visual(name, joint, surface, place, colour)]
    if solid.kind == "box":
        return [Visual(name, joint, coal.Box(*solid.sides), place, colour)]
    if solid.kind == "sphere":
        return [Visual(name, joint, coal.Sphere(solid.radius), place, colour)]
    barrel = Visual(name, joint, coal.Cylinder(solid.radius, solid.length), place, colour)
    if solid.kind == "cylinder":
        return [barrel]
    ends = (place * pin.SE3(np.eye(3), np.array([0.0, 0.0, sign * solid.length / 2.0])) for sign in (-1.0, 1.0))
    balls = [Visual(f"{name}_{k}", joint, coal.Sphere(solid.radius), end, colour) for k, end in enumerate(ends)]
    return [barrel, *balls]
