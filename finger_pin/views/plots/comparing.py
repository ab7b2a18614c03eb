"""Two results in one figure."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from finger_pin.exceptions import InputError
from finger_pin.views.plots.lines import names, trace
from finger_pin.views.plots.panels import labelled, legend, stack, title
from finger_pin.views.plots.style import BLACK, BLUE, VERMILLION, new_figure, styled


@styled
def compare(first: xr.Dataset, second: xr.Dataset, labels: tuple[str, str] = ("first", "second")) -> Figure:
    """Draw two results of fingers with the same joints and tendons over each other.

    (a) theta by joint, deg, with the references. (b) theta^d - theta by joint, deg. (c) The delivered tension f by
    tendon, N.

    Args:
        first: Dataset of `simulate`.
        second: Another; it may be longer or sampled otherwise.
        labels: What the two are called.

    Raises:
        InputError: If joints or tendons differ.
    """
    for coordinate in ("joint", "tendon"):
        if names(first, coordinate) != names(second, coordinate):
            allowed = f"must have the {coordinate}s of the first, {', '.join(names(first, coordinate))}"
            raise InputError("second", allowed, names(second, coordinate))
    joints, tendons = names(first, "joint"), names(first, "tendon")
    figure = new_figure(14.5, max(6.6, 1.3 * max(len(joints), len(tendons))))
    start = min(result["time"].values[0] for result in (first, second))
    end = max(result["time"].values[-1] for result in (first, second))
    columns = (
        (0.0, 4.7, joints, "°", "(a) joint angles, reference dashed", "joint_position", "joint", 180.0 / np.pi),
        (4.8, 9.5, joints, "°", "(b) tracking errors", "tracking_error", "joint", 180.0 / np.pi),
        (9.6, 14.3, tendons, "N", "(c) delivered tensions", "tendon_tension", "tendon", 1.0),
    )
    for left, right, rows, unit, text, variable, coordinate, scale in columns:
        panels = stack(figure, left, right, [labelled(name, unit) for name in rows])
        title(panels[0], text)
        for result, label, colour in zip((first, second), labels, (BLUE, VERMILLION), strict=True):
            time = result["time"].values
            drawn = {variable: {"label": label, "color": colour, "linewidth": 1.1}}
            if variable == "joint_position":
                drawn["joint_reference"] = {"color": BLACK, "linestyle": "--", "linewidth": 0.8, "zorder": 1.5}
            for name, look in drawn.items():
                values = scale * result[name].transpose("time", coordinate).values
                for axes, column in zip(panels, values.T, strict=True):
                    trace(axes, time, column, **look)
        panels[0].set_xlim(start, end)
        legend(panels[-1], [line for line in panels[0].get_lines() if line.get_label() in labels], columns=2)
    return figure
