"""Times at which an input bends or jumps, compiled: a step ends at each, so that none goes across."""

from __future__ import annotations

from typing import NamedTuple

from finger_pin.core.jit import CompiledFunction, Indices, StructType, Vector, call_at, unpack
from finger_pin.core.stepping.rosenbrock import DONE, FULL, INTEGRATION, STRETCH, TIME

# Times it, a positive number becomes the one before it.
_BEFORE = 1.0 - 2.0**-53


class Knotted(NamedTuple):
    """A stretch in which steps end at knots.

    Attributes:
        knots: Positive, in order, s.
        passed: Memory, how many are behind, shape (1,).
        stretch: Address of the bound `Stretch`.
        inner: Address of what is called to advance, and is given ``given``.
        given: Address of a block.
    """

    knots: Vector
    passed: Indices
    stretch: int
    inner: int
    given: int


KNOTTED = StructType(Knotted)


@CompiledFunction
def advance_knotted(address: int, end: float) -> int:
    """Advance as `adaptive.advance` does, by steps that end at knots.

    At a knot itself the value after a jump counts: a step that ends there must not see it, and ends just before.
    """
    knotted = unpack(address, KNOTTED)
    knots, passed, stretch = knotted.knots, knotted.passed, unpack(knotted.stretch, STRETCH)
    memory = unpack(stretch.integration, INTEGRATION).memory
    while True:
        while passed[0] < knots.size and knots[passed[0]] <= memory[TIME]:
            passed[0] += 1
        if passed[0] == knots.size or knots[passed[0]] > end:
            last: int = call_at(knotted.inner, knotted.given, end)
            return last
        knot = knots[passed[0]]
        status: int = call_at(knotted.inner, knotted.given, knot * _BEFORE)
        if status != DONE:
            return status
        memory[TIME] = knot
        if stretch.taken[0] == stretch.taken[1] and stretch.times.size > 0 and knot < end:
            return FULL
