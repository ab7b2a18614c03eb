"""Pieces of paths through space as plain arrays, for the compiled core."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from finger_pin.core.addresses.shape_code import shape_address
from finger_pin.core.jit import IndexTable, Indices, Layers, Matrix, Vector, refuse_copy
from finger_pin.core.tables.axes import along
from finger_pin.core.tables.chains import Chains
from finger_pin.core.tables.motion_bounds import Carrying, first_of_pairs, motion_bounds, pair_bounds
from finger_pin.core.tables.path_movers import PIECE, find_movers
from finger_pin.mechanism.gaps.signed_distance import GAP_OUT_SIZE, GAP_SLOPE_SIZE
from finger_pin.mechanism.path_elements import PathElement, PathTerm, Place


class LookColumns(NamedTuple):
    """Columns of looks at a gap: the share of the step, the gap, its normal, the distance of one body's core."""

    share: int
    gap: int
    normal_x: int
    normal_y: int
    normal_z: int
    far: int


LOOK = LookColumns(*range(len(LookColumns._fields)))
# Numbers of a wrench on the first body, then on the second: (moment, force) each.
WRENCH = 12
# A step is halved so often at most, less two, to look for touches.
MAX_LOOKS = 60


class PathStructure(NamedTuple):
    """E pieces, and the L legs with which R rows use them.

    Attributes:
        bodies: Columns `PIECE`, -1 for the base, shape (E, 4).
        thirds: One where a piece has a third point, shape (E,).
        value, slopes: Addresses of the shape of each, shape (E,).
        columns: Number of wrenches of each that rows use, shape (E,).
        start: First index of the coordinates that move a piece, shape (E + 1,); of a span only those that act on it,
            and others that act on the legs beside it and turn it as a whole.
        acting: How many of these act on it, the first ones, shape (E,).
        at: Coordinates, shape (entries,).
        moves: One where a coordinate moves the body, the first columns of `PIECE`, shape (entries, 3).
        opposing_coordinate: Coordinate that moves the other body in the same direction, -1 for none, shape (entries,).
        row: First row that uses each, shape (E,).
        pair_start: First piece of each pair of solids that may touch, which stand before all others, shape (P + 1,).
        carries: One where a body carries another, shape (n, n).
        rows: Rows with paths, shape (R,).
        leg_start: First index of their legs, shape (R + 1,).
        piece, column, follows: Of each leg, shape (L,).
        bends: Whether each leg's turn counts, shape (L,).
    """

    bodies: Annotated[IndexTable, along("piece", "x", of="body")]
    thirds: Annotated[Indices, along("piece")]
    value: Annotated[Indices, along("piece")]
    slopes: Annotated[Indices, along("piece")]
    columns: Annotated[Indices, along("piece")]
    start: Annotated[Indices, along("piece", starts="mover")]
    acting: Annotated[Indices, along("piece")]
    at: Annotated[Indices, along("mover", of="body")]
    moves: Annotated[IndexTable, along("mover", "x")]
    opposing_coordinate: Annotated[Indices, along("mover", of="body")]
    row: Annotated[Indices, along("piece", of="row")]
    pair_start: Annotated[Indices, along("pair", starts="piece")]
    carries: Annotated[IndexTable, along("body", "body")]
    rows: Annotated[Indices, along("path", of="row")]
    leg_start: Annotated[Indices, along("path", starts="leg")]
    piece: Annotated[Indices, along("leg", of="piece")]
    column: Annotated[Indices, along("leg")]
    follows: Annotated[Indices, along("leg")]
    bends: Annotated[Indices, along("leg")]

    def __reduce__(self) -> NoReturn:
        """Refuse: addresses of shapes are those of one process."""
        refuse_copy(self)


