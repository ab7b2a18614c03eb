"""Many steppers advanced by one call, in threads, with no Python in between."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from finger_pin.core.jit import Indices, Kind, Unit, Vector, bound, bound_at, call_at
from finger_pin.core.stepping.stepper import Stepper
from finger_pin.core.threads import usable_cores
from finger_pin.description.routing import Array

#: In the place of an end: this one is left alone.
RESTING = -1.0
# Pieces for each thread: some steppers take longer than others.
_PIECES = 4


class Batch(NamedTuple):
    """Steppers that are advanced by one call.

    Attributes:
        units: Addresses of what advances each, shape (m,).
        blocks: Addresses of what they are given, shape (m,).
        ends: Until when, shape (m,), s; `RESTING` for those that are left alone.
        statuses: Filled with what they return, shape (m,).
    """

    units: Indices
    blocks: Indices
    ends: Vector
    statuses: Indices


BATCH = Kind(Batch)


@Unit
def advance_batch(address: int, _time: float) -> int:
    """Advance everything in the `Batch` at an address."""
    batch = bound_at(address, BATCH)
    for i in range(batch.ends.size):
        batch.statuses[i] = 0
        if batch.ends[i] >= 0.0:
            batch.statuses[i] = call_at(batch.units[i], batch.blocks[i], batch.ends[i])
    return 1


class Together:
    """Steppers that are advanced side by side, again and again; bound once."""

    def __init__(self, steppers: Sequence[Stepper]) -> None:
        """Bind steppers, whose islands, loops and knots stay the same."""
        parts = [part for stepper in steppers for part in stepper.parts]
        self._owners = np.repeat(np.arange(len(steppers)), [len(stepper.parts) for stepper in steppers])
        self._first = np.searchsorted(self._owners, np.arange(len(steppers)))
        self._whole = len(parts) == len(steppers)
        ready = [part.ready() for part in parts]
        # What the addresses lead to lives as long as this.
        self._steppers, self._parts = steppers, parts
        self._pieces: dict[int, tuple[list[NDArray[np.uint8]], list[int]]] = {}
        self._batch = Batch(
            np.array([unit.address for _, unit in ready], dtype=np.int64),
            np.array([block for block, _ in ready], dtype=np.int64),
            np.zeros(len(parts)),
            np.zeros(len(parts), dtype=np.int64),
        )

    def __reduce__(self) -> tuple[Any, ...]:
        """Return constructor and arguments for `copy.deepcopy` and pickles: a copy binds copies of the steppers."""
        return Together, (self._steppers,)

    def advance(self, ends: Sequence[float]) -> list[int]:
        """Advance each to a time, s, or not at all if that is `RESTING`; return their statuses, as `advance` does."""
        batch = self._batch
        batch.ends[:] = ends if self._whole else np.asarray(ends)[self._owners]
        threads = min(usable_cores(), len(self._parts)) if len(self._parts) > 1 else 1
        # Whoever is free takes the next piece.
        pieces = iter(self._bound(threads))
        others = [_workers().submit(_advance_all, pieces) for _ in range(threads - 1)]
        _advance_all(pieces)
        for other in others:
            other.result()
        found = batch.statuses if self._whole else np.maximum.reduceat(batch.statuses, self._first)
        return list(found.tolist())

    def read(self, out: Array) -> None:
        """Fill the packed states of all, shape (m, size), contiguous."""
        if self._whole and not len(self._parts[0].attitude):
            for row, part in zip(out, self._parts, strict=True):
                row[:] = part.x
        else:
            out[:] = [stepper.x for stepper in self._steppers]

    def _bound(self, threads: int) -> list[int]:
        """Return the addresses of pieces of the batch, for some threads."""
        if threads not in self._pieces:
            count = len(self._parts)
            pieces = 1 if threads < 2 else min(_PIECES * threads, count)
            edges = np.linspace(0, count, pieces + 1).astype(int).tolist()
            parts = [self._part(slice(*each)) for each in pairwise(edges)]
            blocks = [bound(part, BATCH) for part in parts]
            self._pieces[threads] = blocks, [int(block.ctypes.data) for block in blocks]
        return self._pieces[threads][1]

    def _part(self, at: slice) -> Batch:
        batch = self._batch
        return Batch(batch.units[at], batch.blocks[at], batch.ends[at], batch.statuses[at])


def _advance_all(pieces: Iterator[int]) -> None:
    for piece in pieces:
        advance_batch(piece)


@cache
def _workers() -> ThreadPoolExecutor:
    """Return threads that stay: to start them takes longer than many a step."""
    return ThreadPoolExecutor(usable_cores(), "finger_pin")
