"""The coordinates that move the pieces of paths through space."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from finger_pin.core.tables.chains import BODY, Chains
from finger_pin.mechanism.path_elements import PathElement, PathTerm
from finger_pin.mechanism.spans.span import COINCIDENT, STRAIGHT
from finger_pin.typing import Array


class PieceBodies(NamedTuple):
    """Columns of the bodies of a piece: those of its two points, of its frame, and of its third point."""

    first: int
    second: int
    frame: int
    third: int


PIECE = PieceBodies(*range(len(PieceBodies._fields)))
# Coordinates, and which of the first three bodies each moves.
Entries = tuple[NDArray[np.int64], NDArray[np.int64]]


def find_movers(
    paths: Sequence[Sequence[PathTerm]],
    number: Mapping[PathElement, int],
    bodies: NDArray[np.int64],
    points: Sequence[Array],
    chains: Chains,
) -> tuple[list[Entries], NDArray[np.int64]]:
    """Return the coordinates of every piece, those first that act on it, and how many these are, shape (E,).

    Args:
        paths: Legs of every row.
        number: Of every piece.
        bodies: Of every piece, columns `PIECE`, shape (E, 4).
        points: In the frames of their bodies, shape (9,) each, m.
        chains: The bodies of the model.
    """
    moves = [_moves(row, chains.parents) for row in bodies]
    acting = [_acting(*each) for each in zip(number, moves, strict=True)]
    # Contacts have no legs beside them, and there may be thousands.
    spans = ((piece.shape.columns == 1, *each) for piece, *each in zip(number, bodies, points, strict=True))
    is_long = [not is_span or _is_long(row, ends, chains) for is_span, row, ends in spans]
    turning = _turning(paths, number, acting, is_long)
    entries = [_entries(*each) for each in zip(moves, acting, turning, strict=True)]
    return entries, np.array([np.count_nonzero(each) for each in acting], dtype=np.int64)


def _moves(bodies: NDArray[np.int64], parents: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return whether each coordinate moves each of some bodies, columns `PIECE`, shape (n, 4)."""
    moves = np.zeros((len(parents), len(PIECE)), dtype=bool)
    for which, body in enumerate(bodies):
        at = int(body)
        while at >= 0:
            moves[at, which] = True
            at = int(parents[at])
    return moves


def _acting(piece: PathElement, moves: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return whether each coordinate may change the value of a piece, shape (n,)."""
    if piece.shape.columns > 1:
        return np.asarray(moves.any(axis=1))
    # The length of a straight leg is the same in any frame.
    seen = moves[:, : PIECE.frame] if piece.shape is STRAIGHT else moves[:, : 3 + (len(piece.ends) == 3)]
    return np.asarray(seen.any(axis=1) & ~seen.all(axis=1))


def _turning(
    paths: Sequence[Sequence[PathTerm]],
    number: Mapping[PathElement, int],
    acting: Sequence[NDArray[np.bool_]],
    is_long: Sequence[bool],
) -> list[NDArray[np.bool_]]:
    """Return of every piece the coordinates that act on legs beside it in a path, shape (n,) each.

    By these the path turns where the legs meet. Between legs of which one has no length, the next ones meet.
    """
    turning = [np.zeros_like(each) for each in acting]
    for legs in paths:
        for k, leg in enumerate(legs):
            for way in (-1, 1):
                other = k
                while 0 <= other + way < len(legs) and legs[max(other, other + way)].follows:
                    other += way
                    turning[number[leg.piece]] |= acting[number[legs[other].piece]]
                    if is_long[number[legs[other].piece]]:
                        break
    return turning


def _is_long(bodies: NDArray[np.int64], points: Array, chains: Chains) -> bool:
    """Return whether the points of a piece lie apart where all coordinates are zero."""
    places = []
    for body, point in zip(bodies[: PIECE.frame], points.reshape(3, 3), strict=False):
        while body >= 0:
            placed = chains.bodies[body]
            point = placed[BODY.rotation : BODY.rotation + 9].reshape(3, 3) @ point + placed[BODY.translation :][:3]
            body = chains.parents[body]
        places.append(point)
    return float(np.linalg.norm(places[0] - places[1])) > COINCIDENT


def _entries(moves: NDArray[np.bool_], acting: NDArray[np.bool_], turning: NDArray[np.bool_]) -> Entries:
    """Return the coordinates of a piece, those that act on it first, and which of its bodies each moves."""
    at = np.concatenate([np.flatnonzero(acting), np.flatnonzero(turning & ~acting & moves.any(axis=1))])
    return at, np.ascontiguousarray(moves[at, : PIECE.third], dtype=np.int64)
