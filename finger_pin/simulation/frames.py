"""Results in the world's frame in place of the palm's."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

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
