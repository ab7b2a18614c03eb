"""The sensitivity equations of a motion: its derivatives by the numbers of its mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import numpy as np
from numpy.typing import NDArray

from finger_pin.core.evaluation.law_code import SPEED
from finger_pin.core.jit import alike, bound, call
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
from finger_pin.description.routing import Array

# Intervals that are filled at a time.
_ROOM = 256
# A step that ends at a knot ends so much before it, of the time.
_BEFORE = 1.0 - 2.0**-53
# Weights of the values at the begin and the nodes of an interval in powers of the share: the polynomial through them.
_POLYNOMIAL = np.linalg.inv(np.vander(np.array([0.0, *NODES]), increasing=True))


class Derivative:
    """The motion of an island, and S over time, by p numbers."""

    def __init__(self, motion: IslandMotion, ends: Array, solution: Array) -> None:
        """Keep the ends of the intervals, shape (m,), s, and S at begin and nodes of each, shape (m, s + 1, p, n)."""
        self._motion, self._ends, self._solution = motion, ends, solution
        self._begins = np.concatenate([[motion.begin], ends[:-1]])
        self._last: tuple[Array, tuple[Array, Array], NDArray[np.intp], Array] | None = None

    def at(self, times: Array, k: int) -> tuple[Array, Array, Array]:
        """Return states and quaternions at times, as the motion does, and S of a number there, shape (t, n).

        All numbers ask for the same times in turn: what they share of the latest is remembered.
        """
        last = self._last
        if last is None or not np.array_equal(last[0], times):
            place = np.clip(np.searchsorted(self._ends, times, side="right"), 0, len(self._ends) - 1)
            share = (times - self._begins[place]) / (self._ends[place] - self._begins[place])
            weights = np.vander(np.clip(share, 0.0, 1.0), len(_POLYNOMIAL), increasing=True) @ _POLYNOMIAL
            self._last = last = times.copy(), self._motion.interpolate(times), place, weights
        _, (states, attitudes), place, weights = last
        return states, attitudes, np.einsum("tj,tjn->tn", weights, self._solution[place, :, k])


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
    # As long as they are used.
    changed = [_changed(parts[0], each) for each in parts[1:]]
    collocation = _collocation(motion, parts, knots, changes, allowed, changed)
    shape = (-1, len(NODES) + 1, len(changes), len(collocation.scale))
    ends, solutions = [], []
    while (taken := call(collocate, collocation, COLLOCATION)) != SINGULAR:
        ends.append(collocation.ends[:taken].copy())
        solutions.append(collocation.solution[: shape[1] * taken].reshape(shape)[..., : len(motion.start)].copy())
        if taken < _ROOM:
            return Derivative(motion, np.concatenate(ends), np.concatenate(solutions))
    return None


def _collocation(
    motion: IslandMotion,
    parts: Sequence[Part],
    knots: Sequence[Array],
    changes: Array,
    allowed: float,
    changed: Sequence[tuple[NDArray[np.uint8] | None, bool]],
) -> Collocation:
    """Return the `Collocation` at the start of a motion; arguments as for `differentiate`, and `_changed` of each."""
    own, others = parts[0], parts[1:]
    size, count, nodes = len(motion.start), len(others), len(NODES)
    wide = -(-size // LANES) * LANES
    filled = count * wide
    rows, columns, held = _bends(own.tables)
    bends = len(rows) + len(own.control.level)
    corners, shifts = _corners(motion.record.times, knots[0], knots[1:], changes)
    width = len(own.tables.parents) + len(own.tables.lumps)
    memory = np.zeros(MEMORY_SIZE)
    memory[TIME], memory[LENGTH] = motion.begin, motion.record.times[0] - motion.begin
    return Collocation(
        model=own.model.address,
        changed=np.array([0 if block is None else block.ctypes.data for block, _ in changed], dtype=np.int64),
        within=np.array([within for _, within in changed], dtype=np.int64),
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
        right=np.zeros(size + 1),
        part=np.zeros(size),
        source=np.zeros(filled),
        found=np.zeros(filled),
        resolvents=np.zeros((nodes, wide, wide)),
        given=np.zeros((nodes, filled)),
        known=np.zeros((nodes, filled)),
        nodal=np.zeros((nodes, filled)),
        rates=np.zeros((nodes, filled)),
        ends=np.zeros(_ROOM),
        solution=np.zeros(((nodes + 1) * _ROOM, filled)),
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


def _changed(own: Part, other: Part) -> tuple[NDArray[np.uint8] | None, bool]:
    """Return the block of the model with a number changed, if rates feel it, and whether it changes laws alone.

    Then the block has the memory of the model without: what is known of bodies there need not be evaluated again.
    """
    laws = own.tables._replace(parameters=other.tables.parameters)
    if not (alike(laws, other.tables, numbers=True) and alike(own.control, other.control, numbers=True)):
        return bound(other.model.model, MODEL), False
    if np.array_equal(own.tables.parameters, other.tables.parameters):
        return None, False
    return bound(own.model.model._replace(tables=laws), MODEL), True
