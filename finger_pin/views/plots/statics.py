"""Statics: self-locking over the workspace, and fingertip forces, in space and in the flexion plane."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

from finger_pin.analysis import (
    Friction,
    SelfLockingMap,
    critical_friction,
    force_polytope,
    largest_force,
    tension_for_force,
)
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import FingerLike, as_finger
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array
from finger_pin.views.plots.lines import series, times
from finger_pin.views.plots.panels import empty_axes, grid, heading, legend, plain_ticks, sheet, title
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
        empty_axes(axes, "locked everywhere")
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


_LABELS = {
    Friction.HELPING: "can hold, friction helps",
    Friction.NONE: "without friction",
    Friction.HINDERING: "can push, friction hinders",
}
_DIRECTIONS = 120
# Angle beside a direction at which a joint's torque changes its sign, rad.
_SIDE = 0.02


@styled
def plot_force_polytope(
    finger: FingerLike,
    position: Sequence[float] | Array,
    limit: float | tuple[float, ...],
    *,
    width: Width = None,
    titles: bool = True,
) -> Figure:
    """Draw the forces that the fingertip can exert at a posture, within tension limits; N, base frame.

    (a) The frictionless polytope in space, (b) the section through zero in the flexion plane for every friction.

    Args:
        finger: One finger with force closure, its description, its name, or the path of its file.
        position: theta, shape (n,), rad.
        limit: Greatest f^a, N, one number or one per actuated tendon.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    finger = as_finger(finger)
    figure, (left, right) = sheet([(5.5, 5.2), (5.5, 5.2)], width, titles)
    polytope = force_polytope(finger, position, limit)
    axes = axes_around(left, np.vstack([polytope.vertices, np.zeros(3)]), "N")
    triangles = polytope.vertices[polytope.triangles()]
    axes.add_collection3d(Poly3DCollection(triangles, facecolors=colour(BLUE), alpha=0.18, edgecolors="none"))
    for first, second in polytope.ridges():
        axes.plot(*polytope.vertices[[first, second]].T, color=colour(BLUE), linewidth=thin(0.65))
    if len(polytope.vertices) == 1:
        axes.scatter(*polytope.vertices.T, color=colour(BLUE))
    axes.scatter(0.0, 0.0, 0.0, color=colour(BLACK), s=14)
    title(axes, "(a) forces within the tension limits, without friction")
    plane = right.subplots()
    _draw_slice(plane, finger, position, limit)
    title(plane, "(b) section in the flexion plane")
    return figure


@styled
def plot_radius_sensitivity(
    finger: FingerLike,
    position: Sequence[float] | Array,
    force: Sequence[float] | Array,
    *,
    width: Width = None,
    titles: bool = True,
) -> Figure:
    """Draw the derivative of the tension for a fingertip force by every winding radius, N/mm, without friction.

    Args:
        finger: One finger with force closure, its description, its name, or the path of its file.
        position: theta, shape (n,), rad.
        force: E, shape (3,), N, base frame.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    finger = as_finger(finger)
    tension = tension_for_force(finger, position, force)
    names = [
        (f"{name}, {joint}", 1e-3 * tension.by_radius[row, finger.routing.joints.index(joint)])
        for row, (name, tendon) in enumerate(finger.description.tendons.items())
        for joint in tendon.crossings
    ]
    figure, (part,) = sheet([(7.5, 1.2 + 0.3 * len(names))], width, titles)
    axes = part.subplots()
    axes.barh(range(len(names)), [value for _, value in names], height=0.6, color=colour(BLUE))
    axes.set_yticks(range(len(names)), [name for name, _ in names])
    axes.invert_yaxis()
    axes.axvline(0.0, color=colour(GREY), linewidth=thin(0.6))
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("change of the largest tension with the signed radius (N/mm)", wrap=True)
    components = ", ".join(f"{value:.3g}" for value in force)
    title(axes, f"largest tension {tension.largest:.3g} N for the force ({components}) N")
    return figure


def _draw_slice(
    axes: Axes, finger: Finger, position: Sequence[float] | Array, limit: float | tuple[float, ...]
) -> None:
    plane = flexion_plane(finger)
    normal = finger.rigid_body.jacobian(np.asarray(position, dtype=float))[plane, :]
    # The joint's torque changes its sign where the force points at its axis: on either side of it, within its friction
    # circle, lies a step of what the finger can push.
    axis = np.arctan2(-normal[0], normal[1])
    sides = axis[:, None] + np.array([-_SIDE, _SIDE, np.pi - _SIDE, np.pi + _SIDE])
    angles = np.unique(np.concatenate([np.linspace(0.0, 2.0 * np.pi, _DIRECTIONS + 1), sides.ravel() % (2.0 * np.pi)]))
    directions = np.zeros((len(angles), 3))
    directions[:, plane] = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    for index, (friction, label) in enumerate(_LABELS.items()):
        reach = np.array([largest_force(finger, position, each, limit, friction=friction) for each in directions])
        reach[~np.isfinite(reach)] = np.nan
        axes.plot(*(reach[:, None] * directions[:, plane]).T, label=label, **series(index))
    axes.plot(0.0, 0.0, color=colour(BLACK), marker="o", markersize=4)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel(f"{AXES[plane[0]]} (N)")
    axes.set_ylabel(f"{AXES[plane[1]]} (N)")
    axes.legend(loc="best")


AXES = "xyz"
# Least extent of a side, in parts of the largest, so that flat things have a box.
_LEAST_EXTENT = 0.2
# Points that labels stand away from their axis, so that they clear the ticks'.
_LABEL_DISTANCE = 8.0


def axes_around(part: SubFigure, corners: Array, unit: str) -> Axes3D:
    """Return oblique axes around points.

    Args:
        part: The part of the figure.
        corners: Points that must be in view, shape (m, 3).
        unit: Of them.
    """
    axes = part.add_subplot(projection="3d")
    assert isinstance(axes, Axes3D)
    low, high = corners.min(axis=0), corners.max(axis=0)
    longest = float(np.max(high - low)) or 1.0
    span = np.maximum(high - low, _LEAST_EXTENT * longest)
    for index, name in enumerate(AXES):
        middle = 0.5 * (low + high)[index]
        getattr(axes, f"set_{name}lim")(middle - 0.52 * span[index], middle + 0.52 * span[index])
        getattr(axes, f"set_{name}label")(f"{name} ({unit})", labelpad=_LABEL_DISTANCE)
        axis = getattr(axes, f"{name}axis")
        if high[index] - low[index] < 1e-6 * longest:
            axis.set_ticks([round(middle, 9) + 0.0])
        else:
            axis.set_major_locator(MaxNLocator(2 if span[index] < 0.5 * longest else 5, steps=[1, 2, 5, 10]))
    axes.set_box_aspect(tuple(span), zoom=0.75)
    # Flat bodies are seen from higher up.
    axes.view_init(elev=20 if span[2] > 1.01 * _LEAST_EXTENT * longest else 40, azim=-55)
    return axes


def flexion_plane(finger: Finger) -> tuple[int, int]:
    """Return the two axes of the base frame that are most nearly across the axis of the last joint, at rest."""
    limiter, model = finger.stroke_limiter, finger.rigid_body.model
    data = model.createData()
    pin.computeJointJacobians(model, data, np.clip(0.0, limiter.lower, limiter.upper))
    twist = pin.getJointJacobian(model, data, model.njoints - 1, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    # Of a single joint Pinocchio returns a vector.
    normal = int(np.argmax(np.abs(twist.reshape(6, -1)[3:, -1])))
    first, second = (axis for axis in range(3) if axis != normal)
    return first, second
