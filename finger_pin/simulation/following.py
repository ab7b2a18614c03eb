"""A motion evaluated while it is integrated: when the last step is done, most of the result is known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import fields, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from finger_pin.control.closed_loop import ClosedLoop, LoopSignals
from finger_pin.control.proportional import ControlSignals
from finger_pin.control.reference import ReferenceSignals
from finger_pin.core.evaluation import CompiledFinger, Room
from finger_pin.description.routing import Array
from finger_pin.mechanism.kinematics import Motion
from finger_pin.simulation.account import Works, saved

_Signals = TypeVar("_Signals", ReferenceSignals, ControlSignals)


class Following:
    """Takes steps as they come, and evaluates them in a second thread.

    Compiled code holds no lock of Python, so that integration and evaluation run side by side. What commands the loop
    must be a function of time and state, and nobody else may evaluate with the loop's dynamics meanwhile.
    """

    def __init__(self, loop: ClosedLoop, times: Array, thread: ThreadPoolExecutor) -> None:
        """Keep what happens at the saved times, shape (m,), found by a thread that may have something else to do."""
        assert isinstance(loop.dynamics, CompiledFinger)
        self._loop, self._times, self._works, self._thread = loop, times, Works(loop, times), thread
        self._mechanism = loop.dynamics.mechanism
        self._evaluated: list[Future[tuple[ReferenceSignals, ControlSignals, Array]]] = []
        self._taken = 0

    @cached_property
    def _room(self) -> Room:
        return self._mechanism.room(len(self._times))

    def add(self, ends: Array, states: Callable[[Array], Array]) -> None:
        """Take steps, given by their ends with the start first, and what maps times to packed states."""
        self._evaluated.append(self._thread.submit(self._evaluate, ends, states))

    def _evaluate(
        self, ends: Array, states: Callable[[Array], Array]
    ) -> tuple[ReferenceSignals, ControlSignals, Array]:
        # A time at the end of a piece is not taken again at the begin of the next.
        part = slice(self._taken, saved(self._times, ends).stop)
        times, self._taken = self._times[part], part.stop
        # A motion at the edge of what numbers hold has energies beyond it.
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            self._works.add(ends, states)
            return self._loop.fill(self._room.part(part), times, states(times))

    def finish(self, count: int) -> tuple[LoopSignals, Motion, Array] | None:
        """Wait until all steps that came are evaluated.

        Returns:
            All signals at so many of the saved times, the motion there, and the integrals of all powers up to them;
            nothing if no steps came.
        """
        loop, works = self._loop, self._works.values[:count]
        if not self._evaluated:
            return None
        references, controls, commands = zip(*(each.result() for each in self._evaluated), strict=True)
        times, room = self._times[:count], self._room.part(slice(count))
        motion = self._thread.submit(loop.motion, times, loop.finger.layout.unpack(room.packed))
        found, command = self._mechanism.found(room), np.concatenate(commands)
        finger = loop.finger.signals(room.packed, command, loop.force(times), found)
        return LoopSignals(_joined(references), _joined(controls), finger), motion.result(), works


def _joined(pieces: Sequence[_Signals]) -> _Signals:
    """Return signals at all times, from those at times one after the other."""
    names = [field.name for field in fields(pieces[0]) if getattr(pieces[0], field.name) is not None]
    return replace(pieces[0], **{name: np.concatenate([getattr(each, name) for each in pieces]) for name in names})
