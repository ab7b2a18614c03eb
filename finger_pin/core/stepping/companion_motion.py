"""The error of a run that outgrows a linearised flow: the difference to a motion that starts off by it.

Bristles that slip and stick again multiply a small error a hundredfold within a slip, and hold a larger one: it slips
with them and stops where they stop. The flow linearised along the motion knows of the first only. So where the error
carried along has grown too large to be believed, a second motion starts where it was small, off by what it was there,
and goes along until it is small again. Its steps are more exact, so that what is apart is also what the run's own
steps add.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from finger_pin.core.stepping import rosenbrock as core
from finger_pin.core.stepping.island_stepper import Part
from finger_pin.typing import Array

# So many steps lie between two looks.
_STEPS = 128
# So many times as many may a second motion take between them.
_MOST = 8
# An error of more than so many tolerances, rad or m, or at any tolerance of more than that, is followed by a second
# motion until it is less than so large a share of that. It starts where the error was less than another share last,
# or so many looks ago.
_LARGE, _LARGEST, _SMALL, _LEAST, _LOOKS = 3e3, 3e-2, 1.0 / 30.0, 1.0 / 300.0, 64
# Its tolerances are so large a share of the run's. What it is more than so far apart from, rad or m, is another motion.
_TIGHTER, _OTHER = 0.25, 0.1


class Moment(NamedTuple):
    """A moment of an island: its time, s, state, quaternions, memory, and the error carried along."""

    time: float
    x: Array
    attitude: Array
    memory: Array
    drift: Array


class Companion:
    """Follows the error of an island.

    Attributes:
        lost: Whether the error has grown beyond all bounds: it is followed no more.
    """

    lost = False

    def __init__(self, part: Part) -> None:
        """Begin at an island's present state."""
        self._part = part
        turning = np.concatenate([part.joints, part.objects])
        self._large = min(_LARGE * max(part.rtol, float(np.max(part.atol[turning], initial=0.0))), _LARGEST)
        self._seen = [self._now()]
        self._second: Part | None = None
        self._room = part.room(0)

    def look(self, steps: int = _STEPS) -> None:
        """Look at the error, if so many steps have been taken since the last time."""
        part, before = self._part, self._seen[-1]
        if self.lost or part.memory[core.ACCEPTED] - before.memory[core.ACCEPTED] < steps:
            return
        self._seen = [*self._seen[-_LOOKS:], self._now()]
        size = _size(part, part.drift)
        if self._second is None and size > self._large:
            self._second = self._off_by_the_error()
        if self._second is not None:
            self._follow(self._second)
        elif size < _LEAST * self._large:
            self._seen = self._seen[-1:]

    def _now(self) -> Moment:
        part = self._part
        return Moment(part.time, *(each.copy() for each in (part.x, part.attitude, part.memory, part.drift)))

    def _off_by_the_error(self) -> Part:
        """Return a second motion that starts off by the error of the first moment seen."""
        begin = self._seen[0]
        second = self._part.copy(judged=False, tolerances=_TIGHTER)
        second.knots = self._part.knots
        second.restart(begin.x + begin.drift, begin.attitude, begin.time)
        second.memory[core.STEP] = begin.memory[core.STEP]
        # What takes so much longer is no neighbour any more.
        self._room = self._part.room(_MOST * _STEPS)
        return second

    def _follow(self, second: Part) -> None:
        """Replace the error by the difference to the second motion, unless that is another one."""
        part, (begin, *later) = self._part, self._seen
        sums, error, time = begin.memory[[core.DRIFT, core.OBJECT_DRIFT]], begin.drift, begin.time
        for moment in later:
            if not _size(part, error) < _OTHER or second.advance(moment.time, self._room)[0] != core.DONE:
                break
            other = difference(part, moment, second)
            means = [max(_mean(each[places]) for each in (error, other)) for places in (part.joints, part.objects)]
            sums, time, error = sums + (moment.time - time) * np.array(means), moment.time, other
        self.lost = time < later[-1].time or not _size(part, error) < _OTHER
        if self.lost:
            return
        part.drift[:], part.memory[[core.DRIFT, core.OBJECT_DRIFT]], part.memory[core.BEHIND] = error, sums, 0.0
        self._seen = [self._now()]
        if _size(part, error) < _SMALL * self._large:
            self._second, self._room = None, part.room(0)


def difference(part: Part, moment: Moment, other: Part) -> Array:
    """Return the difference of another state of an island to that at a moment, in the chart of that, shape (size,).

    Angles of free bodies are those about the body's axes from one attitude to the other; angular velocities, known in
    either body's frame, become rates of these angles.
    """
    found: Array = other.x - moment.x
    width = len(part.tables.guided)
    for i, turn in zip(part.tables.charts, _turns(moment.attitude, other.attitude), strict=True):
        x, y = moment.x[width + i : width + i + 2]
        found[i : i + 3] = turn
        found[width + i : width + i + 3] += (-y * turn[2], x * turn[2], -x * turn[1])
    return found


def _turns(one: Array, other: Array) -> Array:
    """Return the turns from unit quaternions (x, y, z, w) to others, about the bodies' axes, shape (f, 3), rad."""
    axes = one[:, 3:] * other[:, :3] - other[:, 3:] * one[:, :3] - np.cross(one[:, :3], other[:, :3])
    cosines = np.sum(one * other, axis=1, keepdims=True)
    sines = np.linalg.norm(axes, axis=1, keepdims=True)
    angles = 2.0 * np.arctan2(sines, np.abs(cosines))
    turns: Array = np.copysign(1.0, cosines) * axes * np.where(sines > 0.0, angles / np.maximum(sines, 1e-300), 0.0)
    return turns


def _mean(values: Array) -> float:
    return float(np.mean(values**2)) if len(values) else 0.0


def _size(part: Part, drift: Array) -> float:
    """Return an error, root mean square over joints or over places and turns of objects, whichever is more."""
    return float(np.sqrt(max(_mean(drift[part.joints]), _mean(drift[part.objects]))))
