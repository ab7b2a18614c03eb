"""The primitive that fits the convex hull of points best: the one with the smallest volume between both.

Candidates lie along the principal axes of the hull, or along its smallest box on one of its faces. Their sizes go from
those of the same second moments to those of the same extents. MuJoCo's own fit takes one of the two, along principal
axes, and by moments the sizes of the box that has them: a ball of 15 mm becomes one of 11.6 mm.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from typing import NamedTuple, Self

import numpy as np
import scipy.spatial

from finger_pin.description.primitives import Sizes
from finger_pin.typing import Array

# Share of the hull's volume within which volumes count as equal: an ellipsoid fits a ball, too.
_EQUAL = 0.02
# Points in the hull by which volumes are compared, directions in which distances are, and faces that boxes lie on.
_POINTS, _DIRECTIONS, _FACES = 6000, 3000, 12
# Products of directions and corners at a time.
_PRODUCTS = 80_000
# Parts of the way from sizes and centre of equal moments to those of equal extents.
_MIXES = (0.0, 0.5, 1.0)
# Least length of a capsule, over its radius: without any it is a ball.
_LEAST_LENGTH = 1e-6


class Hull(NamedTuple):
    """The convex hull of points.

    Attributes:
        corners: Shape (v, 3), m.
        normals: Of its triangles, outward, shape (f, 3).
        areas: Of its triangles, shape (f,), m2.
        volume: In m3.
        centre: Centroid, shape (3,), m.
        covariance: Mean product of coordinates about the centroid, shape (3, 3), m2.
        samples: Points spread evenly in it, the same each time, shape (n, 3), m.
        directions: Unit vectors spread evenly, and the normals, shape (d, 3).
        support: Largest coordinate along each direction, shape (d,), m.
    """

    corners: Array
    normals: Array
    areas: Array
    volume: float
    centre: Array
    covariance: Array
    samples: Array
    directions: Array
    support: Array

    @classmethod
    def around(cls, points: Array) -> Self:
        """Return the hull of points, shape (m, 3), m.

        Raises:
            scipy.spatial.QhullError: If they span no volume.
        """
        hull = scipy.spatial.ConvexHull(points)
        corners = points[hull.vertices]
        inside = corners.mean(axis=0)
        # Tetrahedra between a point inside, from which their other corners are counted, and the triangles.
        tetrahedra = points[hull.simplices] - inside
        volumes = np.abs(np.linalg.det(tetrahedra)) / 6.0
        shares = volumes / volumes.sum()
        sums = tetrahedra.sum(axis=1)
        offset = shares @ sums / 4.0
        products = np.einsum("fki,fkj->fij", tetrahedra, tetrahedra) + sums[:, :, None] * sums[:, None, :]
        covariance = np.einsum("f,fij->ij", shares, products) / 20.0 - np.outer(offset, offset)
        random = np.random.default_rng(0)
        weights = random.dirichlet(np.ones(4), _POINTS)[:, 1:]
        samples = np.einsum("nk,nki->ni", weights, tetrahedra[random.choice(len(shares), _POINTS, p=shares)]) + inside
        edges = np.diff(tetrahedra, axis=1)
        areas = 0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
        normals = hull.equations[:, :3]
        spread = _spread(_DIRECTIONS)
        directions = np.concatenate([spread, normals])
        # In parts so small that they stay on one thread: several wait for each other where the machine is busy. Along
        # its normal a face has its own offset.
        parts = np.array_split(spread, math.ceil(len(spread) * len(corners) / _PRODUCTS))
        support = np.concatenate([*((part @ corners.T).max(axis=1) for part in parts), -hull.equations[:, 3]])
        volume, centre = float(volumes.sum()), inside + offset
        return cls(corners, normals, areas, volume, centre, covariance, samples, directions, support)


def _spread(count: int) -> Array:
    """Return unit vectors that are spread evenly, by the golden angle."""
    k = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * k / count, math.pi * (1.0 + math.sqrt(5.0)) * k
    across = np.sqrt(1.0 - z * z)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=-1)


class _Form(NamedTuple):
    """A kind of primitive about its origin, round ones along z, by functions of its sizes, m.

    Attributes:
        volume: In m3.
        support: Largest coordinate along unit vectors, shape (..., 3), m.
        holds: Whether points, shape (n, 3), lie in it.
        by_moments: Sizes from the standard deviations along x, y and z, m, and the volume, m3, of a body.
        by_extents: Sizes from half of the extents along x, y and z, m.
        has_axis: Whether z is an axis that the other two are not.
    """

    volume: Callable[..., float]
    support: Callable[..., Array]
    holds: Callable[..., Array]
    by_moments: Callable[[Array, float], Sizes]
    by_extents: Callable[[Array], Sizes]
    has_axis: bool = False


def _capsule_by_moments(deviations: Array, volume: float) -> Sizes:
    """Solve v s^2 = v r^2 / 4 - pi r^5 / 15 for the radius: s is the deviation across, v at least a ball's volume."""
    across = float(np.mean(deviations[:2] ** 2))
    radius = 2.0 * math.sqrt(across)
    for _ in range(30):
        whole = max(volume, 4.0 / 3.0 * math.pi * radius**3)
        radius = math.sqrt(4.0 * across + 4.0 / 15.0 * math.pi * radius**5 / whole)
    return radius, max(volume / (math.pi * radius**2) - 4.0 / 3.0 * radius, _LEAST_LENGTH * radius)


