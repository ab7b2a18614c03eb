"""Signals of a result as thinned lines and areas that keep every spike."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from finger_pin.simulation.netcdf import require_samples
from finger_pin.typing import Array
from finger_pin.views.plots.style import DASHES, colour, cycle_colours

#: Bins of a decimated line, two points each: more than a panel has columns of pixels.
BINS = 640
# Width of a line, as a share of a panel's height.
_LINE_SHARE = 0.005


def names(result: xr.Dataset, coordinate: str) -> list[str]:
    """Return the names along a coordinate of a result."""
    return [str(name) for name in result[coordinate].values]


def times(result: xr.Dataset) -> Array:
    """Return the sample times of a result, s, shape (m,)."""
    require_samples(result)
    return result["time"].values


def passive_proximal(result: xr.Dataset) -> dict[str, Array]:
    """Return the tension of the proximal half of every passive tendon, N, by tendon.

    A result with one passive tendon keeps it without a dimension of its own; the tendons list it last.
    """
    if "passive_tension_proximal" not in result:
        return {}
    tension = result["passive_tension_proximal"]
    if "passive_tendon" in tension.dims:
        columns = tension.transpose("time", "passive_tendon").values.T
        return dict(zip(names(result, "passive_tendon"), columns, strict=True))
    return {names(result, "tendon")[-1]: tension.values}


def extremes(values: Array, bins: int = BINS) -> NDArray[np.intp]:
    """Return the indices that draw a long line as it looks: the least and the greatest of every bin, and both ends.

    Args:
        values: Shape (m,).
        bins: Number of bins of equal length.

    Returns:
        Increasing indices, at most 2 bins + 2 of them; all of them where there are few.
    """
    size = len(values)
    if size <= 2 * bins:
        return np.arange(size)
    width = -(-size // bins)
    padded = np.append(values, np.full(-size % width, values[-1])).reshape(-1, width)
    start = np.arange(len(padded)) * width
    indices = np.concatenate([[0, size - 1], start + padded.argmin(axis=1), start + padded.argmax(axis=1)])
    return np.unique(np.minimum(indices, size - 1))


def trace(axes: Axes, time: Array, values: Array, **options: Any) -> Line2D:
    """Draw a signal, shape (m,), against time, shape (m,), thinned by `extremes`; return the line."""
    indices = extremes(values)
    if "color" in options:
        options["color"] = colour(options["color"])
    if len(values) == 1:
        options["marker"] = "."
    return axes.plot(time[indices], values[indices], **options)[0]


def bundle(axes: Axes, time: Array, values: Array, labels: Sequence[str], style_indices: Sequence[int]) -> list[Line2D]:
    """Draw signals, shape (m, n), against time; return the lines, dashed if one lies on another.

    Args:
        axes: The panel.
        time: Shape (m,).
        values: Shape (m, n).
        labels: Of the signals.
        style_indices: Of every signal, the index of its `series`.
    """
    tolerance = _LINE_SHARE * np.ptp(values)
    lines: list[Line2D] = []
    for index, (column, label, style_index) in enumerate(zip(values.T, labels, style_indices, strict=True)):
        hidden_count = sum(bool(np.abs(column - other).max() <= tolerance) for other in values.T[:index])
        dashes = {"dashes": (4, 4 * hidden_count)} if hidden_count else {}
        lines.append(trace(axes, time, column, label=label, **series(style_index) | dashes))
    return lines


def shade(axes: Axes, time: Array, first: Array, second: Array, **options: Any) -> None:
    """Fill between two signals, thinned so that no extreme of either is lost."""
    indices = np.union1d(extremes(first), extremes(second))
    if "color" in options:
        options["color"] = colour(options["color"])
    axes.fill_between(time[indices], first[indices], second[indices], linewidth=0.0, **options)


def series(index: int) -> dict[str, Any]:
    """Return colour and dashes of the series with this index."""
    colours = cycle_colours()
    return {"color": colours[index % len(colours)], "linestyle": DASHES[index // len(colours) % len(DASHES)]}
