"""A result as a netCDF file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from finger_pin.files import replacing

if TYPE_CHECKING:
    import xarray as xr


def save(dataset: xr.Dataset, path: str | Path) -> None:
    """Write a result to a netCDF4 file, whole or not at all.

    Raises:
        OSError: If it cannot be written, such as on a full disk.
    """
    with replacing(path) as temporary:
        try:
            dataset.to_netcdf(temporary, engine="netcdf4", format="NETCDF4")
        except RuntimeError as error:
            # The netCDF library does not say why; as many plain bytes do where the disk is full.
            with open(temporary, "ab") as file:
                file.write(bytes(dataset.nbytes + 2**20))
            raise OSError(f"{Path(path).name}: {error}") from error


def load_result(path: str | Path) -> xr.Dataset:
    """Read a result that `save` wrote into memory.

    Args:
        path: A netCDF file, or a folder of results, whose ``trajectory.nc`` is read.

    Raises:
        OSError: If there is no such file, or it cannot be read.
    """
    file = Path(path, "trajectory.nc") if Path(path).is_dir() else path
    import xarray as xr

    return xr.load_dataset(file, engine="netcdf4")
