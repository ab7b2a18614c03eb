"""The error of a run where it outgrows a linearised flow: the difference to a motion that starts off by it.

Bristles that slip and stick again multiply a small error a hundredfold within a slip, and hold a larger one: it slips
with them and stops where they stop. The flow linearised along the motion knows of the first only. So where the error
carried along has grown too large to be believed, the last steps are taken again from the state that is off by the error
with which they began, and what is apart at their end is the error there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from finger_pin.core.stepping import rosenbrock as core
from finger_pin.core.stepping.island_stepper import Part
from finger_pin.description.routing import Array

# So many steps lie between two looks.
_STEPS = 128
# So many times as many may a second motion take between them.
_MOST = 8
# An error of more than so many tolerances, rad or m, or at any tolerance of more than that, is looked into from where
# it was less than so large a share of that, or from so many looks ago; if it was more than another share then: of what
# was less, most has been added by the steps themselves since.
_LARGE, _LARGEST, _SMALL, _LEAST, _LOOKS = 3e3, 3e-2, 1.0 / 30.0, 1.0 / 300.0, 4
# Of an error beyond the largest such a share is followed, which is what a run at tighter tolerances has left of it: the
# error is beyond all bounds where the share, too, grows beyond the largest.
_LEFT = 0.1


class Moment(NamedTuple):
    """A moment of an island: its time, s, state, quaternions, memory, and the error carried along."""

    time: float
    x: Array
    attitude: Array
    memory: Array
    drift: Array


class Twin:
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

    def look(self) -> None:
        """Look at the error, if enough steps have been taken since the last time."""
        part, before = self._part, self._seen[-1]
        if self.lost or part.memory[core.ACCEPTED] - before.memory[core.ACCEPTED] < _STEPS:
            return
        self._seen = [*self._seen[-_LOOKS:], self._now()]
        size = _size(part, part.drift)
        if size > self._large:
            if _size(part, self._seen[0].drift) > _LEAST * self._large:
                self._follow()
            self._seen = [self._now()]
            return
        if size < _SMALL * self._large:
            self._seen = self._seen[-1:]

    def _now(self) -> Moment:
        part = self._part
        return Moment(part.time, *(each.copy() for each in (part.x, part.attitude, part.memory, part.drift)))

    def _follow(self) -> None:
        """Replace the error by the difference to a motion that starts off by that of the first moment seen.

        Of an error beyond the largest it starts off by a share that is not, and what is apart is that share of it.
        """
        part, (begin, *later) = self._part, self._seen
        share = 1.0
        while _LARGEST < share * _size(part, begin.drift) < np.inf:
            share *= _LEFT
        twin = part.copy(judged=False)
        twin.knots = part.knots
        twin.restart(begin.x + share * begin.drift, begin.attitude, begin.time)
        twin.memory[core.STEP] = begin.memory[core.STEP]
        sums, error, time = begin.memory[[core.DRIFT, core.OBJECT_DRIFT]], begin.drift, begin.time
        # What takes so much longer is no neighbour any more.
        room = part.room(_MOST * _STEPS)
        for moment in later:
            if twin.advance(moment.time, room)[0] != core.DONE:
                return
            other = difference(part, moment, twin) / share
            means = [max(_mean(each[places]) for each in (error, other)) for places in (part.joints, part.objects)]
            sums, time, error = sums + (moment.time - time) * np.minimum(means, 1.0), moment.time, other
        found = _size(part, error)
        self.lost = share < 1.0 and share * found > _LARGEST
        if found < _size(part, part.drift):
            part.drift[:], part.memory[[core.DRIFT, core.OBJECT_DRIFT]], part.memory[core.BEHIND] = error, sums, 0.0


def difference(part: Part, moment: Moment, other: Part) -> Array:
    """Return the difference of another state of an island to that at a moment, in the chart of that, shape (size,).

    Angles of free bodies are those about the body's axes from one attitude to the other; angular velocities, known in
    either body's frame, become rates of these angles.
    """
    found: Array = other.x - moment.x
    width = len(part.tables.parents) + len(part.tables.lumps)
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
