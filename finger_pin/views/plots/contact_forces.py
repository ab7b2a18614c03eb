"""Contacts: normal force and friction over time, the friction cone, sliding, and the motion of free objects."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from finger_pin.exceptions import InputError
from finger_pin.views.plots.lines import names, series, shade, times, trace
from finger_pin.views.plots.panels import labelled, legend, sheet, stack, title
from finger_pin.views.plots.style import BLACK, BLUE, SKY, VERMILLION, Width, colour, styled, thin

#: Most contacts that get a panel: those that push hardest.
_MAX_CONTACTS = 6
#: Most free objects whose motion is drawn along each axis.
_MAX_OBJECTS_PER_AXIS = 2
_MILLI = 1e3


@styled
def plot_contact(result: xr.Dataset, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw contact forces, friction cone, sliding and the motion of free objects, from a result with objects.

    (a) One panel per contact that ever closed, N: normal force, friction, and the most that friction can be; sticking
    is where friction is less. (b) Friction against normal force: the cone, whose edge is sliding. (c) Speed of sliding,
    mm/s. (d) How far free objects have moved from where they were, mm, if there are any: along each axis, or all in all
    where they are more than two.

    Args:
        result: Dataset of `simulate`.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    if "contact" not in result.dims:
        raise InputError("result", "is of a finger with nothing around it to touch")
    contacts = touching(result)
    below = ["sliding (mm/s)"] + (["moved (mm)"] if "object_position" in result else [])
    height = max(6.4, 1.5 * len(contacts))
    figure, (left, right) = sheet([(6.5, height), (5.5, height)], width, titles)
    panels = stack(left, [labelled(name, "N") for name in contacts] or ["force (N)"])
    closed = int((result["contact_normal_force"].max("time") > 0.0).sum())
    note = f": the {len(contacts)} of {closed} that push hardest" if len(contacts) < closed else ""
    title(panels[0], f"(a) contact forces{note}" if contacts else "(a) contact forces: nothing ever touched")
    cone, lower = _right_panels(right, below)
    for index, (axes, name) in enumerate(zip(panels, contacts, strict=False)):
        contact = result.sel(contact=name)
        time = times(result)
        level = contact["contact_level"].values
        shade(axes, time, np.zeros(len(time)), level, color=SKY, alpha=0.35, label="most that friction can be")
        trace(axes, time, contact["contact_normal_force"].values, label="normal force", color=BLUE, linewidth=thin())
        trace(axes, time, contact["contact_friction"].values, label="friction", color=VERMILLION, linewidth=thin())
        style = series(index)
        _draw_cone(cone, contact, name, style["color"])
        trace(lower[0], time, _MILLI * contact["contact_slip"].values, label=name, linewidth=thin(0.6), **style)
    if contacts:
        legend(left, panels[0].get_legend_handles_labels()[0])
        cone.lines[-1].set_label("most that friction can be")
        legend(right, cone.get_legend_handles_labels()[0])
    title(lower[0], "(c) speed of sliding")
    if len(lower) > 1:
        _draw_motion(lower[1], result)
    return figure


def touching(result: xr.Dataset) -> list[str]:
    """Return the names of the contacts that ever push, those that push hardest if there are many."""
    forces = result["contact_normal_force"].max("time")
    closed = [name for name in names(result, "contact") if float(forces.sel(contact=name)) > 0.0]
    names_by_force = sorted(closed, key=lambda name: -float(forces.sel(contact=name)))[:_MAX_CONTACTS]
    return [name for name in closed if name in names_by_force]


def _right_panels(part: SubFigure, below: list[str]) -> tuple[Axes, list[Axes]]:
    """Return the panel of the friction cone, and the panels over time below it."""
    cone, *panels = part.subplots(1 + len(below), 1, height_ratios=[1.8, *(1.0 for _ in below)])
    for axes, label in zip(panels, below, strict=True):
        axes.set_ylabel(label)
        axes.margins(x=0.0)
        axes.label_outer()
    for axes in panels[:-1]:
        axes.sharex(panels[-1])
    panels[-1].set_xlabel("time (s)")
    return cone, panels


def _draw_cone(axes: Axes, contact: xr.Dataset, name: str, colour_name: str) -> None:
    normal, friction = contact["contact_normal_force"].values, contact["contact_friction"].values
    level = contact["contact_level"].values
    closed = normal > 0.0
    axes.plot(normal[closed], friction[closed], color=colour_name, linewidth=thin(0.6), label=name)
    if closed.any():
        steepest = float(np.max(level[closed] / normal[closed]))
        end = float(normal.max())
        axes.plot([0.0, end], [0.0, steepest * end], color=colour(BLACK), linewidth=thin(0.6), linestyle=(0, (4, 2)))
    axes.set(xlabel="normal force (N)", ylabel="friction (N)")
    title(axes, "(b) friction cone")


def _draw_motion(axes: Axes, result: xr.Dataset) -> None:
    time, objects, axis_objects = times(result), names(result, "object"), names(result, "axis")
    position = result["object_position"].transpose("object", "axis", "time").values
    displacement = position - position[..., :1]
    if len(objects) > _MAX_OBJECTS_PER_AXIS:
        # With three lines for each there would be no room for the names.
        lines = dict(zip(objects, np.linalg.norm(displacement, axis=1), strict=True))
    else:
        labels = [f"{name} {axis}" for name in objects for axis in axis_objects]
        lines = dict(zip(labels, displacement.reshape(len(labels), -1), strict=True))
    for index, (label, values) in enumerate(lines.items()):
        trace(axes, time, _MILLI * values, label=label, linewidth=thin(), **series(index))
    low, high = axes.get_ylim()
    # Names stand above the lines.
    axes.set_ylim(low, high + 0.4 * (high - low))
    axes.legend(loc="upper center", ncols=5 if len(objects) > _MAX_OBJECTS_PER_AXIS else 3, fontsize="x-small")
    title(axes, "(d) free objects")
