"""Memory and settings of an integration, and the functions of its model that it calls on the way."""

from __future__ import annotations

from typing import NamedTuple

from finger_pin.core.jit import IndexTable, Indices, Layers, Matrix, StructType, Vector
from finger_pin.core.steps.tableaus import Tableau
from finger_pin.typing import Array

DONE, FULL, UNDERFLOW, NOT_FINITE, STALLED, RUNAWAY = range(6)

# So many tries in a row must advance by so much time each on average, s: a second at that pace would take hours.
WINDOW, LEAST_MEAN_STEP = 20_000, 1e-9
# Where a joint turns faster, rad/s, or a mass is faster, m/s, nothing physical is left to follow: the tip of a link of
# 1 cm is then faster than sound, 343 m/s.
FASTEST = 343.0 / 0.01
# What comes of trying a step.
TRIED, LEFT_BRANCH, SINGULAR, NOT_FINITE_AT_START = range(4)


class StepMemory(NamedTuple):
    """Memory of an integration that outlives a call, one number each, shape (1,); flags are 0 or 1.

    Attributes:
        time: Time reached, s.
        step_size: Size of the next step, s.
        last_step_size: Size of the last step, s; 0 if it says nothing of the next.
        last_error: Error of the last step, in tolerances.
        evaluations: Number of right-hand sides.
        jacobians: Number of Jacobians.
        factorisations: Number of factorisations.
        accepted_steps: Number of steps that were taken.
        rejected_steps: Number of tries that were not.
        rejected: Flag, whether the last try was rejected.
        limiting_state: Index of the state that is named in a failure.
        held_step_size: Size of the first step after the last jump of held inputs, s.
        continued: Flag, whether the last call ended at a full record, so that no input has jumped since.
        goal: End of the last call, s.
        window_start: Time at which the last `WINDOW` tries began, s.
        window_end: Number of tries at which they end.
        fresh: Flag, whether the step that is tried has a new start.
        jumped: Flag, whether held inputs have jumped since the last step.
        uncut_step_size: Size of the step before it was cut at a kink, s, or 0.
        max_next_step_size: Maximum size of the step after a kink, s.
        outcome: Outcome of the try.
        taken_share: Share of the try that is taken.
        retry_share: Share of it that is tried next, or 1.
        stale: Flag, whether the model has changed since the try, which is repeated from a new evaluation of its start.
        frozen: Flag, whether the branches of kinks are given instead of those where the step starts.
        counted: Number of states over which errors are averaged: those of open contacts are none of the motion's.
    """

    time: Vector
    step_size: Vector
    last_step_size: Vector
    last_error: Vector
    evaluations: Vector
    jacobians: Vector
    factorisations: Vector
    accepted_steps: Vector
    rejected_steps: Vector
    rejected: Vector
    limiting_state: Vector
    held_step_size: Vector
    continued: Vector
    goal: Vector
    window_start: Vector
    window_end: Vector
    fresh: Vector
    jumped: Vector
    uncut_step_size: Vector
    max_next_step_size: Vector
    outcome: Vector
    taken_share: Vector
    retry_share: Vector
    stale: Vector
    frozen: Vector
    counted: Vector

    @classmethod
    def from_vector(cls, values: Array) -> StepMemory:
        """Return views of a vector, shape (number of fields,)."""
        return cls(*(values[place : place + 1] for place in range(len(cls._fields))))


class Events(NamedTuple):
    """Hooks of a model into an integrator's steps: addresses of functions of the address of the `Integration`.

    Attributes:
        release: Before the start of a step is evaluated: lets all branches follow the motion, or freezes those given.
        freeze: After it: freezes the present branches, so that the step is smooth.
        left: At a stage: 1 if a branch is left there, else 0.
        cut: After a try whose error is small: fills the step's interpolant, the shares of the step that are taken and
            tried next, and in ``end`` by how much what is frozen has misled the state there.
        detect: Of what ``cut`` calls for what no stage has seen; 0 for nothing, as for the next two.
        settle: At the end of a step that is taken, the model's state.
        forget: Where a step may start anywhere: all that is known of earlier ones.
    """

    release: int
    freeze: int
    left: int
    cut: int
    detect: int
    settle: int
    forget: int


class Integration(NamedTuple):
    """Arrays and settings of an integration.

    Attributes:
        model: Address of the bound `Model`.
        tableau: The method.
        x: State, changed in place, shape (size,); the angles of free bodies are those since the last step.
        attitude: Unit quaternions of the free bodies, changed in place, shape (f, 4).
        rtol: Relative tolerance.
        atol: Absolute tolerances, shape (size,).
        memory: Time, step size, error history and counters; kept between calls.
        k: Scratch for the stages, shape (s, size).
        start: Scratch, f(t, x) at the start of a step, shape (size,).
        r: Scratch, shape (size + 1,).
        end: Scratch, shape (size,).
        live: From where to where numbers of the state may be other than zero, shape (parts, 2); all else is zero in
            states, rates, stages and interpolants.
        live_count: How many of these parts there are, shape (1,).
        dense: Coefficients of a step's interpolant, shape (rows of the tableau's dense, size).
        kinks: Where each row was between the sides of its kink when the step began, or a sign, shape (K,).
        reevaluate: Whether a second try evaluates its start again, for what is read from the memory of that.
        events: What its model does about steps.
    """

    model: int
    tableau: Tableau
    x: Vector
    attitude: Matrix
    rtol: float
    atol: Vector
    memory: StepMemory
    k: Matrix
    start: Vector
    r: Vector
    end: Vector
    live: IndexTable
    live_count: Indices
    dense: Matrix
    kinks: Vector
    reevaluate: bool
    events: Events


class AdvanceArgs(NamedTuple):
    """Arguments of `advance`: an integration, and room for a record of at most m steps.

    Attributes:
        integration: Address of the bound `Integration`.
        times: Times at which steps end, shape (m,); of length zero to record nothing.
        states: States there, with the angles of free bodies since the step's start, shape (m, size).
        attitudes: Quaternions of the free bodies there, shape (m, f, 4).
        dense: Interpolants of the steps, shape (m, rows of the tableau's dense, size).
        shares: Of the length that was tried the share that was taken, shape (m,).
        branches: Where each row was between the sides of its kink at the start of each step, shape (m, K).
        record_range: Number of recorded steps so far, and the one at which to stop, shape (2,).
    """

    integration: int
    times: Vector
    states: Matrix
    attitudes: Layers
    dense: Layers
    shares: Vector
    branches: Matrix
    record_range: Indices


INTEGRATION, ADVANCE_ARGS = StructType(Integration), StructType(AdvanceArgs)
