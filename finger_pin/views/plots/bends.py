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

    Raises:
        InputError: If no tendon rubs at several places.
    """
    if "wrap_tension" not in result:
        raise InputError("result", 'has no tendon that rubs at several places, as with tendon_friction.place = "bends"')
    bends, time = names(result, "wrap"), times(result)
    tendons = [name for name in names(result, "tendon") if any(each.startswith(f"{name}.") for each in bends)]
    height = max(4.2, 1.9 * len(tendons))
    figure, (left, right) = sheet([(6.4, height), (5.2, height)], width, titles)
    panels = stack(left, [labelled(name, "N") for name in tendons])
    title(panels[0], "(a) tension at the entrance and behind every bend")
    loops: list[Axes] = list(right.subplots(len(tendons), 1, squeeze=False)[:, 0])
    title(loops[0], "(b) joints against the tension that enters")
    for axes, loop, name in zip(panels, loops, tendons, strict=True):
        entering = result["spool_tension" if "spool_tension" in result else "tendon_command"].sel(tendon=name).values
        trace(axes, time, entering, color=BLACK, label="entrance", linewidth=thin())
        places = [each for each in bends if each.startswith(f"{name}.")]
        for k, place in enumerate(places):
            joint = place.removeprefix(f"{name}.")
            behind = result["wrap_tension"].sel(wrap=place).values
            trace(axes, time, behind, label=f"behind {joint}", linewidth=thin(), **series(k))
            if joint in names(result, "joint"):
                angle = np.rad2deg(result["joint_position"].sel(joint=joint).values)
                loop.plot(entering, angle, label=joint, linewidth=thin(), **series(k))
        loop.set_ylabel(f"{name}: joints (°)")
    legend(left, panels[0].get_lines())
    legend(right, loops[0].get_lines())
    loops[-1].set_xlabel("tension at the entrance (N)")
    return figure
