"""Runs of a study: tasks, their execution in any process, and the records kept of them.

What is recorded is not done again, and what is done is recorded at once. A record is found by a digest of all that its
run depends on: the scenario, the code of the metrics, and the source of this package.
"""

from __future__ import annotations

import hashlib
import json
import time
import uuid
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from typing import Any, Protocol, Self

from finger_pin.description.loading import to_toml
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import FingerPinError, InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.studies.executing import Crew, Lost
from finger_pin.studies.fingerprint import UnknownDependency, code_digest, finger_digest, source_digest, versions
from finger_pin.studies.keys import Point, Starting
from finger_pin.studies.metrics import Metric
from finger_pin.studies.response import Run

DONE, FAILED = "done", "failed"
Stop = Callable[[], bool]
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

    @classmethod
    def from_json(cls, line: str) -> Self:
        """Read a record that `to_json` wrote.

        Raises:
            ValueError: If it did not.
        """
        try:
            return cls(**json.loads(line))
        except TypeError as error:
            raise ValueError(str(error)) from None


@dataclass(frozen=True)
class PlannedRun:
    """A run to be done.

    Attributes:
        key: Digest of everything that determines it.
        point: Values of the varied keys.
        scenario: At this point.
        finger: Replaces the one that it describes; None for none.
        metrics: To be measured.
        source: Digest of the package that asks.
    """

    key: str
    point: Point
    scenario: Scenario
    finger: Finger | None
    metrics: tuple[Metric, ...]
    source: str

    def failed(self, reason: str, seconds: float = 0.0) -> RunRecord:
        """Return the record of a run that failed."""
        return RunRecord(self.key, dict(self.point), FAILED, " ".join(reason.split()), {}, seconds)


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
    crew: Crew,
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
        crew: Crew that does the runs.
        progress: Called with the numbers of finished, failed and all runs, first with those found.
        stop: When it returns true, runs that have not been done are None.
        retry_failed: Whether runs that failed before count as not done.

    Raises:
        ExecutorError: If the executor cannot go on.
    """
    asked_to_stop = stop or (lambda: False)
    measured = [_identity(metric) for metric in metrics]
    if starting.finger is not None:
        measured.append([_known(finger_digest, starting.finger)])
    plans = [_plan(starting, point, metrics, measured) for point in takewhile(lambda _: not asked_to_stop(), points)]
    found = {key: r for key, r in archive.records.items() if not (retry_failed and r.status == FAILED)}
    records = {each.key: found[each.key] for each in plans if each.key in found}
    tasks = {each.key: each for each in plans if isinstance(each, PlannedRun) and each.key not in records}

    def report() -> None:
        if progress is not None:
            done = [records[each.key] for each in plans if each.key in records]
            progress(len(done), sum(record.status == FAILED for record in done), len(points))

    for each in plans:
        if isinstance(each, RunRecord) and each.key not in records:
            records[each.key] = each
            archive.append(each)
    report()
    waiting = list(tasks.values())
    if waiting:
        crew.compile(waiting[0].scenario)
    for index, done in crew.do(execute, waiting, asked_to_stop):
        record = _failed(waiting[index], done) if isinstance(done, Lost) else done
        archive.append(record)
        records[record.key] = record
        report()
    return [records.get(each.key) for each in plans] + [None] * (len(points) - len(plans))


def _failed(task: PlannedRun, lost: Lost) -> RunRecord:
    """Return the record of a run that ended the processes that did it, as Dask finds out."""
    if type(lost.error).__name__ == "KilledWorker":
        return task.failed(f"the workers that ran it died: {lost.error}")
    raise ExecutorError(f"the executor cannot go on: {lost.reason}; give an output to keep what it has finished")


def execute(task: PlannedRun, stop: Stop) -> RunRecord:
    """Do a task.

    Raises:
        VersionError: If this package is not the one that asked.
        Interrupted: If it was told to stop.
    """
    if task.source != source_digest():
        own = f"{versions()['finger-pin']}, source {source_digest()}"
        raise VersionError(f"a worker has another finger_pin ({own}), not that of source {task.source}")
    begin = time.perf_counter()
    run = Run(task.scenario, stop, task.finger)
    try:
        values = {metric.name: float(metric.measure(run)) for metric in task.metrics}
    except Exception as error:
        # Whatever goes wrong with one point is kept with it, and the others go on.
        kind = "" if isinstance(error, FingerPinError) else f"{type(error).__name__}: "
        return task.failed(f"{kind}{error}", time.perf_counter() - begin)
    return RunRecord(task.key, dict(task.point), DONE, "", values, time.perf_counter() - begin)


def _identity(metric: Metric) -> list[str]:
    """Return the marks of a metric; they never come again if the dependencies of its code cannot be known."""
    return [metric.name, metric.unit, metric.long_name, _known(code_digest, metric.measure)]


def _known(digest: Callable[[Any], str], thing: Any) -> str:
    """Return a digest of a thing, or a unique one if it has none."""
    try:
        return digest(thing)
    except UnknownDependency:
        return uuid.uuid4().hex


def _plan(
    starting: Starting, point: Point, metrics: tuple[Metric, ...], measured: list[list[str]]
) -> PlannedRun | RunRecord:
    """Return the task at a point, or the record of its failure if there is no such scenario."""
    try:
        scenario = starting.at(point)
    except InputError as error:
        key = _digest(to_toml(starting.scenario), dict(point), measured)
        return RunRecord(key, dict(point), FAILED, str(error), {}, 0.0)
    finger = starting.finger_at(scenario)
    return PlannedRun(_digest(to_toml(scenario), measured), dict(point), scenario, finger, metrics, source_digest())


def _digest(*parts: Any) -> str:
    return hashlib.sha256(json.dumps([*parts, source_digest()], sort_keys=True).encode()).hexdigest()[:32]