def _capsule_by_extents(halves: Array) -> Sizes:
    radius = 0.5 * (halves[0] + halves[1])
    return radius, max(2.0 * (halves[2] - radius), _LEAST_LENGTH * radius)


def _along(x: Array) -> Array:
    return np.abs(x[..., 2])


def _across(x: Array) -> Array:
    return np.hypot(x[..., 0], x[..., 1])


def _off_segment(x: Array, length: float) -> Array:
    """Return the distance of points from a segment along z, m."""
    return np.hypot(_across(x), np.maximum(_along(x) - 0.5 * length, 0.0))


#: Kinds that a mesh can be, the simplest first.
FORMS = {
    "sphere": _Form(
        volume=lambda r: 4.0 / 3.0 * math.pi * r**3,
        support=lambda u, r: np.full(u.shape[:-1], r),
        holds=lambda x, r: np.linalg.norm(x, axis=-1) <= r,
        by_moments=lambda s, _: (math.sqrt(5.0 * float(np.mean(s**2))),),
        by_extents=lambda h: (float(np.mean(h)),),
    ),
    "box": _Form(
        volume=lambda *sides: math.prod(sides),
        support=lambda u, *sides: 0.5 * np.abs(u) @ sides,
        holds=lambda x, *sides: np.all(np.abs(x) <= 0.5 * np.array(sides), axis=-1),
        by_moments=lambda s, _: tuple(math.sqrt(12.0) * s),
        by_extents=lambda h: tuple(2.0 * h),
    ),
    "capsule": _Form(
        volume=lambda r, length: math.pi * r**2 * (length + 4.0 / 3.0 * r),
        support=lambda u, r, length: r + 0.5 * length * _along(u),
        holds=lambda x, r, length: _off_segment(x, length) <= r,
        by_moments=_capsule_by_moments,
        by_extents=_capsule_by_extents,
        has_axis=True,
    ),
    "cylinder": _Form(
        volume=lambda r, length: math.pi * r**2 * length,
        support=lambda u, r, length: r * _across(u) + 0.5 * length * _along(u),
        holds=lambda x, r, length: (_across(x) <= r) & (_along(x) <= 0.5 * length),
        by_moments=lambda s, _: (math.sqrt(2.0 * (s[0] ** 2 + s[1] ** 2)), math.sqrt(12.0) * s[2]),
        by_extents=lambda h: (0.5 * (h[0] + h[1]), 2.0 * h[2]),
        has_axis=True,
    ),
    "ellipsoid": _Form(
        volume=lambda *axes: 4.0 / 3.0 * math.pi * math.prod(axes),
        support=lambda u, *axes: np.linalg.norm(u * axes, axis=-1),
        holds=lambda x, *axes: np.linalg.norm(x / np.array(axes), axis=-1) <= 1.0,
        by_moments=lambda s, _: tuple(math.sqrt(5.0) * s),
        by_extents=tuple,
    ),
}


