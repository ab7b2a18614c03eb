"""What contacts do: normal force and friction over time, the friction cone, sliding, and where free objects go."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from finger_pin.exceptions import InputError
from finger_pin.views.plots.lines import names, series, shade, trace
from finger_pin.views.plots.panels import labelled, legend, stack, title
from finger_pin.views.plots.style import BLACK, BLUE, SKY, VERMILLION, new_figure, styled

#: Most contacts that get a panel: those that push hardest.
_MOST = 6
_MILLI = 1e3


@styled
def plot_contact(result: xr.Dataset) -> Figure:
    """Draw what contacts do, from a result of a finger with objects around it.

    (a) One panel per contact that ever closed, N: normal force, friction, and the most that friction can be; sticking
    is where friction is less. (b) Friction against normal force: the cone, whose edge is sliding. (c) Speed of sliding,
    mm/s. (d) How far free objects have moved from where they were, mm, if there are any.

    Args:
        result: Dataset of `simulate`.

    Raises:
        InputError: If there are no objects.
    """
    if "contact" not in result.dims:
        raise InputError("result", "is of a finger with nothing around it to touch")
    shown = touching(result)
    below = ["sliding (mm/s)"] + (["moved (mm)"] if "object_position" in result else [])
    figure = new_figure(12.0, max(6.4, 1.5 * len(shown)))
    panels = stack(figure, 0.0, 6.4, [labelled(name, "N") for name in shown] or ["force (N)"])
    closed = int((result["contact_normal_force"].max("time") > 0.0).sum())
    note = f": the {len(shown)} of {closed} that push hardest" if len(shown) < closed else ""
    title(panels[0], f"(a) contact forces{note}" if shown else "(a) contact forces: nothing ever touched")
    cone, *others = _right(figure, below)
    for index, (axes, name) in enumerate(zip(panels, shown, strict=False)):
        contact = result.sel(contact=name)
        time = result["time"].values
        level = contact["contact_level"].values
        shade(axes, time, np.zeros(len(time)), level, color=SKY, alpha=0.35, label="most that friction can be")
        trace(axes, time, contact["contact_normal_force"].values, label="normal force", color=BLUE, linewidth=1.1)
        trace(axes, time, contact["contact_friction"].values, label="friction", color=VERMILLION, linewidth=1.1)
        style = series(index)
        _cone(cone, contact, name, style["color"])
        trace(others[0], time, _MILLI * contact["contact_slip"].values, label=name, linewidth=0.8, **style)
    if shown:
        legend(panels[-1], panels[0].get_legend_handles_labels()[0], columns=3)
        cone.lines[-1].set_label("most that friction can be")
        cone.legend(loc="upper left")
    title(others[0], "(c) speed of sliding")
    if len(others) > 1:
        _moved(others[1], result)
    return figure


def touching(result: xr.Dataset) -> list[str]:
    """Return the names of the contacts that ever push, those that push hardest if there are many."""
    most = result["contact_normal_force"].max("time")
    closed = [name for name in names(result, "contact") if float(most.sel(contact=name)) > 0.0]
    hardest = sorted(closed, key=lambda name: -float(most.sel(contact=name)))[:_MOST]
    return [name for name in closed if name in hardest]


def _right(figure: Figure, below: list[str]) -> list[Axes]:
    """Return the panel of the cone, and panels over time below it."""
    panels = stack(figure, 6.6, 11.8, ["", *below], heights=[1.8, *(1.0 for _ in below)], gap=0.75)
    cone = panels[0]
    place = cone.get_position().bounds
    cone.remove()
    return [figure.add_axes(place), *panels[1:]]


def _cone(axes: Axes, contact: xr.Dataset, name: str, colour: str) -> None:
    normal, friction = contact["contact_normal_force"].values, contact["contact_friction"].values
    level = contact["contact_level"].values
    closed = normal > 0.0
    axes.plot(normal[closed], friction[closed], color=colour, linewidth=0.8, label=name)
    if closed.any():
        steepest = float(np.max(level[closed] / normal[closed]))
        end = float(normal.max())
        axes.plot([0.0, end], [0.0, steepest * end], color=BLACK, linewidth=0.8, linestyle=(0, (4, 2)))
    axes.set(xlabel="normal force (N)", ylabel="friction (N)")
    title(axes, "(b) friction cone")


def _moved(axes: Axes, result: xr.Dataset) -> None:
    time, index = result["time"].values, 0
    for name in names(result, "object"):
        for axis in names(result, "axis"):
            place = result["object_position"].sel(object=name, axis=axis).values
            label = f"{name} {axis}"
            trace(axes, time, _MILLI * (place - place[0]), label=label, linewidth=1.1, **series(index))
            index += 1
    axes.legend(loc="best", ncols=3)
    title(axes, "(d) free objects")
