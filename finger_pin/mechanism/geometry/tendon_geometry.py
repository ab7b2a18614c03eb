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
from finger_pin.mechanism.geometry.cord_pieces import Arc, LinkPoses, Piece, link_poses
from finger_pin.mechanism.geometry.fingers import wound_fingers
from finger_pin.mechanism.geometry.tree_geometry import finger_of_tree
from finger_pin.mechanism.geometry.visuals import body_visuals, model_visuals
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
        lanes: Sideways places of the tendons of the finger that reaches farthest, and the least spacing of all.
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
            self.model, turns = turned_model(body)
            self.visuals = model_visuals(solids, turns)
        else:
            body, placed = place_bodies(description)
            self.model, turns = body.model, [np.eye(3)] * body.model.njoints
            self.visuals = body_visuals(description.bodies, placed)
        if description.links:
            fingers = wound_fingers(description, self.model, resolution)
        else:
            fingers = [finger_of_tree(description, resolution)]
        frames = [body.model.frames[tip] for tip in body.tips]
        self.tips = tuple((int(f.parentJoint), turns[f.parentJoint].T @ f.placement.translation) for f in frames)
        pieces: dict[str, tuple[Piece, ...]] = {}
        for finger in fingers:
            pieces |= finger.pieces
        self.pieces = {name: pieces.pop(name) for name in description.tendons if name in pieces} | pieces
        self.widths = tuple(width for finger in fingers for width in finger.widths)
        travel = 0.0
        if description.hand is not None:
            travel = sum(description.hand.palm.on_path(axis).greatest for axis in ("x", "y", "z"))
        self.size = max(finger.size for finger in fingers) + travel
        # Joints are looked at along the axes of the finger that reaches farthest.
        farthest = max(fingers, key=lambda finger: finger.size)
        self.lanes = replace(farthest.lanes, spacing=min(finger.lanes.spacing for finger in fingers))

    @property
    def arcs(self) -> tuple[tuple[str, Arc], ...]:
        """Pieces around joints, each with the name of its tendon."""
        return tuple((name, each) for name, pieces in self.pieces.items() for each in pieces if isinstance(each, Arc))

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
