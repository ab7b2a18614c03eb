"""The set of forces that a fingertip can exert within tension limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import scipy

from finger_pin.analysis.printing import BriefRepr
from finger_pin.analysis.tip_statics import UNBOUNDED, Friction, TipStatics, command_bounds, posture
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import FingerLike, as_finger, at_tip
from finger_pin.typing import Array

_RANK_TOLERANCE = 1e-6
_EXTENT_TOLERANCE = 1e-7
_GROWTH_TOLERANCE = 1e-7


@dataclass(frozen=True, eq=False, repr=False)
class ForcePolytope(BriefRepr):
    """The forces that a fingertip can exert, in the directions that its joints can move it.

    Attributes:
        position: theta, shape (n,), rad.
        tip: Fingertip, shape (3,), m, base frame.
        friction: Part of friction in it.
        basis: Orthonormal directions that the set spans, shape (3, r), base frame: r = 3 for a body, 2 for a polygon,
            as of a finger whose two joints are parallel, 1 for a line, as of a finger of one joint.
        vertices: Shape (v, 3), N, base frame.
        faces: Indices of vertices, shape (faces, r): triangles where r = 3, edges where r = 2, ends where r = 1.
        normals: Outer unit normals, shape (f, 3): of the faces, then both ways of every direction in which the joints
            can move the fingertip and the set has no extent.
        offsets: normals @ E <= offsets, shape (f,), N.
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
        """Return whether a force, shape (3,), N, lies in the set, apart from the part that the structure carries."""
        return bool(np.all(self.normals @ np.asarray(force, dtype=float) <= self.offsets + tolerance))

    def support(self, direction: Sequence[float] | Array) -> float:
        """Return the largest component of E along a direction, shape (3,), N times its length."""
        return float(np.max(self.vertices @ np.asarray(direction, dtype=float)))

    def triangles(self) -> Any:
        """Return indices of vertices, shape (., 3): triangles on the surface, or on a flat set itself.

        On a surface their corners run counter-clockwise as seen from outside. There are none where the set is a line.
        """
        rank = self.basis.shape[1]
        if rank < 2:
            return np.zeros((0, 3), dtype=int)
        if rank == 2:
            boundary = self._boundary_order()
            return np.array([(boundary[0], a, b) for a, b in pairwise(boundary[1:])])
        corners = self.vertices[self.faces]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        inwards = np.einsum("fi,fi->f", across, self.normals[: len(self.faces)]) < 0.0
        return np.where(inwards[:, None], self.faces[:, ::-1], self.faces)

    def ridges(self) -> list[tuple[int, int]]:
        """Return pairs of vertices: the edges between faces that do not lie in one plane; the outline of a flat set."""
        rank = self.basis.shape[1]
        if rank < 2:
            return [(0, 1)] if rank else []
        if rank == 2:
            return [(int(first), int(second)) for first, second in self.faces]
        faces_of_edge: dict[tuple[int, int], list[int]] = {}
        for index, face in enumerate(self.faces):
            for first, second in ((0, 1), (1, 2), (2, 0)):
                low, high = sorted((int(face[first]), int(face[second])))
                faces_of_edge.setdefault((low, high), []).append(index)
        return [
            edge for edge, (one, other) in faces_of_edge.items() if self.normals[one] @ self.normals[other] < 1.0 - 1e-6
        ]

    def _boundary_order(self) -> Any:
        """Return the vertices of a flat set in their order around its middle."""
        plane = (self.vertices - self.vertices.mean(axis=0)) @ self.basis
        return np.argsort(np.arctan2(plane[:, 1], plane[:, 0]))


