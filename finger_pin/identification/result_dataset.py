"""The result of an identification: a Dataset, a scenario with the estimates, and a page."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
import xarray as xr

from finger_pin.description.loading import ScenarioLike, load_scenario, to_toml
from finger_pin.description.scenario import Scenario
from finger_pin.files import write_text
from finger_pin.identification.comparison import bic
from finger_pin.identification.cross_validation import CrossValidation, shift_deviations
from finger_pin.identification.estimate import Fit
from finger_pin.identification.intervals import CHI2_95, NORMAL_95, ProfileBound, SmallSample, covariance
from finger_pin.identification.likelihood import minus_twice_likelihood
from finger_pin.identification.misfit import SIGNIFICANCE, outliers, repeats
from finger_pin.identification.pipeline import FitPipeline
from finger_pin.identification.problem import Problem
from finger_pin.identification.scenario_parameters import (
    corrected_column,
    recording_pattern,
    tied_entries,
    with_parameters,
)
from finger_pin.simulation.netcdf import save
from finger_pin.studies.keys import describe
from finger_pin.typing import Array


def result_dataset(problem: Problem, pipeline: FitPipeline, unfinished: str = "") -> xr.Dataset:
    """Return the Dataset of an identification; unfinished pieces are not a number."""
    count, keys = problem.requested_count, problem.keys[: problem.requested_count]
    fits, best, left_out, comparison = pipeline.fits, pipeline.best, pipeline.left_out, pipeline.comparison
    undetermined = [k for direction in pipeline.open_directions for k in direction.parameters if k < count]
    variables: dict[str, Any] = {
        **_estimates(problem, best, pipeline.interval_ends, pipeline.covariance, undetermined),
        **_signals(problem, best, pipeline.covariance, left_out),
        **_left_out(problem, best, left_out, pipeline.covariance),
        "start_objective": ("start", [each.objective for each in fits], {"units": "1"}),
        "start_estimate": (("start", "parameter"), [problem.values(each.z)[:count] for each in fits]),
    }
    coordinates: dict[str, Any] = {
        "parameter": list(keys),
        "other": list(keys),
        "signal": list(dict.fromkeys(f"{signal.recording}.{signal.name}" for signal in problem.signals)),
    }
    if left_out is not None:
        coordinates["left_out"] = list(left_out.settings)
    if comparison is not None:
        coordinates["law"] = comparison.law
        for name in ("parameters", "bic", "rms", "held_out"):
            variables[f"law_{name}"] = ("law", getattr(comparison, name), {"units": "1"})
    # Searches that end within the interval's rise have found the same minimum.
    least, *objectives = (
        minus_twice_likelihood(each.residuals, best.weights, problem.noise_groups, problem.least_noise)
        for each in (best, *fits)
    )
    attrs = {
        "scenario": problem.scenario.name,
        "scenario_toml": to_toml(problem.scenario),
        "undetermined": [direction.text for direction in pipeline.open_directions],
        "searches": len(fits),
        "searches_alike": sum(each < least + CHI2_95 for each in objectives),
        "evaluations": problem.evaluations,
        "bic": bic(best.residuals, best.weights, count, problem.noise_groups, problem.least_noise),
    }
    attrs |= {"unfinished": unfinished} if unfinished else {}
    return xr.Dataset(variables, coordinates, attrs)


def _estimates(
    problem: Problem,
    best: Fit,
    interval_ends: Mapping[tuple[int, int], ProfileBound],
    z_covariance: Array | None,
    undetermined: list[int],
) -> dict[str, Any]:
    """Return the variables along the parameters, some of which the recordings do not determine."""
    count, keys = problem.requested_count, problem.keys[: problem.requested_count]
    unknown = np.full((count, count), np.nan)
    z_covariance = unknown if z_covariance is None else z_covariance[:count, :count]
    ends = np.full((2, count), np.nan)
    for (k, side), bound in interval_ends.items():
        z = best.z.copy()
        z[k] = bound.end if math.isfinite(bound.end) else z[k]
        ends[(side + 1) // 2, k] = problem.values(z)[k] if math.isfinite(bound.end) else bound.end
    units = [_units(problem, key) for key in keys]
    deviation = np.sqrt(np.maximum(np.diag(z_covariance), 0.0))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = z_covariance / np.outer(deviation, deviation)
    estimate, all_deviations = problem.values(best.z)[:count], np.zeros(len(best.z))
    all_deviations[:count] = deviation
    linear = [problem.values(best.z + side * NORMAL_95 * all_deviations)[:count] for side in (-1.0, 1.0)]
    profiles = _profiles(problem, best, interval_ends)
    closed = np.isfinite(ends).all(axis=0)
    closed[undetermined] = False
    return {
        "estimate": ("parameter", estimate, {"long_name": "estimate; units in the variable units"}),
        "lower": ("parameter", ends[0], {"long_name": "lower end of the 95 % interval; infinite where open"}),
        "upper": ("parameter", ends[1], {"long_name": "upper end of the 95 % interval; infinite where open"}),
        "determined": ("parameter", closed, {"long_name": "closed at both ends, by the recordings"}),
        "units": ("parameter", units, {"long_name": "units of estimate, lower and upper"}),
        "linear_lower": ("parameter", linear[0], {"long_name": "lower end by the slopes alone"}),
        "linear_upper": ("parameter", linear[1], {"long_name": "upper end by the slopes alone"}),
        "least": ("parameter", problem.low[:count], {"long_name": "least value that was allowed"}),
        "greatest": ("parameter", problem.high[:count], {"long_name": "greatest value that was allowed"}),
        "correlation": (("parameter", "other"), correlation, {"units": "1", "long_name": "of the estimates"}),
        "profile_value": (("parameter", "point"), profiles[0], {"long_name": "held value of a parameter"}),
        "profile_rise": (
            ("parameter", "point"),
            profiles[1],
            {"units": "1", "long_name": "rise of minus twice the likelihood, the others fitted anew; 3.841 at 95 %"},
        ),
    }


def _left_out(
    problem: Problem, best: Fit, left_out: CrossValidation | None, z_covariance: Array | None
) -> dict[str, Any]:
    """Return the variables of refits without one setting each, if there are any."""
    if left_out is None or z_covariance is None:
        return {}
    inflation = np.sqrt(np.diag(z_covariance) / np.diag(covariance(problem, best)))
    deviations = shift_deviations(problem, best, left_out.settings) * inflation
    shifts = np.zeros_like(deviations)
    np.divide(left_out.estimates - best.z, deviations, out=shifts, where=deviations > 0.0)
    count, dims = problem.requested_count, ("left_out", "parameter")
    estimates = [problem.values(z)[:count] for z in left_out.estimates]
    text = "estimate without one recording, or the readings at one load"
    return {
        "left_out_estimate": (dims, estimates, {"long_name": text}),
        "left_out_shift": (dims, shifts[:, :count], {"units": "1", "long_name": "its shift over that by noise"}),
    }


def _profiles(problem: Problem, best: Fit, bounds: Mapping[tuple[int, int], ProfileBound]) -> tuple[Array, Array]:
    """Return values and rises along every profile, ascending, filled up with NaN."""
    rows: list[Array] = []
    for k in range(problem.requested_count):
        paths = [bound.path for (j, _), bound in bounds.items() if j == k]
        points = np.unique(np.concatenate([np.array([[best.z[k], 0.0]]), *paths]), axis=0)
        values = np.array([problem.values(np.where(np.arange(len(best.z)) == k, z, best.z))[k] for z in points[:, 0]])
        rows.append(np.stack([values, points[:, 1]]))
    width = max((row.shape[1] for row in rows), default=1)
    filled = np.full((2, len(rows), width), np.nan)
    for k, row in enumerate(rows):
        filled[:, k, : row.shape[1]] = row
    return filled[0], filled[1]


def _units(problem: Problem, key: str) -> str:
    column = corrected_column(key, problem.units)
    if column is None:
        return describe(tied_entries(key)[0][0])["units"]
    return {"offset": problem.units[column], "delay": "s"}.get(key.rpartition(".")[2], "1")


def _signals(
    problem: Problem, best: Fit, z_covariance: Array | None, left_out: CrossValidation | None
) -> dict[str, Any]:
    signals, groups, errors, noise = problem.signals, problem.groups, best.residuals, best.noise
    noise_factors = pooled_factors = band_factors = np.ones(len(signals))
    if z_covariance is not None:
        small_sample = SmallSample.from_fit(problem, best, covariance(problem, best))
        noise_factors, pooled_factors = small_sample.noise, small_sample.pooled_noise
        if left_out is not None:
            pooled = _pooled_noise(problem, noise) * pooled_factors
            band_factors = left_out.band_factors(problem, pooled, problem.slopes(best.z), z_covariance)
    if problem.growth.active:
        errors = problem.errors(best.z)
        # Noise of a reading of zero.
        noise = best.noise / problem.growth.levels(errors)
    # Windows of an output share its values: the first one has them.
    first = [int(np.flatnonzero(groups == group)[0]) for group in range(int(groups.max(initial=-1)) + 1)]
    repeated = {first.index(k): each for each in repeats(problem, best.residuals) for k in each.signals if k in first}
    samples = _samples(problem, best, errors)
    return {
        "signal_units": ("signal", [signals[k].unit for k in first]),
        "signal_steady": ("signal", [not signals[k].ordered for k in first]),
        "noise": ("signal", noise[first], {"long_name": "rms of the residuals, in the unit of the signal"}),
        "noise_deviation": (
            "signal",
            (noise * noise_factors)[first],
            {"long_name": "deviation of further readings, of which 95 % are within 1.96 of it"},
        ),
        "noise_elsewhere": (
            "signal",
            (_pooled_noise(problem, noise) * pooled_factors)[first],
            {"long_name": "deviation of readings of recordings that were not fitted, by all fitted ones of the name"},
        ),
        "band_factor": (
            "signal",
            band_factors[first],
            {"units": "1", "long_name": "factor on bands of what was not fitted, by what was left out in turn"},
        ),
        "replicate_noise": (
            "signal",
            [math.sqrt(repeated[k].scatter) if k in repeated else math.nan for k in range(len(first))],
            {"long_name": "rms of equal readings, or of runs with equal inputs, about their mean"},
        ),
        "lack_of_fit": (
            "signal",
            [repeated[k].p_value if k in repeated else math.nan for k in range(len(first))],
            {
                "units": "1",
                "long_name": "probability that a model that misses nothing misses as much (F test)",
                "significance": SIGNIFICANCE,
            },
        ),
        "signal_samples": ("signal", np.bincount(samples["signal_index"][1], minlength=len(first))),
        "signal_correlation": ("signal", best.correlation[first], {"units": "1", "long_name": "of neighbours"}),
        "independent_share": ("signal", best.weights[first], {"units": "1", "long_name": "(1 - rho) / (1 + rho)"}),
        **samples,
    }


def _samples(problem: Problem, best: Fit, errors: Sequence[Array]) -> dict[str, Any]:
    """Return the columns of all samples, over the dimension ``sample``."""
    signals = problem.signals
    columns = {
        "signal_index": (np.repeat(problem.groups, [len(s.measured) for s in signals]), "which signal"),
        "instant": (np.concatenate([s.instant for s in signals]), "time, s; number of a steady reading"),
        "applied": (np.concatenate([s.load for s in signals]), "what pulls, N"),
        "measured": (np.concatenate([s.measured for s in signals]), "measured, in the unit of the signal"),
        "residual": (np.concatenate(errors), "measured less computed, in the unit of the signal"),
        "outlier": (
            np.concatenate(outliers(problem, best.residuals)),
            "residual over the deviation that the median of all tells; zero of those that are no outliers",
        ),
    }
    return {name: ("sample", values, {"long_name": text}) for name, (values, text) in columns.items()}


def _pooled_noise(problem: Problem, noise: Array) -> Array:
    """Return the root mean square of the noises of all outputs of the same name, for every signal, shape (s,)."""
    first = np.unique(problem.groups, return_index=True)[1]
    names = np.array([signal.name for signal in problem.signals])
    return np.array([np.sqrt(np.mean(noise[first][names[first] == name] ** 2)) for name in names])


def write_results(result: xr.Dataset, folder: Path, bench: ScenarioLike, problem: Problem) -> None:
    """Write identification.nc and identified.toml.

    Raises:
        OSError: If they cannot be written.
    """
    save(result, folder / "identification.nc")
    write_text(folder / "identified.toml", identified_toml(result, folder, bench, problem))


def identified_toml(result: xr.Dataset, folder: Path, bench: ScenarioLike, problem: Problem) -> str:
    """Return the text of a scenario with the estimates and their intervals.

    It extends the bench; where no file says all of it, as it was given as a Scenario or with overrides, or where a key
    stands for more or less than one entry, it is whole.
    """
    recordings = ", ".join(dict.fromkeys(signal.recording for signal in problem.signals))
    keys = problem.keys[: problem.requested_count]
    single = all(recording_pattern(key) is not None or not {*"*{[&"} & {*key} for key in keys)
    extended = single and not isinstance(bench, Scenario) and load_scenario(bench) == problem.scenario
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
        lines += ["", to_toml(with_parameters(problem.scenario, numbers)).rstrip()]
    return "\n".join(lines) + "\n"


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
