"""Panels of figures: parts side by side or below each other as the width allows, their labels, titles and legends."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure, SubFigure
from matplotlib.font_manager import FontProperties
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

from finger_pin.typing import Array
from finger_pin.views.plots.style import Width, inches, new_figure, power_of_ten, settings

# Parts are drawn at this share of their own width before they go below each other.
_NARROWEST = 0.62
# Of the heights of panels, where a figure is for a journal.
_LOWER = 0.82
# Mean width of a letter, in parts of the size of the text, and inches of a legend's entry besides its text.
_LETTER, _HANDLE = 0.5, 0.45

# Most letters in a line of a strip's label.
_LINE = 13

# What is below this in the unit of a panel is zero.
_ROUNDING = 1e-9

# Share of samples, at either end, that may leave a panel.
_SPIKE = 0.001

# Steps between ticks, times powers of ten.
_FEW, _MANY = [1, 2, 5, 10], [1, 2, 2.5, 5, 10]


def sheet(
    parts: Sequence[tuple[float, float]], width: Width = None, titles: bool = True
) -> tuple[Figure, list[SubFigure]]:
    """Return a figure and its parts, side by side, or below each other if its width is too small.

    Args:
        parts: Width and height of every part where there is room, in.
        width: Of the figure; default the parts' own.
        titles: Whether panels have titles.
    """
    found = inches(width)
    whole = found or sum(each for each, _ in parts)
    rows: list[list[tuple[float, float]]] = [[]]
    for part in parts:
        if rows[-1] and _NARROWEST * (sum(each for each, _ in rows[-1]) + part[0]) > whole:
            rows.append([])
        rows[-1].append(part)
    heights = [(1.0 if found is None else _LOWER) * max(height for _, height in row) for row in rows]
    figure = new_figure(whole, sum(heights), titles=titles)
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
    found = inches(width)
    across = min(columns, count)
    if found is not None:
        across = max(1, min(across, int(found / (_NARROWEST * cell[0]))))
    down = -(-count // across)
    height = cell[1] * (1.0 if found is None else min(1.0, max(_NARROWEST, found / across / cell[0])))
    figure = new_figure(found or cell[0] * across, height * down, titles=titles)
    panels = list(figure.subplots(down, across, squeeze=False, sharex=sharex).ravel())
    for spare in panels[count:]:
        spare.remove()
    return figure, panels[:count]


def stack(part: Figure | SubFigure, labels: Sequence[str], heights: Sequence[float] | None = None) -> list[Axes]:
    """Return panels below each other that share their time axis.

    Args:
        part: The part of the figure.
        labels: Label of every panel's vertical axis, from the top.
        heights: Relative heights of the panels; equal by default.
    """
    ratios = {"height_ratios": heights} if heights else {}
    panels: list[Axes] = list(part.subplots(len(labels), 1, sharex=True, squeeze=False, gridspec_kw=ratios)[:, 0])
    for axes, label in zip(panels, labels, strict=True):
        axes.set_ylabel(label)
        axes.yaxis.set_major_locator(MaxNLocator(4, steps=_FEW) if len(labels) > 2 else MaxNLocator(7, steps=_MANY))
        axes.xaxis.set_major_locator(MaxNLocator(6, steps=_FEW))
        axes.margins(x=0.0)
    panels[-1].set_xlabel("time (s)")
    part.align_ylabels(panels)
    return panels


def title(axes: Axes, text: str) -> None:
    """Write a title, unless the figure has none."""
    if getattr(axes.get_figure(root=True), "titled", True):
        spot, part = axes.get_subplotspec(), axes.get_figure()
        assert part is not None
        width = part.bbox.width / part.dpi / (1 if spot is None else spot.get_gridspec().ncols)
        points = _points("axes.titlesize")
        # Left of the panel are the labels of ticks and of the axis, of two lines at most; letters of titles are wide.
        written = _wrap(text, min(0.86 * width, width - 8.0 * points / 72.0), points)
        # Panels in three dimensions do not look up the place.
        axes.set_title(written, loc=settings["axes.titlelocation"])


def heading(figure: Figure, text: str) -> None:
    """Write a title of a whole figure, unless it has none."""
    if getattr(figure, "titled", True):
        figure.suptitle(_wrap(text, 0.92 * figure.get_figwidth(), _points("figure.titlesize")), x=0.02, ha="left")


def _wrap(text: str, width: float, points: float) -> str:
    """Return a text in lines that fit into a width, in, in letters of a size."""
    letters = max(12, int(72.0 * width / (_LETTER * points)))
    return "\n".join(textwrap.fill(line, letters, break_long_words=False) for line in text.splitlines())


def _points(setting: str) -> float:
    """Return a size of text in points."""
    return float(FontProperties(size=settings[setting]).get_size_in_points())


def flatten_rounding(axes: Axes) -> None:
    """Make a panel that holds nothing but rounding errors two units high, so that zero looks like zero."""
    if max(map(abs, axes.dataLim.intervaly)) < _ROUNDING:
        axes.set_ylim(-1.0, 1.0)


def cut_spikes(axes: Axes, *signals: Array) -> None:
    """Let a spike leave a panel that would be twice as high for a thousandth of the samples."""
    values = np.concatenate(signals)
    low, high = np.quantile(values, [_SPIKE, 1.0 - _SPIKE])
    if np.ptp(values) > 2.0 * (high - low) > _ROUNDING:
        axes.set_ylim(low - 0.1 * (high - low), high + 0.1 * (high - low))


def legend(part: Figure | SubFigure, handles: Sequence[Artist]) -> None:
    """Write a legend below a part, in as many columns as its width holds, if there is anything to name."""
    if handles:
        longest = max(len(str(each.get_label())) for each in handles)
        entry = _HANDLE + _LETTER * _points("legend.fontsize") * longest / 72.0
        rows = -(-len(handles) // max(1, int(part.bbox.width / part.dpi / entry)))
        # As many columns as the rows need: the last one is no stump.
        columns = -(-len(handles) // rows)
        part.legend(handles=handles, ncols=columns, frameon=False, loc="outside lower center", columnspacing=1.2,
                    handletextpad=0.5, borderaxespad=0.2)  # fmt: skip


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


def labelled(name: str, unit: str | None) -> str:
    """Return the label of a strip: its name and unit if any, on several lines if long."""
    whole = name if unit is None else " ".join([name, f"({unit})".replace(" ", "\N{NO-BREAK SPACE}")])
    lines = [""]
    for piece in re.split(r"(?<=[-. ])", whole):
        if lines[-1] and len((lines[-1] + piece).rstrip()) > _LINE:
            lines.append("")
        lines[-1] += piece
    return "\n".join(line.rstrip(" ") for line in lines)
