"""Pieces of drawn tendons: straight spans at rest in links, arcs around joints, and legs of paths through space."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from finger_pin.mechanism.path_elements import PathElement
from finger_pin.mechanism.spans import CYLINDER, STRAIGHT
from finger_pin.typing import Array

#: Drawn sag of a loose span in parts of its length, and lift of a loose arc off its pulley in parts of its radius.
DRAWN_SAG, DRAWN_LIFT = 0.12, 0.15
# Points of a leg that may wrap.
_POINTS = 12


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
class WoundSpan:
    """A straight piece.

    Attributes:
        link: Index of the link at which it rests; 0 is the base, 1 the link after the first joint.
        points: In the frame of that link, shape (P, 3), m.
        sag: Shape of its sag, 1 at its middle and 0 at its ends, times its length, shape (P,), m.
        distal: Whether a point lies beyond the lumped mass of a passive tendon, shape (P,).
    """

    link: int
    points: Array
    sag: Array
    distal: NDArray[np.bool_]

    def place(self, position: Array, loose: Array, poses: LinkPoses, down: Array) -> Array:
        """Return its points in space, shape (..., P, 3), m.

        Args:
            position: theta, shape (..., n), rad.
            loose: Looseness as drawn, shape (..., 1).
            poses: Of the links.
            down: Direction of gravity.
        """
        rotation, translation = poses.rotation[..., self.link, :, :], poses.translation[..., self.link, None, :]
        sag = (DRAWN_SAG * loose * self.sag)[..., None] * down
        return np.asarray(self.points @ np.swapaxes(rotation, -1, -2) + translation + sag)

    def turned(self, turns: Sequence[Array]) -> WoundSpan:
        """Return the piece with the frames of its links turned, each by a rotation."""
        return replace(self, points=self.points @ turns[self.link].T)


@dataclass(frozen=True, eq=False)
class Arc:
    """A piece around a joint, on a pulley as wide as a lane.

    Attributes:
        joint: Index of the joint, 1 for the first.
        radius: r, m.
        entry: Direction of the path where it meets the pulley, in the frame of the link before the joint, rad.
        turn: Turn of the path from entry to exit at theta = 0, rad.
        lane: Offset of its pulley along the joint axis, m.
        skew: How far its ends lie beside that, each on its side, m.
        fraction: Of each point along the arc, 0 to 1, shape (P,).
        distal: As for `WoundSpan`.
        frame: Rotation of the pulley, whose axis is z, in the frame of the link after the joint, shape (3, 3).
    """

    joint: int
    radius: float
    entry: float
    turn: float
    lane: float
    skew: float
    fraction: Array
    distal: NDArray[np.bool_]
    frame: Array = field(default_factory=lambda: np.eye(3))

    @property
    def offset(self) -> Array:
        """Of each point along the joint axis, shape (P,), m."""
        return self.lane + self.skew * (2.0 * self.fraction - 1.0)

    def place(self, position: Array, loose: Array, poses: LinkPoses, down: Array) -> Array:
        """Return its points in space; see `WoundSpan.place`."""
        rotation, translation = poses.rotation[..., self.joint, :, :], poses.translation[..., self.joint, None, :]
        theta = position[..., self.joint - 1, None]
        direction = self.entry - theta + self.fraction * (self.turn + theta)
        radius = self.radius * (1.0 + DRAWN_LIFT * loose * np.sin(math.pi * self.fraction))
        offset = np.broadcast_to(self.offset, direction.shape)
        local = np.stack([-radius * np.sin(direction), radius * np.cos(direction), offset], axis=-1)
        return np.asarray(local @ np.swapaxes(rotation @ self.frame, -1, -2) + translation)

    def turned(self, turns: Sequence[Array]) -> Arc:
        """Return the piece with the frames of its links turned, each by a rotation."""
        return replace(self, frame=turns[self.joint])


@dataclass(frozen=True, eq=False)
class Leg:
    """A leg of a path through space, between two points, straight or around a wrap; it never sags.

    Attributes:
        element: Its element.
    """

    element: PathElement

    @property
    def distal(self) -> NDArray[np.bool_]:
        """As for `WoundSpan`."""
        return np.zeros(2 if self.element.shape is STRAIGHT else _POINTS, dtype=bool)

    def place(self, position: Array, loose: Array, poses: LinkPoses, down: Array) -> Array:
        """Return its points in space; see `WoundSpan.place`."""
        *leading, count, _ = poses.translation.shape
        postures = zip(poses.rotation.reshape(-1, count, 3, 3), poses.translation.reshape(-1, count, 3), strict=True)
        points = np.array([_stretch(self.element, *posture) for posture in postures])
        return points.reshape(*leading, len(self.distal), 3)


Piece: TypeAlias = WoundSpan | Arc | Leg


def link_poses(model: pin.Model, position: Array) -> LinkPoses:
    """Return the poses of the links of a model at theta, shape (..., n), rad or m."""
    flat, count = np.ascontiguousarray(position.reshape(-1, model.nq)), model.njoints
    rotation, translation = np.empty((len(flat), count, 3, 3)), np.empty((len(flat), count, 3))
    data = model.createData()
    for row, posture in enumerate(flat):
        pin.forwardKinematics(model, data, posture)
        for index, placement in enumerate(data.oMi):
            rotation[row, index], translation[row, index] = placement.rotation, placement.translation
    leading = position.shape[:-1]
    return LinkPoses(rotation.reshape(*leading, count, 3, 3), translation.reshape(*leading, count, 3))


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
    start, end = _tangent_point(piece, a, -out[2:5]), _tangent_point(piece, b, out[5:8] * -1.0)
    arc = _arc(piece, start, end, -out[2:5], out[1])
    return np.asarray(np.concatenate([[a], arc, [b]]) @ turned.T + origin)


def _tangent_point(piece: PathElement, point: Array, direction: Array) -> Array:
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
