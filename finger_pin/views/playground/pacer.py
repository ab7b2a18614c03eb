"""Pace of playing: simulated time per frame, limits of a frame, and the actual rate of time."""

from __future__ import annotations

import time
from collections.abc import Callable

#: Frames per second that are aimed at.
FRAME_RATE = 60.0
# Most wall time of a frame's steps, and of what is still owed from before, s.
_MAX_STEP_TIME, _MAX_BACKLOG = 1.0 / 30.0, 0.1
# Time over which the rate is averaged, s; below this part of the wish, time is called slow.
_AVERAGING_TIME, _SLOW_RATE = 0.7, 0.9


class Pacer:
    """Clock that keeps simulated time in pace with wall time, as far as the machine can.

    Attributes:
        speed: Desired simulated seconds per second.
        rate: Actual simulated seconds per second.
    """

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        """Start now, by a clock in s."""
        self._clock, self.speed = clock, 1.0
        self.restart()

    def restart(self) -> None:
        """Restart the clock, such as after a pause."""
        self.rate, self._backlog, self._frame_start = self.speed, 0.0, self._clock()

    def start_frame(self) -> float:
        """Start a frame; return the simulated time that is due, s."""
        now = self._clock()
        self._frame_time, self._frame_start = now - self._frame_start, now
        # A larger backlog is dropped: time runs slower.
        self._backlog = min(self._backlog + self.speed * self._frame_time, self.speed * _MAX_BACKLOG)
        return self._backlog

    @property
    def is_late(self) -> bool:
        """True once the steps of this frame have taken as long as they may."""
        return self._clock() - self._frame_start > _MAX_STEP_TIME

    def finish_frame(self, simulated: float) -> None:
        """End a frame, with the simulated time in it, s."""
        self._backlog -= simulated
        if self._frame_time > 0.0:
            share = min(self._frame_time / _AVERAGING_TIME, 1.0)
            self.rate += share * (simulated / self._frame_time - self.rate)

    @property
    def is_slow(self) -> bool:
        """True where the machine cannot follow."""
        return self.rate < _SLOW_RATE * self.speed

    def idle_time(self) -> float:
        """Return the time to wait for the next frame, s."""
        return max(0.0, self._frame_start + 1.0 / FRAME_RATE - self._clock())
