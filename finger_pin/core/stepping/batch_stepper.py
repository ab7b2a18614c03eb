"""Many steppers advanced side by side, in threads that release the GIL."""

from __future__ import annotations

from collections.abc import Sequence

from finger_pin.core.stepping.stepper import Stepper
from finger_pin.core.threads import in_threads
from finger_pin.typing import Array

#: In the place of an end: this one is left alone.
NO_END = -1.0


class BatchStepper:
    """Steppers that are advanced together, bound once."""

    def __init__(self, steppers: Sequence[Stepper]) -> None:
        """Bind steppers; their islands, loops and knots must not change."""
        self._steppers = steppers
        self._parts = [part for stepper in steppers for part in stepper.parts]
        self._owners = [index for index, stepper in enumerate(steppers) for _ in stepper.parts]
        self._ready = [part.ready() for part in self._parts]

    def __reduce__(self) -> tuple[type[BatchStepper], tuple[Sequence[Stepper]]]:
        """Return constructor and arguments for `copy.deepcopy` and pickles: a copy binds copies of the steppers."""
        return BatchStepper, (self._steppers,)

    def advance(self, ends: Sequence[float]) -> list[int]:
        """Advance each to a time, s, or not if that is `NO_END`; return the statuses of `advance`."""
        active = [index for index, owner in enumerate(self._owners) if ends[owner] != NO_END]

        def advance(index: int) -> int:
            block, unit = self._ready[index]
            return unit(block, ends[self._owners[index]])

        statuses = [0] * len(ends)
        for index, status in zip(active, in_threads(advance, active), strict=True):
            statuses[self._owners[index]] = max(statuses[self._owners[index]], status)
        return statuses

    def read(self, out: Array) -> None:
        """Fill the packed states of all, shape (m, size), contiguous."""
        if len(self._parts) == len(out) and not len(self._parts[0].attitude):
            for row, part in zip(out, self._parts, strict=True):
                row[:] = part.x
        else:
            out[:] = [stepper.x for stepper in self._steppers]
