"""Figures of a whole hand, a row for each finger; and the part of a result that is about one of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from finger_pin.exceptions import InputError
from finger_pin.views.plots.lines import names, series, trace
from finger_pin.views.plots.panels import labelled, legend, stack, title
from finger_pin.views.plots.style import new_figure

if TYPE_CHECKING:
    from finger_pin.description.routing import Array

#: A column of such a figure: its title, variable, factor and unit.
Column = tuple[str, str, float, str]
_HEIGHT, _WIDTH = 1.5, 4.6


def fingers_of(result: xr.Dataset) -> list[str]:
    """Return the names of the fingers of a hand's result; none for that of a finger."""
    found = dict.fromkeys(name.split(".")[0] for name in names(result, "joint") if "." in name)
    return list(found)


def finger_of(result: xr.Dataset, finger: str) -> xr.Dataset:
    """Return what a hand's result says of one finger: joints and tendons under their own names, no energies.

    Raises:
        InputError: If there is no such finger.
    """
    present = fingers_of(result)
    if finger not in present:
        from finger_pin.description.validation import nearest

        near = nearest(finger, present)
        hint = f"; did you mean {near}?" if near else ""
        listed = f"the fingers are {', '.join(present)}" if present else "it is the result of one finger"
        raise InputError("finger", f"{listed}{hint}", finger)
    chosen = result.drop_vars([name for name in result if str(name).startswith(("energy_", "power_"))])
    for dimension in ("joint", "tendon", "passive_tendon"):
        if dimension in chosen.coords:
            own = [name for name in names(chosen, dimension) if name.startswith(f"{finger}.")]
            bare = [name.removeprefix(f"{finger}.") for name in own]
            chosen = chosen.sel({dimension: own}).assign_coords({dimension: bare})
    return chosen.sel(finger=finger, drop=True) if "finger" in chosen.dims else chosen


def plot_by_finger(result: xr.Dataset, columns: Sequence[Column]) -> Figure:
    """Draw variables of joints or tendons of a hand: a row for each finger, a column for each variable."""
    parts = {name: finger_of(result, name) for name in fingers_of(result)}
    figure = new_figure(0.3 + _WIDTH * len(columns), 1.2 + _HEIGHT * len(parts))
    for index, (text, variable, factor, unit) in enumerate(columns):
        left = 0.1 + _WIDTH * index
        labels = [labelled(name, unit) for name in parts]
        panels = stack(figure, left, left + _WIDTH - 0.15, labels, bottom=0.9)
        title(panels[0], f"({'abcdef'[index]}) {text}")
        # Fingers may differ: the same name has the same look in all rows, and another name another one.
        shown: dict[str, Line2D] = {}
        for axes, part in zip(panels, parts.values(), strict=True):
            _lines(axes, part, variable, factor, shown)
        legend(panels[-1], list(shown.values()), columns=5)
    return figure


def _lines(axes: Axes, part: xr.Dataset, variable: str, factor: float, shown: dict[str, Line2D]) -> None:
    dimension = "joint" if "joint" in part[variable].dims else "tendon"
    time, values = part["time"].values, factor * part[variable].transpose("time", dimension).values
    for index, name in enumerate(names(part, dimension)):
        column: Array = np.asarray(values[:, index])
        look = list(shown).index(name) if name in shown else len(shown)
        line = trace(axes, time, column, label=name, **series(look))
        shown.setdefault(name, line)
