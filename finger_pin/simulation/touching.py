"""Contacts and free objects in a result."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from finger_pin.description.routing import Array
from finger_pin.exceptions import InputError
from finger_pin.laws.contact import CONTACT
from finger_pin.laws.law import Touch
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.finger_signals import FingerSignals
from finger_pin.mechanism.surroundings import POSE, VELOCITY

if TYPE_CHECKING:
    import xarray as xr

Variables = dict[str, tuple[Any, Array, dict[str, str]]]
_OBJECTS = {
    "object_pose": ("object_position", "object_orientation"),
    "object_velocity": ("object_velocity", "object_angular_velocity"),
}
_CONTACT, _SPACE = ("time", "contact"), ("time", "contact", "axis")


def contact_variables(finger: Finger, signals: FingerSignals) -> Variables:
    """Return what contacts and free objects do over time; nothing without surroundings."""
    around, state = finger.surroundings, signals.state
    if around is None or state.object_pose is None or state.object_velocity is None or state.contact_bend is None:
        return {}
    found = signals.mechanism.rows[around.contacts.group]
    touch, arms = found.row, CONTACT.arms
    assert isinstance(touch, Touch)
    space = signals.mechanism.touching or around.touching(state.position, state.object_pose, found.force)
    friction = np.hypot(found.force[:, 1::arms], found.force[:, 2::arms])
    text = "distance of the surfaces, negative where they penetrate; far apart, no more than it"
    table = {
        "contact_gap": _entry(_CONTACT, touch.gap, "m", text),
        "contact_slip": _entry(_CONTACT, found["sliding_speed"] * (friction > 0.0), "m/s", "speed of sliding"),
        "contact_force": _entry(_SPACE, space.force, "N", "force on the second body of the pair"),
        "contact_normal_force": _entry(_CONTACT, found.force[:, ::arms], "N", "normal force"),
        "contact_friction": _entry(_CONTACT, friction, "N", "friction force"),
        "contact_level": _entry(_CONTACT, found["level"], "N", "most friction, mu times the normal force"),
        "contact_point": _entry(_SPACE, space.point, "m", "midway between the surfaces; zero where they are open"),
        "contact_normal": _entry(_SPACE, space.normal, "1", "normal of the second body; zero where they are open"),
        "contact_bend": _entry(
            ("time", "contact", "tangent"),
            _split(state.contact_bend, 2),
            "m",
            "bend of the bristles along two tangents",
        ),
    }
    if around.free:
        pose, velocity = _split(state.object_pose, POSE), _split(state.object_velocity, VELOCITY)
        axes, turns = ("time", "object", "axis"), ("time", "object", "quaternion")
        table |= {
            "object_position": _entry(axes, pose[..., :3], "m", "position of a free object"),
            "object_orientation": _entry(turns, pose[..., 3:], "1", "its orientation, a unit quaternion"),
            "object_velocity": _entry(axes, velocity[..., :3], "m/s", "its velocity"),
            "object_angular_velocity": _entry(
                axes, velocity[..., 3:], "rad/s", "its angular velocity, in its own frame"
            ),
        }
    return table


def contact_coordinates(finger: Finger) -> dict[str, Any]:
    """Return the coordinates of these variables."""
    around = finger.surroundings
    if around is None:
        return {}
    found = {
        "contact": ("contact", list(around.contacts.names), {"long_name": "contact"}),
        "tangent": ("tangent", ["1", "2"], {"long_name": "tangent of a contact"}),
    }
    if around.free:
        found["object"] = ("object", list(around.free), {"long_name": "free object"})
        found["quaternion"] = ("quaternion", ["x", "y", "z", "w"], {"long_name": "component of a quaternion"})
    return found


def last_touching(finger: Finger, last: xr.Dataset) -> dict[str, Array]:
    """Return poses and velocities of free objects and the bend of bristles at an instant of a result, packed.

    Raises:
        InputError: If the result has other contacts or objects.
    """
    around = finger.surroundings
    if around is None:
        return {}
    parts = {"contact_bend": ("contact_bend",)} | (_OBJECTS if around.free else {})
    for dimension, expected in (("contact", around.contacts.names), ("object", tuple(around.free))):
        found = tuple(map(str, last[dimension].values)) if dimension in last.coords else ()
        if found != expected:
            raise InputError("initial", f"is a result with other {dimension}s: they must be {', '.join(expected)}")
    return {
        part: np.concatenate([last[name].values for name in names], axis=-1).reshape(-1)
        for part, names in parts.items()
    }


def _split(values: Array, size: int) -> Array:
    return values.reshape(*values.shape[:-1], -1, size)


def _entry(dims: Any, values: Array, units: str, long_name: str) -> tuple[Any, Array, dict[str, str]]:
    return dims, np.asarray(values), {"units": units, "long_name": long_name}
