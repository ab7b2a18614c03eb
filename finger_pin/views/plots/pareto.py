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
from finger_pin.views.plots.panels import grid, legend, title
from finger_pin.views.plots.style import BLACK, BLUE, GREY, VERMILLION, Width, colour, styled, thin
from finger_pin.views.shown_units import in_shown_units

# Percentiles of the designs that are in view whatever they are, and the room around them, in shares of their span.
_IN_VIEW, _ROOM = (0.0, 95.0), 0.08
# Designs of a front that are nearer to one with a number than this have none, in parts of the panel.
_APART = (0.035, 0.04)


@styled
def plot_pareto(result: xr.Dataset, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw every design that keeps the constraints over each two objectives, the front, and the design at the start.

    Of one objective its course is drawn: every design, and the best so far. Designs that break a constraint are left
    out, but for the one at the start.

    Args:
        result: Dataset of `optimise`.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.

    Raises:
        InputError: If the Dataset is of another kind.
    """
    if "minimise" not in result.attrs:
        raise InputError("result", "must be of optimise")
    result = in_shown_units(result)
    names = [name for kind in ("minimise", "maximise") for name in result.attrs[kind].split(", ") if name]
    if len(names) == 1:
        return _course(result, names[0], width, titles)
    if len(names) == 2:
        # A front of one design is a point: there is nothing to magnify.
        figure, panels = grid(1 if int((result["front"] > 0).sum()) == 1 else 2, 2, (5.5, 5.2), width, titles)
        _pair(panels[0], result, *names)
        if panels[1:]:
            _magnify(panels[0], panels[1], result, *names)
    else:
        pairs = list(combinations(names, 2))
        figure, panels = grid(len(pairs), 3, (4.6, 4.4), width, titles)
        for axes, (first, second) in zip(panels, pairs, strict=True):
            _pair(axes, result, first, second)
    legend(figure, panels[0].get_legend_handles_labels()[0])
    return figure


def _pair(axes: Axes, result: xr.Dataset, first: str, second: str) -> None:
    """Draw designs that keep the bounds, front and start, with all but the farthest designs in view."""
    x, y, front = (result[name].values for name in (first, second, "front"))
    kept = result["feasible"].values & (front == 0)
    if kept.any():
        axes.plot(x[kept], y[kept], "o", label="kept bounds", **_kept_look())
    axes.plot(x[front > 0], y[front > 0], "o", color=colour(VERMILLION), markersize=5.0, label="front", zorder=3)
    if result["status"].values[0] == "done":
        note = "start" if result["feasible"].values[0] else "start, breaks a bound"
        axes.plot(x[:1], y[:1], "*", color=colour(BLACK), markersize=12.0, label=note)
    axes.set_xlabel(textwrap.fill(_label(result, first), 42))
    axes.set_ylabel(textwrap.fill(_label(result, second), 42))
    always = front > 0
    always[0] = True
    for values, limit in ((x, axes.set_xlim), (y, axes.set_ylim)):
        most = values[kept & np.isfinite(values)]
        shown = np.concatenate([values[always], np.percentile(most, _IN_VIEW) if most.size else most])
        shown = shown[np.isfinite(shown)]
        if shown.size and np.ptp(shown) > 0.0:
            limit(shown.min() - _ROOM * np.ptp(shown), shown.max() + _ROOM * np.ptp(shown))
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    beyond = int((kept & ~((x >= left) & (x <= right) & (y >= low) & (y <= high))).sum())
    title(axes, _count(int(result["feasible"].sum())) + (f", {beyond} beyond the edges" if beyond else ""))


def _magnify(whole: Axes, close: Axes, result: xr.Dataset, first: str, second: str) -> None:
    """Draw the front with its numbers, and where it lies among all designs."""
    x, y, front = (result[name].values for name in (first, second, "front"))
    order = np.argsort(np.where(front > 0, front, np.inf))[: int((front > 0).sum())]
    close.set_xlabel(whole.get_xlabel())
    if not order.size:
        close.set_axis_off()
        close.text(0.5, 0.5, "no design keeps all bounds", transform=close.transAxes, ha="center", color=colour(GREY))
        return
    kept = result["feasible"].values & (front == 0)
    close.plot(x[kept], y[kept], "o", **_kept_look())
    # Between two designs of a front nothing is known to be better than the worse value of either.
    falls = second in result.attrs["minimise"].split(", ")
    between: Any = {"color": colour(VERMILLION), "linewidth": thin(), "alpha": 0.6}
    close.step(x[order], y[order], where="post" if falls else "pre", **between)
    close.plot(x[order], y[order], "o", color=colour(VERMILLION), markersize=5.0)
    for values, limit in ((x[order], close.set_xlim), (y[order], close.set_ylim)):
        span = np.ptp(values) or 0.02 * abs(values[0]) or 1.0
        limit(values.min() - 0.35 * span, values.max() + 0.35 * span)
    numbered: list[np.ndarray] = []
    for row in order:
        at = close.transAxes.inverted().transform(close.transData.transform((x[row], y[row])))
        if all(np.any(np.abs(at - other) > _APART) for other in numbered):
            numbered.append(at)
            spot: Any = {"xytext": (5, 4), "textcoords": "offset points", "fontsize": "small"}
            close.annotate(str(front[row]), (x[row], y[row]), **spot)
    title(close, f"the front: {len(order)} designs")
    close.xaxis.set_major_locator(MaxNLocator(6))
    (left, right), (low, high) = close.get_xlim(), close.get_ylim()
    whole.add_patch(Rectangle((left, low), right - left, high - low, fill=False, edgecolor=colour(GREY), alpha=0.8))


def _course(result: xr.Dataset, name: str, width: Width, titles: bool) -> Figure:
    figure, (axes,) = grid(1, 1, (7.5, 4.6), width, titles)
    rows = np.flatnonzero(result["feasible"].values)
    values = result[name].values[rows]
    pick = np.minimum if result.attrs["minimise"] else np.maximum
    axes.plot(rows, values, "o", label="kept bounds", **_kept_look())
    if rows.size:
        axes.step(rows, pick.accumulate(values), where="post", color=colour(VERMILLION), label="best so far")
    else:
        axes.text(0.5, 0.5, "no design keeps all bounds", transform=axes.transAxes, ha="center", color=colour(GREY))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("design, in the order of the search")
    axes.set_ylabel(_label(result, name))
    axes.legend(loc="best")
    return figure


def _count(designs: int) -> str:
    return f"{designs} design{'s' if designs > 1 or not designs else ''}"


def _kept_look() -> dict[str, Any]:
    """Return the look of designs that keep the bounds."""
    return {"color": colour(BLUE), "alpha": 0.35, "markersize": 4.0, "markeredgewidth": 0.0}


def _label(result: xr.Dataset, name: str) -> str:
    return f"{result[name].attrs['long_name']} ({result[name].attrs['units']})"
