"""Where a run parts from its repetition at a tighter tolerance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from finger_pin.views.plots.lines import names, series
from finger_pin.views.plots.panels import legend, logarithmic, stack, title
from finger_pin.views.plots.style import GREY, new_figure, styled

if TYPE_CHECKING:
    from finger_pin.description.routing import Array

# A difference changes sign all the time: on a logarithmic axis only its greatest values show something.
_BINS = 400
# Below this runs agree to rounding, rad.
_LEAST = 1e-14


@styled
def plot_convergence(result: xr.Dataset) -> Figure:
    """Draw how far every joint is from the run at a tighter tolerance, rad, and where the two part.

    Args:
        result: Dataset of `simulate`, of any finger, with what `Convergence.attach` adds.
    """
    # One row of the legend for every five entries.
    bottom = 0.8 + 0.2 * (result.sizes["joint"] // 5)
    figure = new_figure(8.0, 3.2 + bottom)
    (axes,) = stack(figure, 0.0, 7.8, ["greatest difference (rad)"], bottom=bottom)
    values = np.abs(result["convergence_difference"].transpose("time", "joint").values)
    reached = np.isfinite(values).all(axis=1)
    time, values = result["time"].values[reached], np.maximum(values[reached], _LEAST)
    for index, name in enumerate(names(result, "joint")):
        axes.plot(*_envelope(time, values[:, index]), label=name, **series(index))
    logarithmic(axes)
    axes.set_xlim(time[0], max(time[-1], time[0] + 1e-9))
    limit, parting = result.attrs["convergence_limit"], result.attrs["convergence_parting_time"]
    axes.axhline(limit, color=GREY, linestyle="--", linewidth=1.0, label=f"limit, {limit:g} rad")
    lines = list(axes.get_lines())
    if np.isfinite(parting):
        axes.axvline(parting, color=GREY, linestyle="--", linewidth=1.0)
        axes.text(parting, 0.02, f" parts at {parting:.3g} s", color=GREY, transform=axes.get_xaxis_transform())
    title(axes, f"from the run at rtol {result.attrs['convergence_rtol']:.0e}")
    legend(axes, lines, columns=5)
    return figure


def _envelope(time: Array, values: Array) -> tuple[Array, Array]:
    """Return the greatest value of every bin, and when it is reached."""
    parts = np.array_split(np.arange(len(time)), min(_BINS, len(time)))
    kept = np.array([part[np.argmax(values[part])] for part in parts])
    return time[kept], values[kept]
