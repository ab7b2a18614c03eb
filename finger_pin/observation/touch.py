"""Whether something presses on tips, and whether a model fits its readings, over the periods of an observer."""

from __future__ import annotations

import numpy as np
import scipy.stats
from numpy.typing import NDArray

from finger_pin.observation.filter import JUMP

# F^T P^-1 F from which a force presses, and below which none does any more: what its noise alone passes once in a
# thousand and in two times; and how long it must be beyond, s.
_TOUCH, _LET_GO = (float(scipy.stats.chi2.ppf(level, 3)) for level in (0.999, 0.5))
_TOUCH_TIME = 0.01
# Time over which innovations are averaged, s.
_CONSISTENCY_TIME = 0.2


class TouchMonitor:
    """Touches of some tips, and the consistency of innovations.

    Attributes:
        since: When a force began to press on each tip, shape (f,), s; NaN where none does.
        consistency: Mean square of the last innovations over their standard deviations.
    """

    def __init__(self, tips: int) -> None:
        """Start where nothing touches."""
        self.since, self._beyond_since, self.consistency = np.full(tips, np.nan), np.full(tips, np.nan), 1.0

    @property
    def touched(self) -> NDArray[np.bool_]:
        """Whether a force presses on each tip, shape (f,)."""
        touched: NDArray[np.bool_] = self.since == self.since
        return touched

    def follow(self, innovations: list[float], distances: list[float], time: float, h: float) -> None:
        """Go on by a period, s, to a time, s.

        Args:
            innovations: Over their standard deviations, NaN for readings that are missing.
            distances: F^T P^-1 F of the force at each tip.
            time: s.
            h: s.
        """
        # Jumps that are not taken count as well, but one alone says little.
        squares = [min(each * each, JUMP * JUMP) for each in innovations if each == each]
        if squares:
            self.consistency += min(1.0, h / _CONSISTENCY_TIME) * (sum(squares) / len(squares) - self.consistency)
        for k, distance in enumerate(distances):
            if distance < (_LET_GO if self.since[k] == self.since[k] else _TOUCH):
                self.since[k] = self._beyond_since[k] = np.nan
            elif self._beyond_since[k] != self._beyond_since[k]:
                self._beyond_since[k] = time
            elif time - self._beyond_since[k] >= _TOUCH_TIME:
                self.since[k] = self._beyond_since[k]
