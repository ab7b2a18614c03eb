"""Figures of a whole hand: a row for each finger, or the joints of a tree and the forces that drive it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from finger_pin.exceptions import InputError
from finger_pin.mechanism.groups import ACTUATORS
from finger_pin.typing import Array
from finger_pin.views.plots.lines import bundle, names, series, times, trace
from finger_pin.views.plots.panels import NO_TENDONS, empty_axes, labelled, legend, sheet, stack, title
from finger_pin.views.plots.style import Width, styled
from finger_pin.views.shown_units import OF_FINGER, actuators_by_unit, joints_by_unit, shown_unit

#: A column of such a figure: its title, variable, factor and unit.
Column = tuple[str, str, float, str]
_ROW_HEIGHT, _COLUMN_WIDTH = 1.5, 4.6
_DIMENSIONS = ("joint", "tendon")
# Factor and unit of what slides, by the unit of what turns.
_OF_SLIDES = {"°": (1.0, "m"), "°/s": (1.0, "m/s"), "mN m": (1e3, "mN")}


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
    part = part.assign_attrs({OF_FINGER: finger})
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
        kind = next(kind for kind in _DIMENSIONS if kind in result[variable].dims)
        shown = {name: _shown(part, kind, factor, unit) for name, part in parts.items()}
        units = [" or ".join(dict.fromkeys(unit for _, unit in each)) or unit for each in shown.values()]
        panels = stack(subfigure, [labelled(name, unit) for name, unit in zip(parts, units, strict=True)])
        title(panels[0], f"({'abcdef'[index]}) {text}")
        lines: dict[str, Line2D] = {}
        for axes, (name, part) in zip(panels, parts.items(), strict=True):
            if not shown[name]:
                empty_axes(axes, NO_TENDONS)
                continue
            values = np.array([each for each, _ in shown[name]]) * part[variable].transpose("time", kind).values
            labels, order = names(part, kind), list(styles[kind])
            drawn = bundle(axes, times(part), values, labels, [order.index(label) for label in labels])
            lines |= dict(zip(labels, drawn, strict=True))
        legend(subfigure, [lines[name] for name in styles[kind]])
    return figure


def _shown(part: xr.Dataset, kind: str, factor: float, unit: str) -> list[tuple[float, str]]:
    """Return the factor and the unit of every joint or tendon of a finger, whose joints may slide."""
    slides = joints_by_unit(part).get("m", []) if kind == "joint" else []
    return [_OF_SLIDES[unit] if name in slides else (factor, unit) for name in names(part, kind)]


# The label of a panel's vertical axis, and its lines by name.
Panel: TypeAlias = tuple[str, dict[str, Array]]

# Lines in a panel that can still be told apart.
_MAX_LINES = 5


@styled
def plot_hand_motion(result: xr.Dataset, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw positions of all joints, deg or m, tensions of tendons and forces of actuators, N or N m, by their units.

    Args:
        result: Dataset of `simulate`, of a hand with a tree.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    motion_panels, force_panels = _motion_panels(result), _force_panels(result)
    columns = ((motion_panels, "(a) joints"), (force_panels, "(b) tendons and actuators"))
    sizes = [(5.5, 1.0 + 1.5 * max(len(panels), 1)) for panels, _ in columns]
    figure, parts = sheet(sizes, width, titles)
    for part, (panels, text) in zip(parts, columns, strict=True):
        if panels:
            axes = stack(part, [label for label, _ in panels])
            title(axes[0], text)
            for panel_axes, (_, panel) in zip(axes, panels, strict=True):
                for index, (name, values) in enumerate(panel.items()):
                    trace(panel_axes, times(result), values, label=name, **series(index))
                panel_axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize="x-small", frameon=False)
    return figure


def _motion_panels(result: xr.Dataset) -> list[Panel]:
    panels = []
    for unit, joints in joints_by_unit(result).items():
        factor, unit_text = shown_unit(unit)
        label = f"{'angle' if unit == 'rad' else 'position'} ({unit_text})"
        panels += _split_panels(factor * result["joint_position"], "joint", joints, label)
    return panels


def _force_panels(result: xr.Dataset) -> list[Panel]:
    panels = _split_panels(result["tendon_tension"], "tendon", names(result, "tendon"), "tension (N)")
    if "cord_tension" in result:
        panels += _split_panels(result["cord_tension"], "cord", names(result, "cord"), "cord tension (N)")
    for group in ACTUATORS:
        if f"{group}_force" in result:
            for unit, actuators in actuators_by_unit(result, group).items():
                label = f"{'torque' if unit == 'N m' else 'force'} ({unit})"
                panels += _split_panels(result[f"{group}_force"], group, actuators, label)
    return panels


def _split_panels(signals: xr.DataArray, dimension: str, line_names: list[str], label: str) -> list[Panel]:
    """Return lines by their names, a few for each panel, each with the label of its axis."""
    lines = [(name, signals.sel({dimension: name}).values) for name in line_names]
    return [(label, dict(lines[first : first + _MAX_LINES])) for first in range(0, len(lines), _MAX_LINES)]
