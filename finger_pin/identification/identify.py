"""Identification: from recordings to the numbers of a scenario, with intervals."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from finger_pin.cancellation import CancelToken
from finger_pin.description.loading import ScenarioLike, load_bench
from finger_pin.description.recordings.bench import IdentifySettings
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError, ScenarioWarning
from finger_pin.identification.comparison import other_laws
from finger_pin.identification.parameters.keys import key_in
from finger_pin.identification.pipeline import FitPipeline
from finger_pin.identification.prediction import check_predictable, predictions
from finger_pin.identification.residuals.models import fitted_residuals
from finger_pin.identification.residuals.motions import GREATEST_TOLERANCE
from finger_pin.identification.residuals.recordings import Recording, read_recording
from finger_pin.identification.residuals.residuals import Residuals
from finger_pin.identification.result_dataset import result_dataset, write_results
from finger_pin.identification.search.checkpoint import Checkpoint
from finger_pin.identification.search.gauss_newton import LOSSES
from finger_pin.identification.search.objective import Objective
from finger_pin.identification.search.search import Progress
from finger_pin.mechanism.coerce import FingerLike, resolve_finger, with_finger
from finger_pin.studies.fingerprint import digest as content_digest
from finger_pin.typing import Array
from finger_pin.version import __version__

Data = Mapping[str, Mapping[str, Any]]


def identify(
    bench: ScenarioLike,
    *,
    parameters: Mapping[str, Sequence[float]] | None = None,
    recordings: Mapping[str, Mapping[str, Any]] | None = None,
    compare: Mapping[str, Mapping[str, Any]] | None = None,
    data: Data | None = None,
    finger: FingerLike | None = None,
    overrides: Mapping[str, Any] | None = None,
    output: str | Path | None = None,
    starts: int = 3,
    seed: int = 0,
    loss: str = "linear",
    profiles: bool = True,
    refits: bool = True,
    restart: bool = False,
    progress: Progress | None = None,
    stop: Callable[[], bool] | None = None,
) -> xr.Dataset:
    """Find the numbers with which a scenario fits its recordings, with intervals by the profile likelihood.

    Every signal has a noise of its own, estimated with the parameters. Neighbouring residuals of a motion are
    correlated: n of them count as n (1 - rho) / (1 + rho) (Bartlett). Parameters whose least value is positive are
    searched for as logarithms, from the scenario's own numbers and from the best of Sobol points.

    Args:
        bench: Name of a bench or scenario that ships, or path of a TOML file; its table ``[identify]`` says the rest.
            Or a scenario: then `parameters` and `recordings` say it all.
        parameters: By dotted key, the least and the greatest value; on top of the table's, as the next two.
        recordings: By name, entries as in a file.
        compare: By name, other laws: keys with a number that is held, or with bounds.
        data: By name of a recording, columns by name, in place of its file.
        finger: Replaces the finger that the scenario describes, as for `fp.simulate`.
        overrides: Values by dotted key, as for `load_scenario`.
        output: Folder for ``identification.nc``, ``identified.toml`` and ``identification.html``; work that is done is
            kept there too, so that the same call goes on where another was stopped.
        starts: From how many points to search.
        seed: Of those points.
        loss: ``linear``, or where outliers are to count less ``soft_l1``, ``huber``, ``cauchy`` or ``arctan``, as of
            `scipy.optimize.least_squares`.
        profiles: Whether intervals follow the likelihood; without, they are those of its curvature at the estimate,
            which of long motions takes a part of the time.
        refits: Whether to refit without each recording or load, which widens bands of predictions and names recordings
            that disagree, and along combinations that the recordings leave open. Without, bands are those of the noise
            and the covariance, and such combinations those by slopes; estimates and intervals stay.
        restart: Whether to forget what the folder holds of this.
        progress: Called with what is being done, how much of it is finished, and how much there is.
        stop: Asked now and then; when it returns true the best so far is returned, attribute ``unfinished``.

    Returns:
        Recordings in order of their names. Along ``parameter``: ``estimate``, ``lower`` and ``upper`` at 95 %,
        infinite where open, ``determined``, ``units``, ``correlation``, profiles; along ``signal`` noise and
        correlation; along ``sample`` what was measured and the residuals; along ``law`` what `compare` found; along
        ``prediction`` and ``predicted`` what `predict` returns of what is held out. Attribute ``undetermined``: what
        the recordings leave open, in words.

    Raises:
        InputError: If the table or a recording is wrong, there are fewer readings than parameters, or a parameter is
            felt by no output.
        OSError: If the folder cannot be written.
    """
    if loss not in LOSSES:
        raise InputError("loss", f"must be one of {', '.join(LOSSES)}", loss)
    tables = {"parameters": parameters, "recordings": recordings, "compare": compare}
    entries = {name: {key: _as_builtin(each) for key, each in table.items()} for name, table in tables.items() if table}
    scenario, settings = load_bench(bench, overrides, entries)
    asked = list(settings.bounds)
    # In one order, so that sums and random starts, and so all numbers, are the same in whichever order they were given.
    in_order = {name: dict(sorted(getattr(settings, name).items())) for name in ("parameters", "recordings")}
    settings = settings.model_copy(update=in_order)
    custom_finger = resolve_finger(finger, scenario)
    scenario = with_finger(scenario, custom_finger)
    recorded = [read_recording(name, each, (data or {}).get(name)) for name, each in settings.recordings.items()]
    residuals = fitted_residuals(scenario, settings, recorded, custom_finger)
    held_out = [each for each in recorded if each.settings.held_out is not False]
    # Before any work: an entry that is wrong in them is refused now.
    other_laws(residuals, settings)
    check_predictable(scenario, held_out, custom_finger)
    for message in _model_warnings(residuals):
        warnings.warn(message, ScenarioWarning, stacklevel=2)
    objective = Objective(residuals, CancelToken(stop))
    request = digest(scenario, settings, recorded, starts, seed, loss, custom_finger)
    with Checkpoint(None if output is None else Path(output), request, restart) as checkpoint:
        pipeline = FitPipeline(objective, checkpoint, loss, progress)
        unfinished = pipeline.run(settings, starts, seed, profiles, refits)
        result = result_dataset(pipeline, unfinished).sel(parameter=asked, other=asked)
        result.attrs["ringing"] = _ringing(residuals, pipeline.best.z)
        result.attrs["profiles"], result.attrs["refits"] = int(profiles), int(refits)
        result.attrs["custom_finger"] = int(custom_finger is not None)
        result.update(predictions(result, scenario, held_out, recorded, custom_finger))
        result.attrs["bench"] = bench.name if isinstance(bench, Scenario) else str(bench)
        if output is not None:
            write_results(result, Path(output), bench, residuals)
    return result


def digest(scenario: Scenario, settings: IdentifySettings, recordings: Sequence[Recording], *options: Any) -> str:
    """Return the digest of an identification: scenario, table, data, options, version."""
    data = [(each.inputs, each.outputs, each.time, each.speed) for each in recordings]
    return content_digest((__version__, scenario, settings, data, options))


def _model_warnings(residuals: Residuals) -> Iterator[str]:
    """Yield warnings: of the first window of every recording that has any, and of too coarse tolerances."""
    for name in dict.fromkeys(each.recording.name for each in residuals.models):
        keys = [key_in(key, name) for key in residuals.parameters.keys]
        messages = (each.warnings(keys) for each in residuals.models if each.recording.name == name)
        yield from next(filter(None, messages), [])
    for name in () if residuals.exact else ("rtol", "atol_scale"):
        tolerance = getattr(residuals.scenario.simulation, name)
        if tolerance > GREATEST_TOLERANCE:
            coarse = f"simulation.{name} = {tolerance:g}: slopes of such runs may err by as much as themselves"
            yield f"{coarse}; {GREATEST_TOLERANCE:g} or less is fine enough"


def _ringing(residuals: Residuals, z: Array) -> str:
    """Return the first warning about ringing in the motions at a place of the search; empty without any."""
    values = residuals.parameters.values(z)
    said = (model.ringing(*scenario_map(values)) for model, scenario_map in residuals.maps)
    return next(filter(None, said), "")


def _as_builtin(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _as_builtin(each) for key, each in value.items()}
    return [_as_builtin(each) for each in value] if isinstance(value, tuple | np.ndarray) else value
