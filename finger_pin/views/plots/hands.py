"""Figures of a whole hand, one row per finger, and the part of its result about one finger."""

from __future__ import annotations

from collections.abc import Sequence

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from finger_pin.exceptions import InputError
from finger_pin.typing import Array
from finger_pin.views.plots.lines import bundle, names, times
from finger_pin.views.plots.panels import labelled, legend, sheet, stack, title
from finger_pin.views.plots.style import Width

#: A column of such a figure: its title, variable, factor and unit.
Column = tuple[str, str, float, str]
_ROW_HEIGHT, _COLUMN_WIDTH = 1.5, 4.6
_DIMENSIONS = ("joint", "tendon")


def fingers_of(result: xr.Dataset) -> list[str]:
    """Return the names of the fingers of a hand's result; none for that of a finger."""
    fingers = dict.fromkeys(name.split(".")[0] for name in names(result, "joint") if "." in name)
    return list(fingers)


def finger_of(result: xr.Dataset, finger: str) -> xr.Dataset:
    """Return the part of a hand's result about one finger: joints and tendons by their own names, no energies."""
    available = fingers_of(result)
    if finger not in available:
        from finger_pin.description.validation import suggestion

        hint = suggestion(finger, available)
        names_text = f"the fingers are {', '.join(available)}" if available else "it is the result of one finger"
        raise InputError("finger", f"{names_text}{hint}", finger)
    part = result.drop_vars([name for name in result if str(name).startswith(("energy_", "power_"))])
    for dimension in ("joint", "tendon", "passive_tendon"):
        if dimension in part.coords:
            full_names = [name for name in names(part, dimension) if name.startswith(f"{finger}.")]
            short_names = [name.removeprefix(f"{finger}.") for name in full_names]
            part = part.sel({dimension: full_names}).assign_coords({dimension: short_names})
    return part.sel(finger=finger, drop=True) if "finger" in part.dims else part


def plot_by_finger(result: xr.Dataset, columns: Sequence[Column], width: Width, titles: bool) -> Figure:
    """Draw variables of joints or tendons of a hand: a row for each finger, a column for each variable."""
    parts = {name: finger_of(result, name) for name in fingers_of(result)}
    # Fingers may differ: the same name has the same look in all rows, and another name another one.
    styles = {
        kind: dict.fromkeys(name for part in parts.values() for name in names(part, kind)) for kind in _DIMENSIONS
    }
    figure, subfigures = sheet([(_COLUMN_WIDTH, 1.2 + _ROW_HEIGHT * len(parts))] * len(columns), width, titles)
    for index, (subfigure, (text, variable, factor, unit)) in enumerate(zip(subfigures, columns, strict=True)):
        panels = stack(subfigure, [labelled(name, unit) for name in parts])
        title(panels[0], f"({'abcdef'[index]}) {text}")
        kind = next(kind for kind in _DIMENSIONS if kind in result[variable].dims)
        lines: dict[str, Line2D] = {}
        for axes, part in zip(panels, parts.values(), strict=True):
            lines |= _draw_lines(
                axes, part, kind, list(styles[kind]), factor * part[variable].transpose("time", kind).values
            )
        legend(subfigure, [lines[name] for name in styles[kind]])
    return figure


def _draw_lines(axes: Axes, part: xr.Dataset, kind: str, styles: list[str], values: Array) -> dict[str, Line2D]:
    labels = names(part, kind)
    return dict(zip(labels, bundle(axes, times(part), values, labels, list(map(styles.index, labels))), strict=True))
