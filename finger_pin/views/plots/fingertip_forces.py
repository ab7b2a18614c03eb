"""Fingertip forces: the polytope in space, its section in the flexion plane with and without friction."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

from finger_pin.analysis import Friction, force_polytope, largest_force, tension_for_force
from finger_pin.mechanism.coerce import FingerLike, as_finger
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array
from finger_pin.views.plots.axes_3d import AXES, axes_around, flexion_plane
from finger_pin.views.plots.lines import series
from finger_pin.views.plots.panels import sheet, title
from finger_pin.views.plots.style import BLACK, BLUE, GREY, Width, colour, styled, thin

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
