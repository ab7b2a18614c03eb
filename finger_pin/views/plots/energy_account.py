"""The energy account of a run, and its repetition at a tighter tolerance."""

from __future__ import annotations

from itertools import cycle

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from finger_pin.mechanism.rows import LOST, STORED, SUPPLIED
from finger_pin.simulation.energy import account_entries
from finger_pin.typing import Array
from finger_pin.views.plots.lines import names, series, shade, times, trace
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
    limit_line,
    power_of_ten,
    styled,
    thin,
)
from finger_pin.views.shown_units import prefixed, shown_joints

#: Of losses, in their order; they begin anew where there are more.
_COLOURS = (
    *(VERMILLION, ORANGE, YELLOW, PURPLE, BLUE, SKY, BLACK, GREEN),
    *("saddlebrown", "darkcyan", "palevioletred", "tan", "firebrick", "slategrey", "lightsteelblue", "olive"),
    *("yellowgreen", "darkolivegreen", "sienna", "mediumpurple", "rosybrown"),
)
# Parts of the intake: less is stored as good as never, and less of a loss is thinner than a line.
_LEAST_STORED, _LEAST_LOSS = 1e-9, 1e-3


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
    stored, supplies, losses = (account_entries(result, kind) for kind in (STORED, SUPPLIED, LOST))
    supplied, total = (np.sum([energy.values for energy in kind.values()], axis=0) for kind in (supplies, stored))
    supplied_energy = float(np.max(np.abs(supplied) + np.maximum(total[0] - total, 0.0)))
    # There is always one panel: that of the kinetic energy, which comes first.
    traces = [np.max(np.abs(energy.values)) <= _LEAST_STORED * supplied_energy for energy in stored.values()]
    stored_terms = [energy for index, energy in enumerate(stored.values()) if not (index and traces[index])]
    figure, (left, right) = sheet([(5.1, max(6.6, 1.35 * len(stored_terms))), (5.9, 6.6)], width, titles)
    scales = [prefixed(energy.values, "J") for energy in stored_terms]
    labels = [labelled(energy.attrs["label"], unit) for energy, (_, unit) in zip(stored_terms, scales, strict=True)]
    strips = stack(left, labels)
    title(strips[0], "(a) stored energy")
    for axes, energy, (factor, _) in zip(strips, stored_terms, scales, strict=True):
        trace(axes, time, factor * energy.values, color=BLUE, linewidth=thin())
    factor, unit = prefixed(np.array([supplied_energy]), "J")
    above, below = stack(right, [f"energy ({unit})", "|residual| / intake"], heights=[2.2, 1.0])
    _draw_balance(above, time, supplied, losses, total, _LEAST_LOSS * supplied_energy, factor)
    handles = above.get_legend_handles_labels()[0]
    legend(right, [handles[-1], *handles[-2::-1]])
    _draw_residual(below, result, supplied_energy)
    return figure


def _draw_balance(
    axes: Axes, time: Array, supplied: Array, losses: dict[str, xr.Variable], stored: Array, limit: float, factor: float
) -> None:
    level = np.zeros(len(time))
    for loss, options in zip(losses.values(), cycle(_COLOURS), strict=False):
        if np.any(loss.values):
            upper = level + factor * loss.values
            label = {"label": loss.attrs["label"]} if np.max(np.abs(loss.values)) > limit else {}
            shade(axes, time, level, upper, color=options, alpha=0.8, **label)
            level = upper
    change = factor * (stored - stored[0])
    shade(axes, time, level, level + np.maximum(change, 0.0), color=GREY, alpha=0.35, label="put into store")
    if np.min(change) < -factor * limit:
        hatching = {"facecolor": "none", "edgecolor": colour(BLACK), "hatch": "////", "alpha": 0.5}
        shade(axes, time, level + np.minimum(change, 0.0), level, label="taken from store", **hatching)
    trace(axes, time, factor * supplied, label="supplied", color=BLACK, linewidth=thin(1.15))
    if axes.dataLim.y0 >= 0.0:
        axes.set_ylim(bottom=0.0)
    title(axes, "(b) supplied energy and its uses")


def _draw_residual(axes: Axes, result: xr.Dataset, scale: float) -> None:
    time, residual = times(result), result["energy_residual"].values
    share = np.abs(residual) / (scale or 1.0)
    worst = float(np.max(share))
    if worst > 0.0:
        # Zeros are moved below the end of the logarithmic axis.
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


# A difference changes sign all the time: on a logarithmic axis only its greatest values show something.
_BINS = 400
# Below this runs agree to rounding, deg.
_ROUNDING = 1e-12


@styled
def plot_convergence(result: xr.Dataset, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw every joint's difference from the run at a tighter tolerance, deg or m, and the time at which they part.

    Args:
        result: Dataset of `simulate`, of any finger, with what `Convergence.attach` adds.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    figure, (part,) = sheet([(8.0, 4.2)], width, titles)
    factors, deviation = zip(*shown_joints(result).values(), strict=True)
    (axes,) = stack(part, [f"greatest difference ({' or '.join(dict.fromkeys(deviation))})"])
    values = np.abs(np.array(factors) * result["convergence_difference"].transpose("time", "joint").values)
    reached = np.isfinite(values).all(axis=1)
    time, values = times(result)[reached], np.maximum(values[reached], _ROUNDING)
    for index, name in enumerate(names(result, "joint")):
        axes.plot(*_envelope(time, values[:, index]), label=name, **series(index))
    logarithmic(axes)
    axes.set_xlim(time[0], max(time[-1], time[0] + 1e-9))
    limit, parting = np.rad2deg(result.attrs["convergence_limit"]), result.attrs["convergence_parting_time"]
    axes.axhline(limit, label=f"limit, {limit:.2g}°", **limit_line())
    lines = list(axes.get_lines())
    if np.isfinite(parting):
        axes.axvline(parting, **limit_line())
        axes.text(parting, 0.02, f" parts at {parting:.3g} s", color=colour(GREY), transform=axes.get_xaxis_transform())
    title(axes, f"from the run at rtol {result.attrs['convergence_rtol']:.0e}")
    legend(part, lines)
    return figure


def _envelope(time: Array, values: Array) -> tuple[Array, Array]:
    """Return the greatest value of every bin, and when it is reached."""
    bins = np.array_split(np.arange(len(time)), min(_BINS, len(time)))
    indices = np.array([bin_indices[np.argmax(values[bin_indices])] for bin_indices in bins])
    return time[indices], values[indices]
