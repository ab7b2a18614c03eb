"""Fig. 6 in the paper's layout, the printed curves under ours."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from finger_pin.typing import Array
from finger_pin.views.plots.lines import names, trace
from finger_pin.views.plots.panels import labelled, legend, sheet, stack, title
from finger_pin.views.plots.style import BLACK, BLUE, VERMILLION, Width, colour, styled, thin
from paper.printed import Printed

_PRINT = {"color": "#F0C27B", "linewidth": 4.5, "solid_capstyle": "butt", "zorder": 1}
_HEIGHT = 7.2


@styled
def plot_printed(result: xr.Dataset, printed: Printed, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw the angles (a), errors (b), commands and tensions (c) of a result over the printed curves.

    Args:
        result: Dataset of the scenario `fig6`.
        printed: The printed curves; inside the strokes at jumps, where lines lie on each other, there are none.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    figure, (left, middle, right) = sheet([(3.8, _HEIGHT), (3.8, _HEIGHT), (4.4, _HEIGHT)], width, titles)
    time, joints, tendons = result["time"].values, names(result, "joint"), names(result, "tendon")
    angles = stack(left, [labelled(joint, "rad") for joint in joints])
    title(angles[0], "(a) joint angles")
    errors = stack(middle, [labelled(joint, "mrad") for joint in joints])
    title(errors[0], "(b) errors")
    for k, joint in enumerate(joints):
        _printed(angles[k], printed.time, printed.angles[:, k])
        trace(angles[k], time, result["joint_reference"].sel(joint=joint).values, color=BLACK, linestyle="--",
              linewidth=thin(0.8), label="reference")  # fmt: skip
        trace(angles[k], time, result["joint_position"].sel(joint=joint).values, color=BLUE, label="ours")
        _printed(errors[k], printed.time, 1e3 * printed.errors[:, k])
        trace(errors[k], time, 1e3 * result["tracking_error"].sel(joint=joint).values, color=BLUE)
        _fit(errors[k], 1e3 * printed.errors[:, k])
    panels = stack(right, [labelled(tendon, "N") for tendon in tendons])
    title(panels[0], "(c) commands (dashed) and tensions")
    for k, tendon in enumerate(tendons):
        for values in (printed.commands[:, k], printed.tensions[:, k]):
            _printed(panels[k], printed.time, values)
        command, tension = (result[name].sel(tendon=tendon).values for name in ("tendon_command", "tendon_tension"))
        trace(panels[k], time, command, color=BLACK, linestyle="--", linewidth=thin())
        trace(panels[k], time, tension, color=BLUE)
        shown = [printed.commands[:, k], printed.tensions[:, k]]
        if k == len(tendons) - 1:
            _printed(panels[k], printed.time, printed.medial)
            medial = result["passive_tension_proximal"].values.reshape(len(time))
            trace(panels[k], time, medial, color=VERMILLION, linestyle=":", linewidth=thin(1.3))
            shown.append(printed.medial)
        _fit(panels[k], np.concatenate(shown))
    print_, ours = angles[0].get_lines()[0], angles[0].get_lines()[2]
    print_.set_label("printed")
    legend(left, [print_, ours])
    legend(middle, [print_, ours])
    legend(right, [print_, ours])
    return figure


def _printed(axes: Axes, time: Array, values: Array) -> None:
    """Draw a printed curve, wide and pale."""
    axes.plot(time, values, **_PRINT | {"color": colour(_PRINT["color"])})


def _fit(axes: Axes, values: Array) -> None:
    """Let a panel show the printed range: at t = 0 ours starts from rest within a hundredth of a second."""
    low, high = np.nanmin(values), np.nanmax(values)
    axes.set_ylim(low - 0.08 * (high - low), high + 0.08 * (high - low))
