"""Many steppers advanced side by side, in threads that release the GIL."""

from __future__ import annotations

from collections.abc import Sequence

from finger_pin.core.stepping.stepper import Stepper
from finger_pin.threads import in_threads


def advance_many(steppers: Sequence[Stepper], ends: Sequence[float]) -> list[int]:
    """Advance steppers to a time each, s; return the statuses of `Stepper.advance`."""
    owners = [index for index, stepper in enumerate(steppers) for _ in stepper.parts]
    ready = [part.ready() for stepper in steppers for part in stepper.parts]

    def advance(index: int) -> int:
        block, unit = ready[index]
        return unit(block, ends[owners[index]])

    statuses = [0] * len(steppers)
    for owner, status in zip(owners, in_threads(advance, range(len(owners))), strict=True):
        statuses[owner] = max(statuses[owner], status)
    return statuses
