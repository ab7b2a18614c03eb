"""The front of a search as files: a table, and every design as a scenario that can be simulated."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import xarray as xr

from finger_pin.description.loading import to_toml
from finger_pin.files import replacing
from finger_pin.studies.keys import Starting

PRODUCTS = ["optimise.nc", "front.csv", "front/*.toml", "figures/pareto.png"]


def write_front(result: xr.Dataset, starting: Starting, folder: Path) -> None:
    """Write ``front.csv`` and a scenario per design, ``front/01.toml`` and so on in the order of the table.

    Raises:
        OSError: If they cannot be written.
    """
    keys = [str(key) for key in result.coords]
    columns = [*(str(name) for name in result.data_vars if "units" in result[name].attrs), *keys]
    scenarios = folder / "front"
    scenarios.mkdir(exist_ok=True)
    for old in scenarios.glob("*.toml"):
        old.unlink()
    with replacing(folder / "front.csv") as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(["design", *(f"{name} ({result[name].attrs['units']})" for name in columns)])
        for number in range(1, 1 + int(result["front"].max())):
            row = result.isel(sample=int(np.flatnonzero(result["front"].values == number)[0]))
            name = f"{number:02d}"
            table.writerow([name, *(repr(float(row[column])) for column in columns)])
            scenario = starting.at({key: float(row[key]) for key in keys})
            title = f"design {name} of the front of a search on {scenario.name}"
            changed = scenario.model_copy(update={"name": f"{scenario.name[:50]}_front_{name}", "title": title})
            with replacing(scenarios / f"{name}.toml") as text:
                Path(text).write_text(to_toml(changed), encoding="utf-8", newline="\n")
