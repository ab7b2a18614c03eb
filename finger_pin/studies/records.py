"""Runs of a study: recorded as soon as they end, and not repeated once they are recorded."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import joblib

from finger_pin.cancellation import CancelToken, Stop
from finger_pin.description.loading import to_toml
from finger_pin.exceptions import FingerPinError
from finger_pin.studies.executor import FailedTask, compile_for, open_executor, run_tasks
from finger_pin.studies.fingerprint import UnknownDependency, code_digest, finger_digest, source_digest, versions
from finger_pin.studies.keys import BaseScenario, Point
from finger_pin.studies.metrics import Metric
from finger_pin.studies.response import Run
from finger_pin.studies.store import DONE, FAILED, RunRecord, Store, open_store

#: Called with the numbers of finished, failed and all runs.
Progress = Callable[[int, int, int], None]


class ExecutorError(FingerPinError):
    """An executor cannot go on: a pool is broken, a cluster is lost; finished runs are recorded."""


class VersionError(FingerPinError):
    """A worker has another version of the package than the process that asks."""


@contextmanager
def open_study(
    output: str | Path | None,
    asked: Mapping[str, Any],
    products: Sequence[str],
    executor: Executor | None,
    stop: Stop | None,
    restart: bool,
) -> Iterator[tuple[Store, Executor, CancelToken]]:
    """Open the store of a study, its executor, and a token that Ctrl-C and a `Stop` cancel.

    Args:
        output: Its folder; without one its records are in memory alone.
        asked: From `describe_study`.
        products: Patterns of the files that a study with other settings replaces.
        executor: By default one thread for each core.
        stop: Asked now and then.
        restart: Whether to drop what the folder holds of a study.
    """
    with ExitStack() as stack:
        token = stack.enter_context(CancelToken(stop))
        pool = stack.enter_context(open_executor(executor))
        store = Store() if output is None else stack.enter_context(open_store(output, asked, products, restart=restart))
        yield store, pool, token


def evaluate(
    base: BaseScenario,
    points: Sequence[Point],
    metrics: tuple[Metric, ...],
    store: Store,
    executor: Executor,
    *,
    progress: Progress | None = None,
    stop: Stop | None = None,
    retry_failed: bool = False,
) -> list[RunRecord | None]:
    """Do the missing runs of a store, keep each as it finishes, and return all in the order of the points.

    Args:
        base: The scenario that is varied.
        points: Points of the study.
        metrics: Metrics of every run.
        store: Store of the records.
        executor: Executor of the runs.
        progress: Called with the numbers of finished, failed and all runs, first with those found.
        stop: When it returns true, runs that have not been done are None.
        retry_failed: Whether runs that failed before count as not done.

    Raises:
        ExecutorError: If the executor cannot go on.
    """
    study = _study_digest(base, metrics)
    keys = [joblib.hash((study, dict(point))) for point in points]
    found = {key: store.records[key] for key in keys if key in store.records}
    records = {key: each for key, each in found.items() if not (retry_failed and each.status == FAILED)}
    tasks = [(key, point) for key, point in dict(zip(keys, points, strict=True)).items() if key not in records]

    def report() -> None:
        if progress is not None:
            done = [records[key] for key in keys if key in records]
            progress(len(done), sum(record.status == FAILED for record in done), len(points))

    report()
    if tasks:
        compile_for(executor, lambda: base.at(tasks[0][1]))
    work = partial(execute, base=base, metrics=metrics, source=source_digest())
    for index, done in run_tasks(executor, work, tasks, stop or (lambda: False)):
        record = _failed(*tasks[index], done) if isinstance(done, FailedTask) else done
        store.append(record)
        records[record.key] = record
        report()
    return [records.get(key) for key in keys]


def _failed(key: str, point: Point, failed: FailedTask) -> RunRecord:
    """Return the record of a run that killed its workers, or raise if the executor failed."""
    if type(failed.error).__name__ == "KilledWorker":
        return RunRecord(key, dict(point), FAILED, f"the workers that ran it died: {failed.error}", {}, 0.0)
    raise ExecutorError(f"the executor cannot go on: {failed.reason}; give an output to keep what it has finished")


def execute(
    task: tuple[str, Point], stop: Stop, base: BaseScenario, metrics: tuple[Metric, ...], source: str
) -> RunRecord:
    """Simulate a point and measure it; an exception becomes the reason of a failed run.

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
        scenario = base.at(point)
        run = Run(scenario, stop, base.finger_at(scenario))
        values = {metric.name: float(metric.measure(run)) for metric in metrics}
    except Exception as error:
        kind = "" if isinstance(error, FingerPinError) else f"{type(error).__name__}: "
        status, reason = FAILED, " ".join(f"{kind}{error}".split())
    return RunRecord(key, dict(point), status, reason, values, time.perf_counter() - start)


def _study_digest(base: BaseScenario, metrics: Sequence[Metric]) -> str:
    """Return a digest of the common input of a study's runs, a unique one if it cannot be known."""
    try:
        codes = [code_digest(metric) for metric in metrics]
        finger = base.finger and finger_digest(base.finger)
    except UnknownDependency:
        return uuid.uuid4().hex
    return str(joblib.hash((to_toml(base.scenario), codes, finger, source_digest())))
