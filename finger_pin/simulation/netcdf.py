"""Results as files: netCDF for all of it, CSV for its signals."""

from __future__ import annotations

import errno
from itertools import product
from pathlib import Path

import numpy as np
import xarray as xr

from finger_pin.exceptions import InputError
from finger_pin.files import replacing, write_table
from finger_pin.typing import Array

# Share of zeros from which on a variable is compressed, 1: others take ten times as long to write, for little.
_MOSTLY = 0.5


def save(dataset: xr.Dataset, path: str | Path) -> None:
    """Write a result to a file, whole or not at all: netCDF4, or its signals as CSV under a name with .csv.

    A column of CSV is a signal of one joint, tendon or the like, such as ``joint_position[distal] (rad)``; a row is a
    sample. Numbers are written so that reading them gives the same floats; those that are mostly zero are compressed.

    Raises:
        OSError: If it cannot be written, such as on a full disk.
    """
    if Path(path).suffix == ".csv":
        columns = _columns(dataset)
        write_table(path, [columns, *zip(*(column.tolist() for column in columns.values()), strict=True)])
        return
    with replacing(path) as temporary:
        try:
            dataset.to_netcdf(temporary, engine="netcdf4", format="NETCDF4", encoding=_encoding(dataset))
        except RuntimeError as error:
            # The netCDF library does not say why; as many plain bytes do where the disk is full.
            with open(temporary, "ab") as file:
                file.write(bytes(dataset.nbytes + 2**20))
            raise OSError(f"{Path(path).name}: {error}") from error


def _encoding(dataset: xr.Dataset) -> dict[str, dict[str, int]]:
    """Return how variables are written that are not as they are: of zeros, which take no time to compress."""
    arrays = {
        str(name): each.values for name, each in dataset.data_vars.items() if each.dims and each.dtype.kind == "f"
    }
    return {
        name: {"zlib": True, "complevel": 1}
        for name, values in arrays.items()
        if np.count_nonzero(values) < (1.0 - _MOSTLY) * values.size
    }


def require_samples(result: xr.Dataset) -> None:
    """Refuse a result that has no time, or no samples.

    Raises:
        InputError: If it has none.
    """
    if "time" not in result.coords or "time" not in result.dims:
        raise InputError("result.time", "is missing; give a result of simulate, with more than one instant")
    if not result.sizes["time"]:
        raise InputError("result.time", "must have at least one sample")


def _columns(dataset: xr.Dataset) -> dict[str, Array]:
    """Return the signals by name, label and unit."""
    require_samples(dataset)
    columns = {"time (s)": dataset["time"].values}
    for name, signal in dataset.items():
        if "time" not in signal.dims:
            continue
        others = [dimension for dimension in signal.dims if dimension != "time"]
        labels = product(*(dataset[each].values if each in dataset else range(signal.sizes[each]) for each in others))
        values = signal.transpose("time", *others).values.reshape(signal.sizes["time"], -1)
        for label, column in zip(labels, values.T, strict=True):
            suffix = f"[{' '.join(map(str, label))}]" if label else ""
            columns[f"{name}{suffix} ({signal.attrs.get('units', '1')})"] = column
    return columns


def load(path: str | Path) -> xr.Dataset:
    """Read a result that `save` wrote into memory.

    Args:
        path: A netCDF file, or a folder of results, whose ``trajectory.nc`` is read.

    Raises:
        OSError: If there is no such file, or it cannot be read.
    """
    file = Path(path, "trajectory.nc") if Path(path).is_dir() else path
    if Path(file).is_fifo():
        raise OSError(errno.ESPIPE, "is a pipe, which may never end; give a file", str(file))
    return xr.load_dataset(file, engine="netcdf4")