class Fit(NamedTuple):
    """A primitive in the place of a hull.

    Attributes:
        kind: Key of `FORMS`.
        sizes: In the order of its `Kind.entries`, m.
        position: Of its centre, shape (3,), m.
        axes: Its axes as columns, shape (3, 3).
    """

    kind: str
    sizes: Sizes
    position: Array
    axes: Array

    def volume_between(self, hull: Hull) -> float:
        """Return the volume that only one of the primitive and a hull has, m3, from samples of the hull."""
        form = FORMS[self.kind]
        shared = float(np.mean(form.holds((hull.samples - self.position) @ self.axes, *self.sizes)))
        return hull.volume + form.volume(*self.sizes) - 2.0 * shared * hull.volume

    def distance(self, hull: Hull) -> float:
        """Return the Hausdorff distance to a hull, m: how far a point of one is from the other at most.

        Of convex bodies it is the largest difference of their supports.
        """
        support = FORMS[self.kind].support(hull.directions @ self.axes, *self.sizes)
        return float(np.abs(support + hull.directions @ self.position - hull.support).max())


def fit(hull: Hull, kinds: tuple[str, ...] = tuple(FORMS)) -> Fit:
    """Return the primitive of some kinds with the smallest volume between it and a hull.

    Of volumes that differ by less than 2 % of the hull's, the earlier kind's counts, and of one kind the nearest.
    """
    frames = [np.linalg.eigh(hull.covariance)[1], _box_frame(hull)]
    best, least = list[Fit](), math.inf
    for kind in kinds:
        fits = [each for frame in frames for each in _candidates(kind, hull, frame)]
        volumes = np.array([each.volume_between(hull) for each in fits])
        if volumes.min() < least - _EQUAL * hull.volume * bool(best):
            least = float(volumes.min())
            best = [fits[k] for k in np.flatnonzero(volumes <= least + _EQUAL * hull.volume)]
    return min(best, key=lambda each: each.distance(hull))


def _candidates(kind: str, hull: Hull, frame: Array) -> Iterator[Fit]:
    """Yield primitives of a kind along the axes of a frame, given as columns."""
    form = FORMS[kind]
    for order in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) if form.has_axis else ((0, 1, 2),):
        axes = frame[:, order] * (1.0, 1.0, np.linalg.det(frame))
        corners = (hull.corners - hull.centre) @ axes
        low, high = corners.min(axis=0), corners.max(axis=0)
        deviations = np.sqrt(np.einsum("ik,ij,jk->k", axes, hull.covariance, axes))
        by_moments, by_extents = form.by_moments(deviations, hull.volume), form.by_extents(0.5 * (high - low))
        for mix, shift in itertools.product(_MIXES, _MIXES):
            sizes = tuple(float(a + mix * (b - a)) for a, b in zip(by_moments, by_extents, strict=True))
            yield Fit(kind, sizes, hull.centre + axes @ (0.5 * shift * (low + high)), axes)


def _box_frame(hull: Hull) -> Array:
    """Return the axes, as columns, of the smallest box around a hull with a face on one of its largest faces."""
    # Triangles of one face have a normal but for rounding.
    _, first, face = np.unique(np.round(hull.normals, 3), axis=0, return_index=True, return_inverse=True)
    largest = np.argsort(-np.bincount(face.ravel(), hull.areas))[:_FACES]
    best, smallest = np.eye(3), math.inf
    for normal in hull.normals[first[largest]]:
        plane = np.linalg.svd(normal[None, :])[2][1:].T
        frame = np.column_stack([plane, normal])
        flat = hull.corners @ frame
        outline = flat[scipy.spatial.ConvexHull(flat[:, :2]).vertices, :2]
        edges = np.roll(outline, -1, axis=0) - outline
        turns = np.arctan2(edges[:, 1], edges[:, 0])
        one = np.stack([np.cos(turns), np.sin(turns)], axis=-1)
        other = np.stack([-np.sin(turns), np.cos(turns)], axis=-1)
        volumes = np.ptp(one @ outline.T, axis=1) * np.ptp(other @ outline.T, axis=1) * np.ptp(flat[:, 2])
        k = int(np.argmin(volumes))
        if volumes[k] < smallest:
            best, smallest = np.column_stack([plane @ one[k], plane @ other[k], frame[:, 2]]), float(volumes[k])
    return best
