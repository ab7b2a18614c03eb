"""A result as plain arrays, before it is a Dataset: to import xarray takes longer than to simulate."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

    from finger_pin.description.routing import Array


@dataclass(eq=False)
class Recording:
    """All signals of a run.

    Attributes:
        variables: Dimensions, of which time is the first, values and attributes, by name.
        coordinates: Likewise, or the values alone.
        attrs: Of the whole.
        slopes: Derivatives of the variables by the values that the run was given, shape (p, ...), if they were asked
            for.
    """

    variables: dict[str, tuple[Any, Array, dict[str, str]]]
    coordinates: dict[str, Any]
    attrs: dict[str, Any]
    slopes: dict[str, Array] = field(default_factory=dict)

    @property
    def time(self) -> Array:
        """The sample times, s, shape (m,)."""
        times: Array = self.coordinates["time"][1]
        return times

    @property
    def nbytes(self) -> int:
        """Size of all variables."""
        return sum(values.nbytes for _, values, _ in self.variables.values())

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

    def cut(self, count: int) -> None:
        """Keep the first samples only."""
        self.variables = {name: (dims, all_[:count], own) for name, (dims, all_, own) in self.variables.items()}
        self.coordinates["time"] = ("time", self.time[:count], self.coordinates["time"][2])

    def dataset(self) -> xr.Dataset:
        """Return the Dataset."""
        import xarray as xr

        return xr.Dataset(self.variables, coords=self.coordinates, attrs=self.attrs)


def as_dataset(result: Recording | xr.Dataset) -> xr.Dataset:
    """Return a result as a Dataset."""
    return result.dataset() if isinstance(result, Recording) else result
