"""Tendon paths in space for any joint position, on the kinematics of the generated URDF."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from finger_pin.description.hand import HandDescription
from finger_pin.description.parameters import FingerDescription
from finger_pin.description.routing import Array
from finger_pin.exceptions import InputError
from finger_pin.mechanism.geometry.cuts import Cut, Groove, cuts
from finger_pin.mechanism.geometry.lanes import Lanes, tendon_lanes
from finger_pin.mechanism.geometry.winding import BASE_LEAD, Arc, Span, wind
from finger_pin.mechanism.shapes import MATERIALS
from finger_pin.mechanism.urdf import build_rigid_body, to_urdf

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


@dataclass(frozen=True)
class Pulley:
    """The winding surface of one tendon at one joint.

    Attributes:
        tendon: Name of the tendon.
        joint: Index of the joint, 1 for the first; its axis is the z axis of the link after it.
        radius: r, signed, m.
        offset: Along the joint axis, m.
    """

    tendon: str
    joint: int
    radius: float
    offset: float


@dataclass(frozen=True)
class Visual:
    """A solid that is fixed to a link.

    Attributes:
        name: Of the solid.
        link: Index of the link, 0 for the base.
        shape: Geometry of Pinocchio: a box, a cylinder, a sphere or a mesh.
        placement: In the frame of the link.
        colour: Red, green, blue and opacity, 0 to 1.
    """

    name: str
    link: int
    shape: Any
    placement: pin.SE3
    colour: tuple[float, float, float, float]


class TendonGeometry:
    """The tendons of a finger, or of all fingers of a hand: wound once, placed for any joint position.

    Attributes:
        description: What it was built from.
        model: Pinocchio model; the axis of every joint is the z axis of its frame.
        lanes: How far along the joint axes each tendon runs.
        pulleys: Winding surfaces whose radius is not zero.
        visuals: The solids.
        tips: The fingertips: index of the link, and place in its frame, shape (3,), m.
        size: How far the fingertips can be from the base, about, m.
        widths: Of the links, m.
        first_seen: First link that the camera must have in view.
    """

    first_seen = 0

    def __init__(self, description: FingerDescription, *, resolution: int = 8) -> None:
        """Wind the tendons.

        Args:
            description: A finger whose joints all carry links.
            resolution: Points per straight span and per radian of arc.

        Raises:
            InputError: If a joint carries no link.
        """
        self.description = description
        body = build_rigid_body(description)
        self.model = body.model
        frames = [self.model.frames[tip] for tip in body.tips]
        self.tips = tuple((int(tip.parentJoint), np.array(tip.placement.translation)) for tip in frames)
        if description.hand is not None:
            self._join(description.hand, resolution)
            return
        links = [joint.link for joint in description.joints.values() if joint.link is not None]
        self.widths = tuple(link.width for link in links)
        self.size = BASE_LEAD * links[0].width + sum(link.length for link in links)
        solids = pin.buildGeomFromUrdfString(self.model, to_urdf(description), pin.GeometryType.VISUAL).geometryObjects
        self.visuals = tuple(
            Visual(each.name, int(each.parentJoint), each.geometry, each.placement, tuple(each.meshColor))
            for each in solids
        )
        self.lanes = tendon_lanes(description, self.model)
        self._pieces = {
            name: wind(description, self.model, self.lanes, name, resolution) for name in description.tendons
        }
        indices = {name: index for index, name in enumerate(description.joints, start=1)}
        self.pulleys = tuple(
            Pulley(name, indices[joint], crossing.radius, self.lanes.offset[name, indices[joint]])
            for name, tendon in description.tendons.items()
            for joint, crossing in tendon.crossings.items()
            if crossing.radius
        )

    def _join(self, hand: HandDescription, resolution: int) -> None:
        """Take over the geometries of the fingers of a hand, each in its place."""
        pieces: dict[str, tuple[Span | Arc, ...]] = {}
        pulleys, lanes, first = [], [], 0
        visuals, widths, sizes = list(_palm(hand)), list[float](), []
        for name, finger in hand.built().items():
            own, placed, begin = TendonGeometry(finger, resolution=resolution), hand.fingers[name], first
            place = pin.SE3(placed.rotation, np.array(placed.position))
            pieces |= {f"{name}.{key}": _moved(each, place, begin) for key, each in own._pieces.items()}
            pulleys += [replace(each, tendon=f"{name}.{each.tendon}", joint=begin + each.joint) for each in own.pulleys]
            for each in own.visuals:
                at = {"link": begin + each.link} if each.link else {"placement": place * each.placement}
                visuals.append(replace(each, name=f"{name}.{each.name}", **at))
            lanes.append((begin, own.lanes))
            widths += own.widths
            sizes.append(float(np.linalg.norm(placed.position)) + own.size)
            first += len(finger.joints)
        self._pieces = {name: pieces[name] for name in self.description.tendons}
        self.pulleys, self.visuals, self.widths, self.size = tuple(pulleys), tuple(visuals), tuple(widths), max(sizes)
        # Joints are looked at along the axes of the finger that reaches farthest.
        begin, farthest = lanes[int(np.argmax(sizes))]
        families = tuple(tuple(begin + joint for joint in family) for family in farthest.families)
        offsets = {
            (f"{name}.{tendon}", begin + joint): offset
            for name, (begin, own) in zip(hand.fingers, lanes, strict=True)
            for (tendon, joint), offset in own.offset.items()
        }
        self.lanes = Lanes(offsets, min(own.spacing for _, own in lanes), families)

    def poses(self, joint_position: ArrayLike) -> LinkPoses:
        """Return where the links are at theta, shape (..., n), rad."""
        q = self._checked(joint_position)
        flat, count = np.ascontiguousarray(q.reshape(-1, self.model.nq)), self.model.njoints
        rotation, translation = np.empty((len(flat), count, 3, 3)), np.empty((len(flat), count, 3))
        data = self.model.createData()
        for row, position in enumerate(flat):
            pin.forwardKinematics(self.model, data, position)
            for index, placement in enumerate(data.oMi):
                rotation[row, index], translation[row, index] = placement.rotation, placement.translation
        leading = q.shape[:-1]
        return LinkPoses(rotation.reshape(*leading, count, 3, 3), translation.reshape(*leading, count, 3))

    def paths(
        self, joint_position: ArrayLike, slack: ArrayLike | None = None, poses: LinkPoses | None = None
    ) -> tuple[TendonPath, ...]:
        """Return the path of every tendon, in the order of the description.

        Args:
            joint_position: theta, shape (..., n), rad.
            slack: How loose each tendon is drawn, 0 (taut) to 1, shape (..., t); all taut when left out. A loose
                tendon sags along gravity and lifts off its pulleys; by how much is a picture, not a prediction.
            poses: Of the links at this position, where they are at hand.
        """
        q = self._checked(joint_position)
        loose = np.zeros((*q.shape[:-1], len(self._pieces))) if slack is None else np.asarray(slack, dtype=float)
        poses = self.poses(q) if poses is None else poses
        paths = []
        for column, (name, pieces) in enumerate(self._pieces.items()):
            parts = [self._place(piece, q, loose[..., column, None], poses) for piece in pieces]
            distal = np.concatenate([piece.distal for piece in pieces])
            paths.append(TendonPath(name, np.concatenate(parts, axis=-2), distal))
        return tuple(paths)

    def cuts(self, groove: Groove = Groove.DISTAL) -> tuple[Cut, ...]:
        """Return where and in which direction every tendon of a finger crosses the joints; see `cuts`."""
        found = (cuts(self.model, name, pieces, groove) for name, pieces in self._pieces.items())
        return tuple(cut for each in found for cut in each)

    def _place(self, piece: Span | Arc, q: Array, loose: Array, poses: LinkPoses) -> Array:
        link = piece.link if isinstance(piece, Span) else piece.joint
        rotation, translation = poses.rotation[..., link, :, :], poses.translation[..., link, None, :]
        if isinstance(piece, Span):
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


def _moved(pieces: tuple[Span | Arc, ...], place: pin.SE3, begin: int) -> tuple[Span | Arc, ...]:
    """Return the pieces of a finger's tendon as those of a hand, where its joints begin later."""
    moved: list[Span | Arc] = []
    for piece in pieces:
        if isinstance(piece, Arc):
            moved.append(replace(piece, joint=begin + piece.joint))
        elif piece.link:
            moved.append(replace(piece, link=begin + piece.link))
        else:
            moved.append(replace(piece, points=piece.points @ place.rotation.T + place.translation))
    return tuple(moved)


def _palm(hand: HandDescription) -> Iterator[Visual]:
    if all(hand.palm.size):
        place = pin.SE3(np.eye(3), np.array(hand.palm.centre))
        yield Visual("palm", 0, coal.Box(*hand.palm.size), place, MATERIALS["palm"])


def tendon_paths(
    description: FingerDescription, joint_position: ArrayLike, slack: ArrayLike | None = None
) -> tuple[TendonPath, ...]:
    """Return the path of every tendon of a finger; see `TendonGeometry.paths`."""
    return TendonGeometry(description).paths(joint_position, slack)