class PathParameters(NamedTuple):
    """Numbers of E pieces and L legs.

    Attributes:
        points: Both points, and a third one, in the frames of their bodies, shape (E, 9), m.
        rotation: Of the piece's frame in its body's, shape (E, 3, 3).
        origin: Of the piece's frame in its body's, shape (E, 3), m.
        shapes: Parameters of the shapes, shape (E, most parameters).
        reach: Shape (E,), m.
        motion_bounds: Largest displacement of a point of a gap's bodies against the other body by a unit of each, shape
            (entries,), m; zero where it carries both, or only turns what looks alike.
        pair_bounds: Likewise, at the first piece of a pair of solids: the largest of its pieces.
        cores: Extent of the core of a gap's first body from the middle of its two points, shape (E,), m.
        extents: Extent of the core of a gap's second body from its frame's origin, shape (E,), m.
        weight: Of each leg, in its row's arm and length, shape (L,).
    """

    points: Annotated[Matrix, along("piece", "x")]
    rotation: Annotated[Layers, along("piece", "x", "y")]
    origin: Annotated[Matrix, along("piece", "x")]
    shapes: Annotated[Matrix, along("piece", "c")]
    reach: Annotated[Vector, along("piece")]
    motion_bounds: Annotated[Vector, along("mover")]
    pair_bounds: Annotated[Vector, along("mover")]
    cores: Annotated[Vector, along("piece")]
    extents: Annotated[Vector, along("piece")]
    weight: Annotated[Vector, along("leg")]


class PathWork(NamedTuple):
    """Working memory for the pieces of paths.

    Attributes:
        out: Numbers of the shapes, columns `GAP_OUT` or `SPAN_OUT`, shape (E, columns).
        active: Zero for gaps that are open, shape (E,).
        active_pairs, active_pair_count: Contact pairs that are not culled, in order, shape (E,), and how many.
        live, live_count: From where to where numbers of the state may be other than zero, as those of culled contacts
            are not, shape (2 + contact pairs, 2), and how many parts, shape (1,); kept from step to step.
        closed, closed_count: Gaps that are not open, in order, shape (E,), and their number, shape (1,).
        culled: One for the rows of a contact that is at rest and too far away to close, shape (K,); kept from step to
            step, as the next.
        clear, ahead: No more than the gap of every piece where the step began, and where it ends, shape (E,), m.
        path: Bound of the path of a gap's bodies against each other in a step, shape (E,), m.
        far: Largest distance of the first body's core from the origin of the second's frame, where the step began,
            shape (E,), m.
        resting: One for a pair of solids that are bounded as one, all pieces culled, shape (P,); kept.
        pair_clear, pair_far: Of a resting pair, the least `clear` and the largest `far` of its pieces, shape (P,), m.
        pair_path, pair_moved: Bounds of the path of a pair in a step, and of all since it rests, shape (P,), m.
        travel: Path of each coordinate, to and fro, in a step, shape (N,).
        control: Bernstein coefficients of its motion, shape (N, 5).
        looks: Moments of a step, and what was seen there of a gap, columns `LOOK`, shape (LOOKS, columns).
        frame, origin: Rotation of each piece's frame in the base's, shape (E, 3, 3), and its origin, shape (E, 3), m.
        ends: Both points and the third one, base frame, shape (E, 9), m.
        wrench: Unit wrenches on the first and on the second body, shape (E, most wrenches, WRENCH).
        arm: Arm of each wrench about the coordinates that act on its piece, shape (entries, most wrenches).
        before, corner: Piece of a path before each and the angle between both, rad; -1 if not known, shape (E,).
        push: Force of a contact on the first body, shape (E, 3), N.
        length, turn: Of every row, shape (K,).
        local_points: All three points in the piece's frame, shape (E, 9), m.
        gather: Shape (N,).
        slopes: Of a shape, columns `GAP_SLOPE` or `SPAN_SLOPE`.
        wrench_slope: Derivatives of the wrenches by the coordinates that move them, shape (entries, most
            wrenches, WRENCH).
    """

    out: Matrix
    active: Indices
    active_pairs: Indices
    active_pair_count: Indices
    live: IndexTable
    live_count: Indices
    closed: Indices
    closed_count: Indices
    culled: Indices
    clear: Vector
    ahead: Vector
    path: Vector
    far: Vector
    resting: Indices
    pair_clear: Vector
    pair_path: Vector
    pair_moved: Vector
    pair_far: Vector
    travel: Vector
    control: Matrix
    looks: Matrix
    frame: Layers
    origin: Matrix
    ends: Matrix
    wrench: Layers
    arm: Matrix
    before: Indices
    corner: Vector
    push: Matrix
    length: Vector
    turn: Vector
    local_points: Matrix
    gather: Vector
    slopes: Vector
    turn_slope: Vector
    wrench_slope: Layers


