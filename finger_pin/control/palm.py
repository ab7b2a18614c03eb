"""A palm that moves along a prescribed path: the inertial forces that its motion brings act on every link."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from finger_pin.core.tables.inputs import InputTable, core_signal
from finger_pin.description.finger_description import HandSettings
from finger_pin.description.objects import PATH as OBJECT_PATH
from finger_pin.description.placement import PATH, PathSignal
from finger_pin.laws.input_functions import base_motion
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.object_scene import POSE, VELOCITY
from finger_pin.references.signal import Signal
from finger_pin.typing import Array

_NO_MOTION = PathSignal()


@dataclass(frozen=True, eq=False)
class PalmPath:
    """The path of the palm, and the inertial forces in its frame.

    Attributes:
        signal: x, y, z, m, and roll, pitch, yaw, rad, over time.
        gravity: In the world, shape (3,), m/s2.
        has_world_objects: Whether objects stand in the world that the palm sees.
    """

    signal: Signal
    gravity: Array
    has_world_objects: bool

    @classmethod
    def from_hand(
        cls, hand: HandSettings | None, start: float, finger: Finger | None = None, tolerance: float = 0.0
    ) -> PalmPath | None:
        """Return the path of a hand's palm from a time on, s; None if it rests.

        The tolerance is that of `Signal.from_settings`; a finger says whether objects stand around it.
        """
        if hand is None or hand.palm.path is None:
            return None
        settings = [hand.palm.on_path(name) for name in PATH]
        has_world_objects = finger is not None and bool(finger.layout.names_of("world_position"))
        return cls(
            Signal.from_settings(settings, tolerance).starting_at(start), np.array(hand.gravity), has_world_objects
        )

    def place(self, time: Array | float) -> tuple[Array, Array]:
        """Return the palm's place, shape (..., 3), m, and rotation to the world, (..., 3, 3), at times (...)."""
        coordinates = self.signal.at(time)[0]
        (a, b, c), (d, e, f) = (np.moveaxis(each(coordinates[..., 3:]), -1, 0) for each in (np.cos, np.sin))
        rows = [
            [b * c, e * d * c - a * f, e * a * c + d * f],
            [b * f, e * d * f + a * c, e * a * f - d * c],
            [-e, b * d, b * a],
        ]
        return coordinates[..., :3], np.moveaxis(np.array(rows), (0, 1), (-2, -1))

    def place_world(self, finger: Finger, x: Array) -> Array:
        """Return a packed state with the world's placement at the start, seen from the palm."""
        if self.has_world_objects:
            state = finger.layout.unpack(x)
            state.world_position[:], state.world_velocity[:] = (self._world(order, 0.0) for order in range(2))
        return x

    def _world(self, order: int, time: Array | float) -> Array:
        """Return a derivative of the coordinates of the world that the palm sees, shape (..., 6)."""
        return -np.roll(self.signal.derivative(time, order), 3, axis=-1)

    def base(self, time: Array | float) -> Array:
        """Return the 27 numbers of `base_motion`, and six accelerations of a moving world, shape (..., 27 or 33)."""
        place, first, second, third = (np.moveaxis(self.signal.derivative(time, order), -1, 0) for order in range(4))
        turns = [each(angle) for angle in place[3:] for each in (np.sin, np.cos)]
        motion = base_motion(first, second, third, turns, self.gravity)
        numbers = np.stack(np.broadcast_arrays(*motion), axis=-1)
        return np.concatenate([numbers, self._world(2, time)], axis=-1) if self.has_world_objects else numbers

    def velocity(self, time: Array) -> tuple[Array, Array]:
        """Return the palm's velocity, m/s, and angular velocity, rad/s, along the world's axes, shape (m, 3)."""
        coordinates, rate = self.signal.at(time)
        pitch_angle, yaw_angle = coordinates[..., 4], coordinates[..., 5]
        sp, cp, sy, cy = np.sin(pitch_angle), np.cos(pitch_angle), np.sin(yaw_angle), np.cos(yaw_angle)
        roll, pitch, yaw = np.moveaxis(rate[..., 3:], -1, 0)
        # About the axes of yaw, pitch and roll, each turned by those before it.
        angular_velocity = [roll * cp * cy - pitch * sy, roll * cp * sy + pitch * cy, yaw - roll * sp]
        return rate[..., :3], np.stack(angular_velocity, axis=-1)

    def gravity_energy(self, time: Array, mass: float) -> Array:
        """Return the potential energy that a mass gains with the palm's height at times (m,), J."""
        return np.asarray(-mass * self.place(time)[0] @ self.gravity)


