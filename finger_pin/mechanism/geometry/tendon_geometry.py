"""Tendons in space at any joint position: of a finger of links or bodies, or on a Pinocchio model."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from finger_pin.description.finger_description import FingerDescription
from finger_pin.exceptions import InputError
from finger_pin.mechanism.bodies import place_bodies
from finger_pin.mechanism.from_pinocchio import turned_model
from finger_pin.mechanism.geometry.cord_pieces import LinkPoses, Piece, link_poses
from finger_pin.mechanism.geometry.fingers import fingers_of_links, fingers_on_model
from finger_pin.mechanism.geometry.tree_geometry import finger_of_tree
from finger_pin.mechanism.geometry.visuals import body_visuals
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.typing import Array


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
    """The tendons and solids of a finger, or of all fingers of a hand: made once, placed for any joint position.

    Attributes:
        description: Description that it was built from.
        model: Pinocchio model; the axis of every joint is the z axis of its frame, but in a tree.
        pieces: Pieces of every tendon, from the actuator on, by name; see `finger_of_tree` for those of a tree.
        lanes: Offset of each tendon along the joint axes.
        pulleys: Winding surfaces whose radius is not zero.
        visuals: The solids.
        tips: The fingertips: index of the link, and place in its frame, shape (3,), m.
        size: Largest distance of the fingertips from the base, about, m.
        widths: Of the links, m.
        first_seen: First link that the camera must have in view: the base of a tree may be far away.
    """

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
            description: A finger or hand whose joints carry links or bodies, or one on a body of the user's own.
            resolution: Points per straight span and per radian of arc.
            body: The body that the joints are of, if it is not made of links.
            solids: Of that body.
        """
        self.description, self.first_seen = description, 0 if description.links else 1
        if body is not None and description.links:
            self.model, fingers, self.visuals = fingers_on_model(description, body, solids, resolution)
        else:
            body, placed = place_bodies(description)
            if description.links:
                fingers = fingers_of_links(description, resolution)
            else:
                fingers = [finger_of_tree(description, resolution)]
            self.model, self.visuals = body.model, body_visuals(description.bodies, placed)
        rotations = [np.eye(3)] * self.model.njoints if body.model is self.model else turned_model(body)[1]
        frames = [body.model.frames[tip] for tip in body.tips]
        self.tips = tuple((int(f.parentJoint), rotations[f.parentJoint].T @ f.placement.translation) for f in frames)
        pieces: dict[str, tuple[Piece, ...]] = {}
        for finger in fingers:
            pieces |= {**finger.legs, **finger.pieces}
        self.pieces = {name: pieces.pop(name) for name in description.tendons if name in pieces} | pieces
        self.pulleys = tuple(pulley for finger in fingers for pulley in finger.pulleys)
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
        poses = link_poses(self.model, self._checked(joint_position))
        if base is None:
            return poses
        turned, moved = base.rotation[..., None, :, :], base.translation[..., None, :]
        return LinkPoses(turned @ poses.rotation, (turned @ poses.translation[..., None])[..., 0] + moved)

    def paths(
        self, joint_position: ArrayLike, slack: ArrayLike | None = None, poses: LinkPoses | None = None
    ) -> tuple[TendonPath, ...]:
        """Return the path of every tendon, in the order of the description, then those of other cords.

        Args:
            joint_position: theta, shape (..., n), rad.
            slack: Looseness of each tendon as drawn, 0 (taut) to 1, shape (..., t); all taut when left out. A loose
                tendon sags along gravity and lifts off its pulleys, but for legs through space; by how much is a
                picture, not a prediction.
            poses: Of the links at this position, where they are at hand.
        """
        q = self._checked(joint_position)
        loose = np.zeros((*q.shape[:-1], len(self.pieces))) if slack is None else np.asarray(slack, dtype=float)
        poses = self.poses(q) if poses is None else poses
        gravity, paths = np.array(self.description.gravity), []
        down = gravity / (np.linalg.norm(gravity) or 1.0)
        for column, (name, pieces) in enumerate(self.pieces.items()):
            parts = [piece.place(q, loose[..., column, None], poses, down) for piece in pieces]
            distal = np.concatenate([piece.distal for piece in pieces])
            paths.append(TendonPath(name, np.concatenate(parts, axis=-2), distal))
        return tuple(paths)

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
