"""Torques and forces before and after the friction of tendons and joints, and tensions behind every bend."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from finger_pin.exceptions import InputError
from finger_pin.typing import Array
from finger_pin.views.plots.hands import finger_of, fingers_of, plot_by_finger
from finger_pin.views.plots.lines import names, passive_proximal, series, shade, times, trace
from finger_pin.views.plots.panels import (
    NO_TENDONS,
    cut_spikes,
    empty_panel,
    flatten_rounding,
    labelled,
    legend,
    sheet,
    stack,
    title,
)
from finger_pin.views.plots.style import BLACK, BLUE, ORANGE, VERMILLION, Width, styled, thin
from finger_pin.views.shown_units import joints_by_unit

_COLUMNS = (("tendon friction", "tendon_friction", 1.0, "N"), ("joint friction", "joint_friction", 1e3, "mN m"))


@styled
def plot_losses(result: xr.Dataset, finger: str | None = None, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw tensions and torques before and after friction, from a result.

    (a) One panel per tendon, N: the tension before its friction (the command, or that at a spool; of a passive tendon,
    the proximal half) and after it (what reaches the joints). (b) One panel per joint, mN m: the commanded torque tau^d
    of (19), the torque of the tendons H_c2^T f of (11), and the latter less joint friction tau^f. A spike of a
    thousandth of the samples, such as a loop's first one, may leave the panel.

    Of a hand there is a row for each finger, with the friction of its tendons and of its joints.

    Args:
        result: Dataset of `simulate`, of any finger or hand.
        finger: One finger of a hand, drawn as a finger is.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    if finger is not None:
        result = finger_of(result, finger)
    elif len(fingers_of(result)) > 1:
        return plot_by_finger(result, _COLUMNS, width, titles)
    height = max(6.6, 1.3 * max(result.sizes["tendon"], result.sizes["joint"]))
    figure, (left, right) = sheet([(5.5, height), (5.5, height)], width, titles)
    _draw_tendons(left, result)
    _draw_joints(right, result)
    return figure


def _draw_tendons(part: SubFigure, result: xr.Dataset) -> None:
    time, tendons = times(result), names(result, "tendon")
    if not tendons:
        return empty_panel(part, NO_TENDONS)
    entry_tension = "spool_tension" if "spool_tension" in result else "tendon_command"
    before = result[entry_tension].transpose("time", "tendon").values
    after = result["tendon_tension"].transpose("time", "tendon").values
    proximal = passive_proximal(result)
    titles = [f"{name}, passive" if name in proximal else name for name in tendons]
    panels = stack(part, [labelled(each, "N") for each in titles])
    for index, (axes, name) in enumerate(zip(panels, tendons, strict=True)):
        _draw_gap(axes, time, proximal.get(name, before[:, index]), after[:, index], "before", "after tendon friction")
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    title(panels[0], "(a) tendon tension before and after tendon friction")
    legend(part, panels[0].get_legend_handles_labels()[0])


def _draw_joints(part: SubFigure, result: xr.Dataset) -> None:
    time, joints = times(result), names(result, "joint")
    command, torque, friction = (
        1e3 * result[name].transpose("time", "joint").values
        for name in ("joint_torque_command", "joint_torque", "joint_friction")
    )
    slides = joints_by_unit(result).get("m", [])
    panels = stack(part, [labelled(name, "mN" if name in slides else "mN m") for name in joints])
    for index, axes in enumerate(panels):
        trace(axes, time, command[:, index], label="commanded", color=BLACK, linestyle="--", linewidth=thin())
        net = torque[:, index] - friction[:, index]
        _draw_gap(axes, time, torque[:, index], net, "of the tendons", "after joint friction")
        cut_spikes(axes, command[:, index], torque[:, index], net)
        flatten_rounding(axes)
    title(panels[0], "(b) joint torque before and after joint friction")
    legend(part, panels[0].get_legend_handles_labels()[0])


def _draw_gap(axes: Axes, time: Array, before: Array, after: Array, first: str, second: str) -> None:
    shade(axes, time, before, after, color=ORANGE, alpha=0.35, label="friction")
    trace(axes, time, before, label=first, color=BLUE, linewidth=thin())
    trace(axes, time, after, label=second, color=VERMILLION, linewidth=thin())


@styled
def plot_bends(result: xr.Dataset, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw the tension behind every bend of tendons that rub there, and the angles of the joints.

    (a) One panel per tendon, N: the tension at its entrance in black, and behind each of its bends, which is what
    reaches the joints from there on. (b) The angles of the joints, deg, against the tension that enters: as a cord is
    let out, the joint at its end holds longest.

    Args:
        result: Dataset of `simulate`.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    if "wrap_tension" not in result:
        raise InputError("result", 'has no tendon that rubs at several places, as with tendon_friction.place = "bends"')
    bends, time = names(result, "wrap"), times(result)
    tendons = [name for name in names(result, "tendon") if any(bend.startswith(f"{name}.") for bend in bends)]
    height = max(4.2, 1.9 * len(tendons))
    figure, (left, right) = sheet([(6.4, height), (5.2, height)], width, titles)
    panels = stack(left, [labelled(name, "N") for name in tendons])
    title(panels[0], "(a) tension at the entrance and behind every bend")
    loops: list[Axes] = list(right.subplots(len(tendons), 1, squeeze=False)[:, 0])
    title(loops[0], "(b) joints against the tension that enters")
    for axes, loop, name in zip(panels, loops, tendons, strict=True):
        entry = result["spool_tension" if "spool_tension" in result else "tendon_command"].sel(tendon=name).values
        trace(axes, time, entry, color=BLACK, label="entrance", linewidth=thin())
        tendon_bends = [bend for bend in bends if bend.startswith(f"{name}.")]
        for index, bend in enumerate(tendon_bends):
            joint = bend.removeprefix(f"{name}.")
            tension = result["wrap_tension"].sel(wrap=bend).values
            trace(axes, time, tension, label=f"behind {joint}", linewidth=thin(), **series(index))
            if joint in names(result, "joint"):
                angle = np.rad2deg(result["joint_position"].sel(joint=joint).values)
                loop.plot(entry, angle, label=joint, linewidth=thin(), **series(index))
        loop.set_ylabel(f"{name}: joints (°)")
    legend(left, panels[0].get_lines())
    legend(right, loops[0].get_lines())
    loops[-1].set_xlabel("tension at the entrance (N)")
    return figure
