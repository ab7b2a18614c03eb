"""Columns of panels at given places: labels, titles and legends that need no measuring."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

from finger_pin.views.plots.style import power_of_ten

# Distances in inches: the top margin, and where labels stand outside a panel.
_TOP, _LABELS, _LABEL, _TIME = 0.32, 0.92, 0.52, 0.27

# What is below this in the unit of a panel is zero.
_ROUNDING = 1e-9

# Steps between ticks, times powers of ten.
_FEW, _MANY = [1, 2, 5, 10], [1, 2, 2.5, 5, 10]


def stack(
    figure: Figure,
    left: float,
    right: float,
    labels: Sequence[str],
    *,
    heights: Sequence[float] | None = None,
    gap: float = 0.17,
    bottom: float = 0.8,
) -> list[Axes]:
    """Return panels below each other that share their time axis. Distances in inches.

    Args:
        figure: Where.
        left: Left edge of the column with its labels.
        right: Right edge of the column.
        labels: Label of every panel's vertical axis, from the top.
        heights: Relative heights of the panels; equal by default.
        gap: Between panels.
        bottom: Margin below the lowest panel; the default leaves room for a legend.
    """
    width, height = figure.get_size_inches()
    panel = (height - _TOP - bottom - (len(labels) - 1) * gap) / len(labels)
    grid = figure.add_gridspec(
        len(labels), 1, height_ratios=heights, hspace=gap / panel,
        left=(left + _LABELS) / width, right=right / width, top=1.0 - _TOP / height, bottom=bottom / height,
    )  # fmt: skip
    panels: list[Axes] = list(grid.subplots(sharex=True, squeeze=False)[:, 0])
    for axes, label in zip(panels, labels, strict=True):
        axes.set_ylabel(label)
        # Labels at given places need no measuring, which is most of the time of drawing many small panels.
        axes.yaxis.set_label_coords(-_LABEL / (right - left - _LABELS), 0.5)
        axes.yaxis.set_major_locator(MaxNLocator(4, steps=_FEW) if len(labels) > 2 else MaxNLocator(7, steps=_MANY))
        axes.xaxis.set_major_locator(MaxNLocator(6, steps=_FEW))
        axes.yaxis.get_offset_text().set(x=-0.01, horizontalalignment="right")
        axes.margins(x=0.0)
        axes.tick_params(labelbottom=axes is panels[-1])
    lowest = panels[-1]
    lowest.set_xlabel("time (s)")
    lowest.xaxis.set_label_coords(0.5, -_TIME / (lowest.get_position().height * height))
    return panels


def title(axes: Axes, text: str) -> None:
    """Write a title at a fixed height, so that nothing has to be measured."""
    axes.set_title(text, y=1.0)


def flatten_rounding(axes: Axes) -> None:
    """Make a panel that holds nothing but rounding errors two units high, so that zero looks like zero."""
    if max(map(abs, axes.dataLim.intervaly)) < _ROUNDING:
        axes.set_ylim(-1.0, 1.0)


def legend(axes: Axes, handles: Sequence[Artist], columns: int) -> None:
    """Write a legend below the lowest panel of a column, as wide as that is with its labels."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    box = axes.get_position()
    figure.legend(
        handles=handles, ncols=columns, columnspacing=1.2, handletextpad=0.5, borderaxespad=0.2, frameon=False,
        loc="lower center", bbox_to_anchor=(0.5 * (box.x0 - _LABELS / figure.get_figwidth() + box.x1), 0.0),
    )  # fmt: skip


def logarithmic(axes: Axes) -> None:
    """Give the vertical axis a logarithmic scale with powers of ten in plain text."""
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: power_of_ten(round(math.log10(value)))))
    axes.yaxis.set_minor_locator(NullLocator())


def plain(axis: Axis) -> None:
    """Write 1, 2 and 5 times powers of ten as they are along a logarithmic axis."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())


def labelled(name: str, unit: str) -> str:
    """Return the label of a strip: its name and unit, on two lines where they are long together."""
    whole = unit.replace(" ", "\N{NO-BREAK SPACE}")
    return textwrap.fill(f"{name} ({whole})", 17, break_long_words=False)
