"""Self-locking: tension over joint friction, and the critical coefficient over the workspace."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from finger_pin.analysis import SelfLockingMap, critical_friction
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import FingerLike, as_finger
from finger_pin.typing import Array
from finger_pin.views.plots.lines import series, times
from finger_pin.views.plots.panels import grid, heading, legend, plain_ticks, sheet, title
from finger_pin.views.plots.style import BLACK, BLUE, GREY, VERMILLION, Width, colour, styled, thin

_PER_MILLE = 1e3


@styled
def plot_critical_friction(finger: FingerLike, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw the critical coefficients of a finger: of each joint alone, and of all joints together.

    Args:
        finger: A finger with force closure, its description, its name, or the path of its file.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    finger = as_finger(finger)
    description = finger.description
    entries = {name: critical_friction(finger, joints=[name]) for name in description.joints}
    entries["all joints"] = critical_friction(finger)
    figure, (part,) = sheet([(7.5, 0.9 + 0.42 * len(entries))], width, titles)
    axes = part.subplots()
    for row, (name, critical) in enumerate(entries.items()):
        value = _PER_MILLE * critical.coefficient
        axes.barh(row, value, height=0.6, color=colour(VERMILLION if name == "all joints" else BLUE))
        axes.text(value, row, f" {value:.2f}", va="center", fontsize="small")
    actual = _PER_MILLE * float(np.max(description.joint_friction.break_away))
    axes.axvline(actual, color=colour(BLACK), linewidth=thin(), label=rf"$M^c$ of the finger, {actual:.2g} mm")
    axes.set_yticks(range(len(entries)), list(entries))
    axes.invert_yaxis()
    axes.margins(x=0.15)
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("joint friction at which it locks, worst direction (mm)", wrap=True)
    axes.legend(loc="lower right")
    return figure


@styled
def plot_self_locking_map(locking_map: SelfLockingMap, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw a map over one or two joints: the tension that slow motion needs, and the critical coefficient.

    What is the same at every posture is said in a line instead.

    Args:
        locking_map: Map of `self_locking_map`.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    coefficient = _PER_MILLE * locking_map.coefficient
    panels = [(locking_map.tension, "largest tension (N)", "tension that slow motion needs")]
    note = f"critical coefficient {coefficient.flat[0]:.3g} mm at every posture"
    if not np.isfinite(coefficient).any():
        note = "no joint friction locks it"
    elif not locking_map.uniform:
        panels.append((coefficient, "critical coefficient (mm)", "joint friction at which it locks"))
        note = f"critical coefficient from {coefficient.min():.3g} to {coefficient.max():.3g} mm"
    figure, places = grid(len(panels), 2, (5.8, 4.8), width, titles)
    heading(figure, f"{note}; the finger has {_PER_MILLE * locking_map.actual:.3g} mm")
    for axes, (values, label, text) in zip(places, panels, strict=True):
        title(axes, text)
        _draw_map(figure, axes, locking_map, values, label)
    return figure


@styled
def plot_runaway(results: dict[str, xr.Dataset], *, width: Width = None, titles: bool = True) -> Figure:
    """Draw runs at several coefficients of joint friction: the largest tension, and the largest error.

    Args:
        results: Datasets of `simulate` by label.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    for label, result in results.items():
        if not result["tendon_command"].size:
            raise InputError(f"results.{label}", "must be of a finger with tendons that ideal sources or motors pull")
    figure, (part,) = sheet([(7.5, 5.6)], width, titles)
    top, bottom = part.subplots(2, 1, sharex=True)
    for index, (label, result) in enumerate(results.items()):
        time = times(result)
        top.plot(time, result["tendon_command"].max("tendon").values, label=label, **series(index))
        error = np.rad2deg(np.max(np.abs(result["tracking_error"].transpose("time", "joint").values), axis=1))
        bottom.plot(time, error, label=label, **series(index))
    top.set_yscale("log")
    plain_ticks(top.yaxis)
    top.set_ylabel("largest command (N)")
    title(top, "tension: settles below the critical coefficient, grows above it")
    bottom.set_ylabel("largest error (°)")
    bottom.set_xlabel("time (s)")
    top.margins(x=0.0)
    legend(part, top.get_lines())
    return figure


def _draw_map(figure: Figure, axes: Axes, locking_map: SelfLockingMap, values: Array, label: str) -> None:
    angles = [np.rad2deg(axis_angles) for axis_angles in locking_map.angles]
    limited = np.ma.masked_invalid(values)
    axes.set_xlabel(f"{locking_map.joints[0]} (°)")
    if not limited.count():
        axes.set(xlim=angles[0][[0, -1]], yticks=[])
        axes.text(0.5, 0.5, "locked everywhere", transform=axes.transAxes, ha="center", color=colour(GREY))
    elif len(angles) == 1:
        axes.plot(angles[0], limited, color=colour(BLUE))
        axes.set_ylabel(label)
        axes.margins(x=0.0)
    else:
        axes.grid(visible=False)
        axes.set_ylabel(f"{locking_map.joints[1]} (°)")
        image = axes.contourf(*angles, limited.T, levels=12, cmap="cividis")
        figure.colorbar(image, ax=axes, label=label)
        if limited.count() < values.size:
            axes.set_facecolor("#DDDDDD")
            axes.text(0.02, 0.02, "grey: locked", transform=axes.transAxes)
