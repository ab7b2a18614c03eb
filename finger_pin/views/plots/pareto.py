"""Designs of a search over each two objectives, their front, and the design that it began with."""

from __future__ import annotations

import textwrap
from itertools import combinations
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from finger_pin.exceptions import InputError
from finger_pin.views.plots.panels import empty_axes, grid, legend, title
from finger_pin.views.plots.style import BLACK, BLUE, GREY, VERMILLION, Width, colour, styled, thin
from finger_pin.views.shown_units import in_shown_units

# Percentiles of the designs that are in view whatever they are, and the room around them, in shares of their span.
_PERCENTILES, _MARGIN = (0.0, 95.0), 0.08
# Designs of a front that are nearer to one with a number than this have none, in parts of the panel.
_LABEL_DISTANCE = (0.035, 0.04)
_NONE_FEASIBLE = "no design keeps all bounds"


@styled
def plot_pareto(result: xr.Dataset, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw every design that keeps the constraints over each two objectives, the front, and the design at the start.

    Of one objective its course is drawn: every design, and the best so far. Designs that break a constraint are left
    out, but for the one at the start.

    Args:
        result: Dataset of `optimise`.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    if "minimise" not in result.attrs:
        raise InputError("result", "must be of optimise")
    result = in_shown_units(result)
    names = [name for kind in ("minimise", "maximise") for name in result.attrs[kind].split(", ") if name]
    if len(names) == 1:
        return _draw_course(result, names[0], width, titles)
    if len(names) == 2:
        # A front of one design is a point, which needs no magnified panel.
        figure, panels = grid(1 if int((result["front"] > 0).sum()) == 1 else 2, 2, (5.5, 5.2), width, titles)
        _draw_pair(panels[0], result, *names)
        if panels[1:]:
            _draw_magnified(panels[0], panels[1], result, *names)
    else:
        pairs = list(combinations(names, 2))
        figure, panels = grid(len(pairs), 3, (4.6, 4.4), width, titles)
        for axes, (first, second) in zip(panels, pairs, strict=True):
            _draw_pair(axes, result, first, second)
    legend(figure, panels[0].get_legend_handles_labels()[0])
    return figure


def _draw_pair(axes: Axes, result: xr.Dataset, first: str, second: str) -> None:
    """Draw designs that keep the bounds, front and start, with all but the farthest designs in view."""
    x, y, front = (result[name].values for name in (first, second, "front"))
    feasible = result["feasible"].values & (front == 0)
    if feasible.any():
        axes.plot(x[feasible], y[feasible], "o", label="kept bounds", **_feasible_style())
    axes.plot(x[front > 0], y[front > 0], "o", color=colour(VERMILLION), markersize=5.0, label="front", zorder=3)
    if result["status"].values[0] == "done":
        note = "start" if result["feasible"].values[0] else "start, breaks a bound"
        axes.plot(x[:1], y[:1], "*", color=colour(BLACK), markersize=12.0, label=note)
    axes.set_xlabel(textwrap.fill(_label(result, first), 42))
    axes.set_ylabel(textwrap.fill(_label(result, second), 42))
    required = front > 0
    required[0] = True
    for values, limit in ((x, axes.set_xlim), (y, axes.set_ylim)):
        finite = values[feasible & np.isfinite(values)]
        in_view = np.concatenate([values[required], np.percentile(finite, _PERCENTILES) if finite.size else finite])
        in_view = in_view[np.isfinite(in_view)]
        if in_view.size and np.ptp(in_view) > 0.0:
            limit(in_view.min() - _MARGIN * np.ptp(in_view), in_view.max() + _MARGIN * np.ptp(in_view))
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    beyond = int((feasible & ~((x >= left) & (x <= right) & (y >= low) & (y <= high))).sum())
    count = int(result["feasible"].sum())
    title(axes, f"{count} design{'' if count == 1 else 's'}" + (f", {beyond} beyond the edges" if beyond else ""))


def _draw_magnified(overview: Axes, detail: Axes, result: xr.Dataset, first: str, second: str) -> None:
    """Draw the front with its numbers, and where it lies among all designs."""
    x, y, front = (result[name].values for name in (first, second, "front"))
    order = np.argsort(np.where(front > 0, front, np.inf))[: int((front > 0).sum())]
    detail.set_xlabel(overview.get_xlabel())
    if not order.size:
        detail.set_axis_off()
        empty_axes(detail, _NONE_FEASIBLE)
        return
    labelled_points = result["feasible"].values & (front == 0)
    detail.plot(x[labelled_points], y[labelled_points], "o", **_feasible_style())
    # Between two designs of a front only the worse value of both is known to be reached.
    is_falling = second in result.attrs["minimise"].split(", ")
    steps: Any = {"color": colour(VERMILLION), "linewidth": thin(), "alpha": 0.6}
    detail.step(x[order], y[order], where="post" if is_falling else "pre", **steps)
    detail.plot(x[order], y[order], "o", color=colour(VERMILLION), markersize=5.0)
    for values, limit in ((x[order], detail.set_xlim), (y[order], detail.set_ylim)):
        span = np.ptp(values) or 0.02 * abs(values[0]) or 1.0
        limit(values.min() - 0.35 * span, values.max() + 0.35 * span)
    numbered: list[np.ndarray] = []
    for row in order:
        position = detail.transAxes.inverted().transform(detail.transData.transform((x[row], y[row])))
        if all(np.any(np.abs(position - other_position) > _LABEL_DISTANCE) for other_position in numbered):
            numbered.append(position)
            annotation: Any = {"xytext": (5, 4), "textcoords": "offset points", "fontsize": "small"}
            detail.annotate(str(front[row]), (x[row], y[row]), **annotation)
    title(detail, f"the front: {len(order)} designs")
    detail.xaxis.set_major_locator(MaxNLocator(6))
    (left, right), (low, high) = detail.get_xlim(), detail.get_ylim()
    overview.add_patch(Rectangle((left, low), right - left, high - low, fill=False, edgecolor=colour(GREY), alpha=0.8))


def _draw_course(result: xr.Dataset, name: str, width: Width, titles: bool) -> Figure:
    figure, (axes,) = grid(1, 1, (7.5, 4.6), width, titles)
    rows = np.flatnonzero(result["feasible"].values)
    values = result[name].values[rows]
    best = np.minimum if result.attrs["minimise"] else np.maximum
    axes.plot(rows, values, "o", label="kept bounds", **_feasible_style())
    if rows.size:
        axes.step(rows, best.accumulate(values), where="post", color=colour(VERMILLION), label="best so far")
    else:
        empty_axes(axes, _NONE_FEASIBLE)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("design, in the order of the search")
    axes.set_ylabel(_label(result, name))
    axes.legend(loc="best")
    return figure


def _feasible_style() -> dict[str, Any]:
    """Return the look of designs that keep the bounds."""
    return {"color": colour(BLUE), "alpha": 0.35, "markersize": 4.0, "markeredgewidth": 0.0}


def _label(result: xr.Dataset, name: str) -> str:
    return f"{result[name].attrs['long_name']} ({result[name].attrs['units']})"
