"""An observation: angles, tensions and forces at tips with bands, times of touch, and whether the model fits."""

from __future__ import annotations

from typing import Any

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from finger_pin.observation.record import CONSISTENCY_LIMIT
from finger_pin.views.observation_text import observed_tips, require_observation, touches
from finger_pin.views.plots.lines import names, series, shade, times, trace
from finger_pin.views.plots.panels import NO_TENDONS, cut_spikes, empty_panel, labelled, legend, sheet, stack, title
from finger_pin.views.plots.style import BLACK, BLUE, VERMILLION, YELLOW, Width, limit_line, styled, thin
from finger_pin.views.shown_units import shown_joints

_TENSIONS = {"spool_tension": ("at the canal's entrance", BLUE), "tendon_tension": ("behind all friction", VERMILLION)}
_TRUTH: dict[str, Any] = {"color": BLACK, "linestyle": (0, (4, 2))}


@styled
def plot_observed(
    result: xr.Dataset, run: xr.Dataset | None = None, *, width: Width = None, titles: bool = True
) -> Figure:
    """Draw what was observed, with bands, and the truth dashed if it is known.

    (a) One panel per joint, deg or m: its position. (b) One panel per tendon, N: its tension at the canal's entrance
    and behind all friction. (c) One panel per tip, N: the force on it; times in which it is touched are shaded. (d)
    The consistency of model and readings, and its limit, beyond which the model does not fit.

    Args:
        result: Dataset of `fp.observe` or `Observer.result`.
        run: Dataset of `simulate` with the truth over the same time. Forces on tips are not drawn of one with contacts:
            they are not part of its variable.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.

    Raises:
        InputError: If the result is none of an observation, or the run lacks a variable.
    """
    require_observation(result)
    units, tendons, tips = shown_joints(result), names(result, "tendon"), observed_tips(result)
    if run is not None:
        run = run.sel(time=slice(float(result["time"][0]), float(result["time"][-1])))
    height = max(5.4, 1.5 * max(len(units), len(tendons), len(tips) + 1))
    figure, (left, middle, right) = sheet([(4.6, height), (4.6, height), (4.8, height)], width, titles)
    panels = stack(left, [labelled(name, unit) for name, (_, unit) in units.items()])
    title(panels[0], "(a) positions of joints")
    for axes, (name, (factor, _)) in zip(panels, units.items(), strict=True):
        _draw_band(axes, result.sel(joint=name), "joint_position", factor, label="observed", color=BLUE)
        if run is not None:
            _draw_truth(axes, run["joint_position"].sel(joint=name), factor)
    legend(left, panels[0].get_legend_handles_labels()[0])
    if tendons:
        panels = stack(middle, [labelled(name, "N") for name in tendons])
        title(panels[0], "(b) tensions")
        for axes, name in zip(panels, tendons, strict=True):
            tensions = [variable for variable in _TENSIONS if variable in result]
            for variable, (label, colour) in ((each, _TENSIONS[each]) for each in tensions):
                _draw_band(axes, result.sel(tendon=name), variable, label=label, color=colour)
                if run is not None:
                    _draw_truth(axes, run[variable].sel(tendon=name))
            # Where a slack cord gets taut its band is wide for a moment.
            ends = [
                result.sel(tendon=name)[f"{variable}{end}"].values for variable in tensions for end in ("_low", "_high")
            ]
            cut_spikes(axes, *ends)
        legend(middle, panels[0].get_legend_handles_labels()[0])
    else:
        empty_panel(middle, NO_TENDONS)
    *panels, below = stack(right, [labelled(f"{name} force".strip(), "N") for name in tips] + ["consistency"])
    for axes, (name, part) in zip(panels, tips.items(), strict=True):
        _draw_force(axes, part, name, run)
    for touch in touches(result):
        panels[[*tips].index(touch.tip)].axvspan(
            touch.begin, touch.end, color=YELLOW, alpha=0.5, linewidth=0.0, zorder=0
        )
    trace(below, times(result), result["consistency"].values, color=BLACK, linewidth=thin())
    below.axhline(CONSISTENCY_LIMIT, **limit_line())
    below.set_ylim(bottom=0.0)
    title(below, "(d) misfit of model and readings; dashed: the limit")
    if panels:
        title(panels[0], "(c) force at the tip; shaded: touched")
        legend(right, panels[0].get_legend_handles_labels()[0])
    return figure


def _draw_band(axes: Axes, part: xr.Dataset, variable: str, factor: float = 1.0, **options: Any) -> None:
    value, low, high = (factor * part[f"{variable}{end}"].values for end in ("", "_low", "_high"))
    shade(axes, times(part), low, high, color=options["color"], alpha=0.2)
    trace(axes, times(part), value, linewidth=thin(), **options)


def _draw_truth(axes: Axes, truth: xr.DataArray, factor: float = 1.0) -> None:
    is_first = all(line.get_label() != "truth" for line in axes.get_lines())
    label = "truth" if is_first else None
    trace(axes, truth["time"].values, factor * truth.values, label=label, linewidth=thin(), **_TRUTH)


def _draw_force(axes: Axes, part: xr.Dataset, tip: str, run: xr.Dataset | None) -> None:
    """Draw the force on a tip, and the truth where the run has a tip of this name, or one only."""
    for index, axis in enumerate(names(part, "axis")):
        _draw_band(axes, part.sel(axis=axis), "fingertip_force", label=axis, **series(index))
    if run is None or "contact_force" in run:
        return
    truth = run["fingertip_force"]
    for dimension in {*truth.dims} - {"time", "axis"}:
        if tip not in truth[dimension].values:
            return
        truth = truth.sel({dimension: tip})
    for axis in names(part, "axis"):
        _draw_truth(axes, truth.sel(axis=axis))