def force_polytope(
    finger: FingerLike,
    position: Sequence[float] | Array,
    maximum_tension: float | tuple[float, ...],
    *,
    minimum_tension: float | tuple[float, ...] = 0.0,
    friction: Friction = Friction.NONE,
    tip: str | None = None,
) -> ForcePolytope:
    """Return the forces that the fingertip can exert within tension limits, weight included.

    The projection is exact: facets of the hull of the vertices found so far are pushed out, by a linear programme
    each, until none moves.

    Args:
        finger: A finger with force closure.
        position: theta, shape (n,), rad.
        maximum_tension: Greatest f^a, N, one number or one per actuated tendon.
        minimum_tension: Least f^a, N, likewise.
        friction: NONE or HELPING.
        tip: Name of the fingertip, where a tree has several.
    """
    finger = at_tip(as_finger(finger), tip)
    if friction is Friction.HINDERING:
        raise InputError("friction", "must be none or helping; hindering friction has a direction", friction.value)
    theta, bounds = posture(finger, position), command_bounds(finger, minimum_tension, maximum_tension)
    statics = TipStatics.from_finger(finger, theta, friction)
    left_vectors, values, _ = np.linalg.svd(statics.jacobian)
    basis = left_vectors[:, : int(np.sum(values > _RANK_TOLERANCE * np.max(values)))]
    if not basis.shape[1]:
        raise InputError("position", "no joint moves the fingertip there", list(position))
    force_columns = statics.jacobian.T @ basis
    rank = basis.shape[1]

    def extreme(direction: Array) -> Array:
        cost = np.concatenate([-direction, np.zeros(sum(statics.sizes))])
        solution = statics.solve(cost, force_columns, [*[(None, None)] * rank, *bounds], np.zeros(len(theta)))
        if solution.status == UNBOUNDED:
            raise InputError("finger.tendons", "the forces are unbounded: passive tendons alone balance some of them")
        if solution.status != 0:
            raise InputError("limit", "no tensions within the limits balance the finger's weight", bounds)
        return np.asarray(solution.x[:rank])

    points, spanned = _spanning_points(rank, extreme)
    perpendicular = np.linalg.svd(np.eye(rank) - spanned.T @ spanned)[2][: rank - len(spanned)]
    axes, thin_axes = basis @ spanned.T, basis @ perpendicular.T
    points, faces, normals, offsets = _expand_hull(points, spanned, extreme)
    vertices = points @ basis.T
    level = vertices[0] @ thin_axes
    return ForcePolytope(
        position=theta,
        tip=finger.rigid_body.tip_position(theta),
        friction=friction,
        basis=axes,
        vertices=vertices,
        faces=faces,
        normals=np.concatenate([normals @ axes.T, thin_axes.T, -thin_axes.T]),
        offsets=np.concatenate([offsets, level, -level]),
    )


def _spanning_points(rank: int, extreme: Any) -> tuple[Array, Array]:
    """Return extreme points that span the set, shape (m, rank), and the directions that they span, (r, rank)."""
    points = np.array([extreme(sign * axis) for axis in np.eye(rank) for sign in (1.0, -1.0)])
    while True:
        scale = max(float(np.max(np.abs(points))), 1e-12)
        _, extents, axes = np.linalg.svd(points - points.mean(axis=0))
        spanned = axes[: int(np.sum(extents > _EXTENT_TOLERANCE * scale))]
        # Extreme points may lie in a plane though the set does not: look to both sides of it.
        candidates = [extreme(sign * axis) for axis in axes[len(spanned) :] for sign in (1.0, -1.0)]
        outside = axes[len(spanned) :]
        new_points = [p for p in candidates if np.max(np.abs(outside @ (p - points[0]))) > _EXTENT_TOLERANCE * scale]
        if not new_points:
            return points, spanned
        points = np.vstack([points, *new_points])


def _expand_hull(points: Array, axes: Array, extreme: Any) -> tuple[Array, Any, Array, Array]:
    """Return vertices, faces, and normals along the axes with their offsets, of the hull of all extreme points."""
    if len(axes) == 0:
        return points[:1], np.zeros((0, 0), dtype=int), np.zeros((0, 0)), np.zeros(0)
    if len(axes) == 1:
        coordinates, sides = points @ axes[0], np.array([-1.0, 1.0])
        ends = [int(np.argmin(coordinates)), int(np.argmax(coordinates))]
        return points[ends], np.array([[0], [1]]), sides[:, None], sides * coordinates[ends]
    scale = max(float(np.max(np.abs(points))), 1e-12)
    searched_normals: set[tuple[float, ...]] = set()
    while True:
        hull = scipy.spatial.ConvexHull(points @ axes.T)
        new_points = []
        for equation in hull.equations:
            key = tuple(equation[:-1].round(9))
            if key in searched_normals:
                continue
            searched_normals.add(key)
            point = extreme(equation[:-1] @ axes)
            if equation[:-1] @ (axes @ point) + equation[-1] > _GROWTH_TOLERANCE * scale:
                new_points.append(point)
        if not new_points:
            break
        points = np.vstack([points, *new_points])
    used = np.unique(hull.simplices)
    new_index = np.zeros(len(points), dtype=int)
    new_index[used] = np.arange(len(used))
    return points[used], new_index[hull.simplices], hull.equations[:, :-1], -hull.equations[:, -1]
