"""Controllers side by side: their errors over time, and their tensions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from finger_pin.views.plots.lines import names, trace
from finger_pin.views.plots.panels import labelled, legend, sheet, stack, title
from finger_pin.views.plots.style import BLACK, BLUE, GREY, ORANGE, VERMILLION, Width, colour, styled, thin
from paper.comparison import Comparison

_COLOURS = (GREY, VERMILLION, BLUE, BLACK)


@styled
def plot_controllers(
    results: dict[str, xr.Dataset], rows: Sequence[Comparison], *, width: Width = None, titles: bool = True
) -> Figure:
    """Draw tracking errors of a few controllers over time, and rms error and peak tension of all of them.

    Args:
        results: At most four datasets of `simulate` by name, of the same finger and motion.
        rows: Rows of `compare`, the one to compare with first.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    figure, (over_time, bars) = sheet([(6.7, 7.0), (6.8, 7.0)], width, titles)
    first = next(iter(results.values()))
    joints = names(first, "joint")
    panels = stack(over_time, [labelled(name, "deg") for name in joints])
    for (name, result), each in zip(results.items(), _COLOURS, strict=False):
        error = np.rad2deg(result["tracking_error"].transpose("time", "joint").values)
        for axes, values in zip(panels, error.T, strict=True):
            trace(axes, result["time"].values, values, label=name, color=each, linewidth=thin())
    title(panels[0], "(a) tracking error")
    legend(over_time, panels[0].get_lines())
    left, right = bars.subplots(1, 2, sharey=True)
    errors, stretches = [row.error for row in rows], [row.passive_error for row in rows]
    # Two errors do not add up to the whole: a bar each.
    _bars(left, errors, VERMILLION, "rms error (deg)", ".3f", "of the motion", (-0.2, 0.36))
    _bars(left, stretches, ORANGE, "rms error (deg)", ".3f", "by passive stretch alone", (0.2, 0.36))
    left.set_xlim(0.0, 1.3 * max(errors + stretches))
    _bars(right, [row.peak_tension for row in rows], BLUE, "peak command (N)", ".2f")
    title(left, "(b) after the first second")
    left.set_yticks(range(len(rows)), [row.name for row in rows])
    left.invert_yaxis()
    legend(bars, left.get_legend_handles_labels()[0])
    return figure


def _bars(
    axes: Axes,
    values: Sequence[float],
    look: str,
    label: str,
    form: str,
    name: str = "",
    place: tuple[float, float] = (0.0, 0.66),
) -> None:
    """Draw a bar for each row, at a place beside its line and of a height."""
    lines = np.arange(len(values)) + place[0]
    axes.barh(lines, values, color=colour(look), height=place[1], label=name)
    axes.set_xlabel(label)
    axes.grid(visible=False, axis="y")
    axes.tick_params(axis="y", length=0)
    most = max(values)
    axes.set_xlim(0.0, 1.3 * most)
    for line, value in zip(lines, values, strict=True):
        axes.text(value + 0.02 * most, line, f"{value:{form}}", va="center", fontsize="small")
