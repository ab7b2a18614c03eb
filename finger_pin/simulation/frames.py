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
    found = result.copy()
    moves = _Palm(result) if any(str(name).startswith("palm_") for name in result) else None
    for name, variable in result.data_vars.items():
        if variable.attrs.get("frame") == BASE_FRAME:
            seen = variable.values if moves is None else moves.seen(str(name), variable)
            found[name] = (variable.dims, seen, variable.attrs | {"frame": WORLD_FRAME})
    found.attrs["frame"] = WORLD_FRAME
    return found


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

    def seen(self, name: str, variable: xr.DataArray) -> Array:
        """Return the values of a variable as the world sees them."""
        values = np.array(variable.values)
        if "quaternion" in variable.dims:
            return self._each(values, lambda own: (self.attitude * Rotation.from_quat(own)).as_quat())
        turned = self._each(values, self.attitude.apply)
        lead = (slice(None), *[None] * (values.ndim - 2))
        if name == "object_velocity":
            places = self._each(np.array(self.result.object_position.values), self.attitude.apply)
            return np.asarray(turned + self.velocity[lead] + np.cross(self.turning[lead], places))
        if name == "object_angular_velocity":
            return np.asarray(turned + self.turning[lead])
        if name == "contact_point":
            # Of contacts that are open there is none.
            return np.asarray(turned + self.place[lead] * np.any(values, axis=-1, keepdims=True))
        return np.asarray(turned + self.place[lead] if variable.attrs["units"] == "m" else turned)

    @staticmethod
    def _each(values: Array, change: Callable[[Array], Array]) -> Array:
        """Change vectors or quaternions, shape (m, ..., k), at all samples, for each of several items."""
        flat = values.reshape(len(values), -1, values.shape[-1])
        return np.stack([change(flat[:, k]) for k in range(flat.shape[1])], axis=1).reshape(values.shape)
