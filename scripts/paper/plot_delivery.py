"""Conclusion (c): planned and delivered tension of the passive tendon, over speed and friction."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from finger_pin.views.plots.lines import series, trace
from finger_pin.views.plots.panels import grid, title
from finger_pin.views.plots.style import BLACK, BLUE, VERMILLION, Width, colour, limit_line, styled
from paper.delivery import PassiveDelivery


@styled
def plot_passive_delivery(found: PassiveDelivery, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw (a) plan and delivery of the scenario as it is, (b) causes of the difference, (c) over speed and friction.

    Args:
        found: Result of the experiment `passive_delivery`.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    figure, (traces, causes, over) = grid(3, 3, (4.2, 4.4), width, titles)
    _traces(traces, found)
    _causes(causes, found)
    _grid(over, found)
    return figure


def _traces(axes: Axes, found: PassiveDelivery) -> None:
    for index, name in enumerate(found.scenario.finger.passive_names):
        trace(axes, found.time, found.planned[:, index], color=BLACK, linestyle="--", label=f"{name} planned")
        trace(axes, found.time, found.delivered[:, index], label=f"{name} delivered", **series(index))
    axes.set_ylim(bottom=0.0)
    axes.margins(x=0.0)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("tension (N)")
    title(axes, f"(a) {found.scenario.name} as it is: off by {100.0 * float(found.given.deviation):.0f} % rms")
    axes.legend(loc="best")


def _causes(axes: Axes, found: PassiveDelivery) -> None:
    causes = {name: value for name, value in found.causes.items() if name != "none"}
    shown = {"none of them": found.causes["none"], **causes}
    for row, value in enumerate(shown.values()):
        axes.barh(row, 100.0 * value, height=0.6, color=colour(VERMILLION if value > found.broken else BLUE))
        axes.text(100.0 * value, row, f" {100.0 * value:.1f}", va="center", fontsize="small")
    axes.axvline(100.0 * found.broken, label="beyond: plan fails", **limit_line())
    axes.legend(loc="lower right", fontsize="x-small")
    axes.set_yticks(range(len(shown)), list(shown))
    axes.invert_yaxis()
    axes.margins(x=0.15)
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("delivered off planned (% rms)")
    title(axes, "(b) causes of the difference, each alone")


def _grid(axes: Axes, found: PassiveDelivery) -> None:
    for index, factor in enumerate(found.factors):
        deviation = 100.0 * found.grid.deviation[:, index]
        label = "no friction" if factor == 0.0 else f"friction \N{MULTIPLICATION SIGN} {factor:g}"
        axes.plot(found.speeds, deviation, label=label, marker="o", markersize=3.5, **series(index))
    axes.axhline(100.0 * found.broken, label="beyond: plan fails", **limit_line())
    axes.set_xscale("log", base=2)
    axes.set_xticks(found.speeds, [f"{speed:g}" for speed in found.speeds])
    axes.set_ylim(0.0, 1.3 * float(np.max(100.0 * found.grid.deviation)))
    axes.set_xlabel("speed over the scenario's own")
    axes.set_ylabel("delivered off planned (% rms)")
    title(axes, "(c) without weight, f₅ᵈ = λ f₅ᵏ")
    axes.legend(loc="upper left", ncols=2, fontsize="x-small")
