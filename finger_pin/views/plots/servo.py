"""Servos: spools against joints, tension at the spool and at the finger, current, and power."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from finger_pin.description.finger_description import FingerDescription
from finger_pin.exceptions import InputError
from finger_pin.simulation.frames import read_scene
from finger_pin.views.plots.lines import names, series, shade, times, trace
from finger_pin.views.plots.panels import labelled, legend, sheet, stack, title
from finger_pin.views.plots.style import BLACK, BLUE, GREEN, GREY, ORANGE, SKY, VERMILLION, Width, colour, styled, thin

# Signed: what micro-damping or a slack tendon gives back is no more than rounding here.
_LOSSES = {
    "windings": (("motor_heat",), VERMILLION),
    "gears": (("gearbox_coulomb", "gearbox_viscous"), ORANGE),
    "tendons": (("elastic_damping", "tendon_coulomb", "tendon_viscous"), SKY),
    "joints": (("joint_coulomb", "joint_viscous", "joint_springs", "limiter"), GREEN),
}


@styled
def plot_servo(result: xr.Dataset, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw joints against spools, tensions at both ends, currents and powers, from a result of a finger with servos.

    (a) One panel per motor: joints that its tendons turn, deg, or move, mm, against the angle of its spool, deg; what
    gears, stretch and canals keep back makes loops of them. (b) One panel per tendon on a spool, N: the tension there,
    and what reaches the finger. (c) Currents, A. (d) Electrical power, W, and on top of each other where it goes; what
    is between is stored, or comes back.

    Args:
        result: Dataset of `simulate`.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    if "motor" not in result.dims:
        raise InputError("result", "is of a finger without servos")
    finger = read_scene(result.attrs).finger
    actuators = finger.actuators
    tendons = [name for actuator in actuators.values() for name in actuator.tendons]
    height = max(6.6, 1.7 * len(tendons))
    figure, (left, middle, right) = sheet([(4.3, height), (4.8, height), (4.9, height)], width, titles)
    loops: list[Axes] = list(left.subplots(len(actuators), 1, squeeze=False)[:, 0])
    title(loops[0], "(a) joints against spools")
    for axes, (name, actuator) in zip(loops, actuators.items(), strict=True):
        _draw_loop(axes, result, name, finger, _driven_joints(finger, actuator.tendons))
    loops[-1].set_xlabel("angle of the spool (°)")
    joints = {line.get_label(): line for axes in loops for line in axes.get_lines()}
    legend(left, list(joints.values()))
    panels = stack(middle, [labelled(name, "N") for name in tendons])
    title(panels[0], "(b) tension at the spool and at the finger")
    for axes, name in zip(panels, tendons, strict=True):
        _draw_tension(axes, result, name)
    legend(middle, panels[0].get_lines())
    current, power = stack(right, ["current (A)", "power (W)"])
    title(current, "(c) current")
    for index, name in enumerate(actuators):
        values = result["motor_current"].sel(motor=name).values
        trace(current, times(result), values, label=name, linewidth=thin(), **series(index))
    current.legend(loc="upper right", ncols=4)
    _draw_power(power, result)
    legend(right, power.get_legend_handles_labels()[0])
    return figure


def _driven_joints(finger: FingerDescription, tendons: Iterable[str]) -> set[str]:
    """Return the joints that tendons turn."""
    parts = [part for name in tendons for part in finger.cord(name).parts]
    return {joint for part in parts for element in part.elements if element.moves for joint in element.crossed}


def _draw_loop(axes: Axes, result: xr.Dataset, motor: str, finger: FingerDescription, driven: set[str]) -> None:
    spool = np.rad2deg(result["motor_position"].sel(motor=motor).values)
    for index, joint in enumerate(names(result, "joint")):
        if joint in driven:
            tree_joint = finger.tree.joints.get(joint)
            is_slide = tree_joint is not None and tree_joint.kind == "slide"
            position = result["joint_position"].sel(joint=joint).values
            values = 1e3 * position if is_slide else np.rad2deg(position)
            label = f"{joint} (mm)" if is_slide else joint
            axes.plot(spool, values, label=label, linewidth=thin(), **series(index))
    axes.set_ylabel(f"{motor}: joints (°)")


def _draw_tension(axes: Axes, result: xr.Dataset, tendon: str) -> None:
    time = times(result)
    spool_tension = result["spool_tension"].sel(tendon=tendon).values
    trace(axes, time, spool_tension, label="at the spool", color=BLUE, linewidth=thin())
    delivered = result["tendon_tension"].sel(tendon=tendon).values
    trace(axes, time, delivered, label="at the finger", color=VERMILLION, linewidth=thin())
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))


def _draw_power(axes: Axes, result: xr.Dataset) -> None:
    time = times(result)
    level = np.zeros(len(time))
    for label, (losses, options) in _LOSSES.items():
        upper = level + sum(result[f"power_{name}"].values for name in losses)
        shade(axes, time, level, upper, color=options, alpha=0.8, label=label)
        level = upper
    trace(axes, time, result["power_electrical"].values, label="electrical", color=BLACK, linewidth=thin())
    axes.axhline(0.0, color=colour(GREY), linewidth=thin(0.5))
    title(axes, "(d) electrical power and its uses")
