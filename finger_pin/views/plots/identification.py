"""Figures of an identification in SI, as its bench and tables are: signals, residuals, predictions, profiles."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from finger_pin.exceptions import InputError
from finger_pin.typing import Array
from finger_pin.views.plots.lines import trace
from finger_pin.views.plots.panels import grid, title
from finger_pin.views.plots.style import BLUE, GREY, VERMILLION, Width, styled

#: Rise of minus twice the likelihood at the ends of a 95 % interval.
_CHI_SQUARE_95 = 3.841


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
    for index, (fit_axes, residual_axes) in enumerate(zip(panels[::2], panels[1::2], strict=True)):
        mask = result["signal_index"].values == index
        measured, residual, load, instant = (
            result[name].values[mask] for name in ("measured", "residual", "applied", "instant")
        )
        steady = bool(result["signal_steady"].values[index])
        by_load = steady and bool(np.isfinite(load).all())
        x, label = (load, "load (N)") if by_load else (instant, "reading" if steady else "time (s)")
        unit = str(result["signal_units"].values[index])
        if steady:
            fit_axes.plot(x, measured, "o", color=BLUE, markersize=3.5, alpha=0.6, label="measured")
            _draw_computed(fit_axes, x, measured - residual)
            residual_axes.plot(x, residual, "o", color=BLUE, markersize=3.5, alpha=0.6)
        else:
            trace(fit_axes, x, measured, color=BLUE, label="measured")
            trace(fit_axes, x, measured - residual, color=VERMILLION, label="computed", linewidth=1.0)
            trace(residual_axes, x, residual, color=BLUE, linewidth=0.8)
        residual_axes.axhline(0.0, color=GREY, linewidth=0.8)
        fit_axes.set(xlabel=label, ylabel=f"({unit})" if unit else "")
        residual_axes.set(xlabel=label)
        title(fit_axes, str(signals[index]))
        title(residual_axes, f"left over, rms {result['noise'].values[index]:.3g} {unit}")
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
    for index, axes in enumerate(panels):
        mask = result["predicted_index"].values == index
        instant, load, measured, value, band = (
            result[f"predicted_{name}"].values[mask] for name in ("instant", "applied", "measured", "value", "band")
        )
        steady = bool(result["prediction_steady"].values[index])
        by_load = steady and bool(np.isfinite(load).all())
        x = load if by_load else instant
        order = np.argsort(x, kind="stable")
        unit = str(result["prediction_units"].values[index])
        x, measured, value, band = (each[order] for each in (x, measured, value, band))
        if steady:
            axes.errorbar(x, value, band, fmt="_", color=VERMILLION, label="predicted, 95 %")
            axes.plot(x, measured, "o", color=BLUE, markersize=3.5, alpha=0.6, label="measured")
        else:
            axes.fill_between(x, value - band, value + band, color=VERMILLION, alpha=0.2, linewidth=0.0)
            trace(axes, x, measured, color=BLUE, label="measured")
            trace(axes, x, value, color=VERMILLION, label="predicted, 95 %", linewidth=1.0)
        rms = f"rms {result['prediction_rms'].values[index]:.3g} {unit}"
        label = "load (N)" if by_load else "reading" if steady else "time (s)"
        axes.set(xlabel=label, ylabel=f"({unit})" if unit else "")
        title(axes, f"{names[index]}, held out, {rms}")
    panels[0].legend(loc="best")
    return figure


def _draw_computed(axes: Axes, abscissa: Array, computed: Array) -> None:
    """Draw the computed values of steady readings: a curve, or marks for several at one load, as to and fro."""
    _, inverse = np.unique(abscissa, return_inverse=True)
    means = np.bincount(inverse, computed) / np.bincount(inverse)
    if np.allclose(computed, means[inverse], rtol=0.0, atol=1e-6 * float(np.max(np.abs(computed)))):
        order = np.argsort(abscissa, kind="stable")
        axes.plot(abscissa[order], computed[order], color=VERMILLION, label="computed")
    else:
        axes.plot(abscissa, computed, "_", color=VERMILLION, markersize=10.0, label="computed")


@styled
def plot_profiles(result: xr.Dataset, *, width: Width = None, titles: bool = True) -> Figure:
    """Draw the profile of every parameter that has one: the misfit of the recordings with it held at other values.

    Args:
        result: Dataset of `identify`.
        width: Of the figure: in, `column` or `page` (`style.Width`).
        titles: Whether panels have titles.
    """
    shown = profiled_parameters(result)
    if not shown:
        raise InputError("result", "has no profiles: identify with profiles")
    figure, panels = grid(len(shown), 2 if len(shown) == 4 else 3, (3.0, 2.5), width, titles)
    for k, axes in zip(shown, panels, strict=True):
        _draw_profile(axes, result.isel(parameter=k))
    return figure


def profiled_parameters(result: xr.Dataset) -> list[int]:
    """Return the indices of the parameters that have a profile: values beside the estimate."""
    return np.flatnonzero(np.sum(np.isfinite(result["profile_rise"].values), axis=1) > 1).tolist()


def _draw_profile(axes: Axes, parameter: xr.Dataset) -> None:
    unit = str(parameter["units"].values)
    value, rise = parameter["profile_value"].values, parameter["profile_rise"].values
    finite = np.isfinite(value) & np.isfinite(rise)
    value, rise = value[finite], np.maximum(rise[finite], 0.0)
    estimate = float(parameter["estimate"])
    # The root of the rise is nearly straight on either side.
    fine_values = np.linspace(value.min(), value.max(), 81)
    root = np.interp(fine_values, value, np.where(value < estimate, -1.0, 1.0) * np.sqrt(rise))
    axes.plot(fine_values, root**2, color=BLUE)
    axes.plot(value, rise, "o", color=BLUE, markersize=3.0)
    axes.axhline(_CHI_SQUARE_95, color=GREY, linewidth=0.8, linestyle="--")
    for end in (float(parameter["lower"]), float(parameter["upper"])):
        if math.isfinite(end):
            axes.axvline(end, color=GREY, linewidth=0.8)
    axes.plot([estimate], [0.0], "o", color=VERMILLION, markersize=5.0)
    title(axes, short_name(str(parameter["parameter"].values)))
    axes.locator_params(axis="x", nbins=3)
    axes.set(xlabel="" if unit == "1" else f"({unit})", ylim=(-0.3, max(8.0, 1.2 * _CHI_SQUARE_95)))


def short_name(key: str) -> str:
    """Return the end of a parameter's key, its first one, after the name of its recording if it is of one."""
    parts = key.partition(" &")[0].split(".")
    return f"{parts[1]}: {'.'.join(parts[-2:])}" if parts[0] == "recordings" else ".".join(parts[-2:])
