"""A run and its repetition at a tighter tolerance, and the time at which they part."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from finger_pin.typing import Array
from finger_pin.views.plots.lines import names, series, times
from finger_pin.views.plots.panels import legend, logarithmic, sheet, stack, title
from finger_pin.views.plots.style import GREY, Width, colour, limit_line, styled
from finger_pin.views.shown_units import shown_joints

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
