"""Bounds of motion: displacements of a gap's two bodies against each other per unit of a coordinate."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from finger_pin.core.tables.chains import BODY, PRISMATIC, Chains
from finger_pin.mechanism.path_elements import PathElement
from finger_pin.typing import Array


class Carrying(NamedTuple):
    """Chains of bodies, with the largest motion of each body relative to its parent.

    Attributes:
        parents: Of each body, -1 for the base.
        slides: Whether it slides, and how far at most, m; None of one that turns.
        distances: From the body before it, m.
        axes: Along which it slides, base frame; None if something turns it.
    """

    parents: list[int]
    slides: list[float | None]
    distances: list[float]
    axes: list[tuple[float, ...] | None]

    @classmethod
    def from_chains(cls, chains: Chains) -> Carrying:
        """Return the motions of chains."""
        parents, sliding = chains.parents.tolist(), (chains.kinds == PRISMATIC).tolist()
        slides = [float(most) if each else None for each, most in zip(sliding, chains.slides, strict=True)]
        distances = [float(np.linalg.norm(body[BODY.translation : BODY.translation + 3])) for body in chains.bodies]
        axes: list[tuple[float, ...] | None] = []
        for at in range(len(parents)):
            rotation, above = np.eye(3), at
            while above >= 0 and sliding[above]:
                rotation = chains.bodies[above, BODY.rotation : BODY.rotation + 9].reshape(3, 3) @ rotation
                above = parents[above]
            axes.append(None if above >= 0 else tuple(rotation[:, 2].tolist()))
        return cls(parents, slides, distances, axes)


def motion_bounds(
    piece: PathElement, coordinates: NDArray[np.int64], moves: NDArray[np.int64], last: list[int], carrying: Carrying
) -> tuple[Array, NDArray[np.int64]]:
    """Return `motion_bounds` and `opposing_coordinate` of `Paths` for the coordinates that move a gap's bodies.

    Args:
        piece: The gap.
        coordinates: Coordinates that move its bodies, shape (k,).
        moves: Which of the bodies of both points and of the frame each moves, shape (k, 3).
        last: Of every joint its last body.
        carrying: Motions by the bodies.
    """
    parents, slides, distances, axes = carrying
    bounds, opposing_coordinate = dict[int, float](), dict[int, int]()
    first = max(_length(end.point) for end in piece.ends) + piece.breadth
    # Of what has no end, how far the first body is counts: `far` is added.
    second = _length(piece.frame.translation) + (piece.extent if math.isfinite(piece.extent) else 0.0)
    for joint, reach in ((piece.ends[0].joint, first), (piece.joint, second)):
        at = last[joint]
        while at >= 0:
            most = slides[at]
            bounds[at] = reach if most is None else 1.0
            reach += distances[at] if most is None else most
            at = parents[at]
    movers = list(zip(coordinates.tolist(), moves.tolist(), strict=True))
    for at, (one, _, two) in movers:
        if one and two:
            bounds[at] = 0.0
    twos = [at for at, (one, _, two) in movers if two > one and axes[at]]
    for one in (at for at, (one, _, two) in movers if one > two and axes[at]):
        for two in twos:
            if axes[one] == axes[two]:
                opposing_coordinate[one], bounds[two] = two, 0.0
    others = np.array([opposing_coordinate.get(at, -1) for at, _ in movers], dtype=np.int64)
    return np.array([bounds.get(at, 0.0) for at, _ in movers]), others


def first_of_pairs(pieces: Sequence[PathElement]) -> NDArray[np.int64]:
    """Return the first piece of each pair of solids, which stand before all other pieces, and the end, (P + 1,)."""
    pair = np.array([piece.pair for piece in pieces if piece.shape.columns > 1], dtype=np.int64)
    return np.append(np.flatnonzero((np.diff(pair, prepend=-1) != 0) | (pair < 0)), len(pair))


def pair_bounds(
    start: NDArray[np.int64],
    entries: Sequence[tuple[NDArray[np.int64], NDArray[np.int64]]],
    bounds: Sequence[tuple[Array, NDArray[np.int64]]],
) -> list[Array]:
    """Return of every piece its bounds, and of the first one of each pair of solids the largest of its pieces.

    Args:
        start: Of every pair the first piece, and the end, shape (P + 1,).
        entries: Of every piece the coordinates that move it, which are the same within a pair, first.
        bounds: Of every piece what `motion_bounds` returns.
    """
    largest = [each for each, _ in bounds]
    for begin, end in itertools.pairwise(start.tolist()):
        most, others = np.max(largest[begin:end], axis=0), bounds[begin][1]
        for at, other in enumerate(others):
            if other >= 0:
                # Where two pieces see each other from either side, the bound of both stands at either.
                opposing = int(np.flatnonzero(entries[begin][0] == other)[0])
                most[at], most[opposing] = max(most[at], most[opposing]), 0.0
        largest[begin] = most
    return largest


def _length(vector: Array) -> float:
    return float(np.linalg.norm(vector))
