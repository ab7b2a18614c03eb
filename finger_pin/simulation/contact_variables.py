"""Contacts and free objects in a result."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.object_scene import rotate
from finger_pin.typing import Array

_OBJECT_VARIABLES = {
    "object_pose": ("object_position", "object_orientation"),
    "object_velocity": ("object_velocity", "object_angular_velocity"),
}
#: Attribute of a result: how many pairs of contacts it leaves out, as they never came near.
OMITTED_PAIRS = "contacts_left_out"
# Pairs whose gap stays above this never come near, m.
_FAR_GAP = 1e-3


def _slip_names(finger: Finger) -> list[str]:
    assert finger.scene is not None
    return ["1", "2", "spin"][: finger.scene.contacts.law.arms - 1]


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
        values["object_velocity"] = np.concatenate([velocity[..., :3], rotate(inverse, velocity[..., 3:])], axis=-1)
    return {block: value.reshape(-1) for block, value in values.items()}


def without_far_pairs(result: xr.Dataset) -> xr.Dataset:
    """Return a result without the pairs of contacts that never came near; the attribute `OMITTED_PAIRS` counts them.

    Near is a millimetre, and twice what a gap changes by to the samples beside, as pairs may touch between these. What
    is left is a copy, which keeps no memory of the others.
    """
    if "contact_gap" not in result or not result.sizes["time"]:
        return result
    gap = result["contact_gap"].values
    change = np.zeros((len(gap) + 1, *gap.shape[1:]))
    bent = (result["contact_bend"] != 0.0).any(("time", "tangent")).values
    with np.errstate(invalid="ignore"):
        change[1:-1] = np.abs(np.diff(gap, axis=0))
        far = np.all(gap > _FAR_GAP + 2.0 * np.maximum(change[:-1], change[1:]), axis=0) & ~bent
    omitted = {OMITTED_PAIRS: int(far.sum())} if far.any() else {}
    return result.isel(contact=~far).assign_attrs(omitted)
