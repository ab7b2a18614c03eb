"""How good the joint reaction (17) is: along a motion, and under fingertip forces."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from finger_pin.analysis.reaction import JointReactions
from finger_pin.description.routing import Array
from finger_pin.views.plots.lines import trace
from finger_pin.views.plots.panels import legend, stack, title
from finger_pin.views.plots.style import BLACK, BLUE, GREEN, GREY, VERMILLION, new_figure, styled

_PERCENT = 100.0
_COLUMN, _GAP, _RIM = 4.55, 0.1, 0.05
#: Between instants of the difference, which inertia makes spike: least and greatest of these parts of all instants.
_MOST = (0.5, 99.5)


@styled
def plot_reaction(motion: JointReactions, loaded: Mapping[str, JointReactions]) -> Figure:
    """Draw reactions by (17) and in full, their difference, and the difference under fingertip forces.

    Args:
        motion: Along a motion, usually without a fingertip force.
        loaded: Under fingertip forces, by label.
    """
    joints = motion.joints
    height = max(6.6, 1.45 * len(joints) + 1.2)
    edges = [_RIM + index * (_COLUMN + _GAP) for index in range(3 if loaded else 2)]
    figure = new_figure(edges[-1] + _COLUMN + 2.0 * _RIM, height)
    left = stack(figure, edges[0], edges[0] + _COLUMN, [f"{name}\n(N)" for name in joints], bottom=1.0)
    title(left[0], "(a) reaction $R$ along the motion")
    middle = stack(figure, edges[1], edges[1] + _COLUMN, ["of mean (17)\n(%)"] * len(joints), bottom=1.0)
    title(middle[0], "(b) its difference from (17)")
    for index, (whole, rest) in enumerate(zip(left, middle, strict=True)):
        _along(whole, rest, motion, index)
    legend(left[-1], left[0].get_lines(), columns=3)
    legend(middle[-1], middle[0].get_lines()[:3], columns=2)
    if loaded:
        right = stack(figure, edges[2], edges[2] + _COLUMN, ["of mean (17)\n(%)"] * len(joints), bottom=1.0)
        title(right[0], "(c) quasi-static, under fingertip forces")
        for index, axes in enumerate(right):
            _under_loads(axes, loaded, index)
        lowest, highest = (pick(axes.get_ylim()[end] for axes in right) for end, pick in enumerate((min, max)))
        for axes in right:
            axes.set_ylim(lowest, highest)
        _name_loads(right[-1], list(loaded))
    return figure


def _along(whole: Axes, rest: Axes, motion: JointReactions, index: int) -> None:
    time, paper = motion.time, motion.paper[:, index]
    trace(whole, time, paper, label="(17)", color=BLACK, linewidth=2.2)
    trace(whole, time, motion.full[:, index], label="full, with inertia", color=VERMILLION, linewidth=0.8)
    trace(whole, time, motion.static[:, index], label="full, quasi-static", color=BLUE, linestyle="--")
    whole.set_ylim(bottom=0.0)
    inertial = _relative(motion.full[:, index], paper)
    trace(rest, time, inertial, label="full, with inertia", color=VERMILLION, linewidth=0.8)
    trace(rest, time, _relative(motion.static[:, index], paper), label="full, quasi-static", color=BLUE)
    other = _relative(motion.other_groove[:, index], paper)
    trace(rest, time, other, label="grooves on proximal links", color=GREEN, linestyle=":")
    low, high = (np.percentile(inertial, part) for part in _MOST)
    span = max(high, 2.0, float(other.max())), min(low, -2.0, float(other.min()))
    rest.set_ylim(1.1 * span[1], 1.1 * span[0])
    rest.axhline(0.0, color=GREY, linewidth=0.8)


def _under_loads(axes: Axes, loaded: Mapping[str, JointReactions], index: int) -> None:
    for place, reactions in enumerate(loaded.values()):
        paper = reactions.paper[:, index]
        relative = _relative(reactions.static[:, index], paper)
        axes.plot([place, place], [relative.min(), relative.max()], color=BLUE, linewidth=3.0, alpha=0.35)
        axes.plot(place, relative.mean(), "o", color=BLUE, markersize=4.0)
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.margins(x=0.03)


def _name_loads(axes: Axes, labels: list[str]) -> None:
    axes.set_xticks(range(len(labels)), labels, rotation=90, fontsize=8.0)
    axes.xaxis.label.set_visible(False)
    keys = [
        Line2D([], [], color=BLUE, marker="o", linestyle="", markersize=4.0, label="mean"),
        Line2D([], [], color=BLUE, linewidth=3.0, alpha=0.35, label="range over the motion"),
    ]
    legend(axes, keys, columns=2)


def _relative(other: Array, paper: Array) -> Array:
    return np.asarray(_PERCENT * (other - paper) / np.mean(paper))
