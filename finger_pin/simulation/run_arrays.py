"""Arrays of a prepared run: those that were asked for, and no more."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from finger_pin.simulation.recording import Recorded
from finger_pin.typing import Array


@dataclass(eq=False)
class RunArrays:
    """Variables of a run as plain arrays.

    Attributes:
        variables: Dimensions, of which time is the first, values and attributes, by name.
        coordinates: Likewise, or the values alone.
        attrs: End, cost and settings of the run.
        slopes: Derivatives of the variables by the values that the run was given, shape (p, ...), if they were asked
            for.
    """

    variables: Recorded
    coordinates: dict[str, Any]
    attrs: dict[str, Any]
    slopes: dict[str, Array] = field(default_factory=dict)

    @property
    def time(self) -> Array:
        """The sample times, s, shape (m,)."""
        return self["time"]

    def __contains__(self, name: str) -> bool:
        """Return whether there is a variable or coordinate of a name."""
        return name in self.variables or name in self.coordinates

    def __getitem__(self, name: str) -> Array:
        """Return the values of a variable or coordinate."""
        entry = self.variables.get(name) or self.coordinates[name]
        return np.asarray(entry[1] if isinstance(entry, tuple) else entry)

    def units(self, name: str) -> str:
        """Return the unit of a variable."""
        return self.variables[name][2]["units"]

    def dataset(self) -> xr.Dataset:
        """Return the same as a Dataset."""
        return xr.Dataset(self.variables, self.coordinates, self.attrs)