@dataclass(frozen=True, eq=False)
class PrescribedJoints:
    """The motion of all joints, along which something holds them.

    Attributes:
        signal: theta over time, n functions, rad.
        gravity: In the base frame, shape (3,), m/s2.
    """

    signal: Signal
    gravity: Array

    def place(self, finger: Finger, x: Array) -> Array:
        """Return a packed state with the joints at the beginning of their motion."""
        state = finger.layout.unpack(x)
        state.position[:], state.velocity[:] = self.signal.at(0.0)
        return x

    def base(self, time: Array | float) -> Array:
        """Return the 27 numbers of `base_motion` for a base at rest, and the n accelerations, at times (...)."""
        return _resting_base(self.gravity, self.signal.derivative(time, 2))


@dataclass(frozen=True, eq=False)
class PrescribedPaths:
    """The paths of j joints of a tree and of k objects.

    Attributes:
        signal: Of each joint its growth, rad or m, then of each object its displacement along x, y, z, m, and three
            turns, which are zero: j + 6 k functions of time.
        joints: Which of the joints they are, shape (j,).
        objects: Which of the objects that move they are, shape (k,).
        gravity: In the base frame, shape (3,), m/s2.
    """

    signal: Signal
    joints: NDArray[np.int64]
    objects: NDArray[np.int64]
    gravity: Array

    @classmethod
    def from_finger(cls, finger: Finger, start: float, tolerance: float) -> PrescribedPaths | None:
        """Return the paths of joints of a finger and of objects around it from a time on, s, or None.

        The tolerance is that of `Signal.from_settings`.
        """
        moving = {} if finger.scene is None else finger.scene.free
        on_paths = finger.description.tree.on_paths
        paths = {name: each.path for name, each in moving.items() if each.path}
        if not on_paths and not paths:
            return None
        settings = [path.get(axis, _NO_MOTION) for path in paths.values() for axis in (*OBJECT_PATH, "", "", "")]
        joints, objects = (
            np.array([names.index(name) for name in selected], dtype=np.int64)
            for names, selected in ((list(finger.routing.joints), on_paths), (list(moving), paths))
        )
        signal = Signal.from_settings([*on_paths.values(), *settings], tolerance).starting_at(start)
        return cls(signal, joints, objects, np.array(finger.rigid_body.model.gravity.linear))

    def place(self, finger: Finger, x: Array) -> Array:
        """Return a packed state with joints and objects at the beginnings of their paths."""
        state, split = finger.layout.unpack(x), len(self.joints)
        value, rate = self.signal.at(0.0)
        state.position[self.joints] += value[:split]
        state.velocity[self.joints] = rate[:split]
        state.object_pose.reshape(-1, POSE)[self.objects, :3] += value[split:].reshape(-1, VELOCITY)[:, :3]
        state.object_velocity.reshape(-1, VELOCITY)[self.objects, :3] = rate[split:].reshape(-1, VELOCITY)[:, :3]
        return x

    def base(self, time: Array | float) -> Array:
        """Return the 27 numbers of `base_motion` for a base at rest, and the j + 6 k accelerations, at times (...)."""
        return _resting_base(self.gravity, self.signal.derivative(time, 2))


#: What moves coordinates along paths.
PrescribedMotion = PrescribedJoints | PrescribedPaths


def _resting_base(gravity: Array, acceleration: Array) -> Array:
    rest = np.zeros((*acceleration.shape[:-1], 27))
    rest[..., 9:12], rest[..., 12:15] = -gravity, gravity
    return np.concatenate([rest, acceleration], axis=-1)


def start_state(finger: Finger, x: Array, palm: PalmPath | None, prescribed: PrescribedMotion | None) -> Array:
    """Return a packed state with palm, joints and objects at the start of their paths."""
    if palm is not None:
        return palm.place_world(finger, x)
    return x if prescribed is None else prescribed.place(finger, x)


def with_paths(control: InputTable, palm: PalmPath | None, prescribed: PrescribedMotion | None) -> InputTable:
    """Return inputs with the paths of palm, joints and objects."""
    if palm is not None:
        control = control._replace(palm=core_signal(palm.signal))
    return control if prescribed is None else control._replace(guide=core_signal(prescribed.signal))
