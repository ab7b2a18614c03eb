"""Fig. 6: angles over references, tracking errors, and every tendon's tension as planned and as delivered."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from finger_pin.simulation.recording import is_tracking
from finger_pin.typing import Array
from finger_pin.views.plots.hands import finger_of, fingers_of, plot_by_finger
from finger_pin.views.plots.lines import bundle, names, passive_proximal, times, trace
from finger_pin.views.plots.panels import NO_TENDONS, labelled, legend, remark, sheet, stack, title
from finger_pin.views.plots.style import BLACK, BLUE, VERMILLION, Width, styled, thin
from finger_pin.views.shown_units import shown_joints

_DEGREES = 180.0 / np.pi
_DELIVERED = ("delivered tendon tensions", "tendon_tension", 1.0, "N")
_COLUMNS = (
    ("references θᵈ", "joint_reference", _DEGREES, "°"),
    ("tracking errors θᵈ \N{MINUS SIGN} θ", "tracking_error", _DEGREES, "°"),
    _DELIVERED,
)
_OPEN_LOOP = (
    ("joint angles θ", "joint_position", _DEGREES, "°"),
    ("joint velocities", "joint_velocity", _DEGREES, "°/s"),
    _DELIVERED,
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

    Raises:
        InputError: If there is no such finger.
    """
    if finger is not None:
        result = finger_of(result, finger)
    elif len(fingers_of(result)) > 1:
        return plot_by_finger(result, _COLUMNS if is_tracking(result) else _OPEN_LOOP, width, titles)
    tendons = names(result, "tendon")
    height = max(6.6, 1.3 * len(tendons))
    figure, (left, right) = sheet([(5.1, height), (5.9, height)], width, titles)
    moves, tracks = bool(np.ptp(result["joint_reference"].values, axis=0).any()), is_tracking(result)
    units = " or ".join(dict.fromkeys(unit for _, unit in shown_joints(result).values()))
    below = f"error θᵈ \N{MINUS SIGN} θ ({units})" if tracks else f"velocity ({units.replace(' or ', '/s or ')}/s)"
    angles = stack(left, [f"{'angle' if units == '°' else 'position'} θ ({units})", below])
    constant = "; the references are constant" if tracks and not moves else ""
    title(angles[0], f"(a) joint angles{constant}")
    _joints(angles[0], result, "joint_position")
    lines = list(angles[0].get_lines())
    if moves and tracks:
        lines.append(_references(angles[0], result))
    title(angles[1], "(b) tracking errors" if tracks else "(b) joint velocities")
    _joints(angles[1], result, "tracking_error" if tracks else "joint_velocity")
    legend(left, lines)
    if not tendons:
        remark(right, NO_TENDONS)
        return figure
    panels = stack(right, [labelled(name, "N") for name in tendons])
    title(panels[0], "(c) tendon tensions")
    _tensions(panels, result)
    handles = {line.get_label(): line for axes in panels for line in axes.get_lines()}
    legend(right, list(handles.values()))
    return figure


def _joints(axes: Axes, result: xr.Dataset, variable: str) -> None:
    time, values = times(result), _shown(result, variable)
    bundle(axes, time, values, names(result, "joint"), range(values.shape[1]))


def _shown(result: xr.Dataset, variable: str) -> Array:
    """Return a variable of the joints, shape (m, n), in the units that are shown."""
    factors = np.array([factor for factor, _ in shown_joints(result).values()])
    return np.asarray(factors * result[variable].transpose("time", "joint").values)


def _references(axes: Axes, result: xr.Dataset) -> Line2D:
    """Draw theta^d of all joints, and return a line that stands for them."""
    time, values = times(result), _shown(result, "joint_reference")
    look: dict[str, Any] = {"color": BLACK, "linestyle": "--", "linewidth": thin(0.7)}
    return [trace(axes, time, column, label="reference θᵈ", **look) for column in values.T][-1]


def _tensions(panels: list[Axes], result: xr.Dataset) -> None:
    time = times(result)
    planned = result["tendon_command"].transpose("time", "tendon").values
    delivered = result["tendon_tension"].transpose("time", "tendon").values
    proximal = passive_proximal(result)
    other = f"proximal half of {next(iter(proximal))}" if len(proximal) == 1 else "proximal half"
    dots: dict[str, Any] = {"label": other, "color": VERMILLION, "linestyle": ":", "linewidth": thin(1.3)}
    for index, (axes, name) in enumerate(zip(panels, names(result, "tendon"), strict=True)):
        trace(axes, time, delivered[:, index], label="delivered", color=BLUE)
        # A tendon that is wound by an angle or a length has no planned tension: its command is zero throughout.
        if planned[:, index].any():
            trace(axes, time, planned[:, index], label="planned", color=BLACK, linestyle="--", linewidth=thin())
        if name in proximal:
            trace(axes, time, proximal[name], **dots)
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
