"""Many steppers advanced by one call, in threads, with no Python in between."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from finger_pin.core.jit import (
    CompiledFunction,
    Indices,
    StructType,
    Vector,
    add_at,
    call_at,
    look_at,
    njit_inline,
    pack,
    put_at,
    unpack,
)
from finger_pin.core.stepping.stepper import Stepper
from finger_pin.core.threads import pool, usable_cores
from finger_pin.typing import Array

#: In the place of an end: this one is left alone.
IDLE = -1.0
# How often a thread that has nothing to do asks whether there is something, before it sleeps: helpers, which take 50 us
# to wake, for 0.15 ms, and the one that waits for them for 0.1 ms; and then how long, s.
_WATCH, _PATIENCE, _NAP = 300_000.0, 50_000.0, 1e-4


class Batch(NamedTuple):
    """Steppers that are advanced by one call.

    Attributes:
        units: Addresses of what advances each, shape (m,).
        blocks: Addresses of what they are given, shape (m,).
        ends: Until when, shape (m,), s; `IDLE` for those that are left alone.
        statuses: Filled with what they return, shape (m,).
        counts: How many are taken up, how many are done, and how many helpers watch, shape (3,).
    """

    units: Indices
    blocks: Indices
    ends: Vector
    statuses: Indices
    counts: Indices


BATCH = StructType(Batch)


@CompiledFunction
def open_batch(address: int, helpers: float) -> int:
    """Open the `Batch` at an address for threads; return the number of further helpers wanted."""
    taken = unpack(address, BATCH).counts.ctypes.data
    put_at(taken + 8, 0)
    put_at(taken, 0)
    missing: int = max(int(helpers) - look_at(taken + 16), 0)
    add_at(taken + 16, missing)
    return missing


@CompiledFunction
def advance_batch(address: int, patience: float) -> int:
    """Advance the remaining steppers of the `Batch` at an address; return whether all are done."""
    batch = unpack(address, BATCH)
    done, size = batch.counts.ctypes.data + 8, batch.ends.size
    _take_up(batch)
    while patience > 0.0 and look_at(done) < size:
        patience -= 1.0
    return int(look_at(done) >= size)


@CompiledFunction
def help_batch(address: int, patience: float) -> int:
    """Worker loop: advance remaining steppers of the `Batch` at an address whenever it is opened."""
    batch = unpack(address, BATCH)
    taken, size, asked = batch.counts.ctypes.data, batch.ends.size, 0.0
    while asked <= patience:
        asked += 1.0
        if look_at(taken) < size:
            _take_up(batch)
            asked = 0.0
    add_at(taken + 16, -1)
    return 1


@njit_inline
def _take_up(batch: Any) -> None:
    taken = batch.counts.ctypes.data
    i = add_at(taken, 1)
    while i < batch.ends.size:
        batch.statuses[i] = call_at(batch.units[i], batch.blocks[i], batch.ends[i]) if batch.ends[i] >= 0.0 else 0
        add_at(taken + 8, 1)
        i = add_at(taken, 1)


class BatchStepper:
    """Steppers that are advanced together in threads, bound once."""

    def __init__(self, steppers: Sequence[Stepper]) -> None:
        """Bind steppers; their islands, loops and knots must not change."""
        parts = [part for stepper in steppers for part in stepper.parts]
        self._owners = np.repeat(np.arange(len(steppers)), [len(stepper.parts) for stepper in steppers])
        self._first = np.searchsorted(self._owners, np.arange(len(steppers)))
        self._whole = len(parts) == len(steppers)
        self._ready = [part.ready() for part in parts]
        # What the addresses lead to lives as long as this.
        self._steppers, self._parts = steppers, parts
        self._batch = Batch(
            np.array([unit.address for _, unit in self._ready], dtype=np.int64),
            np.array([block for block, _ in self._ready], dtype=np.int64),
            np.zeros(len(parts)),
            np.zeros(len(parts), dtype=np.int64),
            np.zeros(3, dtype=np.int64),
        )
        self._block = pack(self._batch, BATCH)
        self._patience = 0.0

    def __reduce__(self) -> tuple[Any, ...]:
        """Return constructor and arguments for `copy.deepcopy` and pickles: a copy binds copies of the steppers."""
        return BatchStepper, (self._steppers,)

    def is_for(self, steppers: Sequence[Stepper]) -> bool:
        """Return whether it was made for these steppers with these islands, loops and knots."""
        return [part.ready() for stepper in steppers for part in stepper.parts] == self._ready

    def advance(self, ends: Sequence[float]) -> list[int]:
        """Advance each to a time, s, or not if that is `IDLE`; return the statuses of `advance`."""
        if len(self._ready) == 1:
            block, unit = self._ready[0]
            return [unit(block, ends[0]) if ends[0] != IDLE else 0]
        batch = self._batch
        batch.ends[:] = ends if self._whole else np.asarray(ends)[self._owners]
        for _ in range(open_batch(self._block.address, min(usable_cores(), len(self._ready)) - 1)):
            pool().submit(self._help, self._patience)
        # Who is called once has nobody wait for a second time.
        self._patience = _WATCH
        while not advance_batch(self._block.address, _PATIENCE):
            time.sleep(_NAP)
        found = batch.statuses if self._whole else np.maximum.reduceat(batch.statuses, self._first)
        return list(found.tolist())

    def _help(self, patience: float) -> None:
        help_batch(self._block.address, patience)

    def read(self, out: Array) -> None:
        """Fill the packed states of all, shape (m, size), contiguous."""
        if self._whole and not len(self._parts[0].attitude):
            for row, part in zip(out, self._parts, strict=True):
                row[:] = part.x
        else:
            out[:] = [stepper.x for stepper in self._steppers]
