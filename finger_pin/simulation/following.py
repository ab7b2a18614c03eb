"""A motion evaluated while it is integrated: when the last step is done, most of the result is known."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np

from finger_pin.control.closed_loop import ClosedLoop, LoopSignals
from finger_pin.core.evaluation import CompiledFinger
from finger_pin.description.routing import Array
from finger_pin.mechanism.kinematics import Motion
from finger_pin.simulation.account import Works, saved


class Following:
    """Takes steps as they come, and evaluates them in a second thread.

    Compiled code holds no lock of Python, so that integration and evaluation run side by side. What commands the loop
    must be a function of time and state, and nobody else may evaluate with the loop's dynamics meanwhile.
    """

    def __init__(self, loop: ClosedLoop, times: Array) -> None:
        """Make room for what happens at the saved times, shape (m,)."""
        assert isinstance(loop.dynamics, CompiledFinger)
        self._loop, self._times, self._works = loop, times, Works(loop, times)
        self._mechanism = loop.dynamics.mechanism
        self._thread = ThreadPoolExecutor(1)
        self._room = self._thread.submit(self._mechanism.room, len(times))
        self._evaluated: list[Future[None]] = []

    def add(self, ends: Array, states: Callable[[Array], Array]) -> None:
        """Take steps, given by their ends with the start first, and what maps times to packed states."""
        self._evaluated.append(self._thread.submit(self._evaluate, ends, states))

    def _evaluate(self, ends: Array, states: Callable[[Array], Array]) -> None:
        part = saved(self._times, ends)
        times = self._times[part]
        # A motion at the edge of what numbers hold has energies beyond it.
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            self._loop.fill(self._room.result().part(part), times, states(times))
            self._works.add(ends, states)

    def finish(self, count: int) -> tuple[LoopSignals, Motion, Array] | None:
        """Wait until all steps that came are evaluated.

        Returns:
            All signals at so many of the saved times, the motion there, and the integrals of all powers up to them;
            nothing if no steps came.
        """
        with self._thread:
            for each in self._evaluated:
                each.result()
            if not self._evaluated:
                return None
            times, room, works = self._times[:count], self._room.result().part(slice(count)), self._works.values[:count]
            motion = self._thread.submit(self._loop.motion, times, self._loop.finger.layout.unpack(room.packed))
            signals = self._loop.evaluate(times, room.packed, self._mechanism.found(room))
            return signals, motion.result(), works
