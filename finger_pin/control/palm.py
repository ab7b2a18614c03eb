"""A palm that moves along a prescribed path: the inertial forces that its motion brings act on every link."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from finger_pin.description.hand import HandSettings
from finger_pin.description.palm import PATH
from finger_pin.description.routing import Array
from finger_pin.laws.palm import base_motion
from finger_pin.mechanism.finger import Finger
from finger_pin.references.signal import Signal


@dataclass(frozen=True, eq=False)
class PalmPath:
    """The path of the palm, and the inertial forces in its frame.

    Attributes:
        signal: x, y, z, m, and roll, pitch, yaw, rad, over time.
        gravity: In the world, shape (3,), m/s2.
        carries: Whether objects stand in the world that the palm sees.
    """

    signal: Signal
    gravity: Array
    carries: bool

    @classmethod
    def of(
        cls, hand: HandSettings | None, start: float, finger: Finger | None = None, tolerance: float = 0.0
    ) -> PalmPath | None:
        """Return the path of a hand's palm from a time on, s; None if it rests. Around the finger objects stand.

        The tolerance is that of `Signal.from_settings`.
        """
        if hand is None or hand.palm.path is None:
            return None
        settings = [hand.palm.on_path(name) for name in PATH]
        carries = finger is not None and bool(finger.layout.world)
        return cls(Signal.from_settings(settings, tolerance).later(start), np.array(hand.gravity), carries)

    def place(self, time: Array | float) -> tuple[Array, Array]:
        """Return the palm's place, shape (..., 3), m, and rotation to the world, (..., 3, 3), at times (...)."""
        at = self.signal.at(time)[0]
        (a, b, c), (d, e, f) = (np.moveaxis(each(at[..., 3:]), -1, 0) for each in (np.cos, np.sin))
        rows = [
            [b * c, e * d * c - a * f, e * a * c + d * f],
            [b * f, e * d * f + a * c, e * a * f - d * c],
            [-e, b * d, b * a],
        ]
        return at[..., :3], np.moveaxis(np.array(rows), (0, 1), (-2, -1))

    def put(self, finger: Finger, x: Array) -> Array:
        """Return a packed state with the world's placement at the start, seen from the palm."""
        if self.carries:
            state = finger.layout.unpack(x)
            assert state.world_position is not None and state.world_velocity is not None
            state.world_position[:], state.world_velocity[:] = (self._world(order, 0.0) for order in range(2))
        return x

    def _world(self, order: int, time: Array | float) -> Array:
        """Return a derivative of the coordinates of the world that the palm sees, shape (..., 6)."""
        return -np.roll(self.signal.derivative(time, order), 3, axis=-1)

    def base(self, time: Array | float) -> Array:
        """Return the 27 numbers of `base_motion`, and accelerations of a world that it sees, shape (..., 27 or 33)."""
        place, first, second, third = (np.moveaxis(self.signal.derivative(time, order), -1, 0) for order in range(4))
        turns = [each(angle) for angle in place[3:] for each in (np.sin, np.cos)]
        found = base_motion(first, second, third, turns, self.gravity)
        numbers = np.stack(np.broadcast_arrays(*found), axis=-1)
        return np.concatenate([numbers, self._world(2, time)], axis=-1) if self.carries else numbers

    def velocity(self, time: Array) -> tuple[Array, Array]:
        """Return the palm's velocity, m/s, and angular velocity, rad/s, along the world's axes, shape (m, 3)."""
        at, rate = self.signal.at(time)
        sp, cp, sy, cy = np.sin(at[..., 4]), np.cos(at[..., 4]), np.sin(at[..., 5]), np.cos(at[..., 5])
        roll, pitch, yaw = np.moveaxis(rate[..., 3:], -1, 0)
        # About the axes of yaw, pitch and roll, each turned by those before it.
        turning = [roll * cp * cy - pitch * sy, roll * cp * sy + pitch * cy, yaw - roll * sp]
        return rate[..., :3], np.stack(turning, axis=-1)

    def lifted(self, time: Array, mass: float) -> Array:
        """Return the potential energy that a mass gains with the palm's height at times (m,), J."""
        return np.asarray(-mass * self.place(time)[0] @ self.gravity)
