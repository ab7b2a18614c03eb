"""What a search found: the designs over each two objectives, their front, and the design that it began with."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from finger_pin.plots.style import BLACK, BLUE, GREY, VERMILLION, new_figure, styled

# Values that differ by more than this factor are drawn on a logarithmic axis.
_WIDE = 30.0
# More designs on a front than this are not numbered all.
_NUMBERED = 24


@styled
def plot_pareto(result: xr.Dataset) -> Figure:
    """Draw every design that keeps the constraints over each two objectives, the front, and the design at the start.

    Of one objective its course is drawn: every design, and the best so far. Designs that break a constraint are left
    out, but for the one at the start.

    Args:
        result: Dataset of `optimise`.
    """
    names = [name for kind in ("minimise", "maximise") for name in result.attrs[kind].split(", ") if name]
    if len(names) == 1:
        return _course(result, names[0])
    pairs = list(combinations(names, 2))
    columns = min(len(pairs), 3)
    rows = -(-len(pairs) // columns)
    figure = new_figure(max(7.5, 4.6 * columns), max(5.4, 4.2 * rows), "constrained")
    grid = figure.subplots(rows, columns, squeeze=False)
    for spare in grid.ravel()[len(pairs) :]:
        spare.remove()
    for axes, (first, second) in zip(grid.ravel(), pairs, strict=False):
        _pair(axes, result, first, second, line=len(names) == 2)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


def _pair(axes: Axes, result: xr.Dataset, first: str, second: str, *, line: bool) -> None:
    x, y, front = (result[name].values for name in (first, second, "front"))
    kept = result["feasible"].values & (front == 0)
    axes.plot(x[kept], y[kept], "o", color=BLUE, alpha=0.35, markersize=3.5, markeredgewidth=0.0, label="kept bounds")
    order = np.argsort(np.where(front > 0, front, np.inf))[: int((front > 0).sum())]
    if line and order.size:
        # Between two designs of a front nothing is known to be better than the worse value of either.
        falls = second in result.attrs["minimise"].split(", ")
        axes.step(x[order], y[order], where="post" if falls else "pre", color=VERMILLION, linewidth=1.0, alpha=0.6)
    axes.plot(x[order], y[order], "o", color=VERMILLION, markersize=5.0, label="front")
    for row in order if len(order) <= _NUMBERED else ():
        axes.annotate(str(front[row]), (x[row], y[row]), xytext=(4, 4), textcoords="offset points", fontsize=8.5)
    if result["status"].values[0] == "done":
        note = "start" if result["feasible"].values[0] else "start, breaks a bound"
        axes.plot(x[:1], y[:1], "*", color=BLACK, markersize=11.0, label=note)
    axes.set_xlabel(_label(result, first))
    axes.set_ylabel(_label(result, second))
    shown = np.append(np.flatnonzero(result["feasible"].values), 0)
    for values, scale in ((x[shown], axes.set_xscale), (y[shown], axes.set_yscale)):
        finite = values[np.isfinite(values)]
        if finite.size and finite.min() > 0.0 and finite.max() > _WIDE * finite.min():
            scale("log")


def _course(result: xr.Dataset, name: str) -> Figure:
    figure = new_figure(7.5, 4.6, "constrained")
    axes = figure.subplots()
    rows = np.flatnonzero(result["feasible"].values)
    values = result[name].values[rows]
    pick = np.minimum if result.attrs["minimise"] else np.maximum
    axes.plot(rows, values, "o", color=BLUE, alpha=0.35, markersize=3.5, markeredgewidth=0.0, label="kept bounds")
    if rows.size:
        axes.step(rows, pick.accumulate(values), where="post", color=VERMILLION, label="best so far")
    else:
        axes.text(0.5, 0.5, "no design keeps all bounds", transform=axes.transAxes, ha="center", color=GREY)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("design, in the order of the search")
    axes.set_ylabel(_label(result, name))
    axes.legend(loc="best")
    return figure


def _label(result: xr.Dataset, name: str) -> str:
    return f"{result[name].attrs['long_name']} ({result[name].attrs['units']})"
