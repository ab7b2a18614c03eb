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
_OBJECT_VARIABLES = {
    "object_pose": ("object_position", "object_orientation"),
    "object_velocity": ("object_velocity", "object_angular_velocity"),
}
#: Attribute of a result: how many pairs of contacts it leaves out, as they never came near.
OMITTED_PAIRS = "contacts_left_out"
# Pairs whose gap stays above this never come near, m.
_FAR_GAP = 1e-3
_SCALAR, _SPACE = ("time", "contact"), ("time", "contact", "axis")


def contact_variables(finger: Finger) -> Variables:
    """Return the variables of contacts and free objects, none if there are no objects."""
    scene = finger.scene
    if scene is None:
        return {}
    table: Variables = {
        "contact_gap": (
            _SCALAR,
            "m",
            "distance of the surfaces, negative where they penetrate; far apart, no more than it",
        ),
        "contact_slip": (_SCALAR, "m/s", "speed of sliding"),
        "contact_force": (_SPACE, "N", "force on the second body of the pair"),
        "contact_normal_force": (_SCALAR, "N", "normal force"),
        "contact_friction": (_SCALAR, "N", "friction force"),
        "contact_level": (_SCALAR, "N", "most friction, mu times the normal force"),
        "contact_point": (_SPACE, "m", "midway between the surfaces; zero where they are open"),
        "contact_normal": (_SPACE, "1", "normal of the second body, shorter deep in an edge; zero where they are open"),
        "contact_bend": (
            ("time", "contact", "tangent"),
            "m",
            "bend of the bristles along the tangents, and by spinning",
        ),
    }
    if scene.contacts.law.arms > SPIN:
        table["contact_moment"] = (_SCALAR, "N m", "friction moment about the normal, on the second body of the pair")
    if scene.free:
        vectors, quaternions = ("time", "object", "axis"), ("time", "object", "quaternion")
        table |= {
            "object_position": (vectors, "m", "position of a free object"),
            "object_orientation": (quaternions, "1", "orientation of a free object, a unit quaternion"),
            "object_velocity": (vectors, "m/s", "velocity of a free object"),
            "object_angular_velocity": (vectors, "rad/s", "angular velocity of a free object"),
        }
    return table


def contact_value(samples: SampledTrajectory, name: str) -> Array:
    """Return the values of one of these variables."""
    if name.startswith("object_"):
        return _object_value(name, samples.state)
    scene, evaluation = samples.loop.finger.scene, samples.finger.mechanism
    assert scene is not None
    contacts, arms = evaluation.rows[scene.contacts.group], scene.contacts.law.arms
    if name == "contact_bend":
        return _split(samples.state.contact_bend, arms - 1)
    if name in ("contact_force", "contact_point", "contact_normal"):
        return np.asarray(getattr(samples.touching, name.removeprefix("contact_")))
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


def _slip_names(finger: Finger) -> list[str]:
    assert finger.scene is not None
    return ["1", "2", "spin"][: finger.scene.contacts.law.arms - 1]


def _object_value(name: str, state: State) -> Array:
    """Return position, orientation, velocity or angular velocity of the free objects."""
    pose, velocity = _split(state.object_pose, POSE), _split(state.object_velocity, VELOCITY)
    if name == "object_position":
        return pose[..., :3]
    if name == "object_orientation":
        return pose[..., 3:]
    return velocity[..., :3] if name == "object_velocity" else _rotate(pose[..., 3:], velocity[..., 3:])


def contact_coordinates(finger: Finger) -> dict[str, Any]:
    """Return the coordinates of these variables."""
    scene = finger.scene
    if scene is None:
        return {}
    coordinates = {
        "contact": ("contact", list(scene.contacts.names), {"long_name": "contact"}),
        "tangent": ("tangent", _slip_names(finger), {"long_name": "tangent of a contact"}),
    }
    if scene.free:
        coordinates["object"] = ("object", list(scene.free), {"long_name": "free object"})
        coordinates["quaternion"] = ("quaternion", ["x", "y", "z", "w"], {"long_name": "component of a quaternion"})
    return coordinates


def last_contact_state(finger: Finger, last: xr.Dataset) -> dict[str, Array]:
    """Return poses and velocities of free objects and the bend of bristles at an instant of a result, packed."""
    scene = finger.scene
    if scene is None:
        return {}
    blocks = {"contact_bend": ("contact_bend",)} | (_OBJECT_VARIABLES if scene.free else {})
    for dimension, expected in (("contact", scene.contacts.names), ("object", tuple(scene.free))):
        recorded_names = tuple(map(str, last[dimension].values)) if dimension in last.coords else ()
        omitted = last.attrs.get(OMITTED_PAIRS, 0) if dimension == "contact" else 0
        if recorded_names != expected and not (
            omitted and omitted + len(recorded_names) == len(expected) and {*recorded_names} < {*expected}
        ):
            raise InputError("initial", f"is a result with other {dimension}s: they must be {', '.join(expected)}")
    # Bristles of omitted pairs, and those that the result's contacts did not have, are not bent.
    last = last[[name for names in blocks.values() for name in names]]
    last = last.reindex(contact=list(scene.contacts.names), tangent=_slip_names(finger), fill_value=0.0)
    values = {block: np.concatenate([last[name].values for name in names], axis=-1) for block, names in blocks.items()}
    if scene.free:
        # A state has angular velocities in the frames of the objects.
        velocity, inverse = values["object_velocity"], last["object_orientation"].values * [-1.0, -1.0, -1.0, 1.0]
        values["object_velocity"] = np.concatenate([velocity[..., :3], _rotate(inverse, velocity[..., 3:])], axis=-1)
    return {block: value.reshape(-1) for block, value in values.items()}


def without_far_pairs(result: xr.Dataset) -> xr.Dataset:
    """Return a result without the pairs of contacts that never came near; the attribute `OMITTED_PAIRS` counts them.

    Near is a millimetre, and twice what a gap changes by between samples, as pairs may touch between these.
    """
    if not {"contact_gap", "contact_bend"} <= {*result.data_vars} or not result.sizes["time"]:
        return result
    gap = result["contact_gap"].transpose("time", "contact").values
    bent = (result["contact_bend"] != 0.0).any(("time", "tangent")).values
    with np.errstate(invalid="ignore"):
        change = np.max(np.abs(np.diff(gap, axis=0)), axis=0, initial=0.0)
        far = (gap.min(axis=0) > _FAR_GAP + 2.0 * change) & ~bent
    if not far.any():
        return result
    return result.isel(contact=~far).assign_attrs({OMITTED_PAIRS: int(result.attrs.get(OMITTED_PAIRS, 0) + far.sum())})


def _rotate(quaternion: Array, vector: Array) -> Array:
    """Turn vectors by unit quaternions x, y, z, w, shapes (..., 3) and (..., 4)."""
    axis, scalar = quaternion[..., :3], quaternion[..., 3:]
    cross = 2.0 * np.cross(axis, vector)
    return np.asarray(vector + scalar * cross + np.cross(axis, cross))


def _split(values: Array, size: int) -> Array:
    return values.reshape(*values.shape[:-1], -1, size)
