"""The sensitivity equations of a motion: its derivatives by the numbers of its mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from finger_pin.core.evaluation.law_code import SPEED
from finger_pin.core.jit import Block, alike, call, pack
from finger_pin.core.model import MODEL
from finger_pin.core.stepping.collocation import (
    COLLOCATION,
    LENGTH,
    MEMORY_SIZE,
    SINGULAR,
    TIME,
    Collocation,
    collocate,
)
from finger_pin.core.stepping.interpolation import Between
from finger_pin.core.stepping.island_motion import IslandMotion
from finger_pin.core.stepping.island_stepper import Part
from finger_pin.core.stepping.radau import BACK, LANES, MATRIX, NODES, SLOPE, SWEEP
from finger_pin.core.tables import END, FIRST, KINK, Tables
from finger_pin.typing import Array

# A step that ends at a knot ends so much before it, of the time.
_BEFORE = 1.0 - 2.0**-53
# Weights of the values at the begin and the nodes of an interval in powers of the share: the polynomial through them.
_POLYNOMIAL = np.linalg.inv(np.vander(np.array([0.0, *NODES]), increasing=True))


class Derivative:
    """The motion of an island, and S over time, by the numbers that it feels."""

    def __init__(self, motion: IslandMotion, felt: list[int], ends: Array, solution: Array) -> None:
        """Keep a motion, the intervals of its derivatives, and S there.

        Args:
            motion: The motion.
            felt: Which numbers it feels.
            ends: Ends of the m intervals, s.
            solution: S at begin and nodes of each, a number after the other, shape ((s + 1) m, f w), w >= n.
        """
        self._motion, self._felt, self._ends, self._solution = motion, felt, ends, solution
        self._begins = np.concatenate([[motion.begin], ends[:-1]])
        self._last: tuple[Array, tuple[Array, Array], Array] | None = None

    def at(self, times: Array, k: int) -> tuple[Array, Array, Array | float]:
        """Return states and quaternions at times, as the motion does, and S of a number there, shape (t, n), or 0.

        All numbers ask for the same times in turn: the latest are remembered, with S of all.
        """
        last = self._last
        if last is None or not np.array_equal(last[0], times):
            self._last = last = times.copy(), self._motion.interpolate(times), self._slopes(times)
        _, (states, attitudes), slopes = last
        if k not in self._felt:
            return states, attitudes, 0.0
        return states, attitudes, slopes[:, self._felt.index(k), : states.shape[1]]

    def _slopes(self, times: Array) -> Array:
        """Return S of all numbers, shape (t, f, w)."""
        if not self._felt:
            return np.zeros((len(times), 0, 0))
        count = len(_POLYNOMIAL)
        place = np.clip(np.searchsorted(self._ends, times, side="right"), 0, len(self._ends) - 1)
        share = (times - self._begins[place]) / (self._ends[place] - self._begins[place])
        weights = np.vander(np.clip(share, 0.0, 1.0), count, increasing=True) @ _POLYNOMIAL
        which = count * place[:, None] + np.arange(count)
        shape, starts = (len(times), len(self._solution)), np.arange(0, which.size + 1, count)
        found: Array = csr_array((weights.ravel(), which.ravel(), starts), shape) @ self._solution
        return found.reshape(len(times), len(self._felt), -1)


@dataclass(frozen=True, eq=False)
class NearbyMotion:
    """The motion of an island with one number changed.

    Attributes:
        derivative: The motion without, and S.
        number: Which.
        change: By how much.
    """

    derivative: Derivative
    number: int
    change: float

    def interpolate(self, at: Array) -> tuple[Array, Array]:
        """Return states at times and the quaternions from which angles count, as the motion does."""
        states, attitudes, derivatives = self.derivative.at(np.asarray(at, dtype=float), self.number)
        return states + self.change * derivatives, attitudes


def fits(motions: Sequence[IslandMotion], parts: Sequence[Part]) -> bool:
    """Return whether a mechanism that starts anew has the same islands, rows and states as motions have."""
    return len(motions) == len(parts) and all(
        len(each.start) == len(part.x) and np.array_equal(each.part.tables.groups[:, :2], part.tables.groups[:, :2])
        for each, part in zip(motions, parts, strict=True)
    )


def differentiate(
    motion: IslandMotion, parts: Sequence[Part], knots: Sequence[Array], changes: Array, allowed: float
) -> Derivative | None:
    """Return the derivatives of an island's motion by numbers, or None if a linear system is singular.

    Args:
        motion: The motion.
        parts: The island where it starts, then the same with one number changed each.
        knots: Of each of these, when inputs bend or jump, s.
        changes: By how much each number is changed, shape (p,).
        allowed: Relative error of the derivatives, roughly.
    """
    own = parts[0]
    changed = [_changed(own, each) for each in parts[1:]]
    same = [_starts(motion, other) and np.array_equal(at, knots[0]) for other, at in zip(parts, knots, strict=True)]
    felt = [k for k, (address, _) in enumerate(changed) if address != 0 or not same[1 + k]]
    if not felt:
        return Derivative(motion, felt, motion.record.times[-1:], np.zeros((0, 0)))
    chosen = [0, *(1 + k for k in felt)]
    given = [parts[k] for k in chosen], [knots[k] for k in chosen], changes[felt], allowed
    collocation = _collocation(motion, *given, [changed[k] for k in felt])
    # As a rule there are fewer intervals than steps.
    room = 2 * len(motion.record.times) + 1
    ends, solutions = [], []
    while True:
        ends.append(np.zeros(room))
        solutions.append(np.zeros(((len(NODES) + 1) * room, len(collocation.derivative))))
        collocation = collocation._replace(ends=ends[-1], solution=solutions[-1])
        taken = call(collocate, collocation, COLLOCATION)
        if taken == SINGULAR:
            return None
        if taken < room:
            ends[-1], solutions[-1] = ends[-1][:taken], solutions[-1][: (len(NODES) + 1) * taken]
            return Derivative(motion, felt, _joined(ends), _joined(solutions))


def _joined(parts: Sequence[Array]) -> Array:
    """Return arrays as one, a single one without a copy."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _starts(motion: IslandMotion, part: Part) -> bool:
    """Return whether a motion starts as an island does."""
    return np.array_equal(part.x, motion.start) and np.array_equal(part.attitude, motion.attitude)


