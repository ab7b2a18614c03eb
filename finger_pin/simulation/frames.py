"""Frames and subject of results: vectors in the world, and the finger and objects that moved."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from finger_pin.description.finger_description import FingerDescription, HandSettings
from finger_pin.description.objects import Object
from finger_pin.description.scenario import Scenario
from finger_pin.description.validation import Description, validate
from finger_pin.exceptions import InputError
from finger_pin.mechanism.signals import BASE_FRAME, WORLD_FRAME
from finger_pin.typing import Array


def in_world(result: xr.Dataset) -> xr.Dataset:
    """Return a result with all vectors in the world's frame.

    The palm's position is added to positions, its motion to velocities of objects; all other vectors are rotated.

    Args:
        result: Dataset that `simulate` returned or saved, with the four variables of its palm if that moves.

    Raises:
        InputError: If it is a result of a palm that moves, and lacks one of these.
    """
    transformed = result.copy()
    palm = _Palm(result) if any(str(name).startswith("palm_") for name in result) else None
    for name, variable in result.data_vars.items():
        if variable.attrs.get("frame") == BASE_FRAME:
            values = variable.values if palm is None else palm.to_world(str(name), variable)
            transformed[name] = (variable.dims, values, variable.attrs | {"frame": WORLD_FRAME})
    transformed.attrs["frame"] = WORLD_FRAME
    return transformed


class _Palm:
    """A palm that moves, at m samples."""

    def __init__(self, result: xr.Dataset) -> None:
        for name in ("position", "orientation", "velocity", "angular_velocity"):
            if f"palm_{name}" not in result:
                raise InputError("result", f"has no palm_{name}, by which places in the world are known")
        self.result = result
        self.position, self.velocity, self.angular_velocity = (
            result[f"palm_{name}"].values for name in ("position", "velocity", "angular_velocity")
        )
        self.rotation = Rotation.from_quat(result.palm_orientation.values)

    def to_world(self, name: str, variable: xr.DataArray) -> Array:
        """Return the values of a variable in the world frame."""
        values = np.array(variable.values)
        if "quaternion" in variable.dims:
            return self._map_items(
                values, lambda quaternion: (self.rotation * Rotation.from_quat(quaternion)).as_quat()
            )
        rotated = self._map_items(values, self.rotation.apply)
        lead = (slice(None), *[None] * (values.ndim - 2))
        if name == "object_velocity":
            positions = self._map_items(np.array(self.result.object_position.values), self.rotation.apply)
            return np.asarray(rotated + self.velocity[lead] + np.cross(self.angular_velocity[lead], positions))
        if name == "object_angular_velocity":
            return np.asarray(rotated + self.angular_velocity[lead])
        if name == "contact_point":
            # Open contacts have no point.
            return np.asarray(rotated + self.position[lead] * np.any(values, axis=-1, keepdims=True))
        return np.asarray(rotated + self.position[lead] if variable.attrs["units"] == "m" else rotated)

    @staticmethod
    def _map_items(values: Array, function: Callable[[Array], Array]) -> Array:
        """Apply a function of all samples of one vector or quaternion to several, shape (m, ..., k)."""
        flat = values.reshape(len(values), -1, values.shape[-1])
        return np.stack([function(flat[:, k]) for k in range(flat.shape[1])], axis=1).reshape(values.shape)


class Scene(NamedTuple):
    """The subject of a result: a finger, or all fingers of a hand together, and the objects around it, by name."""

    finger: FingerDescription
    objects: Mapping[str, Object]


def scene_metadata(scenario: Scenario) -> dict[str, str]:
    """Return the attributes of a result of a scenario from which `read_scene` reads."""
    kind, subject = ("hand", scenario.hand) if scenario.hand else ("finger", scenario.finger)
    objects = {name: _as_dict(body) for name, body in (scenario.environment.objects or {}).items()}
    return {kind: json.dumps(_as_dict(subject)), "objects": json.dumps(objects)}


def read_scene(attributes: Mapping[Any, Any]) -> Scene:
    """Return the subject of a result, given its attributes.

    Raises:
        InputError: If they lack it.
    """
    for kind in ("finger", "hand"):
        if kind in attributes:
            return _read_scene(kind, str(attributes[kind]), str(attributes.get("objects", "{}")))
    raise InputError("result.attrs.finger", "is missing; give a result of simulate or saved, in this version")


# What reads a result asks for it more than once.
@lru_cache(maxsize=4)
def _read_scene(kind: str, text: str, objects: str) -> Scene:
    entry = f"result.attrs.{kind}"
    try:
        table, bodies = json.loads(text), json.loads(objects)
    except ValueError as error:
        raise InputError(entry, "must be a description in JSON") from error
    scene_objects = {name: validate(Object, body, ("result.attrs.objects", name)) for name, body in bodies.items()}
    if kind == "hand":
        return Scene(validate(HandSettings, table, (entry,)).joined(), scene_objects)
    return Scene(validate(FingerDescription, table, (entry,)), scene_objects)


def _as_dict(description: Description) -> dict[str, Any]:
    return description.model_dump(mode="python", exclude_none=True)
