"""Metrics of a sweep: lines over one key, maps over two, points over each of more."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullLocator

from finger_pin.exceptions import InputError
from finger_pin.typing import Array
from finger_pin.views.plots.panels import grid, heading, labelled, plain_ticks, title
from finger_pin.views.plots.style import BLUE, GREY, VERMILLION, Width, colour, inches, new_figure, styled
from finger_pin.views.shown_units import in_shown_units

_COLOUR_MAP = "cividis"
# Values that differ by more than this factor are coloured by their logarithm.
_LOGARITHMIC_RATIO = 50.0
# Look of a run among many.
_RUN_STYLE: Any = {"markersize": 3.5, "alpha": 0.6, "markeredgewidth": 0.0}
# Most letters in a line of a panel's title.
_TITLE_LETTERS = 36
# Most ticks along an axis of a map.
_MAX_TICKS = 7
# Parts of a key that a label does not need.
_OMITTED_PARTS = {"finger", "joints", "link", "tendons", "crossings"}


@styled
def plot_sweep(result: xr.Dataset, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw the metrics of a sweep: lines over one key, maps over two, points over each of more or of samples.

    Runs that failed are marked by crosses. The values of a key that holds names stand side by side. What is the same at
    every point of a map is said in words.

    Args:
        result: Dataset of `sweep`.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    if "status" not in result:
        raise InputError("result", "must be of sweep")
    keys = [str(name) for name in result.coords]
    result = _with_numbered_names(in_shown_units(result))
    if "sample" not in result.dims:
        keys = [key for key in keys if result.sizes[key] > 1] or keys[:1]
        result = result.squeeze([name for name in result.dims if name not in keys], drop=True)
    if len(keys) == 1:
        return _draw_lines(result, keys[0], width, titles)
    if len(keys) == 2 and "sample" not in result.dims:
        return _draw_maps(result, keys[0], keys[1], width, titles)
    return _draw_scatter(result, keys, width, titles)


def short_key(key: str) -> str:
    """Return a key in words, such as ``T3 medial radius``."""
    return " ".join(part.replace("_", " ") for part in key.split(".") if part not in _OMITTED_PARTS)


def _with_numbered_names(result: xr.Dataset) -> xr.Dataset:
    """Return a sweep with numbers from 0 in place of names, which are then the attribute ``names`` of their key."""
    for key, coordinate in result.coords.items():
        if coordinate.dtype.kind not in "iuf":
            names = list(dict.fromkeys(coordinate.values.tolist()))
            numbers = np.array([float(names.index(name)) for name in coordinate.values.tolist()])
            labels = [str(name).lower() if isinstance(name, bool) else str(name) for name in names]
            result = result.assign_coords({key: (coordinate.dims, numbers, {**coordinate.attrs, "names": labels})})
    return result


def _draw_lines(result: xr.Dataset, key: str, width: Width, titles: bool) -> Figure:
    figure, panels = _metric_panels(result, (4.6, 2.7), width, titles)
    # Names are not joined by lines.
    has_names = "names" in result[key].attrs
    order = np.argsort(result[key].values)
    values = result[key].values[order]
    failed_values = result["status"].values[order] == "failed"
    for name, axes in panels.items():
        metric = result[name].values[order]
        marker, line = ("o" if len(values) <= 40 or has_names else ""), ("none" if has_names else "-")
        axes.plot(values, metric, color=colour(BLUE), marker=marker, markersize=3.5, linestyle=line)
        axes.margins(x=0.2 if has_names else 0.02)
        _set_scale(axes.set_xscale, axes.xaxis, result[key])
        if not np.any(np.nan_to_num(metric)):
            axes.set_ylim(0.0, 1.0)
        axes.set_ylabel(_unit(result, name))
        _mark_failures(axes, values[failed_values])
    _legend(figure, panels)
    _name_axes(panels, _label(result, key), None)
    return figure


def _draw_maps(result: xr.Dataset, first: str, second: str, width: Width, titles: bool) -> Figure:
    figure, panels = _metric_panels(result, (4.9, 3.8), width, titles)
    x, y = result[first].values, result[second].values
    status = result["status"].transpose(first, second).values
    for name, axes in panels.items():
        values = result[name].transpose(first, second).values
        axes.grid(visible=False)
        finite = np.ma.masked_invalid(values)
        _set_scale(axes.set_xscale, axes.xaxis, result[first], swept=True)
        _set_scale(axes.set_yscale, axes.yaxis, result[second], swept=True)
        axes.set(xlim=_cell_edges(x)[[0, -1]], ylim=_cell_edges(y)[[0, -1]])
        if finite.count() and finite.min() == finite.max():
            # A colour scale for one value would suggest a range.
            domain = "at every point" if finite.count() == finite.size else "wherever it ended"
            text = f"{float(finite.min()):.4g} {_unit(result, name)}".strip() + f"\n{domain}"
            axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center")
        elif finite.count():
            is_logarithmic = finite.min() > 0.0 and finite.max() > _LOGARITHMIC_RATIO * finite.min()
            norm = LogNorm() if is_logarithmic else None
            image = axes.pcolormesh(_cell_edges(x), _cell_edges(y), finite.T, cmap=_COLOUR_MAP, norm=norm)
            figure.colorbar(image, ax=axes, label=_unit(result, name))
        for outcome, marker_style in (("failed", VERMILLION), ("missing", GREY)):
            row, column = np.nonzero(status == outcome)
            if row.size:
                axes.plot(x[row], y[column], "x", color=colour(marker_style), markersize=5.0, label=outcome)
    _legend(figure, panels)
    _name_axes(panels, _label(result, first), _label(result, second))
    return figure


def _draw_scatter(result: xr.Dataset, keys: list[str], width: Width, titles: bool) -> Figure:
    """Draw every run as a point over each key: a row per metric, a column per key."""
    metrics = _metrics(result)
    column_count = inches(width) or max(6.5, 2.3 * len(keys) + 0.8)
    figure = new_figure(column_count, 1.0 + 1.5 * len(metrics), titles=titles)
    panels = figure.subplots(len(metrics), len(keys), squeeze=False, sharex="col", sharey="row")
    failed = result["status"].values.ravel() != "done"
    for name, row in zip(metrics, panels, strict=True):
        row[0].set_ylabel(labelled(name.replace("_", " "), result[name].attrs["units"]))
        for key, axes in zip(keys, row, strict=True):
            axes.plot(_point_values(result, key), _point_values(result, name), "o", **_RUN_STYLE, color=colour(BLUE))
            axes.xaxis.set_major_locator(MaxNLocator(max(1, int(1.6 * column_count / len(keys) - 0.8))))
            axes.yaxis.set_major_locator(MaxNLocator(4))
            _set_scale(axes.set_xscale, axes.xaxis, result[key])
            _mark_failures(axes, _point_values(result, key)[failed])
    for key, axes in zip(keys, panels[-1], strict=True):
        axes.set_xlabel(labelled(short_key(key), result[key].attrs.get("units")))
        if "names" in result[key].attrs or column_count < 1.1 * len(keys):
            axes.margins(x=0.2)
            axes.tick_params(axis="x", rotation=90)
    count = f"{(~failed).sum()} runs" + (f", {failed.sum()} failed or missing (crosses)" if failed.any() else "")
    heading(figure, count)
    figure.align_labels()
    return figure


def _mark_failures(axes: Axes, places: Array) -> None:
    """Draw crosses along the horizontal axis where runs failed."""
    if places.size:
        options: Any = {"color": colour(VERMILLION), "transform": axes.get_xaxis_transform(), "clip_on": False}
        axes.plot(places, np.full(places.size, 0.03), "x", label="failed", **options)


def _point_values(result: xr.Dataset, name: str) -> Array:
    """Return a metric or a key at every point, shape (m,)."""
    values, status = result[name], result["status"]
    return np.asarray(values.broadcast_like(status).transpose(*status.dims).values, dtype=float).ravel()


def _metric_panels(
    result: xr.Dataset, cell: tuple[float, float], width: Width, titles: bool
) -> tuple[Figure, dict[str, Axes]]:
    """Return a figure with a panel per metric, each of a width and height in inches."""
    names = _metrics(result)
    columns = {1: 1, 2: 2, 4: 2}.get(len(names), 3)
    figure, places = grid(len(names), columns, (max(cell[0], 6.5 / columns), cell[1]), width, titles, sharex=True)
    panels = dict(zip(names, places, strict=True))
    for name, axes in panels.items():
        title(axes, textwrap.fill(str(result[name].attrs["long_name"]), _TITLE_LETTERS))
    return figure, panels


def _name_axes(panels: dict[str, Axes], first: str, second: str | None) -> None:
    """Write the names of the keys at the outer panels: the first one below, the second one at the left."""
    positions = {name: axes.get_subplotspec() for name, axes in panels.items()}
    lowest_row = {position.colspan.start: name for name, position in positions.items() if position is not None}
    for name, axes in panels.items():
        position = positions[name]
        assert position is not None
        if lowest_row[position.colspan.start] == name:
            axes.set_xlabel(first)
            axes.tick_params(labelbottom=True)
        if second is not None and position.colspan.start == 0:
            axes.set_ylabel(second)


def _legend(figure: Figure, panels: dict[str, Axes]) -> None:
    handles, labels = next(iter(panels.values())).get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside upper right", ncols=len(handles))


def _metrics(result: xr.Dataset) -> list[str]:
    return [str(name) for name in result.data_vars if name not in ("status", "reason")]


def _label(result: xr.Dataset, key: str) -> str:
    unit = result[key].attrs.get("units")
    return short_key(key) if unit is None else f"{short_key(key)} ({unit})"


def _unit(result: xr.Dataset, name: str) -> str:
    unit = str(result[name].attrs["units"])
    return "" if unit == "1" else unit


def _logarithmic(values: Array) -> bool:
    """Return whether steps are even in the logarithm, and uneven as they are."""
    if len(values) < 3 or np.min(values) <= 0.0:
        return False
    steps, ratios = np.diff(values), np.diff(np.log(values))
    return bool(np.allclose(ratios, ratios[0], rtol=1e-3) and not np.allclose(steps, steps[0], rtol=1e-2))


def _set_scale(set_scale: Any, axis: Axis, key: xr.DataArray, swept: bool = False) -> None:
    """Give an axis the scale of a key, with its names; or with ticks at its values, as many as there is room for."""
    if "names" in key.attrs:
        axis.set_ticks(range(len(key.attrs["names"])), key.attrs["names"])
    elif _logarithmic(key.values):
        set_scale("log")
        plain_ticks(axis)
    if swept and "names" not in key.attrs:
        values = np.sort(key.values)[:: -(-key.size // _MAX_TICKS)]
        axis.set_minor_locator(NullLocator())
        axis.set_ticks(values, [f"{value:.4g}" for value in values])


def _cell_edges(values: Array) -> Array:
    """Return the edges of cells around values, halfway between them on the axis as it is drawn."""
    positions = np.log(values) if _logarithmic(values) else values
    middle = 0.5 * (positions[1:] + positions[:-1])
    edges = np.concatenate([[2.0 * positions[0] - middle[0]], middle, [2.0 * positions[-1] - middle[-1]]])
    return np.exp(edges) if _logarithmic(values) else edges
