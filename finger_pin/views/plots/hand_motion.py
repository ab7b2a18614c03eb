"""The motion of a hand that is given as a tree: its joints, and the forces that drive it."""

from __future__ import annotations

from typing import TypeAlias

import xarray as xr
from matplotlib.figure import Figure

from finger_pin.mechanism.groups import ACTUATORS
from finger_pin.typing import Array
from finger_pin.views.plots.lines import names, series, times, trace
from finger_pin.views.plots.panels import sheet, stack, title
from finger_pin.views.plots.style import Width, styled
from finger_pin.views.shown_units import actuators_by_unit, joints_by_unit, shown_unit

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
