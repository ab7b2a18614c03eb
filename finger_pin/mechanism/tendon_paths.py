"""Tendons as functions of the posture: sums of joint positions, or paths through space."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from finger_pin.description.caching import cached_property
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.routing import Routing
from finger_pin.description.waypoints import Waypoint
from finger_pin.mechanism.body_places import Placed, rotation
from finger_pin.mechanism.path_elements import PathElement, PathTerm, Place, path_kinematics
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.mechanism.spans import CYLINDER, SPHERE, STRAIGHT
from finger_pin.mechanism.spans.span import COINCIDENT, SIDE_ON_OTHER_BODY
from finger_pin.mechanism.tendon_wraps import Wrap
from finger_pin.typing import Array


@dataclass(frozen=True, eq=False)
class TendonPath:
    """The parts of a tendon's length; L = coefficients q + the lengths of its legs.

    Attributes:
        coefficients: Shape (n,).
        legs: Of its path.
        branches: Behind each pulley, the divisor and the legs of that part, undivided.
    """

    coefficients: Array
    legs: tuple[PathTerm, ...]
    branches: tuple[tuple[float, tuple[PathTerm, ...]], ...] = ()

    def beyond(self, wrap: Wrap, coefficients: Array) -> TendonPath:
        """Return the path from a wrap to the end, with the given coefficients; only the wrap turns."""
        legs = [replace(leg, bends=leg.bends and k < wrap.last) for k, leg in enumerate(self.legs) if k >= wrap.first]
        # The leg before says which way it comes, if its ends lie apart.
        last = max((k for k, leg in enumerate(self.legs[: wrap.first]) if leg.apart), default=0)
        before = [replace(leg, arm=0.0, bends=False) for leg in self.legs[last : wrap.first]]
        return TendonPath(coefficients, (*before, *legs))

    def times(self, factor: float) -> TendonPath:
        """Return the same with its length multiplied."""
        legs = tuple(replace(leg, arm=factor * leg.arm) for leg in self.legs)
        return TendonPath(factor * self.coefficients, legs)


@dataclass(frozen=True, eq=False)
class TendonPaths:
    """All tendons of a finger; t tendons of its tree, n joints.

    Attributes:
        body: The rigid body.
        routes: Those of its tree, by name.
        pulled: Those of the finger, by name: on joints, or along one of the tree's.
        placed: Places of the tree's bodies, by name.
        middles: Of the joints' ranges, by name, rad or m.
        references: Positions of the tree's joints at which its bodies are where their placements say, shape (n,).
    """

    body: RigidBody
    routes: Mapping[str, TendonPath]
    pulled: Mapping[str, TendonPath]
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
        routes = {}
        for name, tendon in tree.tendons.items():
            coefficients = np.zeros(len(joints))
            for joint, coefficient in (tendon.joints or {}).items():
                coefficients[joints.index(joint)] = coefficient
            routes[name] = _route(coefficients, tendon.path or {}, placed or {}, placements)
        crossing = zip(description.tendons.items(), Routing.from_description(description).coupling, strict=True)
        pulled = {
            name: TendonPath(-arms, ()) if tendon.along is None else routes[tendon.along]
            for (name, tendon), arms in crossing
        }
        middles = {name: 0.5 * sum(joint.range) for name, joint in description.joints.items()}
        return cls(body, routes, pulled, placed or {}, middles, references)

    @cached_property
    def reference_lengths(self) -> dict[str | None, float]:
        """Lengths of the tree's tendons with the joints at their references, m; what is drawn in counts from there."""
        return dict(zip(self.routes, self.length(self.references).tolist(), strict=True))

    @property
    def fixed(self) -> Array:
        """The part of dL/dq that does not depend on the posture, shape (t, n)."""
        rows = [route.coefficients for route in self.routes.values()]
        return np.array(rows).reshape(-1, int(self.body.model.nv))

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
        return kinematics.length + self.fixed @ q, kinematics.arm + self.fixed, kinematics.turn


def _route(
    coefficients: Array,
    path: Mapping[str, Waypoint],
    placed: Mapping[str | None, Placed],
    placements: Sequence[pin.SE3],
) -> TendonPath:
    """Return a tendon's path; the turn before the first pulley is that of its canal."""
    parts: list[tuple[float, list[PathTerm]]] = [(1.0, [])]
    before: Place | None = None
    wrap: Waypoint | None = None
    for waypoint in path.values():
        if waypoint.kind == "pulley":
            parts.append((waypoint.divisor, []))
            before = None
        elif waypoint.kind == "point":
            point = placed[waypoint.body].place(waypoint.position)
            if before is not None:
                legs = parts[-1][1]
                ends = [placements[end.joint].act(end.point) for end in (before, point)]
                apart = float(np.linalg.norm(ends[1] - ends[0])) > COINCIDENT
                legs.append(PathTerm(_piece(before, point, wrap, placed), follows=bool(legs), apart=apart))
            before, wrap = point, None
        else:
            wrap = waypoint
    (_, trunk), *branches = parts
    behind = [replace(leg, arm=1.0 / divisor, bends=False) for divisor, legs in branches for leg in legs]
    divided = tuple((divisor, tuple(legs)) for divisor, legs in branches)
    return TendonPath(coefficients, (*trunk, *behind), divided)


def _piece(first: Place, second: Place, wrap: Waypoint | None, placed: Mapping[str | None, Placed]) -> PathElement:
    if wrap is None:
        return PathElement(STRAIGHT, np.zeros(0), (first, second))
    body = placed[wrap.body]
    frame = body.frame * pin.SE3(rotation(wrap.orientation), np.array(wrap.position))
    side, elsewhere = (0.0, 0.0, 0.0) if wrap.side is None else wrap.side, wrap.side_point
    inside = wrap.side is not None and float(np.linalg.norm(side)) < wrap.radius
    has_side = SIDE_ON_OTHER_BODY if elsewhere else float(wrap.side is not None)
    numbers = np.array([wrap.radius, *side, has_side, inside], dtype=float)
    third = (placed[elsewhere.body].place(elsewhere.position),) if elsewhere else ()
    shape = CYLINDER if wrap.kind == "cylinder" else SPHERE
    return PathElement(shape, numbers, (first, second, *third), body.joint, frame)


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
        routes = {routing.tendons[k]: paths.pulled[routing.tendons[k]] for k in self._through_space}
        self._paths = replace(paths, routes=routes)

    def lengths(self, position: Array) -> Array:
        """Return the excursions of the tendons at theta, shape (..., n): shape (..., t), m."""
        drawn = np.asarray(position @ self._coupling.T)
        if self._whole.routes:
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
