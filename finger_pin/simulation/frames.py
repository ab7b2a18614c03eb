"""Frames and subject of results: vectors in the world, and the finger and objects that moved."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from finger_pin.description.finger import FingerDescription, HandSettings
from finger_pin.description.objects import Object
from finger_pin.description.scenario import Scenario
from finger_pin.description.validation import Description, validate
from finger_pin.exceptions import InputError
from finger_pin.simulation.sampled_trajectory import BASE_FRAME, WORLD_FRAME
from finger_pin.typing import Array


def in_world(result: xr.Dataset) -> xr.Dataset:
    """Return a result with all vectors in the world's frame.

    Places gain the palm's, velocities of objects what the palm's motion adds; all else is turned.

    Args:
        result: Dataset that `simulate` returned or saved, with the four variables of its palm if that moves.

    Raises:
        InputError: If it is a result of a palm that moves, and lacks one of these.
    """
    turned = result.copy()
    moves = _Palm(result) if any(str(name).startswith("palm_") for name in result) else None
    for name, variable in result.data_vars.items():
        if variable.attrs.get("frame") == BASE_FRAME:
            values = variable.values if moves is None else moves.to_world(str(name), variable)
            turned[name] = (variable.dims, values, variable.attrs | {"frame": WORLD_FRAME})
    turned.attrs["frame"] = WORLD_FRAME
    return turned


class _Palm:
    """A palm that moves, at m samples."""

    def __init__(self, result: xr.Dataset) -> None:
        for name in ("position", "orientation", "velocity", "angular_velocity"):
            if f"palm_{name}" not in result:
                raise InputError("result", f"has no palm_{name}, by which places in the world are known")
        self.result = result
        self.place, self.velocity, self.turning = (
            result[f"palm_{name}"].values for name in ("position", "velocity", "angular_velocity")
        )
        self.attitude = Rotation.from_quat(result.palm_orientation.values)

    def to_world(self, name: str, variable: xr.DataArray) -> Array:
        """Return the values of a variable in the world frame."""
        values = np.array(variable.values)
        if "quaternion" in variable.dims:
            return self._map_items(
                values, lambda quaternion: (self.attitude * Rotation.from_quat(quaternion)).as_quat()
            )
        turned = self._map_items(values, self.attitude.apply)
        lead = (slice(None), *[None] * (values.ndim - 2))
        if name == "object_velocity":
            places = self._map_items(np.array(self.result.object_position.values), self.attitude.apply)
            return np.asarray(turned + self.velocity[lead] + np.cross(self.turning[lead], places))
        if name == "object_angular_velocity":
            return np.asarray(turned + self.turning[lead])
        if name == "contact_point":
            # Of contacts that are open there is none.
            return np.asarray(turned + self.place[lead] * np.any(values, axis=-1, keepdims=True))
        return np.asarray(turned + self.place[lead] if variable.attrs["units"] == "m" else turned)

    @staticmethod
    def _map_items(values: Array, change: Callable[[Array], Array]) -> Array:
        """Change vectors or quaternions, shape (m, ..., k), at all samples, for each of several items."""
        flat = values.reshape(len(values), -1, values.shape[-1])
        return np.stack([change(flat[:, k]) for k in range(flat.shape[1])], axis=1).reshape(values.shape)


class Scene(NamedTuple):
    """The subject of a result: a finger, or all fingers of a hand together, and the objects around it, by name."""

    finger: FingerDescription
    objects: Mapping[str, Object]


def scene_metadata(scenario: Scenario) -> dict[str, str]:
    """Return the attributes of a result of a scenario from which `read_scene` reads."""
    kind, subject = ("hand", scenario.hand) if scenario.hand else ("finger", scenario.finger)
    objects = {name: _plain(body) for name, body in (scenario.environment.objects or {}).items()}
    return {kind: json.dumps(_plain(subject)), "objects": json.dumps(objects)}


def read_scene(attributes: Mapping[Any, Any]) -> Scene:
    """Return the subject of a result, given its attributes.

    Raises:
        InputError: If they do not say.
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
    around = {name: validate(Object, body, ("result.attrs.objects", name)) for name, body in bodies.items()}
    if kind == "hand":
        return Scene(validate(HandSettings, table, (entry,)).joined(), around)
    return Scene(validate(FingerDescription, table, (entry,)), around)


def _plain(description: Description) -> dict[str, Any]:
    return description.model_dump(mode="python", exclude_none=True)
