"""The motion of a hand that is given as a tree: its joints, and the forces that drive it."""

from __future__ import annotations

import xarray as xr
from matplotlib.figure import Figure

from finger_pin.mechanism.tree import MUSCLES, STATEFUL, STATELESS
from finger_pin.typing import Array
from finger_pin.views.plots.lines import names, series, trace
from finger_pin.views.plots.panels import sheet, stack, title
from finger_pin.views.plots.style import Width, styled

# Lines in a panel that can still be told apart.
_MOST = 5


@styled
def plot_hand_motion(result: xr.Dataset, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw positions of all joints, rad or m, tensions of tendons and forces of actuators, N or N m.

    Args:
        result: Dataset of `simulate`, of a hand with a tree.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    moved = _panels(names(result, "joint"), result["joint_position"].transpose("time", "joint").values)
    driven = _panels(names(result, "tendon"), result["tendon_tension"].transpose("time", "tendon").values)
    for group in (STATELESS, STATEFUL, MUSCLES):
        if f"{group}_force" in result:
            driven += _panels(names(result, group), result[f"{group}_force"].transpose("time", group).values)
    columns = ((moved, "position", "(a) joints, rad or m"), (driven, "force", "(b) tendons and actuators, N or N m"))
    sizes = [(5.5, 1.0 + 1.5 * max(len(panels), 1)) for panels, _, _ in columns]
    figure, parts = sheet(sizes, width, titles)
    for part, (panels, label, text) in zip(parts, columns, strict=True):
        if panels:
            axes = stack(part, [label] * len(panels))
            title(axes[0], text)
            for each, panel in zip(axes, panels, strict=True):
                for index, (name, values) in enumerate(panel.items()):
                    trace(each, result["time"].values, values, label=name, **series(index))
                each.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize="x-small", frameon=False)
    return figure


def _panels(labels: list[str], values: Array) -> list[dict[str, Array]]:
    """Return lines by their labels, a few for each panel."""
    lines = list(zip(labels, values.T, strict=True))
    return [dict(lines[first : first + _MOST]) for first in range(0, len(lines), _MOST)]
