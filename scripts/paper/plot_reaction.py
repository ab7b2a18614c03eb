"""The error of the joint reaction (17): along a motion, and under fingertip forces."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from finger_pin.typing import Array
from finger_pin.views.plots.lines import trace
from finger_pin.views.plots.panels import legend, sheet, stack, title
from finger_pin.views.plots.style import BLACK, BLUE, GREEN, GREY, VERMILLION, Width, colour, styled, thin
from paper.joint_reactions import JointReactions

_PERCENT = 100.0
_COLUMN = 4.6
#: Between instants of the difference, which inertia makes spike: least and greatest of these parts of all instants.
_MOST = (0.5, 99.5)


@styled
def plot_reaction(
    motion: JointReactions, loaded: Mapping[str, JointReactions], *, width: Width = None, titles: bool = True
) -> Figure:
    """Draw reactions by (17) and in full, their difference, and the difference under fingertip forces.

    Args:
        motion: Along a motion, usually without a fingertip force.
        loaded: Under fingertip forces, by label.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    joints = motion.joints
    height = max(6.6, 1.45 * len(joints) + 1.2)
    figure, parts = sheet([(_COLUMN, height)] * (3 if loaded else 2), width, titles)
    left = stack(parts[0], [f"{name}\n(N)" for name in joints])
    title(left[0], "(a) reaction $R$ along the motion")
    middle = stack(parts[1], ["of mean (17)\n(%)"] * len(joints))
    title(middle[0], "(b) its difference from (17)")
    for index, (whole, rest) in enumerate(zip(left, middle, strict=True)):
        _along(whole, rest, motion, index)
    legend(parts[0], left[0].get_lines())
    legend(parts[1], middle[0].get_lines()[:3])
    if loaded:
        right = stack(parts[2], ["of mean (17)\n(%)"] * len(joints))
        title(right[0], "(c) quasi-static, under fingertip forces")
        for index, axes in enumerate(right):
            _under_loads(axes, loaded, index)
        lowest, highest = (pick(axes.get_ylim()[end] for axes in right) for end, pick in enumerate((min, max)))
        for axes in right:
            axes.set_ylim(lowest, highest)
        legend(parts[2], _name_loads(right[-1], list(loaded)))
    return figure


def _along(whole: Axes, rest: Axes, motion: JointReactions, index: int) -> None:
    time, paper = motion.time, motion.paper[:, index]
    trace(whole, time, paper, label="(17)", color=BLACK, linewidth=thin(1.6))
    trace(whole, time, motion.full[:, index], label="full, with inertia", color=VERMILLION, linewidth=thin(0.6))
    trace(whole, time, motion.static[:, index], label="full, quasi-static", color=BLUE, linestyle="--")
    whole.set_ylim(bottom=0.0)
    inertial = _relative(motion.full[:, index], paper)
    trace(rest, time, inertial, label="full, with inertia", color=VERMILLION, linewidth=thin(0.6))
    trace(rest, time, _relative(motion.static[:, index], paper), label="full, quasi-static", color=BLUE)
    other = _relative(motion.other_groove[:, index], paper)
    trace(rest, time, other, label="grooves on proximal links", color=GREEN, linestyle=":")
    low, high = (np.percentile(inertial, part) for part in _MOST)
    span = max(high, 2.0, float(other.max())), min(low, -2.0, float(other.min()))
    rest.set_ylim(1.1 * span[1], 1.1 * span[0])
    rest.axhline(0.0, color=colour(GREY), linewidth=thin(0.6))


def _under_loads(axes: Axes, loaded: Mapping[str, JointReactions], index: int) -> None:
    for place, reactions in enumerate(loaded.values()):
        paper = reactions.paper[:, index]
        relative = _relative(reactions.static[:, index], paper)
        axes.plot([place, place], [relative.min(), relative.max()], color=colour(BLUE), linewidth=3.0, alpha=0.35)
        axes.plot(place, relative.mean(), "o", color=colour(BLUE), markersize=4.0)
    axes.axhline(0.0, color=colour(GREY), linewidth=thin(0.6))
    axes.margins(x=0.03)


def _name_loads(axes: Axes, labels: list[str]) -> list[Line2D]:
    """Write the names of loads, and return the entries of the legend."""
    axes.set_xticks(range(len(labels)), labels, rotation=90, fontsize="x-small")
    axes.xaxis.label.set_visible(False)
    return [
        Line2D([], [], color=colour(BLUE), marker="o", linestyle="", markersize=4.0, label="mean"),
        Line2D([], [], color=colour(BLUE), linewidth=3.0, alpha=0.35, label="range over the motion"),
    ]


def _relative(other: Array, paper: Array) -> Array:
    return np.asarray(_PERCENT * (other - paper) / np.mean(paper))
