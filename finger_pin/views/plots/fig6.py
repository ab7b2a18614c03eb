"""Fig. 6: references, tracking errors, and every tendon's tension as planned and as delivered."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from finger_pin.views.plots.hands import finger_of, fingers_of, plot_by_finger
from finger_pin.views.plots.lines import names, passive_proximal, series, trace
from finger_pin.views.plots.panels import labelled, legend, stack, title
from finger_pin.views.plots.style import BLACK, BLUE, VERMILLION, new_figure, styled

_DEGREES = 180.0 / np.pi
_COLUMNS = (
    ("references θᵈ", "joint_reference", _DEGREES, "°"),
    ("tracking errors θᵈ \N{MINUS SIGN} θ", "tracking_error", _DEGREES, "°"),
    ("delivered tendon tensions", "tendon_tension", 1.0, "N"),
)


@styled
def plot_fig6(result: xr.Dataset, finger: str | None = None) -> Figure:
    """Draw Fig. 6 from a result.

    (a) theta^d and (b) theta^d - theta, deg. (c) One panel per tendon, N: dashed f_hat, solid f; for a passive
    tendon f is the tension of its distal half (f5_4), and that of its proximal half (f5_3) is dotted.

    Of a hand there is a row for each finger, with references, errors and delivered tensions.

    Args:
        result: Dataset of `simulate`, of any finger or hand.
        finger: One finger of a hand, drawn as a finger is.

    Raises:
        InputError: If there is no such finger.
    """
    if finger is not None:
        result = finger_of(result, finger)
    elif len(fingers_of(result)) > 1:
        return plot_by_finger(result, _COLUMNS)
    tendons = names(result, "tendon")
    figure = new_figure(11.0, max(6.6, 1.3 * len(tendons)))
    labels = ["reference θᵈ (°)", "error θᵈ \N{MINUS SIGN} θ (°)"]
    # One row of the legend for every four joints.
    bottom = 0.8 + 0.2 * ((result.sizes["joint"] - 1) // 4)
    angles = stack(figure, 0.0, 5.0, labels, gap=0.4, bottom=bottom)
    title(angles[0], "(a) references")
    _joints(angles[0], result, "joint_reference")
    title(angles[1], "(b) tracking errors")
    _joints(angles[1], result, "tracking_error")
    legend(angles[1], angles[0].get_lines(), columns=4)
    panels = stack(figure, 5.1, 10.8, [labelled(name, "N") for name in tendons], bottom=bottom)
    title(panels[0], "(c) tendon tensions")
    _tensions(panels, result)
    handles = {line.get_label(): line for line in [*panels[0].get_lines(), *panels[-1].get_lines()]}
    legend(panels[-1], list(handles.values()), columns=3)
    return figure


def _joints(axes: Axes, result: xr.Dataset, variable: str) -> None:
    time, values = result["time"].values, np.rad2deg(result[variable].transpose("time", "joint").values)
    for index, name in enumerate(names(result, "joint")):
        trace(axes, time, values[:, index], label=name, **series(index))


def _tensions(panels: list[Axes], result: xr.Dataset) -> None:
    time = result["time"].values
    planned = result["tendon_command"].transpose("time", "tendon").values
    delivered = result["tendon_tension"].transpose("time", "tendon").values
    proximal = passive_proximal(result)
    other = f"proximal half of {next(iter(proximal))}" if len(proximal) == 1 else "proximal half"
    dots: dict[str, Any] = {"label": other, "color": VERMILLION, "linestyle": ":", "linewidth": 1.8}
    for index, (axes, name) in enumerate(zip(panels, names(result, "tendon"), strict=True)):
        trace(axes, time, delivered[:, index], label="delivered", color=BLUE)
        trace(axes, time, planned[:, index], label="planned", color=BLACK, linestyle="--", linewidth=1.0)
        if name in proximal:
            trace(axes, time, proximal[name], **dots)
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
