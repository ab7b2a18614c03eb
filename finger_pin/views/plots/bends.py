"""Tension behind every bend of tendons that rub where they bend, and its effect on the joints."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from finger_pin.exceptions import InputError
from finger_pin.views.plots.lines import names, series, times, trace
from finger_pin.views.plots.panels import labelled, legend, sheet, stack, title
from finger_pin.views.plots.style import BLACK, Width, styled, thin


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
