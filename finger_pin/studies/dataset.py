"""Dataset of a sweep: metrics over the varied keys, and the failed runs with their reasons."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import xarray as xr

from finger_pin.description.loading import to_toml
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import Interrupted, StudyError
from finger_pin.simulation.recording import versions
from finger_pin.studies.designs import SAMPLE, Design
from finger_pin.studies.keys import describe
from finger_pin.studies.metrics import Metric
from finger_pin.studies.records import FAILED, RunRecord

MISSING = "missing"


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
