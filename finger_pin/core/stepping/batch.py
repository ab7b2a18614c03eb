"""Many steppers advanced by one call, in threads, with no Python in between."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from finger_pin.core.jit import Indices, Kind, Unit, Vector, bound_at, call, call_at
from finger_pin.core.stepping import rosenbrock as core
from finger_pin.core.stepping.stepper import Stepper, usable_cores


class Batch(NamedTuple):
    """What is advanced by one call.

    Attributes:
        units: Addresses of what advances each, shape (m,).
        blocks: Addresses of what they are given, shape (m,).
        ends: Until when, shape (m,), s.
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
        batch.statuses[i] = call_at(batch.units[i], batch.blocks[i], batch.ends[i])
    return 1


def advance_together(steppers: Sequence[Stepper], ends: Sequence[float]) -> list[int]:
    """Advance many steppers, each to a time, side by side in threads; return the status of each, as `advance` does."""
    owners = [index for index, stepper in enumerate(steppers) for _ in stepper.parts]
    ready = [part.ready() for stepper in steppers for part in stepper.parts]
    units = np.array([unit.address for _, unit in ready], dtype=np.int64)
    blocks = np.array([block for block, _ in ready], dtype=np.int64)
    until, statuses = np.array([ends[index] for index in owners], dtype=float), np.zeros(len(owners), dtype=np.int64)

    def advance(part: slice) -> None:
        own = np.zeros(len(statuses[part]), dtype=np.int64)
        call(advance_batch, Batch(units[part], blocks[part], until[part], own), BATCH)
        statuses[part] = own

    threads = min(usable_cores(), len(owners))
    if threads < 2:
        advance(slice(None))
    else:
        # A few pieces for each thread: some take longer than others.
        edges = np.linspace(0, len(owners), min(4 * threads, len(owners)) + 1).astype(int).tolist()
        list(_workers(threads).map(advance, [slice(*each) for each in pairwise(edges)]))
    found = [core.DONE] * len(steppers)
    for owner, status in zip(owners, statuses.tolist(), strict=True):
        found[owner] = max(found[owner], status)
    return found


@cache
def _workers(count: int) -> ThreadPoolExecutor:
    """Return threads that stay: to start them takes longer than many a step."""
    return ThreadPoolExecutor(count, "finger_pin")
