"""Pace of playing: how much is due, whether a frame takes too long, and how fast time really runs."""

from __future__ import annotations

import time
from collections.abc import Callable

#: Frames per second that are aimed at.
FRAME_RATE = 60.0
# Most wall time of a frame's steps, and of what is still owed from before, s.
_LONGEST, _OWED = 1.0 / 30.0, 0.1
# Time over which the rate is averaged, s; below this part of the wish, time is called slow.
_AVERAGED, _SLOW = 0.7, 0.9


class Pacer:
    """Keeps simulated time with the wall's, as far as the machine can.

    Attributes:
        speed: Simulated seconds per second that are wished for.
        rate: Simulated seconds per second as they have come.
    """

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        """Start now, by a clock in s."""
        self._clock, self.speed = clock, 1.0
        self.restart()

    def restart(self) -> None:
        """Restart the clock, such as after a pause."""
        self.rate, self._owed, self._begun = self.speed, 0.0, self._clock()

    def due(self) -> float:
        """Begin a frame; return the simulated time that is due, s."""
        now = self._clock()
        self._wall, self._begun = now - self._begun, now
        # What the machine could not do is not caught up with: time runs slower.
        self._owed = min(self._owed + self.speed * self._wall, self.speed * _OWED)
        return self._owed

    @property
    def late(self) -> bool:
        """True once the steps of this frame have taken as long as they may."""
        return self._clock() - self._begun > _LONGEST

    def stepped(self, simulated: float) -> None:
        """End a frame, in which so much time was simulated, s."""
        self._owed -= simulated
        if self._wall > 0.0:
            share = min(self._wall / _AVERAGED, 1.0)
            self.rate += share * (simulated / self._wall - self.rate)

    @property
    def slow(self) -> bool:
        """True where the machine cannot follow."""
        return self.rate < _SLOW * self.speed

    def rest(self) -> float:
        """Return how long to wait for the next frame, s."""
        return max(0.0, self._begun + 1.0 / FRAME_RATE - self._clock())
