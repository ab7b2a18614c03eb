"""Tendon paths in space: straight spans fixed to the links, arcs around the pulleys at the joints.

Between two joints the common tangent of their pulleys is at rest in the link, so only the arcs change when a joint
turns, by r theta: the path follows the winding (3) for any constant radius. The signed radius r puts the path at
y = r in the frame of its joint (axis z, link along x). A path that would leave its pulley on the inner side of the
bend goes once around it, as on an idler; where a tendon ends, it ends on the pulley of the link that it moves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from finger_pin.description import build_rigid_body
from finger_pin.exceptions import InputError
from finger_pin.lanes import tendon_lanes
from finger_pin.parameters import FingerDescription
from finger_pin.routing import Array

#: Least wrap over the range of a joint, rad: of a path that passes, and of one that ends there.
PASSING_WRAP, ENDING_WRAP = 0.05, 0.35
#: Largest tilt of the first span that is preferred to a full turn around the first pulley, rad.
LARGEST_TILT = 0.6
#: Drawn sag of a span without tension, and lift of an arc off its pulley, as parts of its length or radius.
SAG, LIFT = 0.10, 0.12


@dataclass(frozen=True, eq=False)
class LinkPoses:
    """Poses of the base (entry 0) and of the links after each joint, leading dimensions kept.

    Attributes:
        rotation: Link to base frame, shape (..., n + 1, 3, 3).
        translation: Shape (..., n + 1, 3), m.
    """

    rotation: Array
    translation: Array


@dataclass(frozen=True, eq=False)
class TendonPath:
    """A tendon in space.

    Attributes:
        name: Of the tendon.
        points: Polyline from the actuator or proximal anchor to the insertion, base frame, shape (..., P, 3), m.
        distal: Whether a point lies beyond the lumped mass of a passive tendon, shape (P,).
    """

    name: str
    points: Array
    distal: np.ndarray[tuple[int], np.dtype[np.bool_]]


@dataclass(frozen=True)
class Pulley:
    """A winding surface of one tendon at one joint, in the frame of the link after the joint.

    Attributes:
        tendon: Name of the tendon.
        joint: Index of the joint, 1 for the first.
        radius: Signed winding radius r, m.
        offset: Position along the joint axis, m.
    """

    tendon: str
    joint: int
    radius: float
    offset: float


@dataclass(frozen=True, eq=False)
class _Arc:
    joint: int
    radius: float
    entry: float
    exit: float
    turns: int
    offsets: Array
    fractions: Array


@dataclass(frozen=True, eq=False)
class _Span:
    link: int
    points: Array
    sag: Array


class TendonGeometry:
    """The paths of all tendons of a finger, worked out once and placed for any joint position.

    Attributes:
        description: What it was built from.
        model: Pinocchio model of the generated URDF.
        pulleys: Winding surfaces with a radius other than zero.
        spacing: Distance between neighbouring tendons along the joint axes, m.
    """

    def __init__(self, description: FingerDescription, *, resolution: int = 8) -> None:
        """Find tangents and wraps.

        Args:
            description: A finger whose joints carry links.
            resolution: Points per straight span and per radian of arc.
        """
        self.description = description
        self.model = build_rigid_body(description).model
        self.spacing, self._lanes = tendon_lanes(description, self.model)
        self._resolution = max(2, resolution)
        self._joints = {name: index + 1 for index, name in enumerate(description.joints)}
        self._ranges = [joint.range for joint in description.joints.values()]
        self._pieces = {name: self._compile(name, tendon) for name, tendon in description.tendons.items()}
        self.pulleys = tuple(
            Pulley(name, self._joints[joint], crossing.radius, self._lanes[name, self._joints[joint]])
            for name, tendon in description.tendons.items()
            for joint, crossing in tendon.crossings.items()
            if crossing.radius != 0.0
        )

    def poses(self, joint_position: Array) -> LinkPoses:
        """Return the poses of all links at theta, shape (..., n), rad."""
        q = np.asarray(joint_position, dtype=float)
        count = self.model.nq
        if q.shape[-1:] != (count,):
            raise InputError("joint_position", f"the last dimension must have {count} entries", q.shape)
        flat = np.ascontiguousarray(q.reshape(-1, count))
        rotation, translation = np.empty((len(flat), count + 1, 3, 3)), np.empty((len(flat), count + 1, 3))
        data = self.model.createData()
        for row, position in enumerate(flat):
            pin.forwardKinematics(self.model, data, position)
            for index, placement in enumerate(data.oMi):
                rotation[row, index], translation[row, index] = placement.rotation, placement.translation
        shape = q.shape[:-1]
        return LinkPoses(rotation.reshape(*shape, count + 1, 3, 3), translation.reshape(*shape, count + 1, 3))

    def paths(self, poses: LinkPoses, joint_position: Array, slack: Array | None = None) -> tuple[TendonPath, ...]:
        """Return the path of every tendon, in the order of the description.

        Args:
            poses: Of the links at ``joint_position``.
            joint_position: theta, shape (..., n), rad.
            slack: How slack each tendon is drawn, 0 taut to 1 loose, shape (..., t); taut when left out. Slack
                is drawn as sag along gravity; its amount is a picture, not a computed length.
        """
        q = np.asarray(joint_position, dtype=float)
        loose = np.zeros((*q.shape[:-1], len(self._pieces))) if slack is None else np.asarray(slack, dtype=float)
        gravity = np.array(self.description.gravity)
        down = gravity / (np.linalg.norm(gravity) or 1.0)
        paths = []
        for column, (name, pieces) in enumerate(self._pieces.items()):
            level = loose[..., column, None]
            points = [self._place(piece, poses, q, level, down) for piece in pieces]
            paths.append(TendonPath(name, np.concatenate(points, axis=-2), self._distal(name, pieces)))
        return tuple(paths)

    def _place(self, piece: _Span | _Arc, poses: LinkPoses, q: Array, slack: Array, down: Array) -> Array:
        if isinstance(piece, _Span):
            rotation, translation = poses.rotation[..., piece.link, :, :], poses.translation[..., piece.link, None, :]
            taut = piece.points @ np.swapaxes(rotation, -1, -2) + translation
            return np.asarray(taut + (slack * piece.sag)[..., None] * down)
        rotation, translation = poses.rotation[..., piece.joint, :, :], poses.translation[..., piece.joint, None, :]
        angle = q[..., piece.joint - 1, None]
        side = math.copysign(1.0, piece.radius)
        wrap = piece.entry - piece.exit - angle - 2.0 * math.pi * side * piece.turns
        direction = piece.entry - angle - wrap * piece.fractions
        radius = piece.radius * (1.0 + LIFT * slack * np.sin(math.pi * piece.fractions))
        offsets = np.broadcast_to(piece.offsets, direction.shape)
        local = np.stack([-radius * np.sin(direction), radius * np.cos(direction), offsets], axis=-1)
        return np.asarray(local @ np.swapaxes(rotation, -1, -2) + translation)

    def _distal(self, name: str, pieces: list[_Span | _Arc]) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        tendon = self.description.tendons[name]
        before, flags = tendon.proximal_crossings if tendon.kind == "passive" else len(self._joints) + 1, []
        crossed = [self._joints[joint] for joint in tendon.crossings]
        mass_link = crossed[before - 1] if 0 < before <= len(crossed) else (0 if before == 0 else len(self._joints) + 1)
        for piece in pieces:
            count = len(piece.points) if isinstance(piece, _Span) else len(piece.fractions)
            place = piece.link if isinstance(piece, _Span) else piece.joint - 0.5
            flags.append(np.arange(count) >= count / 2 if place == mass_link else np.full(count, place > mass_link))
        return np.concatenate(flags)