def _collocation(
    motion: IslandMotion,
    parts: Sequence[Part],
    knots: Sequence[Array],
    changes: Array,
    allowed: float,
    changed: Sequence[tuple[int, Block | None]],
) -> Collocation:
    """Return the `Collocation` at the start of a motion, without room; arguments of `differentiate`, and `_changed`."""
    own, others = parts[0], parts[1:]
    size, count, nodes = len(motion.start), len(others), len(NODES)
    wide = -(-size // LANES) * LANES
    filled = count * wide
    rows, columns, held = _bends(own.tables)
    bends = len(rows) + len(own.control.level)
    corners, shifts = _corners(motion.record.times, knots[0], knots[1:], changes)
    width = len(own.tables.guided)
    memory = np.zeros(MEMORY_SIZE)
    memory[TIME], memory[LENGTH] = motion.begin, motion.record.times[0] - motion.begin
    return Collocation(
        model=own.model.address,
        changed=np.array([address for address, _ in changed], dtype=np.int64),
        within=np.array([block is not None for _, block in changed], dtype=np.int64),
        changes=np.array(changes, dtype=float),
        motion=_steps(motion, own, width),
        corners=corners,
        shifts=shifts,
        rows=rows,
        columns=columns,
        held=held,
        leaders=np.zeros(len(own.control.level), dtype=np.int64),
        nodes=NODES,
        memory=memory,
        sides=np.zeros(bends),
        before=np.zeros(bends),
        between=np.zeros(bends),
        after=np.zeros(bends),
        derivative=np.pad(_start(motion, others, changes, width), ((0, 0), (0, wide - size))).ravel(),
        rate=np.zeros(filled),
        bend=np.zeros(filled),
        largest=np.zeros(filled),
        scale=np.pad(own.atol, (0, wide - size), constant_values=1.0),
        weight=np.zeros(filled),
        allowed=allowed,
        matrix=MATRIX,
        sweep=SWEEP,
        back=BACK,
        slope=SLOPE,
        state=np.zeros(size),
        order=np.zeros(size, dtype=np.int64),
        torque=np.zeros(width),
        part=np.zeros(size),
        source=np.zeros(filled),
        found=np.zeros(filled),
        resolvents=np.zeros((nodes, wide, wide)),
        given=np.zeros((nodes, filled)),
        known=np.zeros((nodes, filled)),
        nodal=np.zeros((nodes, filled)),
        rates=np.zeros((nodes, filled)),
        ends=np.zeros(0),
        solution=np.zeros((0, filled)),
    )


def _steps(motion: IslandMotion, own: Part, width: int) -> Between:
    """Return the steps of a motion, of which nothing is asked yet."""
    return Between(
        begin=motion.begin,
        start=motion.start,
        attitude=motion.attitude,
        ends=motion.record.times,
        states=motion.record.states,
        attitudes=motion.record.attitudes,
        dense=motion.record.dense,
        charts=own.tables.charts,
        width=width,
        before=np.zeros(len(motion.start)),
        times=np.zeros(0),
        found=np.zeros((0, len(motion.start))),
        turned=np.zeros((0, *motion.attitude.shape)),
    )


def _start(motion: IslandMotion, others: Sequence[Part], changes: Array, width: int) -> Array:
    """Return S at the start, shape (p, n)."""
    found = np.stack([(each.x - motion.start) / change for each, change in zip(others, changes, strict=True)])
    for k, (other, change) in enumerate(zip(others, changes, strict=True)):
        for f, first in enumerate(other.tables.charts):
            # Half of a small turn q^-1 q' about the body's axes is its vector part.
            vector, scalar = motion.attitude[f, :3], motion.attitude[f, 3]
            moved, rest = other.attitude[f, :3], other.attitude[f, 3]
            turn = scalar * moved - rest * vector - np.cross(vector, moved)
            found[k, first : first + 3] = 2.0 * np.sign(scalar * rest + vector @ moved) * turn / change
    return found


def _bends(tables: Tables) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return the rows at which laws bend, the columns that change sign there, and a mask of rows held on a side."""
    count = len(tables.state)
    kink = np.full(count, -1)
    for group in tables.groups:
        kink[group[FIRST] : group[END]] = group[KINK]
    # Law (9) bends where sliding turns round.
    rubbing = (tables.state >= 0) & (kink < 0)
    rows = np.flatnonzero((kink >= 0) | rubbing)
    # There its slopes are right on either side, held or not; of quick vibrations not every turn is found.
    return rows, np.where(kink[rows] >= 0, kink[rows], SPEED), (kink[rows] > SPEED).astype(np.int64)


def _corners(ends: Array, knots: Array, others: Sequence[Array], changes: Array) -> tuple[NDArray[np.int64], Array]:
    """Return the steps at whose ends inputs bend or jump, as one more than the row of the shifts, and the shifts, s."""
    corners = np.zeros(len(ends), dtype=np.int64)
    at = np.flatnonzero(np.isin(ends, knots * _BEFORE))
    corners[at] = 1 + np.arange(len(at))
    which = np.searchsorted(knots * _BEFORE, ends[at])
    shifts = [
        (other[which] - knots[which]) / change if len(other) == len(knots) else np.zeros(len(at))
        for other, change in zip(others, changes, strict=True)
    ]
    return corners, np.ascontiguousarray(np.stack(shifts, axis=1))


def _changed(own: Part, other: Part) -> tuple[int, Block | None]:
    """Return the address of the model with a number changed, 0 where rates do not feel it, and a block to be kept.

    Of a number that changes laws alone the block is one of the motion's own model but for the laws' parameters: bodies
    and inputs, once evaluated, need not be again. Of others there is none.
    """
    laws = own.tables._replace(parameters=other.tables.parameters)
    if not (alike(laws, other.tables, numbers=True) and alike(own.control, other.control, numbers=True)):
        return other.model.address, None
    if np.array_equal(own.tables.parameters, other.tables.parameters):
        return 0, None
    block = pack(own.model.model._replace(tables=laws), MODEL)
    return block.address, block
