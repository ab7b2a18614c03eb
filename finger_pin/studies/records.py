"""Records of a study's runs: what has a record is not run again, and every run is recorded as soon as it ends."""

from __future__ import annotations

import json
import time
import uuid
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import joblib

from finger_pin.core.stepping.textbook import Stop
from finger_pin.description.loading import to_toml
from finger_pin.exceptions import FingerPinError
from finger_pin.studies.executor import FailedTask, compile_for, run_tasks
from finger_pin.studies.fingerprint import UnknownDependency, code_digest, finger_digest, source_digest, versions
from finger_pin.studies.keys import Point, Starting
from finger_pin.studies.metrics import Metric, Run

DONE, FAILED = "done", "failed"
#: Called with the numbers of finished, failed and all runs.
Progress = Callable[[int, int, int], None]


@dataclass(frozen=True)
class RunRecord:
    """The record of a run.

    Attributes:
        key: Digest of everything that determines the run.
        point: Values of the varied keys.
        status: `DONE` or `FAILED`.
        reason: Why it failed; empty if it did not.
        metrics: By name; none if it failed.
        seconds: Wall time, s.
    """

    key: str
    point: Point
    status: str
    reason: str
    metrics: Mapping[str, float]
    seconds: float

    def to_json(self) -> str:
        """Return it as one line of JSON; infinity is spelt as Python spells it."""
        return json.dumps(vars(self))


class Archive(Protocol):
    """A place of records."""

    @property
    def records(self) -> Mapping[str, RunRecord]:
        """All records by key."""

    def append(self, record: RunRecord) -> None:
        """Keep a record."""


class ExecutorError(FingerPinError):
    """An executor cannot go on: a pool is broken, a cluster is lost; finished runs are recorded."""


class VersionError(FingerPinError):
    """A worker has another version of the package than the process that asks."""


def evaluate(
    starting: Starting,
    points: Sequence[Point],
    metrics: tuple[Metric, ...],
    archive: Archive,
    executor: Executor,
    *,
    progress: Progress | None = None,
    stop: Stop | None = None,
    retry_failed: bool = False,
) -> list[RunRecord | None]:
    """Do the runs that are not in an archive, keep each as it finishes, and return all in the order of the points.

    Args:
        starting: The scenario that is varied.
        points: Points of the study.
        metrics: Metrics of every run.
        archive: Archive of the records.
        executor: Executor of the runs.
        progress: Called with the numbers of finished, failed and all runs, first with those found.
        stop: When it returns true, runs that have not been done are None.
        retry_failed: Whether runs that failed before count as not done.

    Raises:
        ExecutorError: If the executor cannot go on.
    """
    study = _study_digest(starting, metrics)
    keys = [joblib.hash((study, dict(point))) for point in points]
    found = {key: archive.records[key] for key in keys if key in archive.records}
    records = {key: each for key, each in found.items() if not (retry_failed and each.status == FAILED)}
    tasks = [(key, point) for key, point in dict(zip(keys, points, strict=True)).items() if key not in records]

    def report() -> None:
        if progress is not None:
            done = [records[key] for key in keys if key in records]
            progress(len(done), sum(record.status == FAILED for record in done), len(points))

    report()
    if tasks:
        compile_for(executor, lambda: starting.at(tasks[0][1]))
    work = partial(execute, starting=starting, metrics=metrics, source=source_digest())
    for index, done in run_tasks(executor, work, tasks, stop or (lambda: False)):
        record = _failed(*tasks[index], done) if isinstance(done, FailedTask) else done
        archive.append(record)
        records[record.key] = record
        report()
    return [records.get(key) for key in keys]


def _failed(key: str, point: Point, failed: FailedTask) -> RunRecord:
    """Return the record of a run that ended the processes that did it, as Dask finds out."""
    if type(failed.error).__name__ == "KilledWorker":
        return RunRecord(key, dict(point), FAILED, f"the workers that ran it died: {failed.error}", {}, 0.0)
    raise ExecutorError(f"the executor cannot go on: {failed.reason}; give an output to keep what it has finished")


def execute(
    task: tuple[str, Point], stop: Stop, starting: Starting, metrics: tuple[Metric, ...], source: str
) -> RunRecord:
    """Simulate a point and measure it; whatever goes wrong with it is its record's reason.

    Raises:
        VersionError: If this package is not the one that asked.
        Interrupted: If it was told to stop.
    """
    if source != source_digest():
        own = f"{versions()['finger-pin']}, source {source_digest()}"
        raise VersionError(f"a worker has another finger_pin ({own}), not that of source {source}")
    key, point = task
    start = time.perf_counter()
    values, status, reason = dict[str, float](), DONE, ""
    try:
        scenario = starting.at(point)
        run = Run(scenario, stop, starting.finger_at(scenario))
        values = {metric.name: float(metric.measure(run)) for metric in metrics}
    except Exception as error:
        kind = "" if isinstance(error, FingerPinError) else f"{type(error).__name__}: "
        status, reason = FAILED, " ".join(f"{kind}{error}".split())
    return RunRecord(key, dict(point), status, reason, values, time.perf_counter() - start)


def _study_digest(starting: Starting, metrics: Sequence[Metric]) -> str:
    """Return a digest of all that the runs of a study have in common; a unique one if it cannot be known."""
    try:
        codes = [code_digest(metric) for metric in metrics]
        finger = starting.finger and finger_digest(starting.finger)
    except UnknownDependency:
        return uuid.uuid4().hex
    return str(joblib.hash((to_toml(starting.scenario), codes, finger, source_digest())))
