"""Self-locking: what friction makes of tension, and where in the workspace."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from finger_pin.analysis import SelfLockingMap, critical_friction
from finger_pin.description.parameters import FingerDescription
from finger_pin.description.routing import Array
from finger_pin.views.plots.lines import series
from finger_pin.views.plots.style import BLACK, BLUE, GREY, VERMILLION, new_figure, styled

_MILLI = 1e3


@styled
def plot_critical_friction(finger: FingerDescription) -> Figure:
    """Draw the critical coefficients of a finger: of every joint alone, and of all joints together.

    Args:
        finger: A finger with force closure.
    """
    entries = {name: critical_friction(finger, joints=[name]) for name in finger.joints}
    entries["all joints"] = critical_friction(finger)
    figure = new_figure(7.5, 0.9 + 0.42 * len(entries), "constrained")
    axes = figure.subplots()
    for row, (name, found) in enumerate(entries.items()):
        value = _MILLI * found.coefficient
        axes.barh(row, value, height=0.6, color=VERMILLION if name == "all joints" else BLUE)
        axes.text(value, row, f" {value:.2f}", va="center", fontsize=9.5)
    actual = _MILLI * float(np.max(finger.joint_friction.stiction))
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
    """Draw a map over two joints: the tension that slow motion needs, and the critical coefficient.

    Args:
        found: What `self_locking_map` returned.
    """
    figure = new_figure(11.0, 4.6, "constrained")
    left, right = figure.subplots(1, 2)
    _map(figure, left, found, found.tension, "largest tension (N)", "(a) tension that slow motion needs, N")
    title = f"(b) critical coefficient, mm; the finger has {_MILLI * found.actual:.3g} mm"
    _map(figure, right, found, _MILLI * found.coefficient, "critical coefficient (mm)", title)
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
    top.set_ylabel("largest command (N)")
    top.set_title("tension: settles below the critical coefficient, grows above it")
    bottom.set_ylabel("largest error (deg)")
    bottom.set_xlabel("time (s)")
    top.margins(x=0.0)
    figure.legend(handles=top.lines, loc="outside lower center", ncols=min(len(results), 5))
    return figure


def _map(figure: Figure, axes: Axes, found: SelfLockingMap, values: Array, label: str, title: str) -> None:
    first, second = np.rad2deg(found.first), np.rad2deg(found.second)
    axes.set_title(title)
    axes.set_xlabel(f"{found.joints[0]} (deg)")
    axes.set_ylabel(f"{found.joints[1]} (deg)")
    axes.grid(visible=False)
    finite = values[np.isfinite(values)]
    if not finite.size:
        axes.text(0.5, 0.5, "locked everywhere", transform=axes.transAxes, ha="center", color=GREY)
    elif np.ptp(finite) <= 1e-6 * np.max(np.abs(finite)) and finite.size == values.size:
        axes.set_xlim(first[0], first[-1])
        axes.set_ylim(second[0], second[-1])
        text = f"{finite.flat[0]:.3f} at every posture:\nno joint bends the canal of a passive tendon"
        axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center")
    else:
        drawn = axes.contourf(first, second, np.ma.masked_invalid(values).T, levels=12, cmap="cividis")
        figure.colorbar(drawn, ax=axes, label=label)
