"""A Rosenbrock step with the exact Jacobian, compiled; without Newton iterations, which could fail."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from finger_pin.core.collision.broad_phase import depart
from finger_pin.core.evaluation.condensation import solve
from finger_pin.core.jit import Indices, Layers, Matrix, StructType, Vector, call_at, njit_always_inline
from finger_pin.core.stepping.kink_sides import hold, release, strayed
from finger_pin.core.stepping.tableaus import Tableau

# Entries of the memory that outlives a call.
TIME, STEP, LAST_STEP, LAST_ERROR, EVALUATIONS, JACOBIANS, FACTORISATIONS, ACCEPTED, REJECTED, CULPRIT = range(10)
HELD_STEP, GOAL, WINDOW_START, WINDOW_END, DRIFT, OBJECT_DRIFT, BEHIND = range(10, 17)
# Of the step that is tried: whether it begins anew, whether inputs have jumped since the last one, how long it was
# before it was cut at a kink, or 0, and how long the one after the kink may be.
FRESH, JUMPED, WHOLE, AFTER = range(17, 21)
# What has come of the try; the share of it that is taken, that to try next, or 1, that after which a row has left its
# side, and that at which bodies touch and part again.
OUTCOME, PART, KEPT, SHARE, TOUCH = range(21, 26)
# Whether the branches of kinks are given instead of those where the step starts.
FROZEN, MEMORY_SIZE = range(26, 28)
DONE, FULL, UNDERFLOW, NOT_FINITE, CREEPING, RUNAWAY = range(6)

# So many tries in a row must advance by so much time each on average, s: a second at that pace would take hours.
WINDOW, LEAST_MEAN_STEP = 20_000, 1e-9
# Where a joint turns faster, rad/s, or a mass is faster, m/s, nothing physical is left to follow: the tip of a link of
# 1 cm is then faster than sound, 343 m/s.
FASTEST = 343.0 / 0.01
# What comes of trying a step.
TRIED, STRAYED, SINGULAR, SENSELESS = range(4)


class Integration(NamedTuple):
    """All that an integration works on, from its start to its end.

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
        dense: Coefficients of a step's interpolant, shape (rows of the tableau's dense, size).
        drift: Estimate of the error so far, shape (size,).
        kinks: Where each row was between the sides of its kink when the step began, or a sign, shape (K,).
        joints: Coordinates whose error is estimated; without any nothing is, which saves a tenth.
        objects: Those of free objects, likewise.
        cut: Address of the unit that cuts a step that was tried.
        survey: Of the one that looks for touches in it; 0 without contacts.
        judge: Of the one that carries the error over it; 0 where none is estimated.
    """

    model: int
    tableau: Tableau
    x: Vector
    attitude: Matrix
    rtol: float
    atol: Vector
    memory: Vector
    k: Matrix
    start: Vector
    r: Vector
    end: Vector
    dense: Matrix
    drift: Vector
    kinks: Vector
    joints: Indices
    objects: Indices
    cut: int
    survey: int
    judge: int


class Stretch(NamedTuple):
    """The motion to be integrated further, and room for a record of at most m steps.

    Attributes:
        integration: Address of the bound `Integration`.
        times: Times at which steps end, shape (m,); of length zero to record nothing.
        states: States there, with the angles of free bodies since the step's start, shape (m, size).
        attitudes: Quaternions of the free bodies there, shape (m, f, 4).
        dense: Interpolants of the steps, shape (m, rows of the tableau's dense, size).
        shares: Of the length that was tried the share that was taken, shape (m,).
        branches: Where each row was between the sides of its kink at the start of each step, shape (m, K).
        taken: Number of steps recorded so far, and that at which to stop, shape (2,).
    """

    integration: int
    times: Vector
    states: Matrix
    attitudes: Layers
    dense: Layers
    shares: Vector
    branches: Matrix
    taken: Indices


INTEGRATION, STRETCH = StructType(Integration), StructType(Stretch)


@njit_always_inline
def try_step(integration: Any, model: Any, time: float, h: float, fresh: bool) -> int:
    """Try one step: fill the increments k and, in model.state, the state at its end.

    What depends on the start alone, f(t, x) and the linearisation, is kept for a second try.

    Returns:
        `TRIED`; `STRAYED`, if at a stage a row was on the other side of its kink than where it is held; `SINGULAR`, if
        g - J is; `SENSELESS`, if f(t, x) is not finite.
    """
    tableau, x, k, r, start = integration.tableau, integration.x, integration.k, integration.r, integration.start
    size, state, rate = x.size, model.state, model.rate
    tables, rows, kinks = model.tables, model.work.rows, integration.kinks
    g = 1.0 / (h * tableau.gamma)
    outcome, frozen = TRIED, integration.memory[FROZEN] > 0.0
    for i in range(tableau.nodes.size):
        for c in range(size):
            r[c], rate[c], state[c] = 0.0, start[c], x[c]
        # Whole rows at a time, so that the compiler can use vector instructions.
        for j in range(i):
            of_stage, of_coupling = tableau.stage[i, j], tableau.coupling[i, j] / h
            for c in range(size):
                state[c] += of_stage * k[j, c]
                r[c] += of_coupling * k[j, c]
        if i == 0 and fresh:
            release(tables, rows)
            if frozen:
                hold(tables, rows, kinks, frozen)
        # For a second try too: what pins and tips feel there is read from the memory of the evaluation.
        if i > 0 or fresh or tables.loaded or tables.touching > 0:
            call_at(model.evaluate, integration.model, time + tableau.nodes[i] * h)
        if i == 0:
            if fresh:
                for c in range(size):
                    start[c] = rate[c]
                    if not np.isfinite(rate[c]):
                        return SENSELESS
                if not frozen:
                    hold(tables, rows, kinks, frozen)
                if tables.touching:
                    depart(tables, model.work.paths)
                call_at(model.linearise, integration.model, time)
            if call_at(model.condense, integration.model, g) == 0:
                return SINGULAR
        elif i < tableau.nodes.size - 1 and strayed(tables, rows, kinks) < 1.0:
            outcome = STRAYED
        for c in range(size):
            r[c] += rate[c]
        r[size] = h * tableau.time[i]
        solve(model.linear, r, k[i])
    for c in range(size):
        state[c] += k[tableau.nodes.size - 1, c]
    return outcome
