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
_HEIGHT, _WIDTH = 1.5, 4.6
_KINDS = ("joint", "tendon")


def fingers_of(result: xr.Dataset) -> list[str]:
    """Return the names of the fingers of a hand's result; none for that of a finger."""
    fingers = dict.fromkeys(name.split(".")[0] for name in names(result, "joint") if "." in name)
    return list(fingers)


def finger_of(result: xr.Dataset, finger: str) -> xr.Dataset:
    """Return the part of a hand's result about one finger: joints and tendons by their own names, no energies.

    Raises:
        InputError: If there is no such finger.
    """
    present = fingers_of(result)
    if finger not in present:
        from finger_pin.description.validation import suggestion

        hint = suggestion(finger, present)
        listed = f"the fingers are {', '.join(present)}" if present else "it is the result of one finger"
        raise InputError("finger", f"{listed}{hint}", finger)
    chosen = result.drop_vars([name for name in result if str(name).startswith(("energy_", "power_"))])
    for dimension in ("joint", "tendon", "passive_tendon"):
        if dimension in chosen.coords:
            dotted = [name for name in names(chosen, dimension) if name.startswith(f"{finger}.")]
            bare = [name.removeprefix(f"{finger}.") for name in dotted]
            chosen = chosen.sel({dimension: dotted}).assign_coords({dimension: bare})
    return chosen.sel(finger=finger, drop=True) if "finger" in chosen.dims else chosen


def plot_by_finger(result: xr.Dataset, columns: Sequence[Column], width: Width, titles: bool) -> Figure:
    """Draw variables of joints or tendons of a hand: a row for each finger, a column for each variable."""
    parts = {name: finger_of(result, name) for name in fingers_of(result)}
    # Fingers may differ: the same name has the same look in all rows, and another name another one.
    looks = {kind: dict.fromkeys(name for part in parts.values() for name in names(part, kind)) for kind in _KINDS}
    figure, places = sheet([(_WIDTH, 1.2 + _HEIGHT * len(parts))] * len(columns), width, titles)
    for index, (place, (text, variable, factor, unit)) in enumerate(zip(places, columns, strict=True)):
        panels = stack(place, [labelled(name, unit) for name in parts])
        title(panels[0], f"({'abcdef'[index]}) {text}")
        kind = next(each for each in _KINDS if each in result[variable].dims)
        lines: dict[str, Line2D] = {}
        for axes, part in zip(panels, parts.values(), strict=True):
            lines |= _lines(axes, part, kind, list(looks[kind]), factor * part[variable].transpose("time", kind).values)
        legend(place, [lines[name] for name in looks[kind]])
    return figure


def _lines(axes: Axes, part: xr.Dataset, kind: str, looks: list[str], values: Array) -> dict[str, Line2D]:
    labels = names(part, kind)
    return dict(zip(labels, bundle(axes, times(part), values, labels, list(map(looks.index, labels))), strict=True))
