"""Self-locking: what friction makes of tension, and where in the workspace."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from finger_pin.analysis import SelfLockingMap, critical_friction
from finger_pin.description.parameters import FingerDescription
from finger_pin.description.routing import Array
from finger_pin.mechanism.finger import Finger
from finger_pin.views.plots.lines import series
from finger_pin.views.plots.panels import plain
from finger_pin.views.plots.style import BLACK, BLUE, GREY, VERMILLION, new_figure, styled

_MILLI = 1e3


@styled
def plot_critical_friction(finger: Finger | FingerDescription) -> Figure:
    """Draw the critical coefficients of a finger: of every joint alone, and of all joints together.

    Args:
        finger: A finger with force closure, or the description of one.
    """
    description = finger.description if isinstance(finger, Finger) else finger
    entries = {name: critical_friction(finger, joints=[name]) for name in description.joints}
    entries["all joints"] = critical_friction(finger)
    figure = new_figure(7.5, 0.9 + 0.42 * len(entries), "constrained")
    axes = figure.subplots()
    for row, (name, found) in enumerate(entries.items()):
        value = _MILLI * found.coefficient
        axes.barh(row, value, height=0.6, color=VERMILLION if name == "all joints" else BLUE)
        axes.text(value, row, f" {value:.2f}", va="center", fontsize=9.5)
    actual = _MILLI * float(np.max(description.joint_friction.stiction))
    axes.axvline(actual, color=BLACK, linewidth=1.0, label=rf"$M^c$ of the finger, {actual:.2g} mm")
    axes.set_yticks(range(len(entries)), list(entries))
    axes.invert_yaxis()
    axes.margins(x=0.1)
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("joint friction at which it locks, worst direction (mm)")
    axes.legend(loc="lower right")
    return figure


@styled
def plot_self_locking_map(found: SelfLockingMap) -> Figure:
    """Draw a map over one or two joints: the tension that slow motion needs, and the critical coefficient.

    What is the same at every posture is said in a line instead.

    Args:
        found: What `self_locking_map` returned.
    """
    coefficient = _MILLI * found.coefficient
    panels = [(found.tension, "largest tension (N)", "tension that slow motion needs")]
    note = f"critical coefficient {coefficient.flat[0]:.3g} mm at every posture"
    if not np.isfinite(coefficient).any():
        note = "no joint friction locks it"
    elif not found.uniform:
        panels.append((coefficient, "critical coefficient (mm)", "joint friction at which it locks"))
        note = f"critical coefficient from {coefficient.min():.3g} to {coefficient.max():.3g} mm"
    figure = new_figure(5.8 * len(panels), 4.8, "constrained")
    figure.suptitle(f"{note}; the finger has {_MILLI * found.actual:.3g} mm", x=0.02, ha="left", fontsize=10.5)
    for axes, (values, label, title) in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        axes.set_title(title)
        _map(figure, axes, found, values, label)
    return figure


@styled
def plot_runaway(results: dict[str, xr.Dataset]) -> Figure:
    """Draw runs at several coefficients of joint friction: the largest tension, and the largest error.

    Args:
        results: Datasets of `simulate` by label.
    """
    figure = new_figure(7.5, 5.6, "constrained")
    top, bottom = figure.subplots(2, 1, sharex=True)
    for index, (label, result) in enumerate(results.items()):
        time = result["time"].values
        top.plot(time, result["tendon_command"].max("tendon").values, label=label, **series(index))
        error = np.rad2deg(np.max(np.abs(result["tracking_error"].transpose("time", "joint").values), axis=1))
        bottom.plot(time, error, label=label, **series(index))
    top.set_yscale("log")
    plain(top.yaxis)
    top.set_ylabel("largest command (N)")
    top.set_title("tension: settles below the critical coefficient, grows above it")
    bottom.set_ylabel("largest error (deg)")
    bottom.set_xlabel("time (s)")
    top.margins(x=0.0)
    figure.legend(handles=top.lines, loc="outside lower center", ncols=min(len(results), 5))
    return figure


def _map(figure: Figure, axes: Axes, found: SelfLockingMap, values: Array, label: str) -> None:
    angles = [np.rad2deg(each) for each in found.angles]
    shown = np.ma.masked_invalid(values)
    axes.set_xlabel(f"{found.joints[0]} (deg)")
    if not shown.count():
        axes.set(xlim=angles[0][[0, -1]], yticks=[])
        axes.text(0.5, 0.5, "locked everywhere", transform=axes.transAxes, ha="center", color=GREY)
    elif len(angles) == 1:
        axes.plot(angles[0], shown, color=BLUE)
        axes.set_ylabel(label)
        axes.margins(x=0.0)
    else:
        axes.grid(visible=False)
        axes.set_ylabel(f"{found.joints[1]} (deg)")
        drawn = axes.contourf(*angles, shown.T, levels=12, cmap="cividis")
        figure.colorbar(drawn, ax=axes, label=label)
        if shown.count() < values.size:
            axes.set_facecolor("#DDDDDD")
            axes.text(0.02, 0.02, "grey: locked", transform=axes.transAxes)
