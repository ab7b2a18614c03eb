"""Inputs that act some time after they were commanded, each after a delay of its own."""

from __future__ import annotations

import numpy as np

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.routing import Routing
from finger_pin.typing import Array

# Arrivals within this time, s, coincide: a step between them would have no length.
_TIME_TOLERANCE = 1e-12


def input_delays(finger: FingerDescription, routing: Routing) -> Array:
    """Return the delays of all inputs, shape (u,), s: none of actuated tendons, then those of a tree's actuators."""
    return np.array([*np.zeros(routing.actuated), *(each.delay for each in finger.tree.actuators.values())])


class InputQueue:
    """Commands on their way; an input is zero until its first one arrives.

    Attributes:
        delays: Of each input, shape (u,), s.
    """

    def __init__(self, delays: Array) -> None:
        """Create an empty queue."""
        self.delays, self._longest = delays, float(np.max(delays, initial=0.0))
        self._values = np.zeros(len(delays))
        self._pending: list[tuple[float, Array]] = []

    def add(self, time: float, values: Array) -> None:
        """Command values, shape (u,), at a time, s, not before those of earlier commands."""
        if self._longest:
            self._pending.append((time, values))
        else:
            self._values = values

    def at(self, time: float) -> Array:
        """Return the values that have arrived by a time, s, shape (u,); never ask for an earlier one again."""
        if self._pending:
            latest = time + _TIME_TOLERANCE
            for commanded, values in self._pending:
                self._values = np.where(commanded + self.delays <= latest, values, self._values)
            self._pending = [each for each in self._pending if each[0] + self._longest > latest]
        return self._values

    def next_arrival(self, time: float, end: float) -> float:
        """Return when the next value arrives after a time, s, at most the end."""
        if not self._pending:
            return end
        arrivals = [commanded + delay for commanded, _ in self._pending for delay in set(self.delays.tolist())]
        return min([each for each in arrivals if time + _TIME_TOLERANCE < each < end - _TIME_TOLERANCE], default=end)

    def copy(self) -> InputQueue:
        """Return a copy that goes on by itself."""
        twin = InputQueue(self.delays)
        twin._values, twin._pending = self._values, self._pending[:]
        return twin
