"""Pieces of paths through space: lengths, arms and turns that depend on the posture.

A piece is a function of two points that bodies carry, seen from a frame that a third body carries: a straight stretch
of a tendon, a wrap about a cylinder, the gap between two surfaces. Its columns are wrenches (moment about the base's
origin, force) on the three bodies, which sum up to nothing; the arm of a row is the power that they take at unit
velocity of every coordinate, and for a length it is the length's gradient.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np
import pinocchio as pin

from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.mechanism.spans.span import COINCIDENT
from finger_pin.typing import Array


class PathShape(Protocol):
    """The form of a piece, seen from its own frame: a span of a tendon, or a gap between surfaces.

    Attributes:
        parameters: Names of its numbers.
        value: (y, p, out) fills what the points y give, six numbers, and three of a third point; see `spans`, `gaps`.
        slopes: (y, p, out) fills its derivatives by y.
        columns: Count of its wrenches: one along a span; of a gap normal, two tangents, and a moment about the normal.
    """

    columns: ClassVar[int]

    @property
    def parameters(self) -> tuple[str, ...]: ...  # noqa: D102

    @property
    def value(self) -> Callable[..., None]: ...  # noqa: D102

    @property
    def slopes(self) -> Callable[..., None]: ...  # noqa: D102


@dataclass(frozen=True, eq=False)
class Place:
    """A point that a body carries.

    Attributes:
        joint: Index of the body's joint in Pinocchio's model, 0 for the base.
        point: In the frame of the joint, shape (3,), m.
    """

    joint: int
    point: Array


@dataclass(frozen=True, eq=False)
class PathElement:
    """A shape between bodies.

    Attributes:
        shape: The function.
        parameters: Its numbers.
        ends: The two points, and the side point of a wrap that another body carries than the wrap's, or a third point
            of the body of both.
        joint: Of the body that carries the frame, 0 for the base.
        frame: Placement of the frame in that joint's.
        reach: Distance of both points' middle from the frame's origin beyond which a gap is open and not asked, m.
        breadth: Half width of the first body's part across its points, m.
        extent: Extent of the frame's body from the frame's origin, less the rounding that looks alike however it
            turns, m; infinite for a half-space.
        pair: Number of the pair of solids of whose contact this is a part, in order; -1 if it is alone.
    """

    shape: PathShape
    parameters: Array
    ends: tuple[Place, ...]
    joint: int = 0
    frame: pin.SE3 = field(default_factory=pin.SE3.Identity)
    reach: float = np.inf
    breadth: float = 0.0
    extent: float = np.inf
    pair: int = -1


# Compared by value, with its piece by identity: rows made anew of the same pieces have the same structure.
class PathTerm(NamedTuple):
    """The use of a piece by a row.

    Attributes:
        piece: The piece.
        column: Which of its wrenches.
        arm: Weight in the row's arm and length.
        follows: Whether it begins where the row's leg before it ends: there the path turns.
        bends: Whether its turn is one of the row's path; behind a pulley each branch has rows of its own.
    """

    piece: PathElement
    column: int = 0
    arm: float = 1.0
    follows: bool = False
    bends: bool = True


#: Column of a gap's moment about the normal.
SPIN = 3
#: Of every row of a table, the legs of its path.
Paths = Sequence[Sequence[PathTerm]]


@dataclass(frozen=True, eq=False)
class PathKinematics:
    """Lengths, arms and turns of paths for the rows of a table at one posture; k rows, N coordinates.

    Attributes:
        length: Shape (k,).
        arm: Shape (k, N).
        turn: Angle by which the paths turn, shape (k,), rad.
        force: Unit wrench's force on the first body of each row's first leg, base frame, shape (k, 3).
    """

    length: Array
    arm: Array
    turn: Array
    force: Array


def path_kinematics(body: RigidBody, q: Array, paths: Paths, coordinates: int) -> PathKinematics:
    """Return lengths, arms and turns of paths for their rows at q, shape (nq,)."""
    width = int(body.model.nv)
    placements, twists = body.placements(q)

    kinematics = PathKinematics(
        np.zeros(len(paths)), np.zeros((len(paths), coordinates)), np.zeros(len(paths)), np.zeros((len(paths), 3))
    )
    for k, legs in enumerate(paths):
        before, bends = np.zeros(3), False
        for number, leg in enumerate(legs):
            piece = leg.piece
            points = [placements[end.joint].act(np.asarray(end.point, dtype=float)) for end in piece.ends]
            frame = placements[piece.joint] * piece.frame
            out = _value(piece, frame, points)
            rotation = frame.rotation
            if piece.shape.columns == 1:
                length, turn = out[0], out[1]
                loads = [(rotation @ out[2:5], points[0]), (rotation @ out[5:8], points[1])]
            else:
                length, turn = (out[0] if leg.column == 0 else 0.0), 0.0
                axis = (1, 7, 10, 1)[leg.column]
                loads = [(rotation @ out[axis : axis + 3], frame.act(out[4:7]))] if out[0] < 0.0 else []
            arm = np.zeros(width)
            if leg.column == SPIN and loads:
                arm += loads[0][0] @ (twists[piece.ends[0].joint] - twists[piece.joint])[3:]
                loads = []
            for (force, point), end in zip(loads, piece.ends[:2], strict=False):
                wrench = np.concatenate([force, pin.skew(point) @ force])
                arm += wrench @ (twists[end.joint] - twists[piece.joint])
            kinematics.length[k] += leg.arm * length
            kinematics.arm[k, :width] += leg.arm * arm
            # A leg between points at one place has no direction: the path turns from the one before to the one behind.
            bends = leg.bends or (bends and leg.follows)
            if leg.bends:
                kinematics.turn[k] += turn
            if number == 0 and loads:
                kinematics.force[k] = loads[0][0]
            if not loads or (piece.shape.columns == 1 and length <= COINCIDENT):
                continue
            if bends and leg.follows:
                kinematics.turn[k] += _angle(before, -loads[0][0])
            before, bends = loads[-1][0], False
    return kinematics


def piece_lengths(body: RigidBody, q: Array, pieces: Sequence[PathElement]) -> Array:
    """Return the lengths of pieces, or gaps, at q, shape (nq,): shape (len(pieces),), m."""
    placements, _ = body.placements(q)
    # Products with a frame take longer than all else: pieces of one body share theirs.
    frames = {id(piece.frame): placements[piece.joint] * piece.frame for piece in pieces}
    ends = {id(end): placements[end.joint].act(end.point) for piece in pieces for end in piece.ends}
    values = [_value(piece, frames[id(piece.frame)], [ends[id(end)] for end in piece.ends]) for piece in pieces]
    return np.array([value[0] for value in values])


def _value(piece: PathElement, frame: pin.SE3, points: Sequence[Array]) -> Array:
    """Return the value of the shape; out of reach, a gap that is open."""
    out = np.zeros(16)
    if piece.reach < np.inf:
        beyond = math.dist(0.5 * (points[0] + points[1]), frame.translation) - piece.reach
        if beyond > 0.0:
            out[0] = beyond
            return out
    piece.shape.value(np.concatenate([frame.actInv(point) for point in points]), piece.parameters, out)
    return out


def _angle(first: Array, second: Array) -> Any:
    return np.arctan2(np.linalg.norm(pin.skew(first) @ second), first @ second)
