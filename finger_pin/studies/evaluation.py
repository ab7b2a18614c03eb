"""Evaluating points of a study: what is recorded is not done again, and what is done is recorded at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import takewhile
from pathlib import Path
from typing import Any

import xarray as xr

from finger_pin.simulation.recording import save
from finger_pin.studies.designs import Point
from finger_pin.studies.keys import Starting
from finger_pin.studies.metrics import Metric
from finger_pin.studies.runs import FAILED, Record, Stop, Task, Workers, plan, version
from finger_pin.studies.store import Store

#: Called with the numbers of finished, failed and all runs.
Progress = Callable[[int, int, int], None]


def write(dataset: xr.Dataset, path: Path) -> None:
    """Write a Dataset, whole or not at all.

    Raises:
        OSError: If it cannot be written, such as on a full disk.
    """
    try:
        save(dataset, path)
    except RuntimeError as error:
        # What the netCDF library makes of a full disk.
        raise OSError(f"{path.name}: {error}") from error


def describe_study(starting: Starting, metrics: Iterable[Metric], design: Mapping[str, Any]) -> dict[str, Any]:
    """Return what determines a study, for a TOML file."""
    scenario = starting.scenario.model_dump(mode="json", exclude_none=True)
    names = [metric.name for metric in metrics]
    return {"finger_pin": version(), "metrics": names, **design, "scenario": scenario}


def evaluate(
    starting: Starting,
    points: Sequence[Point],
    metrics: tuple[Metric, ...],
    store: Store,
    workers: Workers,
    *,
    progress: Progress | None = None,
    stop: Stop | None = None,
    retry_failed: bool = False,
) -> list[Record | None]:
    """Do the runs that are not in the store, keep each as it finishes, and return all in the order of the points.

    Args:
        starting: The scenario that is varied.
        points: Where.
        metrics: What is measured.
        store: Where records are found and kept.
        workers: Who does the runs.
        progress: Called with the numbers of finished, failed and all runs, first with those found.
        stop: When it returns true, runs that have not been done are None.
        retry_failed: Whether runs that failed before count as not done.
    """
    asked_to_stop = stop or (lambda: False)
    plans = [plan(starting, point, metrics) for point in takewhile(lambda _: not asked_to_stop(), points)]
    found = {key: r for key, r in store.records.items() if not (retry_failed and r.status == FAILED)}
    records = {each.key: found[each.key] for each in plans if each.key in found}
    tasks = {each.key: each for each in plans if isinstance(each, Task) and each.key not in records}

    def report() -> None:
        if progress is not None:
            done = [records[each.key] for each in plans if each.key in records]
            progress(len(done), sum(record.status == FAILED for record in done), len(points))

    for each in plans:
        if isinstance(each, Record) and each.key not in records:
            records[each.key] = each
            store.append(each)
    report()
    for record in workers.run(list(tasks.values()), asked_to_stop):
        store.append(record)
        records[record.key] = record
        report()
    return [records.get(each.key) for each in plans] + [None] * (len(points) - len(plans))
