"""Repetition of recorded steps with other parameters, for smooth differences."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from finger_pin.core.jit import CompiledFunction, Indices, Matrix, StructType, Vector, call_at, unpack
from finger_pin.core.steps import integration as at
from finger_pin.core.steps.adaptive import accept_step, try_counted
from finger_pin.core.steps.interpolation import cut_to_share, interpolant
from finger_pin.core.tables.model import MODEL
from finger_pin.typing import Array


class Steps(NamedTuple):
    """The m steps of an island, and the branches frozen within each.

    Attributes:
        ends: Shape (m,), s.
        shares: Of the length that was tried the share that was taken, shape (m,).
        branches: Signs tell the branches of the rows' kinks, shape (m, K), or (m, 0) to freeze those at each start.
    """

    ends: Vector
    shares: Vector
    branches: Matrix

    @classmethod
    def from_ends(cls, ends: Array) -> Steps:
        """Return uncut steps with these ends, s."""
        return cls(np.array(ends, dtype=float), np.ones(len(ends)), np.zeros((len(ends), 0)))


class RepeatStepsArgs(NamedTuple):
    """Arguments of `repeat_steps`.

    Attributes:
        steps: The steps.
        passed: Memory, how many are behind, shape (1,).
        args: Address of the bound `AdvanceArgs`.
    """

    steps: Steps
    passed: Indices
    args: int


REPEAT_STEPS_ARGS = StructType(RepeatStepsArgs)


@CompiledFunction
def repeat_steps(address: int, end: float) -> int:
    """Advance the `RepeatStepsArgs` at an address to a time; a step that a new end cuts is taken whole."""
    repeat = unpack(address, REPEAT_STEPS_ARGS)
    steps, passed, args = repeat.steps, repeat.passed, unpack(repeat.args, at.ADVANCE_ARGS)
    integration = unpack(args.integration, at.INTEGRATION)
    model, memory = unpack(integration.model, MODEL), integration.memory
    while memory.time[0] < end:
        if args.times.size > 0 and args.record_range[0] == args.record_range[1]:
            return at.FULL
        time = memory.time[0]
        while passed[0] < steps.ends.size - 1 and steps.ends[passed[0]] <= time:
            passed[0] += 1
        step, goal, share = passed[0], end, 1.0
        if time < steps.ends[step] <= end:
            goal, share = steps.ends[step], steps.shares[step]
        frozen = steps.branches.shape[1] > 0
        if frozen:
            for k in range(integration.kinks.size):
                integration.kinks[k] = steps.branches[step, k]
        if integration.events.forget:
            call_at(integration.events.forget, args.integration, 0.0)
        memory.fresh[0], memory.frozen[0], memory.taken_share[0] = 1.0, 1.0 * frozen, share
        outcome = try_counted(args.integration, integration, model, (goal - time) / share)
        if outcome == at.NOT_FINITE_AT_START:
            return at.NOT_FINITE
        if outcome == at.SINGULAR:
            return at.UNDERFLOW
        interpolant(integration)
        if share < 1.0:
            cut_to_share(integration, model.state, share)
        accept_step(args, integration, model, goal)
        memory.accepted_steps[0] += 1
    return at.DONE
