"""Tendons as functions of the posture: sums of joint positions, or paths through space."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from finger_pin.description.caching import cached_property
from finger_pin.description.cords import Cord, CordElement
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.routing import Routing
from finger_pin.mechanism.body_places import Placed, rotation
from finger_pin.mechanism.path_elements import PathElement, Paths, PathTerm, path_kinematics
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.mechanism.spans import CYLINDER, SPHERE, STRAIGHT
from finger_pin.mechanism.spans.span import COINCIDENT, SIDE_ON_OTHER_BODY
from finger_pin.typing import Array


@dataclass(frozen=True, eq=False)
class TendonPaths:
    """The cords of a finger on its rigid body; t tendons of its tree or of its own, n joints.

    Attributes:
        body: The rigid body.
        description: Of the finger, or of one whose routing and tree are the same.
        placed: Places of the tree's bodies, by name.
    """

    body: RigidBody
    description: FingerDescription
    placed: Mapping[str | None, Placed]

    @cached_property
    def cords(self) -> dict[str, Cord]:
        """Tendons of the tree, by name."""
        return {name: self.description.tree.cord(name) for name in self.description.tree.tendons}

    @cached_property
    def pieces(self) -> dict[CordElement, PathElement]:
        """The piece of every leg of the tree's tendons; rows with the same leg share it."""
        legs = (leg for cord in self.cords.values() for part in cord.parts for leg in part.elements if leg.points)
        return {leg: _piece(leg, self.placed) for leg in legs}

    @property
    def references(self) -> Array:
        """Positions of the joints at which the tree's bodies are where their placements say, shape (n,)."""
        joints = self.description.tree.joints
        return np.array([joints[name].reference if name in joints else 0.0 for name in self.description.joints])

    def along(self, cords: Iterable[Cord], factors: float | Sequence[float] = 1.0) -> tuple[Array, Paths]:
        """Return arms, shape (k, n), and paths of rows that pull cords from where a piece begins to their ends.

        Pulleys are included. The curvature is that of the piece, and lengths are multiplied by factors.
        """
        pulled, joints = list(cords), tuple(self.description.joints)
        weights = np.broadcast_to(factors, len(pulled)).tolist()
        arms = [-factor * cord._replace(last=None).arms(joints) for cord, factor in zip(pulled, weights, strict=True)]
        return np.reshape(arms, (len(pulled), len(joints))), tuple(map(self._legs, pulled, weights))

    def _legs(self, cord: Cord, factor: float) -> tuple[PathTerm, ...]:
        legs: list[PathTerm] = []
        for k, element in enumerate(cord.elements):
            if not element.points:
                continue
            leg = PathTerm(self.pieces[element], arm=factor, follows=element.follows)
            if k >= cord.first:
                legs.append(leg._replace(bends=cord.last is None or k < cord.last))
            else:
                # The leg before says which way the cord comes, if its ends lie apart.
                legs = [*(() if self._is_long(leg.piece) else legs), leg._replace(arm=0.0, bends=False)]
        behind = (
            PathTerm(self.pieces[element], arm=factor * (1.0 / branch.divisor), follows=element.follows, bends=False)
            for branch in cord.branches
            for element in branch.elements
        )
        return (*legs, *behind)

    def _is_long(self, piece: PathElement) -> bool:
        """Return whether the ends of a piece lie apart where the joints are at their references."""
        placements, _ = self.body.placements(self.references)
        before, after = (placements[end.joint].act(end.point) for end in piece.ends[:2])
        return float(np.linalg.norm(after - before)) > COINCIDENT

    @cached_property
    def reference_lengths(self) -> dict[str | None, float]:
        """Lengths of the tree's tendons with the joints at their references, m; what is drawn in counts from there."""
        return dict(zip(self.cords, self.length(self.references).tolist(), strict=True))

    def length(self, q: Array) -> Array:
        """Return the lengths of the tree's tendons at q, shape (..., n), as MuJoCo's ``ten_length``: (..., t), m."""
        return self._kinematics(self._of_tree, q)[0]

    def arms(self, q: Array) -> Array:
        """Return their dL/dq at q, shape (..., n), as MuJoCo's ``ten_J``: shape (..., t, n), m."""
        return self._kinematics(self._of_tree, q)[1]

    def turn(self, q: Array) -> Array:
        """Return the angle by which each path turns at q, shape (..., n), before its first pulley: (..., t), rad."""
        return self._kinematics(self._of_tree, q)[2]

    def excursion(self, q: Array) -> Array:
        """Return the excursions of the finger's own tendons at q, shape (..., n), drawn in from the joints' references.

        Their shape is (..., t), m; what is on joints alone is at zero there.
        """
        drawn = np.asarray(q @ self.routing.coupling.T)
        if self.cords:
            if self.routing.through_space.any():
                drawn[..., self.routing.through_space] = -self._kinematics(self._own, q)[0]
            drawn += [self.reference_lengths.get(each.along, 0.0) for each in self.description.tendons.values()]
        return drawn

    def coupling(self, q: Array) -> Array:
        """Return their derivatives by q, shape (..., n), at postures: shape (..., t, n), m."""
        coupling = np.broadcast_to(self.routing.coupling, (*q.shape[:-1], *self.routing.coupling.shape)).copy()
        if self.routing.through_space.any():
            coupling[..., self.routing.through_space, :] = -self._kinematics(self._own, q)[1]
        return coupling

    @cached_property
    def routing(self) -> Routing:
        """Its routing."""
        return Routing.from_description(self.description)

    @cached_property
    def _of_tree(self) -> tuple[Array, Paths]:
        return self.along(self.cords.values())

    @cached_property
    def _own(self) -> tuple[Array, Paths]:
        return self.along(cord for cord in map(self.description.cord, self.description.tendons) if cord.through_space)

    def _kinematics(self, rows: tuple[Array, Paths], q: Array) -> tuple[Array, Array, Array]:
        q = np.asarray(q, dtype=float)
        if q.ndim > 1:
            postures = [self._kinematics(rows, one) for one in q]
            length, arms, turn = (np.array(part) for part in zip(*postures, strict=True))
            return length, arms, turn
        fixed, paths = rows
        kinematics = path_kinematics(self.body, q, paths, len(q))
        return kinematics.length + fixed @ q, kinematics.arm + fixed, kinematics.turn


def _piece(leg: CordElement, placed: Mapping[str | None, Placed]) -> PathElement:
    ends = tuple(placed[point.body].place(point.position) for point in leg.points)
    if leg.wrap is None:
        return PathElement(STRAIGHT, np.zeros(0), ends)
    _, wrap = leg.wrap
    body = placed[wrap.body]
    frame = body.frame * pin.SE3(rotation(wrap.orientation), np.array(wrap.position))
    side, elsewhere = (0.0, 0.0, 0.0) if wrap.side is None else wrap.side, wrap.side_point
    inside = wrap.side is not None and float(np.linalg.norm(side)) < wrap.radius
    has_side = SIDE_ON_OTHER_BODY if elsewhere else float(wrap.side is not None)
    numbers = np.array([wrap.radius, *side, has_side, inside], dtype=float)
    third = (placed[elsewhere.body].place(elsewhere.position),) if elsewhere else ()
    shape = CYLINDER if wrap.kind == "cylinder" else SPHERE
    return PathElement(shape, numbers, (*ends, *third), body.joint, frame)
