"""Steps of an earlier run taken again by another one, which is then as smooth in its parameters as its equations."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from finger_pin.core.collision.broad_phase import rouse
from finger_pin.core.jit import CompiledFunction, Indices, Matrix, StructType, Vector, unpack
from finger_pin.core.model import MODEL
from finger_pin.core.stepping import rosenbrock as at
from finger_pin.core.stepping.adaptive import arrive, try_counted
from finger_pin.core.stepping.interpolation import cut, interpolant
from finger_pin.typing import Array


class Steps(NamedTuple):
    """The m steps of an island, and what was frozen within each.

    Attributes:
        ends: Shape (m,), s.
        shares: Of the length that was tried the share that was taken, shape (m,).
        branches: Signs tell the branches of the rows' kinks, shape (m, K), or (m, 0) to freeze those at each start.
    """

    ends: Vector
    shares: Vector
    branches: Matrix

    @classmethod
    def whole(cls, ends: Array) -> Steps:
        """Return steps with these ends, s, taken whole."""
        return cls(np.array(ends, dtype=float), np.ones(len(ends)), np.zeros((len(ends), 0)))


class Repetition(NamedTuple):
    """A stretch that is integrated on given steps, whatever their errors.

    Attributes:
        steps: The steps.
        passed: Memory, how many are behind, shape (1,).
        stretch: Address of the bound `Stretch`.
    """

    steps: Steps
    passed: Indices
    stretch: int


REPETITION = StructType(Repetition)


@CompiledFunction
def repeat_steps(address: int, end: float) -> int:
    """Advance the `Repetition` at an address as `adaptive.advance` does; a step that a new end cuts is taken whole."""
    repetition = unpack(address, REPETITION)
    steps, passed, stretch = repetition.steps, repetition.passed, unpack(repetition.stretch, at.STRETCH)
    integration = unpack(stretch.integration, at.INTEGRATION)
    model, memory = unpack(integration.model, MODEL), integration.memory
    while memory[at.TIME] < end:
        if stretch.times.size > 0 and stretch.taken[0] == stretch.taken[1]:
            return at.FULL
        time = memory[at.TIME]
        while passed[0] < steps.ends.size - 1 and steps.ends[passed[0]] <= time:
            passed[0] += 1
        step, goal, share = passed[0], end, 1.0
        if time < steps.ends[step] <= end:
            goal, share = steps.ends[step], steps.shares[step]
        frozen = steps.branches.shape[1] > 0
        if frozen:
            for k in range(integration.kinks.size):
                integration.kinks[k] = steps.branches[step, k]
        # What another run could cull may be close in this one.
        rouse(model.tables, model.work)
        memory[at.FRESH], memory[at.FROZEN], memory[at.PART] = 1.0, 1.0 * frozen, share
        outcome = try_counted(integration, model, (goal - time) / share)
        if outcome == at.SENSELESS:
            return at.NOT_FINITE
        if outcome == at.SINGULAR:
            return at.UNDERFLOW
        interpolant(integration.tableau, integration.k, integration.dense)
        if share < 1.0:
            cut(integration.x, model.state, integration.dense, share)
        arrive(stretch, integration, model, goal)
        memory[at.ACCEPTED] += 1
    return at.DONE
