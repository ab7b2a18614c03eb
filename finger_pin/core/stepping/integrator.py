"""Integration of a stepper to a trajectory that can be evaluated anywhere."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from typing import Protocol

import numpy as np

from finger_pin.cancellation import Stop
from finger_pin.core.stepping.island_motion import IslandMotion
from finger_pin.core.stepping.island_stepper import IslandIntegrator, failure
from finger_pin.core.stepping.packed_steps import PackedSteps
from finger_pin.core.stepping.stepper import Stepper
from finger_pin.core.steps import integration as core
from finger_pin.core.steps.repetition import Steps
from finger_pin.core.steps.trajectory import Statistics, Trajectory, Watch
from finger_pin.exceptions import SlowRunWarning
from finger_pin.threads import in_threads
from finger_pin.typing import Array

# The steps of a trajectory are kept in memory; this much of it, in bytes, holds millions of steps.
_MOST_BYTES = 2e9
# Room for so many of an island's to begin with; what is not used of it takes no memory.
_FIRST_RECORD_LENGTH = 8192
# Steps with contacts that are packed at once.
_PACKED_LENGTH = 256

# After so long, s, a run is slow that has at least as long before it and has simulated less than this part of it.
_PATIENCE, _SLOW_SHARE = 10.0, 0.1

# Slices of a simulation of several islands, between which it can be watched.
_WATCHED_SLICES = 200


class SampledController(Protocol):
    """Controller that sets tensions at sample times and holds them in between."""

    @property
    def instant(self) -> float:
        """The time of the controller's next action, s."""

    def act(self, x: Array) -> Array:
        """Return the tensions from this instant on, shape (a,), at the packed state."""


class Moving(Protocol):
    """The motion of an island."""

    def interpolate(self, at: Array) -> tuple[Array, Array]:
        """Return states at times, shape (m, size), and the quaternions from which angles count, shape (m, f, 4)."""


class _Recorder:
    """Integration of one island that keeps its steps."""

    def __init__(self, stepper: Stepper, index: int, chunk: int) -> None:
        self._stepper, self._index = stepper, index
        part = self.part
        self.start = (part.time, part.x.copy(), part.attitude.copy())
        # Of what touches nothing all is kept where it is recorded.
        self._packed = PackedSteps(part.structure, part.x) if part.structure.contact_rows else None
        self.room, self._chunk = part.room(_FIRST_RECORD_LENGTH if self._packed is None else _PACKED_LENGTH), chunk
        self.step_count = self._used = 0
        # Compiling is no part of an integration's cost.
        part.ready(self.room)[1].compile()

    def advance(self, end: float, chunks: int = -1) -> int:
        """Go to a time, or until some chunks are full; return the status."""
        part = self.part
        while chunks != 0:
            if self._used == len(self.room.times):
                self._make_room()
            before = self._used
            status, self._used = part.advance(end, self.room, slice(before, before + self._chunk))
            self.step_count += self._used - before
            chunks -= 1
            if status != core.FULL or self.is_full:
                return status
        return core.DONE

    def _make_room(self) -> None:
        if self._packed is None:
            self.room = self.room.doubled()
        else:
            self._packed.add(self.room)
            self._used = 0

    @property
    def is_full(self) -> bool:
        """Whether the steps take all the memory that is for them."""
        size = len(self.part.x) if self._packed is None else int(np.count_nonzero(self._packed.stored))
        return 8 * size * (1 + len(self.part.tableau.dense)) * self.step_count >= _MOST_BYTES

    @property
    def part(self) -> IslandIntegrator:
        """The stepper of the island; loading a force replaces it."""
        return self._stepper.parts[self._index]

    def reason(self, status: int, duration: float, names: Sequence[str]) -> str:
        """Return why a status ends the integration, empty if it does not; ``names`` are those of the state."""
        if status > core.FULL:
            return failure(self.part, status, [names[at] for at in self._stepper.places(self.part.island)])
        if self.is_full and self.part.time < duration:
            return f"after {self.step_count} steps the trajectory has reached the most that is kept in memory"
        return ""

    def limiting_state(self, names: Sequence[str]) -> str:
        """Return the name of the number of the state whose error was largest in the last step."""
        return names[self._stepper.places(self.part.island)[int(self.part.memory.limiting_state[0])]]

    def steps(self) -> IslandMotion:
        """Return the steps that were taken."""
        record, columns = self.room.first(self._used), np.arange(len(self.part.x))
        if self._packed is not None:
            self._packed.add(record)
            record, columns = self._packed.joined(), np.flatnonzero(self._packed.stored)
        return IslandMotion(self._stepper.mechanism, self.part, *self.start, record, columns)


