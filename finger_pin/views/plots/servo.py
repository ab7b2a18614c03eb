"""What servos do: spools against joints, tension at the spool and at the finger, current, and where the power goes."""

from __future__ import annotations

import tomllib

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from finger_pin.exceptions import InputError
from finger_pin.views.plots.lines import names, series, shade, trace
from finger_pin.views.plots.panels import labelled, legend, stack, title
from finger_pin.views.plots.style import BLACK, BLUE, GREEN, GREY, ORANGE, SKY, VERMILLION, new_figure, styled

# Signed: what micro-damping or a slack tendon gives back is no more than rounding here.
_LOST = {
    "windings": (("motor_heat",), VERMILLION),
    "gears": (("gearbox_coulomb", "gearbox_viscous"), ORANGE),
    "tendons": (("elastic_damping", "tendon_coulomb", "tendon_viscous"), SKY),
    "joints": (("joint_coulomb", "joint_viscous", "joint_springs", "limiter"), GREEN),
}


@styled
def plot_servo(result: xr.Dataset) -> Figure:
    """Draw what servos do, from a result of a finger that has some.

    (a) One panel per motor: angles of the joints that its tendons turn against the angle of its spool, deg; what gears,
    stretch and canals keep back makes loops of them. (b) One panel per tendon on a spool, N: the tension there, and
    what reaches the finger. (c) Currents, A. (d) Electrical power, W, and on top of each other where it goes; what is
    between is stored, or comes back.

    Args:
        result: Dataset of `simulate`.

    Raises:
        InputError: If there are no servos.
    """
    if "motor" not in result.dims:
        raise InputError("result", "is of a finger without servos")
    described = tomllib.loads(result.attrs["scenario"])["finger"]
    actuators = described["actuators"]
    tendons = [name for actuator in actuators.values() for name in actuator["tendons"]]
    figure = new_figure(14.0, max(6.6, 1.7 * len(tendons)))
    width, height = figure.get_size_inches()
    grid = figure.add_gridspec(
        len(actuators),
        1,
        hspace=0.45,
        left=0.8 / width,
        right=4.2 / width,
        top=1.0 - 0.32 / height,
        bottom=0.8 / height,
    )
    loops: list[Axes] = list(grid.subplots(squeeze=False)[:, 0])
    title(loops[0], "(a) joints against spools")
    for axes, (name, actuator) in zip(loops, actuators.items(), strict=True):
        _loop(axes, result, name, [described["tendons"][each]["crossings"] for each in actuator["tendons"]])
    loops[-1].set_xlabel("angle of the spool (°)")
    shown = {line.get_label(): line for axes in loops for line in axes.get_lines()}
    legend(loops[-1], list(shown.values()), columns=4)
    panels = stack(figure, 4.3, 9.0, [labelled(name, "N") for name in tendons])
    title(panels[0], "(b) tension at the spool and at the finger")
    for axes, name in zip(panels, tendons, strict=True):
        _tension(axes, result, name)
    legend(panels[-1], panels[0].get_lines(), columns=2)
    current, power = stack(figure, 9.1, 13.8, ["current (A)", "power (W)"], gap=0.4)
    title(current, "(c) current")
    for index, name in enumerate(actuators):
        values = result["motor_current"].sel(motor=name).values
        trace(current, result["time"].values, values, label=name, linewidth=1.0, **series(index))
    current.legend(loc="upper right", ncols=4)
    _power(power, result)
    return figure


def _loop(axes: Axes, result: xr.Dataset, motor: str, crossed: list[dict[str, dict[str, float]]]) -> None:
    spool = np.rad2deg(result["motor_position"].sel(motor=motor).values)
    for index, joint in enumerate(names(result, "joint")):
        if any(tendon.get(joint, {}).get("radius", 0.0) != 0.0 for tendon in crossed):
            angle = np.rad2deg(result["joint_position"].sel(joint=joint).values)
            axes.plot(spool, angle, label=joint, linewidth=1.0, **series(index))
    axes.set_ylabel(f"{motor}: joints (°)")


def _tension(axes: Axes, result: xr.Dataset, tendon: str) -> None:
    time = result["time"].values
    trace(
        axes, time, result["spool_tension"].sel(tendon=tendon).values, label="at the spool", color=BLUE, linewidth=1.1
    )
    delivered = result["tendon_tension"].sel(tendon=tendon).values
    trace(axes, time, delivered, label="at the finger", color=VERMILLION, linewidth=1.1)
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))


def _power(axes: Axes, result: xr.Dataset) -> None:
    time = result["time"].values
    level = np.zeros(len(time))
    for label, (lost, colour) in _LOST.items():
        above = level + sum(result[f"power_{name}"].values for name in lost)
        shade(axes, time, level, above, color=colour, alpha=0.8, label=label)
        level = above
    trace(axes, time, result["power_electrical"].values, label="electrical", color=BLACK, linewidth=1.0)
    axes.axhline(0.0, color=GREY, linewidth=0.6)
    title(axes, "(d) electrical power, and where it goes")
    legend(axes, axes.get_legend_handles_labels()[0], columns=5)
