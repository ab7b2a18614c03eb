"""What a result's Dataset holds, whatever the finger's size."""

from __future__ import annotations

import xarray as xr

from finger_pin.description.routing import Array


def names(result: xr.Dataset, coordinate: str) -> list[str]:
    """Return the names along a coordinate of a result."""
    return [str(name) for name in result[coordinate].values]


def passive_proximal(result: xr.Dataset) -> dict[str, Array]:
    """Return the tension of the proximal half of every passive tendon, N, by tendon.

    A result with one passive tendon keeps it without a dimension of its own; the tendons list it last.
    """
    if "passive_tension_proximal" not in result:
        return {}
    tension = result["passive_tension_proximal"]
    if "passive_tendon" in tension.dims:
        columns = tension.transpose("time", "passive_tendon").values.T
        return dict(zip(names(result, "passive_tendon"), columns, strict=True))
    return {names(result, "tendon")[-1]: tension.values}
