"""The energy account of a result, whatever its finger is made of."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import xarray as xr

_EXCHANGED = "energy_exchanged_"


class AccountSeries(NamedTuple):
    """Energies over time by name, J.

    Attributes:
        stored: What is stored.
        supplied: What was supplied since the start.
        lost: What was lost since the start.
    """

    stored: dict[str, xr.DataArray]
    supplied: dict[str, xr.DataArray]
    lost: dict[str, xr.DataArray]


def account(result: xr.Dataset) -> AccountSeries:
    """Return the account of a result, in its order, without the residual."""
    found = AccountSeries({}, {}, {})
    for name, values in result.items():
        name = str(name)
        if name.startswith(_EXCHANGED):
            kind = found.supplied if values.attrs["long_name"].startswith("energy supplied") else found.lost
            kind[name.removeprefix(_EXCHANGED)] = values
        elif name.startswith("energy_") and name != "energy_residual":
            found.stored[name.removeprefix("energy_")] = values
    return found
