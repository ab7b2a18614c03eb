"""The compiled integrator behind a Python face: from a closed loop to a trajectory that can be evaluated anywhere."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from typing import Protocol

import numpy as np

from finger_pin.core import rosenbrock as core
from finger_pin.core.binding import block_for
from finger_pin.core.linearisation import build_linear
from finger_pin.core.plant import Control, Plant, build_work
from finger_pin.core.tableaus import Tableau, rodas4, rodas5p
from finger_pin.core.textbook import Statistics, Stop, Trajectory, Watch
from finger_pin.description.routing import Array

TABLEAUS: dict[str, Callable[[], Tableau]] = {"Rodas5P": rodas5p, "Rodas4": rodas4}
_FIRST_STEP = 1e-6
# The steps of a trajectory are kept in memory; this much of it, in bytes, holds millions of steps.
_MOST_BYTES = 2e9


class Held(Protocol):
    """A controller that sets tensions at instants of its own and holds them in between."""

    @property
    def instant(self) -> float:
        """The next time at which it is to act, s; later after every act."""

    def act(self, x: Array) -> Array:
        """Return the tensions from this instant on, shape (a,), at the packed state."""


class Stepper:
    """A state that the compiled integrator carries forward; everything that a continued integration needs."""

    def __init__(self, plant: Plant, control: Control, x: Array, tableau: Tableau, rtol: float, atol: Array) -> None:
        """Start at time zero."""
        memory = np.zeros(core.MEMORY_SIZE)
        memory[core.STEP] = _FIRST_STEP
        self._bind(plant, control, np.array(x, dtype=float), tableau, float(rtol), np.array(atol, dtype=float), memory)

    def _bind(
        self, plant: Plant, control: Control, x: Array, tableau: Tableau, rtol: float, atol: Array, memory: Array
    ) -> None:
        # The block holds addresses: what it was made of lives as long as it does, and is not replaced.
        self._bound = core.Integration(
            plant=plant,
            control=control,
            tableau=tableau,
            x=x,
            rtol=rtol,
            atol=atol,
            memory=memory,
            work=build_work(plant),
            linear=build_linear(plant),
            k=np.zeros((len(tableau.nodes), len(x))),
            scratch=np.zeros((4 + len(plant.parents), len(x))),
        )
        self._block = block_for(core.INTEGRATION)
        core.bind(self._bound, self._block)
        self._nothing = (np.zeros(0), np.zeros((0, len(x))), np.zeros((0, len(tableau.dense), len(x))))

    @property
    def plant(self) -> Plant:
        """The finger."""
        return self._bound.plant

    @property
    def control(self) -> Control:
        """The controller."""
        return self._bound.control

    @property
    def tableau(self) -> Tableau:
        """The method."""
        return self._bound.tableau

    @property
    def x(self) -> Array:
        """The packed state itself, shape (size,)."""
        return self._bound.x

    @property
    def atol(self) -> Array:
        """Absolute tolerances, shape (size,)."""
        return self._bound.atol

    @property
    def memory(self) -> Array:
        """Time, step size, error history and counters."""
        return self._bound.memory

    @property
    def time(self) -> float:
        """Time reached, s."""
        return float(self.memory[core.TIME])

    def advance(self, end: float, record: tuple[Array, Array, Array] | None = None) -> tuple[int, int]:
        """Integrate to a time, or until a record is full; return the status and the number of recorded steps."""
        status, steps = core.advance(self._block, end, *(record or self._nothing))
        return status, steps

    def restart(self, x: Array) -> None:
        """Go on from another state at the same time, with no memory of earlier steps."""
        self.x[:] = x
        self.memory[[core.LAST_STEP, core.LAST_ERROR, core.CULPRIT, core.HELD_STEP]] = 0.0
        self.memory[core.STEP] = _FIRST_STEP

    def load(self, fingertip_force: Array) -> None:
        """Set the fingertip force, shape (3,), N, base frame."""
        bound = self._bound
        bound.plant.fingertip_force[:] = fingertip_force
        if np.any(fingertip_force) and not bound.plant.loaded:
            plant = bound.plant._replace(loaded=True)
            self._bind(plant, bound.control, bound.x, bound.tableau, bound.rtol, bound.atol, bound.memory)

    def copy(self) -> Stepper:
        """Return an independent stepper that goes on bit by bit alike."""
        bound, twin = self._bound, copy.copy(self)
        plant = bound.plant._replace(fingertip_force=bound.plant.fingertip_force.copy())
        control = bound.control._replace(tension=bound.control.tension.copy())
        twin._bind(plant, control, bound.x.copy(), bound.tableau, bound.rtol, bound.atol, bound.memory.copy())
        return twin

    def failure(self, status: int, names: tuple[str, ...]) -> str:
        """Say what a status means; empty if nothing failed."""
        culprit = names[max(int(self.memory[core.CULPRIT]), 0)]
        if status == core.UNDERFLOW:
            return f"the step size fell below the resolution of time; the error is largest in {culprit}"
        if status == core.CREEPING:
            return (
                f"the last {core.WINDOW} steps advanced by less than {core.LEAST_MEAN_STEP:g} s each; "
                f"the error is largest in {culprit}"
            )
        if status == core.NOT_FINITE:
            return f"the rate of {culprit} is not finite"
        return ""


def integrate_compiled(
    stepper: Stepper,
    duration: float,
    names: tuple[str, ...],
    *,
    held: Held | None = None,
    watch: Watch | None = None,
    chunk: int = 256,
    stop: Stop | None = None,
) -> Trajectory:
    """Integrate from time zero with the compiled core.

    Args:
        stepper: Where to start, with which method and tolerances.
        duration: s.
        names: Names of the numbers of the state, for messages.
        held: A controller that holds its tensions in between.
        watch: Called with the simulated time and the state after every chunk of steps.
        chunk: Most steps between two calls.
        stop: Asked now and then; true ends the integration there.
    """
    # Advancing by nothing compiles, which is no part of an integration's cost.
    stepper.advance(stepper.time)
    began = time.perf_counter()
    start, size = stepper.x.copy(), len(stepper.x)
    record = (np.zeros(chunk), np.zeros((chunk, size)), np.zeros((chunk, len(stepper.tableau.dense), size)))
    kept: tuple[list[Array], list[Array], list[Array]] = ([np.zeros(1)], [start[None]], [])
    reason, interrupted, taken = "", False, 0
    most = int(_MOST_BYTES / (8 * size * (1 + len(stepper.tableau.dense))))
    while stepper.time < duration and not reason and not interrupted:
        end = duration
        if held is not None:
            if stepper.time >= held.instant:
                stepper.control.tension[:] = held.act(stepper.x)
            end = min(duration, held.instant)
        status, steps = stepper.advance(end, record)
        for store, block in zip(kept, record, strict=True):
            store.append(block[:steps].copy())
        reason = stepper.failure(status, names)
        taken += steps
        if not reason and taken >= most and stepper.time < duration:
            reason = f"after {taken} steps the trajectory has reached the most that is kept in memory"
        if watch is not None:
            watch(stepper.time, stepper.x)
        interrupted = stop is not None and not reason and stepper.time < duration and stop()
    times, states = np.concatenate(kept[0]), np.concatenate(kept[1])
    dense = np.concatenate(kept[2]) if kept[2] else np.zeros((0, len(stepper.tableau.dense), size))
    memory = stepper.memory
    return Trajectory(
        breakpoints=times,
        interpolate=_interpolant(times, states, dense),
        statistics=Statistics(
            steps=len(times) - 1,
            evaluations=int(memory[core.EVALUATIONS]),
            jacobians=int(memory[core.JACOBIANS]),
            factorisations=int(memory[core.FACTORISATIONS]),
            wall_time=time.perf_counter() - began,
        ),
        failure=reason,
        interrupted=interrupted,
    )


def _interpolant(times: Array, states: Array, dense: Array) -> Callable[[Array], Array]:
    def interpolate(at: Array) -> Array:
        if len(times) == 1:
            return np.repeat(states, len(at), axis=0)
        step = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
        s = ((at - times[step]) / (times[step + 1] - times[step]))[:, None]
        bend = dense[step, -1]
        for row in range(dense.shape[1] - 2, -1, -1):
            bend = dense[step, row] + s * bend
        result: Array = (1.0 - s) * states[step] + s * (states[step + 1] + (1.0 - s) * bend)
        return result

    return interpolate
