"""Times at which an input bends or jumps, compiled: a step ends at each, so that none goes across."""

from __future__ import annotations

from typing import NamedTuple

from finger_pin.core.jit import CompiledFunction, Indices, StructType, Vector, call_at, unpack
from finger_pin.core.steps.integration import ADVANCE_ARGS, DONE, FULL, INTEGRATION

# Times it, a positive number becomes the one before it.
_PREVIOUS_FLOAT_FACTOR = 1.0 - 2.0**-53


class AdvanceKnottedArgs(NamedTuple):
    """Arguments of `advance_knotted`: an integration whose steps end at knots.

    Attributes:
        knots: Positive, in order, s.
        passed: Memory, how many are behind, shape (1,).
        args: Address of the bound `AdvanceArgs`.
        inner: Address of what is called to advance, with the block at ``inner_args``.
        inner_args: Address of a block.
    """

    knots: Vector
    passed: Indices
    args: int
    inner: int
    inner_args: int


ADVANCE_KNOTTED_ARGS = StructType(AdvanceKnottedArgs)


@CompiledFunction
def advance_knotted(address: int, end: float) -> int:
    """Advance as `adaptive.advance` does, with steps that end at knots.

    At a knot itself the value after a jump counts: a step that ends there must not see it, and ends just before.
    """
    knotted = unpack(address, ADVANCE_KNOTTED_ARGS)
    knots, passed, args = knotted.knots, knotted.passed, unpack(knotted.args, ADVANCE_ARGS)
    memory = unpack(args.integration, INTEGRATION).memory
    while True:
        while passed[0] < knots.size and knots[passed[0]] <= memory.time[0]:
            passed[0] += 1
        if passed[0] == knots.size or knots[passed[0]] > end:
            last: int = call_at(knotted.inner, knotted.inner_args, end)
            return last
        knot = knots[passed[0]]
        status: int = call_at(knotted.inner, knotted.inner_args, knot * _PREVIOUS_FLOAT_FACTOR)
        if status != DONE:
            return status
        memory.time[0] = knot
        if args.record_range[0] == args.record_range[1] and args.times.size > 0 and knot < end:
            return FULL