def read_paths(paths: Sequence[Sequence[PathTerm]], chains: Chains) -> tuple[PathStructure, PathParameters]:
    """Return structure and parameters of the paths of all rows, each empty for none, through the bodies of a model."""
    parents, last, turns = chains.parents, chains.last, chains.turns
    pieces: list[PathElement] = list(dict.fromkeys(leg.piece for legs in paths for leg in legs))
    number = {piece: e for e, piece in enumerate(pieces)}
    columns = {leg.piece: leg.column + 1 for legs in paths for leg in sorted(legs, key=lambda leg: leg.column)}
    first_row = {leg.piece: k for k, each in reversed(list(enumerate(paths))) for leg in each}
    legs = [leg for each in paths for leg in each]
    ends = [(*p.ends, Place(0, np.zeros(3)))[:3] for p in pieces]
    carried = [(a.joint, b.joint, p.joint, third.joint) for p, (a, b, third) in zip(pieces, ends, strict=True)]
    bodies = np.array([[last[joint] for joint in row] for row in carried], dtype=np.int64).reshape(-1, len(PIECE))
    shapes = np.zeros((len(pieces), max((len(p.shape.parameters) for p in pieces), default=0)))
    for row, piece in zip(shapes, pieces, strict=True):
        row[: len(piece.parameters)] = piece.parameters
    points = [np.concatenate([turns[end.joint].T @ end.point for end in row]) for row in ends]
    entries, acting = find_movers(paths, number, bodies, points, chains)
    carrying = Carrying.from_chains(chains)
    bounds = [motion_bounds(piece, *each, last, carrying) for piece, each in zip(pieces, entries, strict=True)]
    halves = [0.5 * float(np.linalg.norm(row[3:6] - row[:3])) for row in points]
    rows = np.array([k for k, each in enumerate(paths) if each], dtype=np.int64)
    carries = np.zeros((len(parents), len(parents)), dtype=np.int64)
    for body, parent in enumerate(parents):
        if parent >= 0:
            carries[:, body] = carries[:, parent]
            carries[parent, body] = 1
    structure = PathStructure(
        bodies=bodies,
        thirds=np.array([len(p.ends) == 3 for p in pieces], dtype=np.int64),
        value=np.array([shape_address(p.shape.value) for p in pieces], dtype=np.int64),
        slopes=np.array([shape_address(p.shape.slopes) for p in pieces], dtype=np.int64),
        columns=np.array([columns[p] for p in pieces], dtype=np.int64),
        start=np.cumsum([0, *(len(at) for at, _ in entries)]),
        acting=acting,
        at=np.concatenate([np.zeros(0, dtype=np.int64), *(at for at, _ in entries)]),
        moves=np.concatenate([np.zeros((0, 3), dtype=np.int64), *(moves for _, moves in entries)]),
        opposing_coordinate=np.concatenate([np.zeros(0, dtype=np.int64), *(others for _, others in bounds)]),
        row=np.array([first_row[piece] for piece in pieces], dtype=np.int64),
        pair_start=first_of_pairs(pieces),
        carries=carries,
        rows=rows,
        leg_start=np.cumsum([0, *(len(each) for each in paths if each)]),
        piece=np.array([number[leg.piece] for leg in legs], dtype=np.int64),
        column=np.array([leg.column for leg in legs], dtype=np.int64),
        follows=np.array([leg.follows for leg in legs], dtype=np.int64),
        bends=np.array([leg.bends for leg in legs], dtype=np.int64),
    )
    return structure, PathParameters(
        points=np.array(points).reshape(-1, 9),
        rotation=np.array([turns[p.joint].T @ p.frame.rotation for p in pieces]).reshape(-1, 3, 3),
        origin=np.array([turns[p.joint].T @ p.frame.translation for p in pieces]).reshape(-1, 3),
        shapes=shapes,
        reach=np.array([p.reach for p in pieces], dtype=float),
        motion_bounds=np.concatenate([np.zeros(0), *(each for each, _ in bounds)]),
        pair_bounds=np.concatenate([np.zeros(0), *pair_bounds(structure.pair_start, entries, bounds)]),
        cores=np.array([half + piece.breadth for half, piece in zip(halves, pieces, strict=True)]),
        extents=np.array([piece.extent for piece in pieces], dtype=float),
        weight=np.array([leg.arm for leg in legs], dtype=float),
    )


