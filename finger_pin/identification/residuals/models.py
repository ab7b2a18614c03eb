"""Models of recordings, and their residuals."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.recordings.bench import IdentifySettings
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.identification.parameters.keys import acts_on, corrected_column, entry_of, key_in, scenario_key
from finger_pin.identification.parameters.parameters import Bounds, Parameters
from finger_pin.identification.parameters.scenarios import with_recorded_values
from finger_pin.identification.residuals.imposed_motions import ImposedMotion
from finger_pin.identification.residuals.motions import RecordedMotion
from finger_pin.identification.residuals.recordings import (
    RecordedSignal,
    Recording,
    RecordingModel,
    check_angles,
    unit_of,
)
from finger_pin.identification.residuals.residuals import Residuals
from finger_pin.identification.residuals.steady_data import SteadyReadings
from finger_pin.mechanism.coerce import with_parameters_of
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array


def fitted_residuals(
    scenario: Scenario, settings: IdentifySettings, recordings: Sequence[Recording], finger: Finger | None = None
) -> Residuals:
    """Return the residuals of the fitted parts of recordings, for the parameters of a bench."""
    bounds = settings.bounds
    models, signals = recording_models(scenario, recordings, finger, [~held_out_rows(each) for each in recordings])
    count = sum(len(signal.measured) for signal in signals)
    if count <= len(bounds):
        raise InputError("identify.recordings", f"have {count} readings for {len(bounds)} parameters: more are needed")
    residuals = Residuals(scenario, Parameters(bounds, models), models, signals)
    for model in models:
        _check_corrections(model, bounds)
    return residuals


def held_out_residuals(scenario: Scenario, bounds: Bounds, recording: Recording, finger: Finger | None) -> Residuals:
    """Return the residuals of the held-out part of a recording, for parameters within bounds."""
    models, signals = recording_models(scenario, [recording], finger, [held_out_rows(recording)])
    if not any(len(signal.measured) for signal in signals):
        entry = f"identify.recordings.{recording.name}.held_out"
        raise InputError(entry, "has no samples", recording.settings.held_out)
    return Residuals(scenario, Parameters(bounds, models), models, signals)


def _check_corrections(model: RecordingModel, bounds: Bounds) -> None:
    """Refuse bounds of an output's scale that reach 0, and of inputs with which a recording cannot be computed."""
    name = model.recording.name
    for key, (low, high) in bounds.items():
        columns = [f"{name}.{each}" for each in model.recording.outputs]
        if low <= 0.0 <= high and key.endswith(".scale") and corrected_column(key, columns):
            raise InputError(entry_of(key), "must not reach 0: a column has to tell its quantity", [low, high])
    for column in model.recording.inputs:
        keys = [key for key in bounds if acts_on(key, name) and corrected_column(key, [f"{name}.{column}"])]
        for ends in itertools.product(*(bounds[key] for key in keys)) if keys else ():
            corrected = dict(zip(keys, ends, strict=True))
            try:
                model.check({key_in(key, name): value for key, value in corrected.items()})
            except InputError as error:
                where = " and ".join(f"{scenario_key(key)} = {value:g}" for key, value in corrected.items())
                raise InputError(entry_of(keys[0]), f"with {where}: {error}") from None


def held_out_rows(recording: Recording) -> NDArray[np.bool_]:
    """Return a mask of the rows of a recording that are not fitted, shape (m,)."""
    part, time = recording.settings.held_out, recording.time
    if isinstance(part, dict):
        return recording.held_out
    return np.full(len(time), part) if isinstance(part, bool) else (time >= part[0]) & (time <= part[1])


def recording_models(
    scenario: Scenario, recordings: Sequence[Recording], finger: Finger | None, selected: Sequence[NDArray[np.bool_]]
) -> tuple[list[RecordingModel], list[RecordedSignal]]:
    """Return the models of recordings, one for each window with selected rows, and all their outputs."""
    models: list[RecordingModel] = []
    signals: list[RecordedSignal] = []
    for recording, selected_rows in zip(recordings, selected, strict=True):
        steady = recording.settings.kind == "steady"
        pieces = [np.arange(len(recording.time))] if steady else windows(recording)
        parts = [(k, rows) for k, rows in enumerate(pieces) if selected_rows[rows].any()]
        if not parts:
            continue
        recorded_scenario = with_recorded_values(scenario, recording.name, recording.settings)
        check_angles(recording, recorded_scenario)
        replacement = None if finger is None else with_parameters_of(finger, scenario, recorded_scenario)
        if steady:
            models.append(SteadyReadings(recording, recorded_scenario, replacement))
        else:
            model = ImposedMotion if recording.settings.imposed else RecordedMotion
            models += [model(recording, recorded_scenario, rows, k, replacement) for k, rows in parts]
        signals += [
            _signal(recording, name, values, rows, selected_rows)
            for _, rows in parts
            for name, values in recording.outputs.items()
        ]
    return models, signals


def _signal(
    recording: Recording, name: str, values: Array, rows: NDArray[np.intp], selected: NDArray[np.bool_]
) -> RecordedSignal:
    settled = recording.time[rows] - recording.time[rows[0]] >= recording.settings.settle
    steady = recording.settings.kind == "steady"
    valid = np.flatnonzero(np.isfinite(values[rows]) & selected[rows] & (settled | steady))
    valid_rows = rows[valid]
    loads = [each for key, each in recording.inputs.items() if unit_of(key) == "N"]
    load = loads[0] if len(loads) == 1 else np.full(len(values), np.nan)
    instant = np.arange(len(values), dtype=float) if steady else recording.time
    conditions = np.stack([*recording.inputs.values(), recording.speed, recording.time], axis=1)
    replicate = np.unique(conditions[valid_rows], axis=0, return_inverse=True)[1].ravel()
    return RecordedSignal(
        recording.name,
        name,
        unit_of(name),
        values[valid_rows],
        valid,
        instant[valid_rows],
        load[valid_rows],
        replicate,
        ordered=not steady,
        least_noise=recording.settings.outputs[name].least_noise,
        noise_share=recording.settings.outputs[name].noise_share,
        shared_noise=recording.settings.outputs[name].noise or "",
    )


def windows(recording: Recording) -> Sequence[NDArray[np.intp]]:
    """Return the rows of the windows that a recording is cut into, each with two rows at least.

    A window begins earlier than its compared samples, by the time in which bristles settle: their deflection at the
    start is not recorded, and sliding makes them forget it.
    """
    length, time = recording.settings.window, recording.time
    if length is None:
        return [np.arange(len(time))]
    window_of_row = np.floor(time / length * (1.0 + 1e-12)).astype(int)
    pieces = [time[window_of_row == k] for k in np.unique(window_of_row)]
    spans = [(piece[0] - recording.settings.settle, piece[-1]) for piece in pieces if len(piece) > 1]
    return [np.flatnonzero((time >= first - 1e-9) & (time <= last)) for first, last in spans]
