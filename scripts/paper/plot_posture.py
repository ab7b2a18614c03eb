"""Conclusion (a): the share of its command that a tendon delivers, over the workspace and in motion."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.tendons import Tendons
from finger_pin.views.plots.panels import grid, title
from finger_pin.views.plots.statics import flexion_plane
from finger_pin.views.plots.style import BLACK, BLUE, GREY, VERMILLION, Width, colour, cycle_colours, styled, thin
from paper.posture import Transmission
from paper.transmission import flexion_postures, transmission_efficiency

_MILLI = 1e3
_AXES = "xyz"
_POINTS, _SIDE = 400, 41


@styled
def plot_transmission(found: Transmission, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw (a) the efficiencies of all tendons over the workspace, (b) the most affected one by fingertip, (c) motion.

    Args:
        found: Result of the experiment `transmission`.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    figure, (ranges, space, motion) = grid(3, 3, (4.2, 4.6), width, titles)
    _ranges(ranges, found)
    _space(figure, space, found)
    _motion(motion, found)
    return figure


def _ranges(axes: Axes, found: Transmission) -> None:
    space = found.workspace
    for index in range(len(found.tendons)):
        for values, look in ((space.pulling, colour(BLUE)), (space.releasing, colour(VERMILLION))):
            low, high = values[:, index].min(), values[:, index].max()
            axes.barh(index, high - low, left=low, height=0.42, color=look)
            # A range of no width is a line.
            axes.plot([low, low], [index - 0.21, index + 0.21], color=look, linewidth=thin(1.4))
        least = space.least[:, index].min()
        greatest = space.greatest[:, index].max()
        axes.plot([least, greatest], [index, index], **_possible_look(), linewidth=thin(), zorder=0.5)
    axes.axvline(1.0, color=colour(BLACK), linewidth=thin(0.6))
    axes.set_yticks(range(len(found.tendons)), list(found.tendons))
    axes.invert_yaxis()
    axes.grid(visible=False, axis="y")
    axes.set_xlabel(r"$f\,/\,f^a$")
    handles = [
        axes.bar(0, 0, color=colour(BLUE), label="pulling"),
        axes.bar(0, 0, color=colour(VERMILLION), label="releasing"),
        axes.plot([], [], **_possible_look(), label="possible at rest")[0],
    ]
    axes.set_xlim(0.0, None)
    below: Any = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.16), "frameon": False}
    axes.legend(handles=handles, ncols=2, columnspacing=1.0, **below)
    title(axes, "(a) over the whole workspace")


def _possible_look() -> dict[str, Any]:
    return {"color": colour(GREY), "marker": "|", "markersize": 9}


def _space(figure: Figure, axes: Axes, found: Transmission) -> None:
    pulling = found.workspace.pulling
    worst = int(np.argmax(pulling.max(axis=0) - pulling.min(axis=0)))
    finger = Finger(found.scenario.finger)
    positions = flexion_postures(finger, _SIDE)
    first, second = flexion_plane(finger)
    tips = _MILLI * np.array(
        [finger.rigid_body.tip_position(theta) for theta in positions.reshape(-1, positions.shape[2])]
    )
    tips = tips.reshape(*positions.shape[:2], 3)
    values = transmission_efficiency(finger, positions).pulling[..., worst]
    drawn = axes.pcolormesh(tips[..., first], tips[..., second], values, shading="gouraud", cmap="cividis")
    axes.plot(0.0, 0.0, color=colour(BLACK), marker="o", markersize=4)
    figure.colorbar(drawn, ax=axes, label=rf"$f\,/\,f^a$ of {found.tendons[worst]}, pulling")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel(f"fingertip {_AXES[first]} (mm)")
    axes.set_ylabel(f"fingertip {_AXES[second]} (mm)")
    title(axes, f"(b) {found.tendons[worst]} by fingertip position; the dot: joint 1")


def _motion(axes: Axes, found: Transmission) -> None:
    motion, tendons = found.motion, Tendons.from_description(found.scenario.finger)
    phi = np.linspace(0.0, 1.05 * float(motion.curvature.max()), 100)
    if np.ptp(tendons.surface) == 0.0:
        for sign, label in ((-1.0, r"$e^{\mp\mu_e\varphi}$"), (1.0, None)):
            axes.plot(phi, np.exp(sign * tendons.surface[0] * phi), color=colour(BLACK), linewidth=thin(), label=label)
    step = max(1, len(found.time) // _POINTS)
    for index, name in enumerate(found.tendons):
        moving = motion.sliding[::step, index]
        look = cycle_colours()[index % len(cycle_colours())]
        curvature, ratio = motion.curvature[::step, index], motion.ratio[::step, index]
        axes.scatter(curvature[moving], ratio[moving], s=5, color=look, label=name, linewidths=0.0)
        axes.scatter(curvature[~moving], ratio[~moving], s=3, color=look, alpha=0.35, linewidths=0.0)
    axes.axhline(1.0, color=colour(GREY), linewidth=thin(0.6))
    axes.set_xlabel(r"curvature $\varphi$ (rad)")
    axes.set_ylabel(r"$f\,/\,f^a$")
    title(axes, f"(c) in motion, {found.scenario.name}; pale: not yet sliding")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=6, columnspacing=0.9, markerscale=2.5,
                handletextpad=0.3, handlelength=1.2)  # fmt: skip
