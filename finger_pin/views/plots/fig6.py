"""Fig. 6: angles, tracking errors, and tensions as planned and as delivered, of one result or of two."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from finger_pin.exceptions import InputError
from finger_pin.simulation.recording import is_tracking
from finger_pin.typing import Array
from finger_pin.views.plots.hands import finger_of, fingers_of, plot_by_finger
from finger_pin.views.plots.lines import bundle, names, passive_proximal, times, trace
from finger_pin.views.plots.panels import NO_TENDONS, empty_panel, labelled, legend, sheet, stack, title
from finger_pin.views.plots.style import BLACK, BLUE, VERMILLION, Width, styled, thin
from finger_pin.views.shown_units import shown_joints

_DEGREES = 180.0 / np.pi
_DELIVERED_COLUMN = ("delivered tendon tensions", "tendon_tension", 1.0, "N")
_COLUMNS = (
    ("references θᵈ", "joint_reference", _DEGREES, "°"),
    ("tracking errors θᵈ \N{MINUS SIGN} θ", "tracking_error", _DEGREES, "°"),
    _DELIVERED_COLUMN,
)
_OPEN_LOOP_COLUMNS = (
    ("joint angles θ", "joint_position", _DEGREES, "°"),
    ("joint velocities", "joint_velocity", _DEGREES, "°/s"),
    _DELIVERED_COLUMN,
)


@styled
def plot_fig6(result: xr.Dataset, finger: str | None = None, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw Fig. 6 from a result.

    (a) theta over theta^d, dashed, and (b) theta^d - theta, deg; where nothing is followed, theta and its rate. (c)
    One panel per tendon, N: dashed f_hat, solid f; for a passive tendon f is the tension of its distal half (f5_4),
    and that of its proximal half (f5_3) is dotted.

    Of a hand there is a row for each finger, with references, errors and delivered tensions.

    Args:
        result: Dataset of `simulate`, of any finger or hand.
        finger: One finger of a hand, drawn as a finger is.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    if finger is not None:
        result = finger_of(result, finger)
    elif len(fingers_of(result)) > 1:
        return plot_by_finger(result, _COLUMNS if is_tracking(result) else _OPEN_LOOP_COLUMNS, width, titles)
    tendons = names(result, "tendon")
    height = max(6.6, 1.3 * len(tendons))
    figure, (left, right) = sheet([(5.1, height), (5.9, height)], width, titles)
    has_reference, tracking = bool(np.ptp(result["joint_reference"].values, axis=0).any()), is_tracking(result)
    units = " or ".join(dict.fromkeys(unit for _, unit in shown_joints(result).values()))
    lower = f"error θᵈ \N{MINUS SIGN} θ ({units})" if tracking else f"velocity ({units.replace(' or ', '/s or ')}/s)"
    angles = stack(left, [f"{'angle' if units == '°' else 'position'} θ ({units})", lower])
    is_constant = "; the references are constant" if tracking and not has_reference else ""
    title(angles[0], f"(a) joint angles{is_constant}")
    _draw_joints(angles[0], result, "joint_position")
    lines = list(angles[0].get_lines())
    if has_reference and tracking:
        lines.append(_draw_references(angles[0], result))
    title(angles[1], "(b) tracking errors" if tracking else "(b) joint velocities")
    _draw_joints(angles[1], result, "tracking_error" if tracking else "joint_velocity")
    legend(left, lines)
    if not tendons:
        empty_panel(right, NO_TENDONS)
        return figure
    panels = stack(right, [labelled(name, "N") for name in tendons])
    title(panels[0], "(c) tendon tensions")
    _draw_tensions(panels, result)
    handles = {line.get_label(): line for axes in panels for line in axes.get_lines()}
    legend(right, list(handles.values()))
    return figure


def _draw_joints(axes: Axes, result: xr.Dataset, variable: str) -> None:
    time, values = times(result), _in_shown_units(result, variable)
    bundle(axes, time, values, names(result, "joint"), range(values.shape[1]))


def _in_shown_units(result: xr.Dataset, variable: str) -> Array:
    """Return a variable of the joints or the tendons, shape (m, n), in the units that are shown."""
    signals = result[variable].transpose("time", ...)
    factors = np.array([factor for factor, _ in shown_joints(result).values()]) if "joint" in signals.dims else 1.0
    return np.asarray(factors * signals.values)


def _draw_references(axes: Axes, result: xr.Dataset) -> Line2D:
    """Draw theta^d of all joints, and return a line that stands for them."""
    time, values = times(result), _in_shown_units(result, "joint_reference")
    options: dict[str, Any] = {"color": BLACK, "linestyle": "--", "linewidth": thin(0.7)}
    return [trace(axes, time, column, label="reference θᵈ", **options) for column in values.T][-1]


def _draw_tensions(panels: list[Axes], result: xr.Dataset) -> None:
    time = times(result)
    planned = result["tendon_command"].transpose("time", "tendon").values
    delivered = result["tendon_tension"].transpose("time", "tendon").values
    proximal = passive_proximal(result)
    planned_line = f"proximal half of {next(iter(proximal))}" if len(proximal) == 1 else "proximal half"
    markers: dict[str, Any] = {"label": planned_line, "color": VERMILLION, "linestyle": ":", "linewidth": thin(1.3)}
    for index, (axes, name) in enumerate(zip(panels, names(result, "tendon"), strict=True)):
        trace(axes, time, delivered[:, index], label="delivered", color=BLUE)
        # A tendon commanded by an angle or a length has no planned tension: its command is zero throughout.
        if planned[:, index].any():
            trace(axes, time, planned[:, index], label="planned", color=BLACK, linestyle="--", linewidth=thin())
        if name in proximal:
            trace(axes, time, proximal[name], **markers)
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))


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
    tracking, angles = is_tracking(first) or is_tracking(second), [unit for _, unit in shown_joints(first).values()]
    rates = [f"{unit}/s" for unit in angles]
    columns = (
        (joints, angles, f"(a) joint angles{', reference dashed' if tracking else ''}", "joint_position"),
        (joints, angles, "(b) tracking errors", "tracking_error")
        if tracking
        else (joints, rates, "(b) joint velocities, without a reference", "joint_velocity"),
        (tendons, ["N"] * len(tendons), "(c) delivered tensions", "tendon_tension"),
    )
    for part, (rows, units, text, variable) in zip(panel_groups, columns, strict=True):
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
                for axes, column in zip(panels, _in_shown_units(result, name).T, strict=True):
                    trace(axes, time, column, **options)
        panels[0].set_xlim(start_time, end_time)
        legend(part, [line for line in panels[0].get_lines() if line.get_label() in labels])
    return figure
