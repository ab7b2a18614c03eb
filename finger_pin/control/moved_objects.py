"""Prescribed motions of objects, which no load changes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from finger_pin.description.objects import PATH
from finger_pin.description.palm import PathSignal
from finger_pin.description.routing import Array
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.surroundings import POSE, VELOCITY
from finger_pin.references.signal import Signal

_STILL = PathSignal()


@dataclass(frozen=True, eq=False)
class Guides:
    """The paths of k objects.

    Attributes:
        signal: Of each its displacement along x, y, z, m, and three turns, which are zero: 6 k functions of time.
        places: Which of the objects that move they are, shape (k,).
        gravity: In the base frame, shape (3,), m/s2.
    """

    signal: Signal
    places: Array
    gravity: Array

    @classmethod
    def of(cls, finger: Finger, start: float, tolerance: float) -> Guides | None:
        """Return the paths of the moved objects around a finger from a time on, s, or None.

        The tolerance is that of `Signal.from_settings`.
        """
        around = finger.surroundings
        paths = {} if around is None else {name: each.path for name, each in around.free.items() if each.path}
        if around is None or not paths:
            return None
        settings = [path.get(axis, _STILL) for path in paths.values() for axis in (*PATH, "", "", "")]
        names = list(around.free)
        places = np.array([names.index(name) for name in paths])
        return cls(
            Signal.from_settings(settings, tolerance).later(start), places, np.array(around.body.model.gravity.linear)
        )

    def place(self, finger: Finger, x: Array) -> Array:
        """Return a packed state with the objects at the beginnings of their paths."""
        state = finger.layout.unpack(x)
        assert state.object_pose is not None and state.object_velocity is not None
        value, rate = (each.reshape(-1, 6)[:, :3] for each in self.signal.at(0.0))
        state.object_pose.reshape(-1, POSE)[self.places, :3] += value
        state.object_velocity.reshape(-1, VELOCITY)[self.places, :3] = rate
        return x

    def base(self, time: Array | float) -> Array:
        """Return the 27 numbers of `laws.palm` for a base at rest, and the 6 k accelerations, at times (...)."""
        acceleration = self.signal.derivative(time, 2)
        rest = np.zeros((*np.shape(time), 27))
        rest[..., 9:12], rest[..., 12:15] = -self.gravity, self.gravity
        return np.concatenate([rest, acceleration], axis=-1)
