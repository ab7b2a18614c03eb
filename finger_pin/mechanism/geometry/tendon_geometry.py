"""Tendon paths in space for any joint position, on the kinematics of the generated URDF."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from finger_pin.description.finger import FingerDescription
from finger_pin.exceptions import InputError
from finger_pin.mechanism.from_pinocchio import turned_model
from finger_pin.mechanism.geometry.fingers import fingers_of_links, fingers_on_model, palm_of
from finger_pin.mechanism.geometry.wound_tendon import Arc, WoundSpan
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.mechanism.urdf import build_rigid_body
from finger_pin.typing import Array

#: Drawn sag of a loose span in parts of its length, and lift of a loose arc off its pulley in parts of its radius.
SAG, LIFT = 0.12, 0.15


@dataclass(frozen=True, eq=False)
class LinkPoses:
    """Poses of the base (entry 0) and of the link after each joint; leading dimensions such as time are kept.

    Attributes:
        rotation: From the link to the base frame, shape (..., n + 1, 3, 3).
        translation: Shape (..., n + 1, 3), m.
    """

    rotation: Array
    translation: Array


@dataclass(frozen=True, eq=False)
class TendonPath:
    """A tendon in space.

    Attributes:
        name: Of the tendon.
        points: From the actuator or proximal anchor to the insertion, base frame, shape (..., P, 3), m.
        distal: Whether a point lies beyond the lumped mass of a passive tendon, shape (P,).
    """

    name: str
    points: Array
    distal: NDArray[np.bool_]


class TendonGeometry:
    """The tendons of a finger, or of all fingers of a hand: wound once, placed for any joint position.

    Attributes:
        description: Description that it was built from.
        model: Pinocchio model; the axis of every joint is the z axis of its frame.
        pieces: Straight spans and arcs of every tendon, from the actuator on, by name.
        lanes: Offset of each tendon along the joint axes.
        pulleys: Winding surfaces whose radius is not zero.
        visuals: The solids.
        tips: The fingertips: index of the link, and place in its frame, shape (3,), m.
        size: Largest distance of the fingertips from the base, about, m.
        widths: Of the links, m.
        first_seen: First link that the camera must have in view.
    """

    first_seen = 0

    def __init__(
        self,
        description: FingerDescription,
        *,
        resolution: int = 8,
        body: RigidBody | None = None,
        solids: pin.GeometryModel | None = None,
    ) -> None:
        """Wind the tendons.

        Args:
            description: A finger or hand whose joints all carry links, or one on a body of the user's own.
            resolution: Points per straight span and per radian of arc.
            body: The body that the joints are of, if it is not made of links.
            solids: Of that body.

        Raises:
            InputError: If a joint carries no link, or the body has joints that do not turn.
        """
        self.description = description
        if body is None:
            fingers, visuals = fingers_of_links(description, resolution), palm_of(description.hand)
            body = build_rigid_body(description)
            self.model = body.model
        else:
            self.model, fingers, visuals = fingers_on_model(description, body, solids, resolution)
        rotations = [np.eye(3)] * self.model.njoints if body.model is self.model else turned_model(body)[1]
        frames = [body.model.frames[tip] for tip in body.tips]
        self.tips = tuple((int(f.parentJoint), rotations[f.parentJoint].T @ f.placement.translation) for f in frames)
        pieces = {name: each for finger in fingers for name, each in finger.pieces.items()}
        self.pieces = {name: pieces[name] for name in description.tendons}
        self.pulleys = tuple(pulley for finger in fingers for pulley in finger.pulleys)
        self.visuals = (*visuals, *(visual for finger in fingers for visual in finger.visuals))
        self.widths = tuple(width for finger in fingers for width in finger.widths)
        travel = 0.0
        if description.hand is not None:
            travel = sum(description.hand.palm.on_path(axis).greatest for axis in ("x", "y", "z"))
        self.size = max(finger.size for finger in fingers) + travel
        # Joints are looked at along the axes of the finger that reaches farthest.
        self.lanes = replace(
            max(fingers, key=lambda finger: finger.size).lanes,
            offset={key: at for finger in fingers for key, at in finger.lanes.offset.items()},
            spacing=min(finger.lanes.spacing for finger in fingers),
        )

    def poses(self, joint_position: ArrayLike, base: LinkPoses | None = None) -> LinkPoses:
        """Return the poses of the links at theta, shape (..., n), rad.

        Args:
            joint_position: theta.
            base: Poses of the base, shapes (..., 3, 3) and (..., 3), where it moves.
        """
        q = self._checked(joint_position)
        flat, count = np.ascontiguousarray(q.reshape(-1, self.model.nq)), self.model.njoints
        rotation, translation = np.empty((len(flat), count, 3, 3)), np.empty((len(flat), count, 3))
        data = self.model.createData()
        for row, position in enumerate(flat):
            pin.forwardKinematics(self.model, data, position)
            for index, placement in enumerate(data.oMi):
                rotation[row, index], translation[row, index] = placement.rotation, placement.translation
        leading = q.shape[:-1]
        if base is not None:
            turned, moved = base.rotation.reshape(-1, 1, 3, 3), base.translation.reshape(-1, 1, 3)
            translation = (turned @ translation[..., None])[..., 0] + moved
            rotation = turned @ rotation
        return LinkPoses(rotation.reshape(*leading, count, 3, 3), translation.reshape(*leading, count, 3))

    def paths(
        self, joint_position: ArrayLike, slack: ArrayLike | None = None, poses: LinkPoses | None = None
    ) -> tuple[TendonPath, ...]:
        """Return the path of every tendon, in the order of the description.

        Args:
            joint_position: theta, shape (..., n), rad.
            slack: Looseness of each tendon as drawn, 0 (taut) to 1, shape (..., t); all taut when left out. A loose
                tendon sags along gravity and lifts off its pulleys; by how much is a picture, not a prediction.
            poses: Of the links at this position, where they are at hand.
        """
        q = self._checked(joint_position)
        loose = np.zeros((*q.shape[:-1], len(self.pieces))) if slack is None else np.asarray(slack, dtype=float)
        poses = self.poses(q) if poses is None else poses
        paths = []
        for column, (name, pieces) in enumerate(self.pieces.items()):
            parts = [self._place(piece, q, loose[..., column, None], poses) for piece in pieces]
            distal = np.concatenate([piece.distal for piece in pieces])
            paths.append(TendonPath(name, np.concatenate(parts, axis=-2), distal))
        return tuple(paths)

    def _place(self, piece: WoundSpan | Arc, q: Array, loose: Array, poses: LinkPoses) -> Array:
        link = piece.link if isinstance(piece, WoundSpan) else piece.joint
        rotation, translation = poses.rotation[..., link, :, :], poses.translation[..., link, None, :]
        if isinstance(piece, WoundSpan):
            gravity = np.array(self.description.gravity)
            down = gravity / (np.linalg.norm(gravity) or 1.0)
            sag = (SAG * loose * piece.sag)[..., None] * down
            return np.asarray(piece.points @ np.swapaxes(rotation, -1, -2) + translation + sag)
        theta = q[..., piece.joint - 1, None]
        direction = piece.entry - theta + piece.fraction * (piece.turn + theta)
        radius = piece.radius * (1.0 + LIFT * loose * np.sin(math.pi * piece.fraction))
        offset = np.broadcast_to(piece.offset, direction.shape)
        local = np.stack([-radius * np.sin(direction), radius * np.cos(direction), offset], axis=-1)
        return np.asarray(local @ np.swapaxes(rotation, -1, -2) + translation)

    def _checked(self, joint_position: ArrayLike) -> Array:
        q = np.asarray(joint_position, dtype=float)
        if q.shape[-1:] != (self.model.nq,):
            raise InputError(
                "joint_position", f"the last of its dimensions must be the {self.model.nq} joints", q.shape
            )
        return q


def tendon_paths(
    description: FingerDescription, joint_position: ArrayLike, slack: ArrayLike | None = None
) -> tuple[TendonPath, ...]:
    """Return the path of every tendon of a finger; see `TendonGeometry.paths`."""
    return TendonGeometry(description).paths(joint_position, slack)