def coordinates_of_paths(paths: PathStructure, count: int, width: int) -> NDArray[np.bool_]:
    """Return a mask of the coordinates that the paths of every row depend on, shape (K, N)."""
    mask = np.zeros((count, width), dtype=bool)
    for k, begin, end in zip(paths.rows, paths.leg_start[:-1], paths.leg_start[1:], strict=True):
        for e in paths.piece[begin:end]:
            mask[k, paths.at[paths.start[e] : paths.start[e + 1]]] = True
    return mask


def build_path_work(paths: PathStructure, count: int, width: int, size: int) -> PathWork:
    """Allocate the memory for the pieces of K rows, with N coordinates and a state of some size."""
    pieces, entries, columns = len(paths.columns), len(paths.at), int(paths.columns.max(initial=1))
    pairs = len(paths.pair_start) - 1
    return PathWork(
        out=np.zeros((pieces, GAP_OUT_SIZE)),
        active=np.ones(pieces, dtype=np.int64),
        active_pairs=np.arange(pieces),
        active_pair_count=np.array([np.count_nonzero(paths.columns > 1)]),
        live=np.array([[0, size], *[[0, 0]] * (1 + np.count_nonzero(paths.columns > 1))]),
        live_count=np.ones(1, dtype=np.int64),
        closed=np.zeros(pieces, dtype=np.int64),
        closed_count=np.zeros(1, dtype=np.int64),
        culled=np.zeros(count, dtype=np.int64),
        clear=np.zeros(pieces),
        ahead=np.zeros(pieces),
        path=np.zeros(pieces),
        far=np.zeros(pieces),
        resting=np.zeros(pairs, dtype=np.int64),
        pair_clear=np.zeros(pairs),
        pair_path=np.zeros(pairs),
        pair_moved=np.zeros(pairs),
        pair_far=np.zeros(pairs),
        travel=np.zeros(width),
        control=np.zeros((width, 5)),
        looks=np.zeros((MAX_LOOKS, len(LOOK))),
        frame=np.zeros((pieces, 3, 3)),
        origin=np.zeros((pieces, 3)),
        ends=np.zeros((pieces, 9)),
        wrench=np.zeros((pieces, columns, WRENCH)),
        arm=np.zeros((entries, columns)),
        before=np.full(pieces, -1),
        corner=np.zeros(pieces),
        push=np.zeros((pieces, 3)),
        length=np.zeros(count),
        turn=np.zeros(count),
        local_points=np.zeros((pieces, 9)),
        gather=np.zeros(width),
        slopes=np.zeros(GAP_SLOPE_SIZE),
        turn_slope=np.zeros(entries),
        wrench_slope=np.zeros((entries, columns, WRENCH)),
    )
