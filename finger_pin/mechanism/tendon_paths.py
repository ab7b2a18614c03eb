"""Tendons as functions of the posture: sums of joint positions, or paths through space."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from finger_pin.description.caching import cached_property
from finger_pin.description.cords import Cord, CordElement
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.routing import Routing
from finger_pin.mechanism.body_places import Placed, rotation
from finger_pin.mechanism.path_elements import PathElement, PathTerm, path_kinematics
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.mechanism.spans import CYLINDER, SPHERE, STRAIGHT
from finger_pin.mechanism.spans.span import COINCIDENT, SIDE_ON_OTHER_BODY
from finger_pin.typing import Array


class TendonPath(NamedTuple):
    """Line along which the rows of a tendon act; its length is coefficients q + the lengths of the legs.

    Attributes:
        coefficients: Shape (n,).
        legs: Of its path.
    """

    coefficients: Array
    legs: tuple[PathTerm, ...] = ()


@dataclass(frozen=True, eq=False)
class TendonPaths:
    """All tendons of a finger; t tendons of its tree, n joints.

    Attributes:
        body: The rigid body.
        terms: Of every leg of a cord of the tree, how rows use its piece.
        cords: Tendons of the tree, by name.
        placed: Places of the tree's bodies, by name.
        middles: Of the joints' ranges, by name, rad or m.
        references: Positions of the tree's joints at which its bodies are where their placements say, shape (n,).
    """

    body: RigidBody
    terms: Mapping[CordElement, PathTerm]
    cords: Mapping[str, Cord]
    placed: Mapping[str | None, Placed]
    middles: Mapping[str, float]
    references: Array

    @classmethod
    def from_description(
        cls, description: FingerDescription, body: RigidBody, placed: Mapping[str | None, Placed] | None = None
    ) -> TendonPaths:
        """Read the tendons of a finger on a rigid body, on which the bodies of its tree have their places."""
        tree, joints = description.tree, list(description.joints)
        references = np.array([tree.joints[name].reference if name in tree.joints else 0.0 for name in joints])
        placements = body.placements(references)[0] if tree.tendons else []
        cords, terms = {name: tree.cord(name) for name in tree.tendons}, {}
        for leg in (each for cord in cords.values() for part in cord.parts for each in part.elements if each.points):
            piece = _piece(leg, placed or {})
            before, after = (placements[end.joint].act(end.point) for end in piece.ends[:2])
            apart = float(np.linalg.norm(after - before)) > COINCIDENT
            terms[leg] = PathTerm(piece, follows=leg.follows, apart=apart)
        middles = {name: 0.5 * sum(joint.range) for name, joint in description.joints.items()}
        return cls(body, terms, cords, placed or {}, middles, references)

    def along(self, cord: Cord, factor: float = 1.0) -> TendonPath:
        """Return what rows act along that pull a cord from the beginning of a piece to its end, pulleys included.

        Its curvature is that of the piece, and its length is multiplied.
        """
        coefficients = -factor * cord._replace(last=None).arms(tuple(self.middles))
        legs: list[PathTerm] = []
        for k, element in enumerate(cord.elements):
            if not element.points:
                continue
            term = self.terms[element]
            if k >= cord.first:
                legs.append(replace(term, arm=factor, bends=cord.last is None or k < cord.last))
            else:
                # The leg before says which way the cord comes, if its ends lie apart.
                legs = [*(() if term.apart else legs), replace(term, arm=0.0, bends=False)]
        behind = (
            replace(self.terms[element], arm=factor * (1.0 / branch.divisor), bends=False)
            for branch in cord.branches
            for element in branch.elements
        )
        return TendonPath(coefficients, (*legs, *behind))

    @cached_property
    def routes(self) -> dict[str, TendonPath]:
        """The tendons of the tree as what rows act along, by name."""
        return {name: self.along(cord) for name, cord in self.cords.items()}

    @cached_property
    def reference_lengths(self) -> dict[str | None, float]:
        """Lengths of the tree's tendons with the joints at their references, m; what is drawn in counts from there."""
        return dict(zip(self.routes, self.length(self.references).tolist(), strict=True))

    def length(self, q: Array) -> Array:
        """Return the lengths at q, shape (..., n), as MuJoCo's ``ten_length``: shape (..., t), m."""
        return self._kinematics(q)[0]

    def arms(self, q: Array) -> Array:
        """Return dL/dq at q, shape (..., n), as MuJoCo's ``ten_J``: shape (..., t, n), m."""
        return self._kinematics(q)[1]

    def turn(self, q: Array) -> Array:
        """Return the angle by which each path turns at q, shape (..., n), before its first pulley: (..., t), rad."""
        return self._kinematics(q)[2]

    def _kinematics(self, q: Array) -> tuple[Array, Array, Array]:
        q = np.asarray(q, dtype=float)
        if q.ndim > 1:
            postures = [self._kinematics(one) for one in q]
            length, arms, turn = (np.array(part) for part in zip(*postures, strict=True))
            return length, arms, turn
        kinematics = path_kinematics(self.body, q, [route.legs for route in self.routes.values()], len(q))
        fixed = np.reshape([route.coefficients for route in self.routes.values()], (-1, len(q)))
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


class Excursions:
    """Excursions of all t tendons, zero in the joints' reference posture."""

    def __init__(self, routing: Routing, description: FingerDescription, paths: TendonPaths) -> None:
        """Find the tendons that go through space.

        Args:
            routing: H_c.
            description: Of the finger.
            paths: Its tendons.
        """
        self._coupling, self._whole = routing.coupling, paths
        self._along = [tendon.along for tendon in description.tendons.values()]
        self._through_space = np.flatnonzero(routing.through_space)
        cords = {routing.tendons[k]: description.cord(routing.tendons[k]) for k in self._through_space}
        self._paths = replace(paths, cords=cords)

    def lengths(self, position: Array) -> Array:
        """Return the excursions of the tendons at theta, shape (..., n): shape (..., t), m."""
        drawn = np.asarray(position @ self._coupling.T)
        if self._whole.cords:
            if self._through_space.size:
                drawn[..., self._through_space] = -self._paths.length(position)
            drawn += [self._whole.reference_lengths.get(name, 0.0) for name in self._along]
        return drawn

    def slopes(self, position: Array) -> Array:
        """Return their derivatives by theta, shape (..., n): shape (..., t, n), m."""
        coupling = np.broadcast_to(self._coupling, (*position.shape[:-1], *self._coupling.shape)).copy()
        if self._through_space.size:
            coupling[..., self._through_space, :] = -self._paths.arms(position)
        return coupling
