"""Predictions of recordings that were not fitted, from the parameters of an identification."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from finger_pin.description.loading import read_scenario
from finger_pin.description.recordings.bench import RecordingSettings
from finger_pin.description.scenario import Scenario
from finger_pin.description.validation import validate
from finger_pin.exceptions import InputError
from finger_pin.identification.cross_validation import parameter_variance, refitted_errors
from finger_pin.identification.intervals import NORMAL_95
from finger_pin.identification.misfit import scatter as scatter_of
from finger_pin.identification.parameters.keys import acts_on, recording_pattern, scenario_key
from finger_pin.identification.residuals.models import held_out_residuals, held_out_rows
from finger_pin.identification.residuals.recordings import RecordedSignal, Recording, read_recording
from finger_pin.identification.residuals.residuals import Residuals
from finger_pin.mechanism.coerce import FingerLike, resolve_finger
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array

_TEXTS = {
    "rms": "rms of measured less predicted, in the unit of the signal",
    "bias": "mean of measured less predicted, in the unit of the signal",
    "within": "share of samples within the band",
    "band_ratio": "rms of half the band over 1.96 times the rms: 1 where the band is as wide as errors ask for",
    "scatter": "rms of repeated readings or runs about their mean, in the unit of the signal",
    "beyond": "share of samples whose load is beyond those that were fitted: no band knows what the model lacks there",
    "samples": "number of samples",
    "units": "units of the signal",
    "steady": "whether readings, not a motion",
}
_SAMPLE_TEXTS = {
    "index": "which prediction",
    "instant": "time, s; number of a steady reading",
    "applied": "what pulls, N",
    "measured": "measured, in the unit of the signal",
    "value": "predicted, in the unit of the signal",
    "band": "half the width of the 95 % band about it",
}


def predict(
    result: xr.Dataset,
    recordings: Mapping[str, Mapping[str, Any]],
    *,
    data: Mapping[str, Mapping[str, Any]] | None = None,
    finger: FingerLike | None = None,
) -> xr.Dataset:
    """Compare recordings with the predictions of an identification; nothing is fitted.

    The band is that of 95 %: the noise of fitted signals of the same name, and what the covariance of the parameters
    does to the prediction, times what recordings that were left out in turn ask for.

    Args:
        result: Dataset of `identify`, as returned or as `load` reads it.
        recordings: By name, entries as for `identify`; with ``held_out`` a part of one. What was found for one
            recording alone counts where the name is that of this recording.
        data: By name of a recording, columns by name, in place of its file.
        finger: The finger that `identify` was called with, if any.

    Returns:
        Along ``prediction``, the signals: ``prediction_rms``, ``prediction_bias`` (measured less predicted),
        ``prediction_within``, the share of samples in the band, ``prediction_band_ratio``, the rms of half the band
        over 1.96 times the rms, ``prediction_scatter`` of equal readings of a table or
        of runs with equal inputs, not a number without any, ``prediction_beyond``, the share of loads outside of those
        that were fitted; along ``predicted``, the samples: ``predicted_measured``,
        ``predicted_value`` and ``predicted_band``, half its width.
    """
    if result.attrs.get("custom_finger") and finger is None:
        raise InputError("finger", "is missing: this identification was given a finger that its scenario does not have")
    scenario = read_scenario(tomllib.loads(result.attrs["scenario_toml"]))
    recorded = []
    for name, entries in recordings.items():
        entries_held_out = {**entries, "held_out": entries.get("held_out") or True}
        settings = validate(RecordingSettings, entries_held_out, ("identify", "recordings", name))
        recorded.append(read_recording(name, settings, (data or {}).get(name)))
    custom_finger = resolve_finger(finger, scenario)
    check_predictable(scenario, recorded, custom_finger)
    return predictions(result, scenario, recorded, recorded, custom_finger)


def check_predictable(scenario: Scenario, recordings: Sequence[Recording], finger: Finger | None) -> None:
    """Compute the held-out part of recordings once, under the scenario as it is, before any work."""
    for recording in recordings:
        function = held_out_residuals(scenario, {}, recording, finger)
        function.errors(function.parameters.start)


def predictions(
    result: xr.Dataset,
    scenario: Scenario,
    recordings: Sequence[Recording],
    all_recordings: Sequence[Recording],
    finger: Finger | None,
) -> xr.Dataset:
    """Return the Dataset of `predict` for the held-out parts of recordings; empty without any.

    Args:
        result: Dataset of `identify`.
        scenario: Whose numbers were found.
        recordings: To predict.
        all_recordings: Recordings among which those with equal inputs are repeated runs.
        finger: Replaces the one that the scenario describes.
    """
    signals: list[dict[str, Any]] = []
    fitted = result["applied"].values[np.isfinite(result["applied"].values)]
    lowest, highest = (float(fitted.min()), float(fitted.max())) if len(fitted) else (-math.inf, math.inf)
    for recording in recordings:
        function, z, covariance, left_out = _at_estimate(result, scenario, recording, finger)
        residuals = function.errors(z)
        refits = refitted_errors(function, z, residuals, left_out)
        growths = function.growth.growth(residuals)
        refitted = [np.array([errors[k] for errors in refits]) for k in range(len(residuals))]
        computed = zip(function.signals, residuals, function.error_slopes(z), growths, refitted, strict=True)
        rows_by_signal: dict[str, list[Array]] = {}
        for signal, residual, slopes, growth, errors in computed:
            noise, factor = _noise(result, signal)
            deviation = factor * np.sqrt((noise * growth) ** 2 + parameter_variance(slopes, covariance, errors))
            value = np.where(np.isfinite(residual), signal.measured - residual, np.nan)
            rows = np.stack([signal.instant, signal.load, signal.measured, value, NORMAL_95 * deviation])
            rows_by_signal.setdefault(signal.name, []).append(rows)
        for name, pieces in rows_by_signal.items():
            first = next(each for each in function.signals if each.name == name)
            square = math.nan if first.ordered else scatter_of(first.measured, first.replicate)
            scatter = _repeats(recording, name, all_recordings) if first.ordered else math.sqrt(square)
            rows = np.concatenate(pieces, axis=1)
            # Loads that are not numbers count as inside.
            beyond = float(np.mean((rows[1] < lowest) | (rows[1] > highest)))
            signals.append(
                {"name": f"{recording.name}.{name}", "units": first.unit, "steady": not first.ordered}
                | {"rows": rows, "scatter": scatter, "beyond": beyond, **_statistics(rows)}
            )
    return _dataset(signals) if signals else xr.Dataset()


def _at_estimate(
    result: xr.Dataset, scenario: Scenario, recording: Recording, finger: Finger | None
) -> tuple[Residuals, Array, Array, list[Array]]:
    """Return the residuals of what is held out of a recording, z, its covariance, and z of refits without a setting."""

    def applies(key: str) -> bool:
        of_column = scenario_key(key).rpartition(".")[0] in {*recording.inputs, *recording.outputs}
        has_effect = scenario_key(key).partition(".")[0] in Scenario.model_fields or of_column
        return recording_pattern(key) is None or (acts_on(key, recording.name) and has_effect)

    applicable = [k for k, key in enumerate(result["parameter"].values) if applies(str(key))]
    estimate, upper, low, high = (
        result[name].values[applicable].astype(float) for name in ("estimate", "linear_upper", "least", "greatest")
    )
    keys = [str(result["parameter"].values[k]) for k in applicable]
    bounds = dict(zip(keys, zip(low.tolist(), high.tolist(), strict=True), strict=True))
    function = held_out_residuals(scenario, bounds, recording, finger)
    # Estimated starts are not known here: the recorded ones stand in.
    at_values, count = function.parameters.at_values, len(keys)
    z = at_values(estimate)
    covariance, half = np.zeros((len(z), len(z))), (at_values(upper) - z)[:count]
    correlation = result["correlation"].values[np.ix_(applicable, applicable)]
    covariance[:count, :count] = np.outer(half, half) / NORMAL_95**2 * correlation
    # A result of fewer than two settings or of an earlier version has none.
    without = result["left_out_estimate"].values[:, applicable] if "left_out" in result.dims else ()
    left_out = list(map(at_values, without))
    # An identification stopped early has no covariance: the band is that of the noise alone.
    return function, z, np.nan_to_num(covariance, nan=0.0), left_out


def _noise(result: xr.Dataset, signal: RecordedSignal) -> tuple[float, float]:
    """Return the deviation of readings of a signal, and the factor on its band; not a number if nothing tells it.

    The deviation is that of the same recording, else that of fitted signals that share its noise, else of those of its
    name. The rest of a motion that was fitted has no factor: what was left out were whole motions.
    """
    fitted = result["signal"].values.astype(str)
    # A result of an earlier version lacks these.
    elsewhere = result["noise_elsewhere" if "noise_elsewhere" in result else "noise_deviation"].values
    factors = result["band_factor"].values if "band_factor" in result else np.ones(len(fitted))
    noises = result["shared_noise"].values.astype(str) if "shared_noise" in result else np.full(len(fitted), "")
    own = np.flatnonzero(fitted == f"{signal.recording}.{signal.name}")
    if len(own):
        k = int(own[0])
        factor = float(factors[k]) if result["signal_steady"].values[k] else 1.0
        return float(result["noise_deviation"].values[k]), factor
    of_name = np.array([each.partition(".")[2] == signal.name for each in fitted], dtype=bool)
    may_share = result["signal_units"].values == signal.unit if signal.shared_noise else of_name
    of_noise = (noises == signal.shared_noise) & may_share
    members = of_noise if of_noise.any() else of_name
    if not members.any():
        return math.nan, 1.0
    return float(np.sqrt(np.mean(elsewhere[members] ** 2))), float(factors[members].max())


def _repeats(recording: Recording, name: str, recordings: Sequence[Recording]) -> float:
    """Return the rms of an output about its mean over motions with equal inputs; not a number of one alone."""
    runs = np.array([each.outputs[name] for each in recordings if name in each.outputs and each.repeats(recording)])
    compared = np.isfinite(runs).all(axis=0) & held_out_rows(recording)
    if len(runs) < 2 or not compared.any():
        return math.nan
    return float(np.sqrt(np.mean(np.var(runs[:, compared], axis=0, ddof=1))))


def _statistics(rows: Array) -> dict[str, float]:
    """Return how well a signal is predicted by the rows of its samples."""
    _, _, measured, value, band = rows
    residual = measured - value
    rms = np.sqrt(np.mean(residual**2))
    return {
        "rms": float(rms),
        "bias": float(np.mean(residual)),
        # A run that fails is within no band; without noise there is no band.
        "within": float(np.mean(np.abs(residual) <= band)) if np.isfinite(band).all() else math.nan,
        "band_ratio": float(np.sqrt(np.mean(band**2)) / NORMAL_95 / max(rms, 1e-300)),
        "samples": len(residual),
    }


def _dataset(signals: Sequence[Mapping[str, Any]]) -> xr.Dataset:
    """Return the Dataset of predictions."""
    columns = {f"prediction_{key}": [each[key] for each in signals] for key in _TEXTS}
    index = np.repeat(np.arange(len(signals)), columns["prediction_samples"])
    rows = [index, *np.concatenate([each["rows"] for each in signals], axis=1)]
    return xr.Dataset(
        {
            name: ("prediction", column, {"long_name": text})
            for (name, column), text in zip(columns.items(), _TEXTS.values(), strict=True)
        }
        | {
            f"predicted_{name}": ("predicted", values, {"long_name": text})
            for (name, text), values in zip(_SAMPLE_TEXTS.items(), rows, strict=True)
        },
        {"prediction": [each["name"] for each in signals]},
    )
