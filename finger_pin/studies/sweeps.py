"""Sweeps: metrics of a scenario over some of its numbers and names, as a Dataset, with reasons of failed runs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from finger_pin.cancellation import Stop
from finger_pin.description.loading import ScenarioLike, to_toml
from finger_pin.description.scenario import Scenario
from finger_pin.description.tables import split
from finger_pin.exceptions import InputError, Interrupted, StudyError
from finger_pin.mechanism.coerce import FingerLike
from finger_pin.progress import notebook_bar
from finger_pin.simulation.netcdf import save
from finger_pin.simulation.recording import versions
from finger_pin.studies.designs import SAMPLE, Design, Grid
from finger_pin.studies.keys import BaseScenario, Value, describe
from finger_pin.studies.metrics import Metric, scenario_metrics
from finger_pin.studies.records import FAILED, Progress, RunRecord, open_study

MISSING = "missing"
PRODUCTS = ["sweep.nc", "figures/sweep.png"]


def assemble(
    scenario: Scenario, design: Design, metrics: Iterable[Metric], records: Iterable[RunRecord | None]
) -> xr.Dataset:
    """Return the Dataset of a sweep.

    Args:
        scenario: The base scenario.
        design: The points.
        metrics: The metrics; one variable each, NaN where there is no value.
        records: In the order of the design's points; None where a run has not been done.

    Returns:
        The metrics, ``status`` (done, failed or missing) and ``reason``, over the dimensions of the design.
    """
    dims = design.dims
    coordinates = {}
    for key, values in design.values.items():
        attributes = describe(key)
        if not isinstance(values[0], float):
            del attributes["units"]
        coordinates[key] = ((SAMPLE if dims == (SAMPLE,) else key,), np.array(values), attributes)
    shape = (len(design.points()),) if dims == (SAMPLE,) else tuple(map(len, design.values.values()))
    rows = list(records)

    def shaped(values: list[Any]) -> Any:
        return np.array(values).reshape(shape)

    variables: dict[str, tuple[tuple[str, ...], Any, dict[str, str]]] = {
        metric.name: (
            dims,
            shaped([np.nan if row is None else row.metrics.get(metric.name, np.nan) for row in rows]),
            {"units": metric.unit, "long_name": metric.long_name},
        )
        for metric in metrics
    }
    status = shaped([MISSING if row is None else row.status for row in rows])
    reason = shaped(["" if row is None else row.reason for row in rows])
    variables["status"] = (dims, status, {"long_name": "what came of the run: done, failed or missing"})
    variables["reason"] = (dims, reason, {"long_name": "why the run failed"})
    return xr.Dataset(variables, coords=coordinates, attrs=origin_attributes(scenario))


def require_complete(result: xr.Dataset, interrupted: bool) -> xr.Dataset:
    """Return a complete result, or raise if every run failed or Ctrl-C ended the study.

    Raises:
        Interrupted: After Ctrl-C.
        StudyError: If every run failed.
    """
    if interrupted:
        raise Interrupted(math.nan, result, f"after {int((result['status'] != MISSING).sum())} runs")
    if (result["status"] == FAILED).all():
        raise StudyError(str(result["reason"].values.flat[0]), result)
    return result


def origin_attributes(scenario: Scenario) -> Mapping[str, str]:
    """Return the attributes of a Dataset about its origin: the scenario and the versions of packages."""
    return {"title": scenario.title or scenario.name, "scenario": to_toml(scenario), **versions()}


def sweep(
    scenario: ScenarioLike,
    over: Design | Mapping[str, Sequence[Value]],
    *,
    metrics: Iterable[str | Metric] | None = None,
    overrides: Mapping[str, Any] | None = None,
    finger: FingerLike | None = None,
    output: str | Path | None = None,
    executor: Executor | None = None,
    restart: bool = False,
    retry_failed: bool = False,
    progress: Progress | None = None,
    stop: Stop | None = None,
) -> xr.Dataset:
    """Run a scenario at many points and measure every run.

        fp.sweep("fig6", {"controller.gain": [0.5, 1.0, 2.0]}, metrics=["tracking_rms"])

    With an ``output`` every finished run is on disk at once: after a kill the same call continues where it ended; runs
    whose code has changed since, such as that of a metric, are repeated. A run that fails is NaN, with its reason.

    Args:
        scenario: The scenario to be varied, its name, or the path of a file.
        over: A design, or the values of every key, which make a grid. Keys are those of `load_scenario`; an index as in
            ``environment.fingertip_force[2]`` means one number of a list.
        metrics: Names of `METRICS`, or custom metrics; by default those of `DEFAULT_METRICS` that the scenario has
            references and tendons for.
        overrides: Entries of the scenario that hold at all points.
        finger: Replaces the finger that the scenario describes, as for `fp.simulate`; values at its keys change it.
        output: Folder for ``runs.jsonl`` and ``sweep.nc``; by default nothing is kept.
        executor: Executor of the runs, any of `concurrent.futures`; by default one thread for each core.
        restart: Whether to drop what the folder holds of a study, instead of going on with it.
        retry_failed: Whether to repeat runs that failed before.
        progress: Called with the numbers of finished, failed and all runs; in a notebook there is a bar by default.
        stop: Called now and then; true ends the sweep, with ``status`` missing for the runs that were not made.

    Returns:
        A variable per metric, ``status`` and ``reason``; a dimension per key of a grid, else the dimension ``sample``.

    Raises:
        InputError: Naming the argument, key or value that is wrong; nothing is written then.
        StudyError: If every run failed.
        Interrupted: After Ctrl-C, a KeyboardInterrupt; its ``result`` has the runs that were finished.
        OSError: If a record cannot be written.
        ExecutorError: If the executor cannot go on.
    """
    design = Grid(over) if isinstance(over, Mapping) else over
    _check_overrides(overrides or {}, design)
    base = BaseScenario.from_scenario(scenario, overrides, finger)
    chosen = scenario_metrics(base.scenario, metrics)
    for key, values in design.values.items():
        base.check(key, values, alone=len(design.values) == 1)
    with open_study(base, chosen, output, PRODUCTS, executor, stop, restart) as study:
        records = study.evaluate(design.points(), progress or notebook_bar("runs"), retry_failed=retry_failed)
        result = assemble(base.scenario, design, chosen, records)
        if output is not None:
            save(result, Path(output) / "sweep.nc")
    return require_complete(result, study.token.cancelled)


def _check_overrides(overrides: Mapping[str, Any], design: Design) -> None:
    """Refuse an override of an entry that a key of the design replaces: itself, or one of a finger, hand or motor."""
    for name in (split(key)[0].removesuffix(".base") for key in design.values if split(key)[1] is None):
        for entry in overrides:
            if fnmatchcase(entry, name) or fnmatchcase(entry, f"{name}.*"):
                raise InputError(entry, f"has no effect where {name} is varied", overrides[entry])
