"""Contacts and free objects in a result."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from finger_pin.exceptions import InputError
from finger_pin.laws.law import Touch
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.object_scene import POSE, VELOCITY
from finger_pin.mechanism.path_elements import SPIN
from finger_pin.mechanism.state import State
from finger_pin.simulation.sampled_trajectory import SampledTrajectory
from finger_pin.typing import Array

# Dimensions, unit and name.
Variables = dict[str, tuple[tuple[str, ...], str, str]]
_OBJECTS = {
    "object_pose": ("object_position", "object_orientation"),
    "object_velocity": ("object_velocity", "object_angular_velocity"),
}
#: Attribute of a result: how many pairs of contacts it leaves out, as they never came near.
LEFT_OUT = "contacts_left_out"
# Pairs whose gap stays above this never come near, m.
_NEAR = 1e-3
_CONTACT, _SPACE = ("time", "contact"), ("time", "contact", "axis")


def contact_variables(finger: Finger) -> Variables:
    """Return the variables of contacts and free objects, none if there are no objects."""
    around = finger.scene
    if around is None:
        return {}
    table: Variables = {
        "contact_gap": (
            _CONTACT,
            "m",
            "distance of the surfaces, negative where they penetrate; far apart, no more than it",
        ),
        "contact_slip": (_CONTACT, "m/s", "speed of sliding"),
        "contact_force": (_SPACE, "N", "force on the second body of the pair"),
        "contact_normal_force": (_CONTACT, "N", "normal force"),
        "contact_friction": (_CONTACT, "N", "friction force"),
        "contact_level": (_CONTACT, "N", "most friction, mu times the normal force"),
        "contact_point": (_SPACE, "m", "midway between the surfaces; zero where they are open"),
        "contact_normal": (_SPACE, "1", "normal of the second body, shorter deep in an edge; zero where they are open"),
        "contact_bend": (
            ("time", "contact", "tangent"),
            "m",
            "bend of the bristles along the tangents, and by spinning",
        ),
    }
    if around.contacts.law.arms > SPIN:
        table["contact_moment"] = (_CONTACT, "N m", "friction moment about the normal, on the second body of the pair")
    if around.free:
        axes, turns = ("time", "object", "axis"), ("time", "object", "quaternion")
        table |= {
            "object_position": (axes, "m", "position of a free object"),
            "object_orientation": (turns, "1", "orientation of a free object, a unit quaternion"),
            "object_velocity": (axes, "m/s", "velocity of a free object"),
            "object_angular_velocity": (axes, "rad/s", "angular velocity of a free object"),
        }
    return table


def contact_value(name: str, finger: Finger, of: SampledTrajectory) -> Array:
    """Return the values of one of these variables."""
    if name.startswith("object_"):
        return _of_object(name, of.state)
    if name == "contact_bend":
        return _split(of.state.contact_bend, _arms(finger) - 1)
    around, evaluation = finger.scene, of.finger.mechanism
    assert around is not None
    contacts, arms = evaluation.rows[around.contacts.group], _arms(finger)
    if name in ("contact_force", "contact_point", "contact_normal"):
        return np.asarray(getattr(of.touching, name.removeprefix("contact_")))
    if name == "contact_normal_force":
        return contacts.force[:, ::arms]
    if name == "contact_moment":
        return -contacts.force[:, SPIN::arms]
    if name == "contact_level":
        return contacts["level"]
    if name == "contact_gap":
        assert isinstance(contacts.row, Touch)
        return np.asarray(contacts.row.gap)
    friction = np.hypot(contacts.force[:, 1::arms], contacts.force[:, 2::arms])
    return friction if name == "contact_friction" else contacts["sliding_speed"] * (friction > 0.0)


def _arms(finger: Finger) -> int:
    assert finger.scene is not None
    return finger.scene.contacts.law.arms


def _slips(finger: Finger) -> list[str]:
    return ["1", "2", "spin"][: _arms(finger) - 1]


def _of_object(name: str, state: State) -> Array:
    """Return place, turn, or rates of the free objects."""
    pose, velocity = _split(state.object_pose, POSE), _split(state.object_velocity, VELOCITY)
    if name == "object_position":
        return pose[..., :3]
    if name == "object_orientation":
        return pose[..., 3:]
    return velocity[..., :3] if name == "object_velocity" else _turned(pose[..., 3:], velocity[..., 3:])


def contact_coordinates(finger: Finger) -> dict[str, Any]:
    """Return the coordinates of these variables."""
    around = finger.scene
    if around is None:
        return {}
    coordinates = {
        "contact": ("contact", list(around.contacts.names), {"long_name": "contact"}),
        "tangent": ("tangent", _slips(finger), {"long_name": "tangent of a contact"}),
    }
    if around.free:
        coordinates["object"] = ("object", list(around.free), {"long_name": "free object"})
        coordinates["quaternion"] = ("quaternion", ["x", "y", "z", "w"], {"long_name": "component of a quaternion"})
    return coordinates


def last_touching(finger: Finger, last: xr.Dataset) -> dict[str, Array]:
    """Return poses and velocities of free objects and the bend of bristles at an instant of a result, packed.

    Raises:
        InputError: If the result has other contacts or objects.
    """
    around = finger.scene
    if around is None:
        return {}
    parts = {"contact_bend": ("contact_bend",)} | (_OBJECTS if around.free else {})
    for dimension, expected in (("contact", around.contacts.names), ("object", tuple(around.free))):
        recorded_names = tuple(map(str, last[dimension].values)) if dimension in last.coords else ()
        left_out = last.attrs.get(LEFT_OUT, 0) if dimension == "contact" else 0
        if recorded_names != expected and not (
            left_out and left_out + len(recorded_names) == len(expected) and {*recorded_names} < {*expected}
        ):
            raise InputError("initial", f"is a result with other {dimension}s: they must be {', '.join(expected)}")
    # Bristles of pairs that never came near are not bent, nor those that the result's contacts did not have.
    last = last[[name for names in parts.values() for name in names]]
    last = last.reindex(contact=list(around.contacts.names), tangent=_slips(finger), fill_value=0.0)
    values = {part: np.concatenate([last[name].values for name in names], axis=-1) for part, names in parts.items()}
    if around.free:
        # A state has angular velocities in the objects' own frames.
        rates, back = values["object_velocity"], last["object_orientation"].values * [-1.0, -1.0, -1.0, 1.0]
        values["object_velocity"] = np.concatenate([rates[..., :3], _turned(back, rates[..., 3:])], axis=-1)
    return {part: each.reshape(-1) for part, each in values.items()}


def without_far_pairs(result: xr.Dataset) -> xr.Dataset:
    """Return a result without the pairs of contacts that never came near; the attribute `LEFT_OUT` counts them.

    Near is a millimetre, and twice what a gap changes by between samples, as pairs may touch between these.
    """
    if not {"contact_gap", "contact_bend"} <= {*result.data_vars} or not result.sizes["time"]:
        return result
    gap = result["contact_gap"].transpose("time", "contact").values
    bent = (result["contact_bend"] != 0.0).any(("time", "tangent")).values
    with np.errstate(invalid="ignore"):
        change = np.max(np.abs(np.diff(gap, axis=0)), axis=0, initial=0.0)
        far = (gap.min(axis=0) > _NEAR + 2.0 * change) & ~bent
    if not far.any():
        return result
    return result.isel(contact=~far).assign_attrs({LEFT_OUT: int(result.attrs.get(LEFT_OUT, 0) + far.sum())})


def _turned(quaternion: Array, vector: Array) -> Array:
    """Turn vectors by unit quaternions x, y, z, w, shapes (..., 3) and (..., 4)."""
    axis, scalar = quaternion[..., :3], quaternion[..., 3:]
    across = 2.0 * np.cross(axis, vector)
    return np.asarray(vector + scalar * across + np.cross(axis, across))


def _split(values: Array, size: int) -> Array:
    return values.reshape(*values.shape[:-1], -1, size)
