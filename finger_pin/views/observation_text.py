"""An observation in words and numbers: angles, tensions and touch with bands, and whether the model fits."""

from __future__ import annotations

import textwrap
from typing import NamedTuple

import numpy as np
import xarray as xr

from finger_pin.exceptions import InputError
from finger_pin.observation.record import CONSISTENCY_LIMIT
from finger_pin.simulation.netcdf import require_samples
from finger_pin.views.shown_units import joints_by_unit
from finger_pin.views.summary import number_row, table

# From this part of a sensor's readings on, those that were used say little of the model.
_MANY = 0.1
_MISFIT = "something touches elsewhere than at a tip, or numbers are off by more than was said"


class Touch(NamedTuple):
    """A span of time in which a tip is touched.

    Attributes:
        tip: Name of the tip; empty where the finger has one only.
        begin: From when on it is sure, s.
        end: Until when, s.
        force: Largest estimate in it, N.
    """

    tip: str
    begin: float
    end: float
    force: float


def observed_tips(result: xr.Dataset) -> dict[str, xr.Dataset]:
    """Return the parts of an observation about each tip, by its name, which is empty where there is one only."""
    if "fingertip" not in result.dims:
        return {"": result}
    return {str(name): result.sel(fingertip=name) for name in result["fingertip"].values}


def touches(result: xr.Dataset) -> list[Touch]:
    """Return the touches of an observation, tip by tip, in the order of time."""
    time, spans = result["time"].values, []
    for tip, part in observed_tips(result).items():
        force = np.linalg.norm(part["fingertip_force"].transpose("time", "axis").values, axis=1)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], part["touched"].values, [False]]).astype(int)))
        for first, behind in edges.reshape(-1, 2):
            spans.append(Touch(tip, float(time[first]), float(time[behind - 1]), float(force[first:behind].max())))
    return spans


def require_observation(result: xr.Dataset) -> None:
    """Refuse what is no observation.

    Raises:
        InputError: If it is none.
    """
    require_samples(result)
    if "consistency" not in result:
        raise InputError("result.consistency", "is missing; give the result of fp.observe")


def summarize_observed(result: xr.Dataset) -> str:
    """Return a summary of an observation as plain text, at most 80 columns wide if its names allow.

    Args:
        result: Dataset of `fp.observe` or `Observer.result`.

    Raises:
        InputError: If it is none.
    """
    require_observation(result)
    time, attributes = result["time"].values, result.attrs
    head = f"{attributes['name']}: {time[0]:.6g} s to {time[-1]:.6g} s observed"
    kept = f", every {attributes['stride']}th kept" if attributes["stride"] > 1 else ""
    steps = f"steps of {1e3 * attributes['period']:g} ms, bands of {100.0 * attributes['level']:g} %"
    blocks = [[head, f"{len(time)} rows{kept}, {steps}"]]
    for unit, names in joints_by_unit(result).items():
        title, factor, digits = ("Joint angles, deg", 180.0 / np.pi, 2) if unit == "rad" else ("Slides, m", 1.0, 5)
        rows = [_row(name, result.sel(joint=name), "joint_position", factor, digits) for name in names]
        blocks.append(_banded(title, rows))
    if result.sizes["tendon"]:
        for title, name in (("behind all friction", "tendon_tension"), ("at the canal's entrance", "spool_tension")):
            if name in result:
                rows = [_row(str(each), result.sel(tendon=each), name, 1.0, 3) for each in result["tendon"].values]
                blocks.append(_banded(f"Tension {title}, N", rows))
    told = [_touches(result), _consistency(result), *_dropped(result), _speed(result)]
    blocks.append([line for each in told for line in textwrap.wrap(each, 80, subsequent_indent="  ")])
    return "\n\n".join("\n".join(block) for block in blocks)


def _banded(title: str, rows: list[tuple[str, ...]]) -> list[str]:
    return [f"{title}, with the mean half width of the band", *table(("", "least", "greatest", "half width"), rows)]


def _row(name: str, part: xr.Dataset, variable: str, factor: float, digits: int) -> tuple[str, ...]:
    values, low, high = (factor * part[f"{variable}{end}"].values for end in ("", "_low", "_high"))
    return number_row(name, (values.min(), values.max(), 0.5 * np.mean(high - low)), digits)


def _touches(result: xr.Dataset) -> str:
    end = float(result["time"][-1])
    texts = [
        f"{each.tip + ' ' if each.tip else ''}from {each.begin:.3f} s to "
        f"{'the end' if each.end == end else f'{each.end:.3f} s'}, up to {each.force:.2f} N"
        for each in touches(result)
    ]
    return f"Touched: {'; '.join(texts) or 'no touch was seen'}"


def _consistency(result: xr.Dataset) -> str:
    """Return whether the model fits its readings."""
    consistency, time = result["consistency"].values, result["time"].values
    if np.all(consistency == 1.0):
        return "Consistency: no reading beside the inputs was used, so that nothing tells whether the model fits"
    beyond = consistency >= CONSISTENCY_LIMIT
    largest, last = (f"{each:.3g}" for each in (consistency.max(), consistency[-1]))
    numbers = f"Consistency {largest} at most, {last} at the end (limit {CONSISTENCY_LIMIT:g})"
    if not beyond.any():
        rows = len(time) * result.attrs["stride"]
        counts = {name: int(count) for name, _, count in (each.rpartition(": ") for each in _texts(result, "skipped"))}
        lost = [f"{100.0 * count / rows:.3g} % of {name}" for name, count in counts.items() if count > _MANY * rows]
        if lost:
            return f"{numbers}, of the readings that were used: {', '.join(lost)} was missing or too far off to fit"
        return f"{numbers}: the readings do not contradict the model"
    first, share = time[beyond.argmax()], 100.0 * beyond.mean()
    reached = f"beyond the limit in {share:.3g} % of the time, first at {first:.3f} s"
    return f"{numbers}: the model does not fit its readings, {reached}: {_MISFIT}"


def _dropped(result: xr.Dataset) -> list[str]:
    """Return what was skipped, left out and has failed."""
    removed = _texts(result, "removed_objects")
    unknown = [f"Objects of the scenario, unknown to the observer: {', '.join(removed)}"] if removed else []
    named = {"skipped": "Skipped readings", "left_out": "Left out", "failures": "Failed integrations"}
    return unknown + [f"{title}: {', '.join(_texts(result, name)) or 'none'}" for name, title in named.items()]


def _texts(result: xr.Dataset, name: str) -> list[str]:
    """Return the texts of an attribute; a file keeps a list of one text as the text."""
    return [str(each) for each in np.atleast_1d(result.attrs.get(name, []))]


def _speed(result: xr.Dataset) -> str:
    """Return how fast it was, but for the first step, in which things are got ready."""
    duration, time = result["step_time"].values[1:], result["time"].values
    if not len(duration):
        return "Speed: there is one step only"
    factor = (time[-1] - time[0]) / (duration.sum() * result.attrs["stride"])
    period = result.attrs["period"]
    share = f"{100.0 * np.mean(duration < period):.4g} % of steps took less than {1e3 * period:g} ms"
    return f"Real-time factor {factor:.3g} (observed over wall time); {share}"
