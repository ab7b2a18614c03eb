"""The energy account: energies stored, supplied and lost, and the residual."""

from __future__ import annotations

from itertools import cycle

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from finger_pin.mechanism.rows import LOST, STORED, SUPPLIED
from finger_pin.simulation.energy import entries
from finger_pin.typing import Array
from finger_pin.views.plots.lines import shade, times, trace
from finger_pin.views.plots.panels import labelled, legend, logarithmic, sheet, stack, title
from finger_pin.views.plots.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    YELLOW,
    Width,
    colour,
    power_of_ten,
    styled,
    thin,
)
from finger_pin.views.shown_units import prefixed

#: Of losses, in their order; they begin anew where there are more.
_COLOURS = (
    *(VERMILLION, ORANGE, YELLOW, PURPLE, BLUE, SKY, BLACK, GREEN),
    *("saddlebrown", "darkcyan", "palevioletred", "tan", "firebrick", "slategrey", "lightsteelblue", "olive"),
    *("yellowgreen", "darkolivegreen", "sienna", "mediumpurple", "rosybrown"),
)
# Parts of the intake: less is stored as good as never, and less of a loss is thinner than a line.
_STORED, _LOST = 1e-9, 1e-3


@styled
def plot_energy(result: xr.Dataset, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw the energy account from a result.

    (a) Every stored energy but traces. (b) What has been supplied, and on top of each other what has been
    lost, named where it shows; with the change of the stored energy this must reach what was supplied. (c) What the
    account cannot explain, as a part of the intake: the most that was supplied, or taken from store.

    Args:
        result: Dataset of `simulate`, of any finger.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    time = times(result)
    stored, coming, lost = (entries(result, kind) for kind in (STORED, SUPPLIED, LOST))
    supplied, total = (np.sum([each.values for each in kind.values()], axis=0) for kind in (coming, stored))
    intake = float(np.max(np.abs(supplied) + np.maximum(total[0] - total, 0.0)))
    # There is always one panel: that of the kinetic energy, which comes first.
    traces = [np.max(np.abs(each.values)) <= _STORED * intake for each in stored.values()]
    shown = [each for index, each in enumerate(stored.values()) if not (index and traces[index])]
    figure, (left, right) = sheet([(5.1, max(6.6, 1.35 * len(shown))), (5.9, 6.6)], width, titles)
    scales = [prefixed(each.values, "J") for each in shown]
    labels = [labelled(each.attrs["label"], unit) for each, (_, unit) in zip(shown, scales, strict=True)]
    strips = stack(left, labels)
    title(strips[0], "(a) stored energy")
    for axes, energy, (factor, _) in zip(strips, shown, scales, strict=True):
        trace(axes, time, factor * energy.values, color=BLUE, linewidth=thin())
    factor, unit = prefixed(np.array([intake]), "J")
    above, below = stack(right, [f"energy ({unit})", "|residual| / intake"], heights=[2.2, 1.0])
    _balance(above, time, supplied, lost, total, _LOST * intake, factor)
    handles = above.get_legend_handles_labels()[0]
    legend(right, [handles[-1], *handles[-2::-1]])
    _residual(below, result, intake)
    return figure


def _balance(
    axes: Axes, time: Array, supplied: Array, lost: dict[str, xr.Variable], stored: Array, least: float, factor: float
) -> None:
    level = np.zeros(len(time))
    for loss, look in zip(lost.values(), cycle(_COLOURS), strict=False):
        if np.any(loss.values):
            above = level + factor * loss.values
            named = {"label": loss.attrs["label"]} if np.max(np.abs(loss.values)) > least else {}
            shade(axes, time, level, above, color=look, alpha=0.8, **named)
            level = above
    change = factor * (stored - stored[0])
    shade(axes, time, level, level + np.maximum(change, 0.0), color=GREY, alpha=0.35, label="put into store")
    if np.min(change) < -factor * least:
        hatching = {"facecolor": "none", "edgecolor": colour(BLACK), "hatch": "////", "alpha": 0.5}
        shade(axes, time, level + np.minimum(change, 0.0), level, label="taken from store", **hatching)
    trace(axes, time, factor * supplied, label="supplied", color=BLACK, linewidth=thin(1.15))
    if axes.dataLim.y0 >= 0.0:
        axes.set_ylim(bottom=0.0)
    title(axes, "(b) supplied energy and its uses")


def _residual(axes: Axes, result: xr.Dataset, scale: float) -> None:
    time, residual = times(result), result["energy_residual"].values
    share = np.abs(residual) / (scale or 1.0)
    worst = float(np.max(share))
    if worst > 0.0:
        # Zeros have no place on a logarithmic axis: they go below its end.
        logarithmic(axes)
        axes.set_ylim(1e-4 * worst, 10.0 * worst)
        share = np.maximum(share, 1e-6 * worst)
    trace(axes, time, share, color=BLUE, linewidth=thin(0.65))
    title(axes, f"(c) unexplained: at most {_scientific(worst)} {'of the intake' if scale else 'J'}")
    if not scale:
        axes.set_ylabel("|residual| (J)")


def _scientific(value: float) -> str:
    mantissa, exponent = f"{value:.0e}".split("e")
    return f"{mantissa} \N{MULTIPLICATION SIGN} {power_of_ten(int(exponent))}" if value else "0"
