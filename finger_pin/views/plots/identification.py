"""Figures of an identification: measured and computed signals, residuals, profiles."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from finger_pin.typing import Array
from finger_pin.views.plots.lines import trace
from finger_pin.views.plots.panels import grid, title
from finger_pin.views.plots.style import BLUE, GREY, VERMILLION, Width, styled
from finger_pin.views.shown_units import shown_unit

#: Rise of minus twice the likelihood at the ends of a 95 % interval.
_LEVEL = 3.841


@styled
def plot_identification(result: xr.Dataset, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw every signal as measured and computed with its residuals, a row each, over load or over time.

    Args:
        result: Dataset of `identify`.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    signals = result["signal"].values
    figure, panels = grid(2 * len(signals), 2, (4.3, 2.6), width, titles)
    for k, (met, left) in enumerate(zip(panels[::2], panels[1::2], strict=True)):
        of_signal = result["signal_index"].values == k
        measured, residual, load, instant = (
            result[name].values[of_signal] for name in ("measured", "residual", "applied", "instant")
        )
        steady = bool(result["signal_steady"].values[k])
        by_load = steady and bool(np.isfinite(load).all())
        over, label = (load, "load (N)") if by_load else (instant, "reading" if steady else "time (s)")
        factor, unit = shown_unit(str(result["signal_units"].values[k]))
        measured, residual = factor * measured, factor * residual
        if steady:
            met.plot(over, measured, "o", color=BLUE, markersize=3.5, alpha=0.6, label="measured")
            _computed(met, over, measured - residual)
            left.plot(over, residual, "o", color=BLUE, markersize=3.5, alpha=0.6)
        else:
            trace(met, over, measured, color=BLUE, label="measured")
            trace(met, over, measured - residual, color=VERMILLION, label="computed", linewidth=1.0)
            trace(left, over, residual, color=BLUE, linewidth=0.8)
        left.axhline(0.0, color=GREY, linewidth=0.8)
        met.set(xlabel=label, ylabel=f"({unit})" if unit else "")
        left.set(xlabel=label)
        title(met, str(signals[k]))
        title(left, f"left over, rms {factor * result['noise'].values[k]:.3g} {unit}")
    panels[0].legend(loc="best")
    return figure


@styled
def plot_predictions(result: xr.Dataset, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw what was measured over what was predicted of every signal that was held out, with the band of 95 %.

    Args:
        result: Dataset of `identify` or `predict`.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    names = result["prediction"].values
    figure, panels = grid(len(names), 1, (8.6, 2.6), width, titles)
    for k, axes in enumerate(panels):
        of_signal = result["predicted_index"].values == k
        instant, load, measured, value, band = (
            result[f"predicted_{name}"].values[of_signal]
            for name in ("instant", "applied", "measured", "value", "band")
        )
        steady = bool(result["prediction_steady"].values[k])
        by_load = steady and bool(np.isfinite(load).all())
        over = load if by_load else instant
        order = np.argsort(over, kind="stable")
        factor, unit = shown_unit(str(result["prediction_units"].values[k]))
        over, measured, value, band = (each[order] for each in (over, factor * measured, factor * value, factor * band))
        if steady:
            axes.errorbar(over, value, band, fmt="_", color=VERMILLION, label="predicted, 95 %")
            axes.plot(over, measured, "o", color=BLUE, markersize=3.5, alpha=0.6, label="measured")
        else:
            axes.fill_between(over, value - band, value + band, color=VERMILLION, alpha=0.2, linewidth=0.0)
            trace(axes, over, measured, color=BLUE, label="measured")
            trace(axes, over, value, color=VERMILLION, label="predicted, 95 %", linewidth=1.0)
        rms = f"rms {factor * result['prediction_rms'].values[k]:.3g} {unit}"
        label = "load (N)" if by_load else "reading" if steady else "time (s)"
        axes.set(xlabel=label, ylabel=f"({unit})" if unit else "")
        title(axes, f"{names[k]}, held out, {rms}")
    panels[0].legend(loc="best")
    return figure


def _computed(axes: Axes, over: Array, computed: Array) -> None:
    """Draw the computed values of steady readings: a curve, or marks for several at one load, as to and fro."""
    _, place = np.unique(over, return_inverse=True)
    means = np.bincount(place, computed) / np.bincount(place)
    if np.allclose(computed, means[place], rtol=0.0, atol=1e-6 * float(np.max(np.abs(computed)))):
        order = np.argsort(over, kind="stable")
        axes.plot(over[order], computed[order], color=VERMILLION, label="computed")
    else:
        axes.plot(over, computed, "_", color=VERMILLION, markersize=10.0, label="computed")


@styled
def plot_profiles(result: xr.Dataset, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw the profile of every parameter: the misfit of the recordings with it held at other values.

    Args:
        result: Dataset of `identify`.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    names = result["parameter"].values
    figure, panels = grid(len(names), 2 if len(names) == 4 else 3, (3.0, 2.5), width, titles)
    for k, axes in enumerate(panels):
        _profile(axes, result.isel(parameter=k))
    return figure


def _profile(axes: Axes, one: xr.Dataset) -> None:
    factor, unit = shown_unit(str(one["units"].values))
    value, rise = factor * one["profile_value"].values, one["profile_rise"].values
    there = np.isfinite(value) & np.isfinite(rise)
    value, rise = value[there], np.maximum(rise[there], 0.0)
    estimate = factor * float(one["estimate"])
    # The root of the rise is nearly straight on either side.
    fine = np.linspace(value.min(), value.max(), 81)
    root = np.interp(fine, value, np.where(value < estimate, -1.0, 1.0) * np.sqrt(rise))
    axes.plot(fine, root**2, color=BLUE)
    axes.plot(value, rise, "o", color=BLUE, markersize=3.0)
    axes.axhline(_LEVEL, color=GREY, linewidth=0.8, linestyle="--")
    for end in (factor * float(one["lower"]), factor * float(one["upper"])):
        if math.isfinite(end):
            axes.axvline(end, color=GREY, linewidth=0.8)
    axes.plot([estimate], [0.0], "o", color=VERMILLION, markersize=5.0)
    title(axes, short_name(str(one["parameter"].values)))
    axes.locator_params(axis="x", nbins=3)
    axes.set(xlabel="" if unit == "1" else f"({unit})", ylim=(-0.3, max(8.0, 1.2 * _LEVEL)))


def short_name(key: str) -> str:
    """Return the end of a parameter's key, after the name of its recording if it is of one."""
    parts = key.split(".")
    return f"{parts[1]}: {'.'.join(parts[-2:])}" if parts[0] == "recordings" else ".".join(parts[-2:])
