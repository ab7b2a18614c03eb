"""What a fingertip can push with: the forces within tension limits, and the tensions that a force needs.

At rest at theta, with E = -F the force that the fingertip exerts on what it touches, (18) reads

    J^T E = H_c2^T f - G - tau^f,

linear in E and the tensions f of the strands. With bounds on the commands f^a it describes a polytope of (E, f^a, f,
tau^f), and the forces are its projection on E. Passive tendons carry whatever the balance asks of them, without
limit, but never push. Friction enters in one of three ways.

- NONE: f_i = f^a_i, halves of passive tendons alike, tau^f = 0.
- HELPING: whatever stiction can hold. f_i / f^a_i and the ratio of the halves lie between exp(-mu_e phi) and
  exp(mu_e phi), and |tau^f_j| <= M^d_j S_j. The set of forces that the finger can hold against a contact that pushes.
- HINDERING: what is left when the finger pushes and everything slips against it. f_i = f^a_i exp(-mu_e phi_i) at all
  actuated tendons, passive tendons lose to whichever side is worse, and tau^f_j = s_j M^d_j (S_j + |E|) with s_j the
  sign of (J^T E)_j. It depends on the direction of E, so it is asked about direction by direction; no polytope.

S_j is the sum of the tensions that cross joint j. The reaction (17) is |-e_j S_j - E|, at most S_j + |E|: so HINDERING
is on the safe side, and HELPING leaves out what the contact itself adds to the friction.

Directions in which no joint moves the fingertip are carried by the structure and are left out of the polytope.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import product
from typing import Any

import numpy as np
import scipy.optimize
import scipy.spatial

from finger_pin.exceptions import InputError
from finger_pin.finger import Finger
from finger_pin.routing import Array
from finger_pin.validation import expand

_RANK = 1e-6
_FLAT = 1e-7
_NEW = 1e-7
_INFEASIBLE = 2
_UNBOUNDED = 3


class Friction(Enum):
    """How friction acts on a finger that pushes; see the module."""

    NONE = "none"
    HELPING = "helping"
    HINDERING = "hindering"


@dataclass(frozen=True, eq=False)
class ForcePolytope:
    """The forces that a fingertip can exert, in the directions that its joints can move it.

    Attributes:
        position: theta, shape (n,), rad.
        tip: Fingertip, shape (3,), m, base frame.
        friction: What was assumed of friction.
        basis: Orthonormal directions that the set spans, shape (3, r), base frame.
        vertices: Shape (v, 3), N, base frame.
        faces: Indices of vertices, shape (faces, r): triangles where r = 3, edges where r = 2; empty where r < 2 or the
            set is flat.
        normals: Outer unit normals of the faces, shape (faces, 3).
        offsets: normals @ E <= offsets, shape (faces,), N.
    """

    position: Array
    tip: Array
    friction: Friction
    basis: Array
    vertices: Array
    faces: Any
    normals: Array
    offsets: Array

    def contains(self, force: Sequence[float] | Array, tolerance: float = 1e-6) -> bool:
        """Return whether a force, shape (3,), N, lies in the set; its part outside the basis does not count."""
        return bool(np.all(self.normals @ np.asarray(force, dtype=float) <= self.offsets + tolerance))

    def support(self, direction: Sequence[float] | Array) -> float:
        """Return the largest component of E along a direction, shape (3,), N times its length."""
        return float(np.max(self.vertices @ np.asarray(direction, dtype=float)))


@dataclass(frozen=True, eq=False)
class RequiredTension:
    """The tensions that a fingertip force needs, those with the least maximum.

    Attributes:
        largest: The largest command, N.
        command: f^a, shape (a,), N.
        strands: Delivered tensions f, shape (s,), N.
        by_radius: Derivative of ``largest`` with respect to every winding radius, shape (t, n), N/m; zero where a
            tendon does not cross. One-sided where the solution is degenerate.
    """

    largest: float
    command: Array
    strands: Array
    by_radius: Array


@dataclass(frozen=True, eq=False)
class _Statics:
    """The linear constraints on x = (f^a, f, tau^f) that do not depend on E, and J^T.

    Attributes:
        jacobian: J, shape (3, n).
        equal: Rows that vanish, shape (., a + s + n).
        below: Rows that are at most zero, shape (., a + s + n).
        torque: Rows (n) of H_c2^T f - tau^f.
        weight: G, shape (n,), N m.
        sizes: a, s, n.
    """

    jacobian: Array
    equal: Array
    below: Array
    torque: Array
    weight: Array
    sizes: tuple[int, int, int]

    @classmethod
    def of(cls, finger: Finger, theta: Array, friction: Friction, slide: tuple[float, ...], signs: Array) -> _Statics:
        """Collect the constraints; ``slide`` and ``signs`` serve HINDERING alone."""
        routing, tendons = finger.routing, finger.tendons
        a, (s, n) = routing.actuated, routing.strand_coupling.shape
        curvature = np.abs(theta) @ routing.curvature_matrix.T + routing.curvature_offset
        loss = np.exp(-tendons.surface * curvature)
        command, strand, joint = np.split(np.eye(a + s + n), [a, a + s])
        direct, proximal, distal = strand[:a], strand[a::2], strand[a + 1 :: 2]
        reaction = finger.joint_friction.kinetic[:, None] * (routing.loads @ strand)
        below: list[Array] = []
        if friction is Friction.NONE:
            equal = [direct - command, distal - proximal, joint]
        elif friction is Friction.HINDERING:
            ratio = loss[a:] ** np.array(slide)
            equal = [direct - loss[:a, None] * command, distal - ratio[:, None] * proximal]
            equal.append(joint - signs[:, None] * reaction)
        else:
            equal = []
            pairs = ((command, direct, loss[:a]), (proximal, distal, loss[a:]))
            below = [
                row
                for before, after, least in pairs
                for row in (least[:, None] * before - after, least[:, None] * after - before)
            ]
            below += [joint - reaction, -joint - reaction]
        torque = routing.strand_coupling.T @ strand - joint
        width = a + s + n
        return cls(
            jacobian=finger.rigid_body.jacobian(theta),
            equal=np.concatenate([np.zeros((0, width)), *equal]),
            below=np.concatenate([np.zeros((0, width)), *below]),
            torque=torque,
            weight=finger.rigid_body.gravity_torque(theta),
            sizes=(a, s, n),
        )

    def solve(self, cost: Array, extra: Array, bounds: list[tuple[float | None, float | None]], offset: Array) -> Any:
        """Minimise over (z, x): the torque rows are extra @ z = torque @ x - weight - offset.

        Args:
            cost: Of z and x.
            extra: Shape (n, z).
            bounds: Of z and f^a.
            offset: Shape (n,), N m.
        """
        _, s, n = self.sizes
        count = extra.shape[1]
        zeros = np.zeros((len(self.equal), count))
        below = np.hstack([np.zeros((len(self.below), count)), self.below])
        return scipy.optimize.linprog(
            cost,
            A_ub=below if len(below) else None,
            b_ub=np.zeros(len(below)) if len(below) else None,
            A_eq=np.vstack([np.hstack([-extra, self.torque]), np.hstack([zeros, self.equal])]),
            b_eq=np.concatenate([self.weight + offset, np.zeros(len(self.equal))]),
            bounds=[*bounds, *[(0.0, None)] * s, *[(None, None)] * n],
        )


def force_polytope(
    finger: Finger,
    position: Sequence[float] | Array,
    limit: float | tuple[float, ...],
    *,
    minimum: float | tuple[float, ...] = 0.0,
    friction: Friction = Friction.NONE,
) -> ForcePolytope:
    """Return the forces that the fingertip can exert within tension limits, weight included.

    The projection is exact: facets of the hull of the vertices found so far are pushed out, by a linear programme
    each, until none moves.

    Args:
        finger: A finger with force closure.
        position: theta, shape (n,), rad.
        limit: Greatest f^a, N, one number or one per actuated tendon.
        minimum: Least f^a, N, likewise.
        friction: NONE or HELPING.

    Raises:
        InputError: If an argument is wrong, or no tensions within the limits hold the finger without a contact or with
            one.
    """
    if friction is Friction.HINDERING:
        raise InputError("friction", "must be none or helping; what hinders depends on the direction", friction.value)
    theta, bounds = _posture(finger, position), _bounds(finger, minimum, limit)
    statics = _Statics.of(finger, theta, friction, (), np.zeros(len(theta)))
    left, values, _ = np.linalg.svd(statics.jacobian)
    basis = left[:, : int(np.sum(values > _RANK * np.max(values)))]
    extra = statics.jacobian.T @ basis
    rank = basis.shape[1]

    def extreme(direction: Array) -> Array:
        cost = np.concatenate([-direction, np.zeros(sum(statics.sizes))])
        found = statics.solve(cost, extra, [*[(None, None)] * rank, *bounds], np.zeros(len(theta)))
        if found.status == _UNBOUNDED:
            raise InputError("finger.tendons", "the forces are unbounded: passive tendons alone balance some of them")
        if found.status != 0:
            raise InputError("limit", "no tensions within the limits balance the finger's weight", bounds)
        return np.asarray(found.x[:rank])

    points = np.array([extreme(sign * axis) for axis in np.eye(rank) for sign in (1.0, -1.0)])
    hull, points = _grow(points, extreme)
    tip = finger.rigid_body.tip_position(theta)
    if hull is None:
        empty = np.zeros((0, rank), dtype=int)
        return ForcePolytope(theta, tip, friction, basis, points @ basis.T, empty, np.zeros((0, 3)), np.zeros(0))
    used = np.unique(hull.simplices)
    number = np.zeros(len(points), dtype=int)
    number[used] = np.arange(len(used))
    normals, offsets = hull.equations[:, :-1] @ basis.T, -hull.equations[:, -1]
    return ForcePolytope(theta, tip, friction, basis, points[used] @ basis.T, number[hull.simplices], normals, offsets)


def largest_force(
    finger: Finger,
    position: Sequence[float] | Array,
    direction: Sequence[float] | Array,
    limit: float | tuple[float, ...],
    *,
    minimum: float | tuple[float, ...] = 0.0,
    friction: Friction = Friction.NONE,
) -> float:
    """Return the largest force that the fingertip can exert straight along a direction, N; negative if only backwards.

    Args:
        finger: A finger with force closure.
        position: theta, shape (n,), rad.
        direction: Of E, shape (3,), base frame; its length does not matter.
        limit: Greatest f^a, N, one number or one per actuated tendon.
        minimum: Least f^a, N, likewise.
        friction: Of any kind.

    Returns:
        The force; infinite where the structure carries it, not a number where no force along this line can be held.

    Raises:
        InputError: If an argument is wrong.
    """
    theta, bounds = _posture(finger, position), _bounds(finger, minimum, limit)
    along = _unit(direction)
    worst = np.inf
    for slide in _slides(finger, friction):
        signs = np.sign(_clean(finger.rigid_body.jacobian(theta).T @ along))
        statics = _Statics.of(finger, theta, friction, slide, signs)
        extra = (statics.jacobian.T @ along)[:, None]
        if friction is Friction.HINDERING:
            extra = extra + (signs * finger.joint_friction.kinetic)[:, None]
        cost = np.append(-1.0, np.zeros(sum(statics.sizes)))
        found = statics.solve(cost, extra, [(None, None), *bounds], np.zeros(len(theta)))
        if found.status == _INFEASIBLE:
            return float("nan")
        worst = min(worst, np.inf if found.status == _UNBOUNDED else float(found.x[0]))
    return worst


def tension_for_force(
    finger: Finger,
    position: Sequence[float] | Array,
    force: Sequence[float] | Array,
    *,
    minimum: float | tuple[float, ...] = 0.0,
    friction: Friction = Friction.NONE,
) -> RequiredTension:
    """Return the tensions with the least maximum at which the fingertip exerts a force.

    Args:
        finger: A finger with force closure.
        position: theta, shape (n,), rad.
        force: E = -F, shape (3,), N, base frame; zero holds the finger against its weight.
        minimum: Least f^a, N, one number or one per actuated tendon.
        friction: Of any kind; HELPING gives what holds at least, HINDERING what surely pushes.

    Raises:
        InputError: If an argument is wrong, or no tensions whatever give this force.
    """
    theta, bounds = _posture(finger, position), _bounds(finger, minimum, np.inf)
    wanted = _vector("force", force, 3)
    demand = finger.rigid_body.jacobian(theta).T @ wanted
    signs = np.sign(_clean(demand))
    if friction is Friction.HINDERING:
        demand = demand + signs * finger.joint_friction.kinetic * np.linalg.norm(wanted)
    needed: list[RequiredTension] = []
    for slide in _slides(finger, friction):
        statics = _Statics.of(finger, theta, friction, slide, signs)
        a, s, n = statics.sizes
        # z is the largest command: an inequality for each.
        lower = np.hstack([-np.ones((a, 1)), np.eye(a), np.zeros((a, s + n))])
        raised = np.vstack([lower, np.hstack([np.zeros((len(statics.below), 1)), statics.below])])
        equal = np.vstack([statics.torque, statics.equal])
        found = scipy.optimize.linprog(
            np.append(1.0, np.zeros(a + s + n)),
            A_ub=raised,
            b_ub=np.zeros(len(raised)),
            A_eq=np.hstack([np.zeros((len(equal), 1)), equal]),
            b_eq=np.concatenate([statics.weight + demand, np.zeros(len(statics.equal))]),
            bounds=[(0.0, None), *bounds, *[(0.0, None)] * s, *[(None, None)] * n],
        )
        if found.status != 0:
            raise InputError("force", "no tensions, however large, exert it", wanted.tolist())
        strands = found.x[1 + a : 1 + a + s]
        # A radius r of a strand enters its joint's row as r f: d(value) = -(multiplier) f dr.
        by_strand = -np.asarray(found.eqlin.marginals)[:n, None] * strands * (finger.routing.loads > 0.0)
        halves = by_strand[:, a:].reshape(n, -1, 2).sum(axis=2)
        by_radius = np.hstack([by_strand[:, :a], halves]).T
        needed.append(RequiredTension(float(found.x[0]), found.x[1 : 1 + a], strands, by_radius))
    return max(needed, key=lambda each: each.largest)


def _grow(points: Array, extreme: Any) -> tuple[Any, Array]:
    """Return the hull of all extreme points, None where it is flat or a line, and the points."""
    scale = max(float(np.max(np.abs(points))), 1e-12)
    rank = points.shape[1]
    if rank < 2 or np.linalg.svd(points - points.mean(axis=0))[1][-1] < _FLAT * scale:
        return None, points
    asked: set[tuple[float, ...]] = set()
    while True:
        hull = scipy.spatial.ConvexHull(points)
        fresh = []
        for equation in hull.equations:
            key = tuple(equation[:-1].round(9))
            if key in asked:
                continue
            asked.add(key)
            point = extreme(equation[:-1])
            if equation[:-1] @ point + equation[-1] > _NEW * scale:
                fresh.append(point)
        if not fresh:
            return hull, points
        points = np.vstack([points, *fresh])


def _slides(finger: Finger, friction: Friction) -> list[tuple[float, ...]]:
    passive = finger.routing.passive
    return list(product((1.0, -1.0), repeat=passive)) if friction is Friction.HINDERING else [(0.0,) * passive]


def _posture(finger: Finger, position: Sequence[float] | Array) -> Array:
    return _vector("position", position, len(finger.routing.joints))


def _bounds(
    finger: Finger, minimum: float | tuple[float, ...], limit: float | tuple[float, ...]
) -> list[tuple[float | None, float | None]]:
    count = finger.routing.actuated
    low, high = expand(minimum, count), expand(limit, count)
    if not (np.all(low >= 0.0) and np.all(high > low)):
        raise InputError("limit", "must be above the least tension, which must not be negative", high.tolist())
    return [(float(a), None if np.isinf(b) else float(b)) for a, b in zip(low, high, strict=True)]


def _unit(direction: Sequence[float] | Array) -> Array:
    vector = _vector("direction", direction, 3)
    length = float(np.linalg.norm(vector))
    if not length > 0.0:
        raise InputError("direction", "must not be zero", vector.tolist())
    return vector / length


def _clean(torque: Array) -> Array:
    return np.where(np.abs(torque) > 1e-12 * np.max(np.abs(torque), initial=0.0), torque, 0.0)


def _vector(name: str, value: Sequence[float] | Array, size: int) -> Array:
    vector = np.asarray(value, dtype=float)
    if vector.shape != (size,) or not np.isfinite(vector).all():
        raise InputError(name, f"must be {size} finite numbers", vector.tolist())
    return vector
