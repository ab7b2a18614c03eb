"""Panels of figures: parts side by side or below each other as the width allows, their labels, titles and legends."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

from finger_pin.typing import Array
from finger_pin.views.plots.style import GREY, Width, colour, inches, new_figure, power_of_ten, settings

# Panels are drawn at this share of their width before they go below each other.
_LEAST_WIDTH = 0.62
# Of the heights of panels, where a figure is for a journal.
_JOURNAL_HEIGHT = 0.82

# Most letters in a line of a strip's label.
_LETTERS = 13

#: Said where tensions of tendons would be drawn.
NO_TENDONS = "no tensions: no tendon is passive, or pulled by an ideal source or a motor"

# What is below this in the unit of a panel is zero.
_ROUNDING = 1e-9

# Share of samples, at either end, that may leave a panel.
_SPIKE_SHARE = 0.001

# Steps between ticks, times powers of ten.
_COARSE, _FINE = [1, 2, 5, 10], [1, 2, 2.5, 5, 10]


def sheet(
    parts: Sequence[tuple[float, float]], width: Width = None, titles: bool = True
) -> tuple[Figure, list[SubFigure]]:
    """Return a figure and its parts, side by side, or below each other if its width is too small.

    Args:
        parts: Width and height of every part where there is room, in.
        width: Of the figure; default the parts' own.
        titles: Whether panels have titles.
    """
    chosen = inches(width)
    figure_width = chosen or sum(w for w, _ in parts)
    columns_per_row = _column_count(chosen, len(parts), sum(w for w, _ in parts) / len(parts))
    rows = [parts[index : index + columns_per_row] for index in range(0, len(parts), columns_per_row)]
    heights = [(1.0 if chosen is None else _JOURNAL_HEIGHT) * max(height for _, height in row) for row in rows]
    figure = new_figure(figure_width, sum(heights), titles=titles)
    bands = figure.subfigures(len(rows), 1, squeeze=False, height_ratios=heights)[:, 0]
    pairs = zip(bands, rows, strict=True)
    columns = [band.subfigures(1, len(row), squeeze=False, width_ratios=[w for w, _ in row])[0] for band, row in pairs]
    return figure, [part for row in columns for part in row]


def grid(
    count: int, columns: int, cell: tuple[float, float], width: Width = None, titles: bool = True, sharex: bool = False
) -> tuple[Figure, list[Axes]]:
    """Return a figure and its panels in rows, with as many columns as its width holds.

    Args:
        count: Number of panels.
        columns: Most columns.
        cell: Width and height of a panel where there is room, in.
        width: Of the figure; default that of the columns.
        titles: Whether panels have titles.
        sharex: Whether the panels share their horizontal axis.
    """
    whole = inches(width)
    across = _column_count(whole, min(columns, count), cell[0])
    down = -(-count // across)
    height = cell[1] * (1.0 if whole is None else min(1.0, max(_LEAST_WIDTH, whole / across / cell[0])))
    figure = new_figure(whole or cell[0] * across, height * down, titles=titles)
    panels = list(figure.subplots(down, across, squeeze=False, sharex=sharex).ravel())
    for unused in panels[count:]:
        unused.remove()
    return figure, panels[:count]


def _column_count(figure_width: float | None, count: int, panel_width: float) -> int:
    """Return how many panels of a width fit side by side into a figure, in; at least one."""
    return count if figure_width is None else max(1, min(count, int(figure_width / (_LEAST_WIDTH * panel_width))))


def stack(part: Figure | SubFigure, labels: Sequence[str], heights: Sequence[float] | None = None) -> list[Axes]:
    """Return panels below each other that share their time axis.

    Args:
        part: The part of the figure.
        labels: Label of every panel's vertical axis, from the top.
        heights: Relative heights of the panels; equal by default.
    """
    panels: list[Axes] = list(part.subplots(len(labels), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0])
    for axes, label in zip(panels, labels, strict=True):
        axes.set_ylabel(label)
        axes.yaxis.set_major_locator(MaxNLocator(4, steps=_COARSE) if len(labels) > 2 else MaxNLocator(7, steps=_FINE))
        axes.xaxis.set_major_locator(MaxNLocator(6, steps=_COARSE))
        axes.margins(x=0.0)
    panels[-1].set_xlabel("time (s)")
    part.align_ylabels(panels)
    return panels


def empty_panel(part: Figure | SubFigure, text: str) -> None:
    """Write in the middle of a part why nothing is drawn there."""
    axes = part.subplots()
    axes.set_axis_off()
    empty_axes(axes, text)


def empty_axes(axes: Axes, text: str) -> None:
    """Write in the middle of a panel why nothing is drawn there."""
    axes.text(0.5, 0.5, textwrap.fill(text, 3 * _LETTERS), transform=axes.transAxes, ha="center", color=colour(GREY))


def title(axes: Axes, text: str) -> None:
    """Write a title, broken at the edge of the part of the figure, unless the figure has none."""
    if getattr(axes.get_figure(root=True), "titled", True):
        # Panels in three dimensions do not look up the place.
        axes.set_title(text, loc=settings["axes.titlelocation"], wrap=True)


def heading(figure: Figure, text: str) -> None:
    """Write a title of a whole figure, unless it has none."""
    if getattr(figure, "titled", True):
        figure.suptitle(text, x=0.02, ha="left", wrap=True)


def flatten_rounding(axes: Axes) -> None:
    """Make a panel that holds nothing but rounding errors two units high, so that zero looks like zero."""
    if max(map(abs, axes.dataLim.intervaly)) < _ROUNDING:
        axes.set_ylim(-1.0, 1.0)


def cut_spikes(axes: Axes, *signals: Array) -> None:
    """Let a spike leave a panel that would be twice as high for a thousandth of the samples."""
    values = np.concatenate(signals)
    low, high = np.quantile(values, [_SPIKE_SHARE, 1.0 - _SPIKE_SHARE])
    if np.ptp(values) > 2.0 * (high - low) > _ROUNDING:
        axes.set_ylim(low - 0.1 * (high - low), high + 0.1 * (high - low))


def legend(part: Figure | SubFigure, handles: Sequence[Artist]) -> None:
    """Write a legend below a part, in as many columns as its width holds, if there is anything to name."""
    if handles:
        # With the paddings of the style sheet, n columns are at most n times as wide as one.
        one_column = part.legend(handles=handles)
        rows = -(-len(handles) // max(1, int(part.bbox.width / one_column.get_window_extent().width)))
        one_column.remove()
        # No more columns than the rows need, so that the last one is filled.
        part.legend(handles=handles, ncols=-(-len(handles) // rows), loc="outside lower center")


def logarithmic(axes: Axes) -> None:
    """Give the vertical axis a logarithmic scale with powers of ten in plain text."""
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(lambda value, _: power_of_ten(round(math.log10(value))))
    axes.yaxis.set_minor_locator(NullLocator())


def plain_ticks(axis: Axis) -> None:
    """Write 1, 2 and 5 times powers of ten as they are along a logarithmic axis."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())


def labelled(name: str, unit: str | None) -> str:
    """Return the label of a strip: its name and unit if any, on several lines if long."""
    label = name if unit is None else " ".join([name, f"({unit})".replace(" ", "\N{NO-BREAK SPACE}")])
    lines = textwrap.wrap(label.replace(".", ". "), _LETTERS, break_long_words=False)
    return "\n".join(lines).replace(". ", ".")
