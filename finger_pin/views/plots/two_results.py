"""Two results in one figure."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from finger_pin.exceptions import InputError
from finger_pin.simulation.recording import is_tracking
from finger_pin.views.plots.lines import names, times, trace
from finger_pin.views.plots.panels import NO_TENDONS, empty_panel, labelled, legend, sheet, stack, title
from finger_pin.views.plots.style import BLACK, BLUE, VERMILLION, Width, styled, thin
from finger_pin.views.shown_units import shown_joints


@styled
def compare(
    first: xr.Dataset,
    second: xr.Dataset,
    labels: tuple[str, str] = ("first", "second"),
    *,
    width: Width = None,
    titles: bool = True,
) -> Figure:
    """Draw two results of fingers with the same joints and tendons over each other.

    (a) theta by joint, deg, with the references. (b) theta^d - theta by joint, deg, or where no joints had a reference
    theta', deg/s. (c) The delivered tension f by tendon, N.

    Args:
        first: Dataset of `simulate`.
        second: Another; it may be longer or sampled otherwise.
        labels: Names of the two in the legend.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    for coordinate in ("joint", "tendon"):
        if names(first, coordinate) != names(second, coordinate):
            allowed = f"must have the {coordinate}s of the first, {', '.join(names(first, coordinate))}"
            raise InputError("second", allowed, names(second, coordinate))
    joints, tendons = names(first, "joint"), names(first, "tendon")
    height = max(6.6, 1.3 * max(len(joints), len(tendons)))
    figure, panel_groups = sheet([(4.8, height)] * 3, width, titles)
    start_time = min(times(result)[0] for result in (first, second))
    end_time = max(times(result)[-1] for result in (first, second))
    tracking, units_by_joint = is_tracking(first) or is_tracking(second), shown_joints(first)
    factors = np.array([factor for factor, _ in units_by_joint.values()])
    angles = [unit for _, unit in units_by_joint.values()]
    rates = [f"{unit}/s" for unit in angles]
    columns = (
        (
            joints,
            angles,
            f"(a) joint angles{', reference dashed' if tracking else ''}",
            "joint_position",
            "joint",
            factors,
        ),
        (joints, angles, "(b) tracking errors", "tracking_error", "joint", factors)
        if tracking
        else (joints, rates, "(b) joint velocities, without a reference", "joint_velocity", "joint", factors),
        (tendons, ["N"] * len(tendons), "(c) delivered tensions", "tendon_tension", "tendon", 1.0),
    )
    for part, (rows, units, text, variable, coordinate, scale) in zip(panel_groups, columns, strict=True):
        if not rows:
            empty_panel(part, NO_TENDONS)
            continue
        panels = stack(part, list(map(labelled, rows, units)))
        title(panels[0], text)
        for result, label, colour in zip((first, second), labels, (BLUE, VERMILLION), strict=True):
            time = times(result)
            curves = {variable: {"label": label, "color": colour, "linewidth": thin()}}
            if variable == "tracking_error" and not is_tracking(result):
                continue
            if variable == "joint_position" and is_tracking(result):
                curves["joint_reference"] = {"color": BLACK, "linestyle": "--", "linewidth": thin(0.6), "zorder": 1.5}
            for name, options in curves.items():
                values = scale * result[name].transpose("time", coordinate).values
                for axes, column in zip(panels, values.T, strict=True):
                    trace(axes, time, column, **options)
        panels[0].set_xlim(start_time, end_time)
        legend(part, [line for line in panels[0].get_lines() if line.get_label() in labels])
    return figure
