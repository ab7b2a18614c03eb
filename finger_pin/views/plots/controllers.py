"""Controllers side by side: their errors over time, and what they cost."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from finger_pin.studies.comparison import Comparison
from finger_pin.views.plots.lines import names, trace
from finger_pin.views.plots.panels import labelled, legend, stack, title
from finger_pin.views.plots.style import BLACK, BLUE, GREY, ORANGE, VERMILLION, new_figure, styled

_COLOURS = (GREY, VERMILLION, BLUE, BLACK)


@styled
def plot_controllers(results: dict[str, xr.Dataset], rows: Sequence[Comparison]) -> Figure:
    """Draw tracking errors of a few controllers over time, and rms error and peak tension of all of them.

    Args:
        results: At most four datasets of `simulate` by name, of the same finger and motion.
        rows: What `compare` returned, the one to compare with first.
    """
    figure = new_figure(13.5, 7.0)
    first = next(iter(results.values()))
    joints = names(first, "joint")
    panels = stack(figure, 0.0, 6.6, [labelled(name, "deg") for name in joints])
    for (name, result), colour in zip(results.items(), _COLOURS, strict=False):
        error = np.rad2deg(result["tracking_error"].transpose("time", "joint").values)
        for axes, values in zip(panels, error.T, strict=True):
            trace(axes, result["time"].values, values, label=name, color=colour, linewidth=1.1)
    title(panels[0], "(a) tracking error")
    legend(panels[-1], panels[0].get_lines(), columns=len(results))
    left, right = figure.subplots(
        1, 2, sharey=True, gridspec_kw={"left": 9.1 / 13.5, "right": 0.985, "top": 0.954, "bottom": 0.8 / 7.0}
    )
    _bars(left, rows, [row.error for row in rows], VERMILLION, "rms error (deg)", ".3f")
    left.barh(
        range(len(rows)),
        [row.passive_error for row in rows],
        color=ORANGE,
        height=0.66,
        label="of which passive stretch",
    )
    _bars(right, rows, [row.peak_tension for row in rows], BLUE, "peak command (N)", ".2f")
    left.set_title("(b) after the first second")
    left.set_yticks(range(len(rows)), [row.name for row in rows])
    left.invert_yaxis()
    legend(left, left.get_legend_handles_labels()[0], columns=2)
    return figure


def _bars(axes: Axes, rows: Sequence[Comparison], values: Sequence[float], colour: str, label: str, form: str) -> None:
    axes.barh(range(len(rows)), values, color=colour, height=0.66, label="all of it")
    axes.set_xlabel(label)
    axes.grid(visible=False, axis="y")
    axes.tick_params(axis="y", length=0)
    most = max(values)
    axes.set_xlim(0.0, 1.22 * most)
    for index, value in enumerate(values):
        axes.text(value + 0.02 * most, index, f"{value:{form}}", va="center", fontsize=9.0)
