"""Conclusion (b): tracking error, tension and friction over both frictions and the least tension, and self-locking."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from finger_pin.typing import Array
from finger_pin.views.plots.panels import grid, plain_ticks, title
from finger_pin.views.plots.style import BLACK, BLUE, VERMILLION, Width, colour, limit_line, styled
from paper.influence import FrictionInfluence, Sweep
from paper.runs import Measures

_MILLI = 1e3
_JOINTS, _TENDONS = VERMILLION, BLUE
_MEASURES: tuple[tuple[str, Callable[[Measures], Array]], ...] = (
    ("rms tracking error (deg)", lambda runs: np.rad2deg(runs.error)),
    ("largest tension (N)", lambda runs: runs.tension),
    ("mean joint friction (mN m)", lambda runs: _MILLI * runs.joint_friction),
)


@styled
def plot_friction_influence(found: FrictionInfluence, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw errors, tensions and losses over both frictions and the least tension, and the two frictions compared.

    Args:
        found: Result of the experiment `friction_influence`.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    figure, places = grid(9, 3, (4.0, 3.4), width, titles)
    rows = [places[:3], places[3:6], places[6:]]
    locking = found.gripping.predicted
    for axes, (label, value) in zip(rows[0], _MEASURES, strict=True):
        _line(axes, found.joint, value, "joint friction varied", _JOINTS)
        _line(axes, found.tendon, value, "tendon friction varied", _TENDONS)
        if locking < found.joint.values[-1]:
            axes.axvline(locking, label="joints lock, by the statics", **limit_line())
        axes.set_xlabel("friction over the finger's own")
        _logarithmic(axes, label)
    for axes, (label, value) in zip(rows[1], _MEASURES, strict=True):
        _line(axes, found.minimum, value, "with both frictions", BLACK)
        _line(axes, found.minimum_without_joint, value, "without joint friction", _TENDONS)
        _line(axes, found.minimum_without_tendon, value, "without tendon friction", _JOINTS)
        _tensions(axes)
        _logarithmic(axes, label)
    title(rows[0][0], "(a) more of one friction, the other as it is")
    title(rows[1][0], "(b) more tension")
    _same_work(rows[2][0], found)
    _elasticity(rows[2][1], found)
    _gripping(rows[2][2], found)
    for axes in (rows[0][0], rows[1][0], *rows[2][:2]):
        axes.legend(loc="best", fontsize="x-small")
    rows[2][2].legend(loc="lower left", fontsize="x-small")
    return figure


def _line(axes: Axes, sweep: Sweep, value: Callable[[Measures], Array], label: str, look: str) -> None:
    axes.plot(sweep.values, value(sweep.runs), label=label, color=colour(look), marker="o", markersize=3.5)


def _logarithmic(axes: Axes, label: str) -> None:
    axes.set_yscale("log")
    axes.set_ylabel(label)
    plain_ticks(axes.yaxis)


def _tensions(axes: Axes) -> None:
    axes.set_xscale("log")
    axes.set_xlabel(r"least tension $f_0$ (N)")
    plain_ticks(axes.xaxis)


def _same_work(axes: Axes, found: FrictionInfluence) -> None:
    joint, tendon = found.joint_alone.runs, found.tendon_alone.runs
    most = 1.15 * float(tendon.tendon_work[-1])
    for work, runs, label, look in (
        (joint.joint_work, joint, "joint friction alone", _JOINTS),
        (tendon.tendon_work, tendon, "tendon friction alone", _TENDONS),
    ):
        axes.plot(_MILLI * work, np.rad2deg(runs.error), label=label, color=colour(look), marker="o", markersize=3.5)
    axes.set_xlim(0.0, _MILLI * most)
    axes.set_ylim(0.0, 1.1 * float(np.rad2deg(np.interp(most, joint.joint_work, joint.error))))
    axes.set_xlabel("lost by sliding (mJ)")
    axes.set_ylabel("rms tracking error (deg)")
    title(axes, "(c) for the same energy lost")


def _elasticity(axes: Axes, found: FrictionInfluence) -> None:
    for values, label, look in (
        (found.elasticity_joint, "joint friction", _JOINTS),
        (found.elasticity_tendon, "tendon friction", _TENDONS),
    ):
        axes.plot(found.minimum.values, values, label=label, color=colour(look), marker="o", markersize=3.5)
    _tensions(axes)
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel("d ln(error) / d ln(friction)")
    title(axes, "(d) for a small change")


def _gripping(axes: Axes, found: FrictionInfluence) -> None:
    grip = found.gripping
    look: Any = {"color": colour(BLACK), "marker": "o", "markersize": 3.5}
    axes.plot(grip.shares, 1.0 / grip.tension, label="1 / largest tension (1/N)", **look)
    low = grip.shares[0]
    near = int(np.searchsorted(grip.shares, grip.extrapolated)) - 1
    slope = (1.0 / grip.tension[near]) / (grip.extrapolated - grip.shares[near])
    ends = np.array([low, grip.extrapolated])
    axes.plot(ends, slope * (grip.extrapolated - ends), color=colour(VERMILLION), linestyle=(0, (1, 1)),
              label=f"reaches zero at {grip.extrapolated:.3f}")  # fmt: skip
    axes.axvline(1.0, label="locks, by the statics", **limit_line())
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("joint friction over the critical one")
    axes.set_ylabel("1 / largest tension (1/N)")
    travel = axes.twinx()
    travel.plot(grip.shares, 100.0 * grip.followed, color=colour(BLUE), marker="s", markersize=3.5)
    travel.set_ylim(0.0, 105.0)
    travel.grid(visible=False)
    travel.set_ylabel("travel of the joint that follows least (%)", color=colour(BLUE))
    title(axes, "(e) where the finger grips itself, slow swing")