def integrate_compiled(
    stepper: Stepper,
    duration: float,
    names: tuple[str, ...],
    *,
    controller: SampledController | None = None,
    knots: Array | None = None,
    watch: Watch | None = None,
    chunk: int = 256,
    together: bool = False,
    stop: Stop | None = None,
) -> Trajectory:
    """Integrate from a stepper's present state with the compiled core, island by island.

    Args:
        stepper: State to start from, method and tolerances.
        duration: Time of the end, s.
        names: Names of the numbers of the state, for messages.
        controller: Controller that holds its tensions between sample times.
        knots: Times at which an input bends or jumps, in order, s: steps end there.
        watch: Called with the simulated time that all have reached and the state after every chunk of steps.
        chunk: Most steps between two calls.
        together: Whether islands stop at the same times to be watched, which cuts some of their steps; otherwise a
            state that is watched has each where it has got to.
        stop: Asked now and then; true ends the integration there.
    """
    if knots is not None:
        stepper.end_steps_at(knots[(knots > stepper.time) & (knots < duration)])
    # Of a controller that acts in between, the linearised flow knows nothing.
    keeps_islands = controller is None and not stepper.driven
    recorders = [_Recorder(stepper, index, chunk) for index in range(len(stepper.parts))]
    began, start, warned = time.perf_counter(), stepper.time, False
    alone = len(recorders) == 1
    reason, interrupted = "", False
    while stepper.time < duration and not reason and not interrupted:
        sliced = together and not alone
        end, chunks = _next_end(stepper, duration, controller, sliced), -1 if sliced else 1
        statuses = in_threads(partial(_Recorder.advance, end=end, chunks=chunks), recorders)
        for recorder, status in zip(recorders, statuses, strict=True):
            reason = reason or recorder.reason(status, duration, names)
        if not warned and time.perf_counter() - began > _PATIENCE:
            span = start, stepper.time, duration
            warned = _warn_if_slow(recorders, span, time.perf_counter() - began, names)
        if watch is not None:
            watch(stepper.time, stepper.x)
        interrupted = stop is not None and not reason and stepper.time < duration and stop()
    steps = [recorder.steps() for recorder in recorders]
    ends = np.unique(np.concatenate([each.times for each in steps]))
    return Trajectory(
        breakpoints=ends[ends <= stepper.time],
        interpolate=packed_interpolant(stepper, steps),
        statistics=_statistics(recorders, time.perf_counter() - began),
        failure=reason,
        interrupted=interrupted,
        # Inputs that are held in between are not the core's own.
        islands=() if not keeps_islands or stepper.holds_inputs else tuple(steps),
        steps=tuple(Steps(each.record.times, each.record.shares, each.record.branches) for each in steps),
    )


def _warn_if_slow(
    recorders: Sequence[_Recorder], span: tuple[float, float, float], elapsed: float, names: Sequence[str]
) -> bool:
    """Warn of a run that is slow for what it simulates, with its steps and what keeps them short; return whether."""
    start, now, end = span
    simulated = now - start
    if simulated > _SLOW_SHARE * elapsed or (end - now) * elapsed < _PATIENCE * simulated:
        return False
    slowest = max(recorders, key=lambda recorder: recorder.step_count)
    count = slowest.step_count
    remaining = f", at this rate {(end - now) * elapsed / simulated:.3g} s more" if simulated > 0.0 else ""
    warnings.warn(
        f"t = {now:.3g} s of {end:.3g} s after {elapsed:.3g} s{remaining}: {count} steps, {count / elapsed:.3g} a "
        f"second, of {simulated / max(count, 1):.1g} s on average; what keeps them short is "
        f"{slowest.limiting_state(names)}",
        SlowRunWarning,
        stacklevel=7,
    )
    return True


def _next_end(stepper: Stepper, duration: float, controller: SampledController | None, sliced: bool) -> float:
    """Let a controller that is due act, and return the next time at which islands synchronise."""
    if controller is None:
        return min(duration, stepper.time + duration / _WATCHED_SLICES) if sliced else duration
    if stepper.time >= controller.instant:
        stepper.hold(controller.act(stepper.x))
    return min(duration, controller.instant)


def _statistics(recorders: Sequence[_Recorder], wall_time: float) -> Statistics:
    """Return the statistics of all islands together."""
    steps = sum(recorder.step_count for recorder in recorders)
    memories = [recorder.part.memory for recorder in recorders]
    evaluations = int(sum(each.evaluations[0] for each in memories))
    jacobians = int(sum(each.jacobians[0] for each in memories))
    factorisations = int(sum(each.factorisations[0] for each in memories))
    return Statistics(steps, evaluations, jacobians, factorisations, wall_time)


def packed_interpolant(stepper: Stepper, steps: Sequence[Moving]) -> Callable[[Array], Array]:
    """Return the function from times to packed states, from the steps of all islands."""

    def interpolate(at: Array) -> Array:
        motions = [each.interpolate(at) for each in steps]
        if len(steps) == 1 and not motions[0][1].size:
            return motions[0][0]
        return stepper.to_packed([state for state, _ in motions], [attitude for _, attitude in motions])

    return interpolate
