"""The result of an identification: a Dataset, a scenario with the estimates, and a page."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
import xarray as xr

from finger_pin.description.loading import ScenarioLike, load_scenario, to_toml
from finger_pin.description.scenario import Scenario
from finger_pin.files import write_text
from finger_pin.identification.comparison import bic
from finger_pin.identification.cross_validation import shift_deviations
from finger_pin.identification.intervals import CHI2_95, NORMAL_95, SmallSample, covariance
from finger_pin.identification.misfit import SIGNIFICANCE, outliers, repeats
from finger_pin.identification.parameters.keys import corrected_column, recording_pattern, tied_entries
from finger_pin.identification.parameters.parameters import Parameters
from finger_pin.identification.parameters.scenarios import with_parameters
from finger_pin.identification.pipeline import FitPipeline
from finger_pin.identification.residuals.recordings import unit_of
from finger_pin.identification.residuals.residuals import Residuals
from finger_pin.simulation.netcdf import save
from finger_pin.studies.keys import describe
from finger_pin.typing import Array


def result_dataset(pipeline: FitPipeline, unfinished: str = "") -> xr.Dataset:
    """Return the Dataset of an identification; unfinished pieces are not a number."""
    objective, best, fits = pipeline.objective, pipeline.best, pipeline.searches.fits
    function, parameters = objective.function, objective.function.parameters
    keys, count = list(parameters.bounds), len(parameters.bounds)
    variables: dict[str, Any] = {
        **_estimates(pipeline),
        **_signals(pipeline),
        **_samples(pipeline),
        **_left_out(pipeline),
        "start_objective": ("start", [each.objective for each in fits], {"units": "1"}),
        "start_estimate": (("start", "parameter"), [parameters.values(each.z)[:count] for each in fits]),
    }
    names = dict.fromkeys(f"{signal.recording}.{signal.name}" for signal in function.signals)
    coordinates: dict[str, Any] = {"parameter": keys, "other": keys, "signal": list(names)}
    if pipeline.left_out is not None:
        coordinates["left_out"] = list(pipeline.left_out.settings)
    for name, column in pipeline.comparison.items():
        if name == "law":
            coordinates["law"] = column
        else:
            variables[f"law_{name}"] = ("law", column, {"units": "1"})
    # Searches that end within the interval's rise have found the same minimum.
    least, *objectives = (function.likelihood.minus_twice_log(each.residuals, best.weights) for each in (best, *fits))
    attrs = {
        "scenario": function.scenario.name,
        "scenario_toml": to_toml(function.scenario),
        "undetermined": [direction.text for direction in pipeline.open_directions],
        "searches": len(fits),
        "searches_alike": sum(each < least + CHI2_95 for each in objectives),
        "evaluations": objective.evaluations,
        "bic": bic(function.likelihood, best.residuals, best.weights, count),
    }
    attrs |= {"unfinished": unfinished} if unfinished else {}
    return xr.Dataset(variables, coordinates, attrs)


def _estimates(pipeline: FitPipeline) -> dict[str, Any]:
    """Return the variables along the parameters, some of which the recordings do not determine."""
    parameters, z = pipeline.objective.function.parameters, pipeline.best.z
    keys, count = parameters.bounds, len(parameters.bounds)
    z_covariance = np.full((count, count), np.nan) if pipeline.covariance is None else pipeline.covariance
    z_covariance = z_covariance[:count, :count]
    ends = np.full((2, count), np.nan)
    for (k, side), bound in pipeline.interval_ends.items():
        finite = math.isfinite(bound.end)
        ends[(side + 1) // 2, k] = _value_at(parameters, z, k, bound.end) if finite else bound.end
    deviation = np.sqrt(np.maximum(np.diag(z_covariance), 0.0))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = z_covariance / np.outer(deviation, deviation)
    all_deviations = np.append(deviation, np.zeros(len(z) - count))
    linear = [parameters.values(z + side * NORMAL_95 * all_deviations)[:count] for side in (-1.0, 1.0)]
    profiles = _profiles(pipeline)
    closed = np.isfinite(ends).all(axis=0)
    closed[[k for direction in pipeline.open_directions for k in direction.parameters if k < count]] = False
    columns = {
        "estimate": (parameters.values(z)[:count], "estimate; units in the variable units"),
        "lower": (ends[0], "lower end of the 95 % interval; infinite where open"),
        "upper": (ends[1], "upper end of the 95 % interval; infinite where open"),
        "determined": (closed, "closed at both ends, by the recordings"),
        "units": ([_units(parameters, key) for key in keys], "units of estimate, lower and upper"),
        "linear_lower": (linear[0], "lower end by the slopes alone"),
        "linear_upper": (linear[1], "upper end by the slopes alone"),
        "least": (parameters.low[:count], "least value that was allowed"),
        "greatest": (parameters.high[:count], "greatest value that was allowed"),
    }
    rise = "rise of minus twice the likelihood, the others fitted anew; 3.841 at 95 %"
    return {
        **_variables("parameter", columns),
        "correlation": (("parameter", "other"), correlation, {"units": "1", "long_name": "of the estimates"}),
        "profile_value": (("parameter", "point"), profiles[0], {"long_name": "held value of a parameter"}),
        "profile_rise": (("parameter", "point"), profiles[1], {"units": "1", "long_name": rise}),
    }


def _variables(dim: str, columns: Mapping[str, tuple[Any, str]]) -> dict[str, Any]:
    """Return variables along a dimension, each with what it is."""
    return {name: (dim, values, {"long_name": text}) for name, (values, text) in columns.items()}


def _value_at(parameters: Parameters, z: Array, k: int, end: float) -> float:
    """Return the value of parameter k at a place on its axis through z."""
    return float(parameters.values(np.where(np.arange(len(z)) == k, end, z))[k])


def _left_out(pipeline: FitPipeline) -> dict[str, Any]:
    """Return the variables of refits without one setting each, if there are any."""
    objective, best, left_out = pipeline.objective, pipeline.best, pipeline.left_out
    if left_out is None or pipeline.covariance is None:
        return {}
    inflation = np.sqrt(np.diag(pipeline.covariance) / np.diag(covariance(objective, best)))
    deviations = shift_deviations(objective, best, left_out.settings) * inflation
    shifts = np.zeros_like(deviations)
    np.divide(left_out.estimates - best.z, deviations, out=shifts, where=deviations > 0.0)
    parameters, dims = objective.function.parameters, ("left_out", "parameter")
    count = len(parameters.bounds)
    estimates = [parameters.values(z)[:count] for z in left_out.estimates]
    text = "estimate without one recording, or the readings at one load"
    return {
        "left_out_estimate": (dims, estimates, {"long_name": text}),
        "left_out_shift": (dims, shifts[:, :count], {"units": "1", "long_name": "its shift over that by noise"}),
    }


def _profiles(pipeline: FitPipeline) -> Array:
    """Return values and rises along every profile, ascending, filled up with NaN, shape (2, p, k)."""
    parameters, z, rows = pipeline.objective.function.parameters, pipeline.best.z, list[Array]()
    for k in range(len(parameters.bounds)):
        paths = [bound.path for (j, _), bound in pipeline.interval_ends.items() if j == k]
        points = np.unique(np.concatenate([np.array([[z[k], 0.0]]), *paths]), axis=0)
        rows.append(np.stack([[_value_at(parameters, z, k, end) for end in points[:, 0]], points[:, 1]]))
    filled = np.full((2, len(rows), max((row.shape[1] for row in rows), default=1)), np.nan)
    for k, row in enumerate(rows):
        filled[:, k, : row.shape[1]] = row
    return filled


def _units(parameters: Parameters, key: str) -> str:
    column = corrected_column(key, parameters.columns)
    if column is None:
        return describe(tied_entries(key)[0][0])["units"]
    unit = unit_of(column.partition(".")[2])
    return {"offset": unit, "delay": "s"}.get(key.rpartition(".")[2], "1")


def _signals(pipeline: FitPipeline) -> dict[str, Any]:
    """Return the variables along the signals: those of an output, whose windows share its values."""
    objective, best, likelihood = pipeline.objective, pipeline.best, pipeline.objective.likelihood
    signals, growth, first, noise = objective.function.signals, objective.function.growth, likelihood.first, best.noise
    noise_factors = pooled_factors = band_factors = np.ones(len(signals))
    if pipeline.covariance is not None:
        small_sample = SmallSample.from_fit(objective, best, covariance(objective, best))
        noise_factors, pooled_factors = small_sample.noise, small_sample.pooled_noise
        if pipeline.left_out is not None:
            pooled = likelihood.pooled(noise) * pooled_factors
            band_factors = pipeline.left_out.band_factors(objective, best, pooled, pipeline.covariance)
    if growth.active:
        # Noise of a reading of zero.
        noise = best.noise / growth.levels(objective.function.errors(best.z))
    found = repeats(objective.function, best.residuals)
    repeated = {first.index(k): each for each in found for k in each.signals if k in first}
    by_output = [repeated.get(k) for k in range(len(first))]
    elsewhere = "deviation of readings of recordings that were not fitted, by all fitted ones of the name, or noise"
    chance = {
        "units": "1",
        "long_name": "probability that a model that misses nothing misses as much (F test)",
        "significance": SIGNIFICANCE,
    }
    samples = np.bincount(likelihood.outputs, [len(signal.measured) for signal in signals]).astype(int)
    columns = {
        "noise": (noise[first], "rms of the residuals, in the unit of the signal"),
        "noise_deviation": (
            (noise * noise_factors)[first],
            "deviation of further readings, of which 95 % are within 1.96 of it",
        ),
        "noise_elsewhere": ((likelihood.pooled(noise) * pooled_factors)[first], elsewhere),
        "replicate_noise": (
            [math.sqrt(each.scatter) if each else math.nan for each in by_output],
            "rms of equal readings, or of runs with equal inputs, about their mean",
        ),
    }
    shares = {
        "band_factor": (band_factors[first], "factor on bands of what was not fitted, by what was left out in turn"),
        "signal_correlation": (best.correlation[first], "of neighbours"),
        "independent_share": (best.weights[first], "(1 - rho) / (1 + rho)"),
    }
    return {
        "signal_units": ("signal", [signals[k].unit for k in first]),
        "signal_steady": ("signal", [not signals[k].ordered for k in first]),
        "shared_noise": ("signal", [signals[k].shared_noise for k in first]),
        "signal_samples": ("signal", samples),
        "lack_of_fit": ("signal", [each.p_value if each else math.nan for each in by_output], chance),
        **_variables("signal", columns),
        **{name: ("signal", each, {"units": "1", "long_name": text}) for name, (each, text) in shares.items()},
    }


def _samples(pipeline: FitPipeline) -> dict[str, Any]:
    """Return the columns of all samples, over the dimension ``sample``."""
    function, best = pipeline.objective.function, pipeline.best
    signals, outputs = function.signals, function.likelihood.outputs
    errors = function.errors(best.z) if function.growth.active else best.residuals
    deviant = "residual over the deviation that the median of all tells; zero of those that are no outliers"
    columns = {
        "signal_index": (np.repeat(outputs, [len(s.measured) for s in signals]), "which signal"),
        "instant": (np.concatenate([s.instant for s in signals]), "time, s; number of a steady reading"),
        "applied": (np.concatenate([s.load for s in signals]), "what pulls, N"),
        "measured": (np.concatenate([s.measured for s in signals]), "measured, in the unit of the signal"),
        "residual": (np.concatenate(errors), "measured less computed, in the unit of the signal"),
        "outlier": (np.concatenate(outliers(function, best.residuals)), deviant),
    }
    return _variables("sample", columns)


def write_results(result: xr.Dataset, folder: Path, bench: ScenarioLike, function: Residuals) -> None:
    """Write identification.nc and identified.toml, a scenario with the estimates and their intervals.

    It extends the bench; where no file says all of it, as it was given as a Scenario or with overrides, or where a key
    stands for more or less than one entry, it is whole.

    Raises:
        OSError: If they cannot be written.
    """
    save(result, folder / "identification.nc")
    recordings = ", ".join(dict.fromkeys(signal.recording for signal in function.signals))
    keys = result["parameter"].values.tolist()
    single = all(recording_pattern(key) is not None or not {*"*{[&"} & {*key} for key in keys)
    extended = single and not isinstance(bench, Scenario) and load_scenario(bench) == function.scenario
    lines = ["# What an identification has found; intervals at 95 %."]
    if extended:
        lines += [tomli_w.dumps({"extends": _extends_entry(str(bench), folder)}).strip(), ""]
    numbers: dict[str, float] = {}
    for key, value, low, high, unit in zip(
        keys, *(result[each].values.tolist() for each in ("estimate", "lower", "upper", "units")), strict=True
    ):
        ends = f"{_end_text(low)} to {_end_text(high)}{'' if unit == '1' else f' {unit}'}"
        if recording_pattern(key) is None:
            numbers[key] = value
        if not extended or key not in numbers:
            lines.append(f"# {key} = {value:.6g}, {ends}, from {recording_pattern(key) or recordings}")
            continue
        lines.append(f"{key} = {value!r} # {ends}, from {recordings}")
    if not extended:
        lines += ["", to_toml(with_parameters(function.scenario, numbers)).rstrip()]
    write_text(folder / "identified.toml", "\n".join(lines) + "\n")


def _extends_entry(bench: str, folder: Path) -> str:
    """Return the entry ``extends`` of a scenario in a folder: a name as it is, a path from the folder."""
    path = Path(bench).expanduser()
    if path.suffix != ".toml":
        return bench
    try:
        return Path(os.path.relpath(path.absolute(), folder.absolute())).as_posix()
    except ValueError:
        # Another drive.
        return str(path.absolute())


def _end_text(value: float) -> str:
    return "not known" if math.isnan(value) else "open" if math.isinf(value) else f"{value:.4g}"
