"""Records of a study's runs: a line of JSON each, written at once, identified by a digest of the inputs."""

from __future__ import annotations

import json
import os
import sys
import time
import uuid
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import filelock
import joblib

from finger_pin.cancellation import CancelToken, Stop
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import FingerPinError, InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.studies.executor import KilledRun, compile_for, error_line, open_executor, run_tasks
from finger_pin.studies.fingerprint import UnknownDependency, digest, source_digest
from finger_pin.studies.keys import BaseScenario, Point
from finger_pin.studies.metrics import Metric
from finger_pin.studies.response import Run
from finger_pin.version import __version__

#: Called with the numbers of finished, failed and all runs.
Progress = Callable[[int, int, int], None]
DONE, FAILED = "done", "failed"
_RECORDS_FILE, _LOCK_FILE, _RECORD_START = "runs.jsonl", ".lock", b'{"key": '


class ExecutorError(FingerPinError):
    """An executor cannot go on: a pool is broken, a cluster is lost; finished runs are recorded."""


@dataclass(frozen=True)
class RunRecord:
    """Record of a run: its key, varied values, status, reason of a failure, metrics by name, and wall time, s."""

    key: str
    point: Point
    status: str
    reason: str
    metrics: Mapping[str, float]
    seconds: float


@dataclass(frozen=True, eq=False)
class Study:
    """Runs of a scenario, each done and recorded once.

    Attributes:
        base: The scenario that is varied.
        metrics: Metrics of every run.
        path: File of the records; without one they are in memory alone.
        digest: Digest of what all runs depend on; with a point's values it is a run's key.
        records: Records by key.
        executor: Executor of the runs.
        token: Ends the study; Ctrl-C and a `Stop` cancel it.
    """

    base: BaseScenario
    metrics: tuple[Metric, ...]
    path: Path | None
    digest: str
    records: dict[str, RunRecord]
    executor: Executor
    token: CancelToken

    def evaluate(
        self, points: Sequence[Point], progress: Progress | None = None, *, retry_failed: bool = False
    ) -> list[RunRecord | None]:
        """Execute the missing runs, and return the records of all, None where the study was stopped before.

        Args:
            points: Points of the study.
            progress: Called with the numbers of finished, failed and all runs, first with those of earlier studies.
            retry_failed: Whether runs that failed before count as missing.

        Raises:
            ExecutorError: If the executor cannot go on.
            OSError: If a record cannot be written, such as on a full disk.
        """
        keys = [self._key(point) for point in points]
        records = {key: self.records[key] for key in keys if key in self.records}
        if retry_failed:
            records = {key: record for key, record in records.items() if record.status != FAILED}
        tasks = [(key, point) for key, point in dict(zip(keys, points, strict=True)).items() if key not in records]

        def report() -> None:
            if progress is not None:
                finished = [records[key] for key in keys if key in records]
                progress(len(finished), sum(record.status == FAILED for record in finished), len(points))

        report()
        if tasks:
            compile_for(self.executor, lambda: self.base.at(tasks[0][1]))
        task_function = partial(execute, base=self.base, metrics=self.metrics, source=source_digest())
        for index, outcome in run_tasks(self.executor, task_function, tasks, self.token):
            record = self._failed(*tasks[index], outcome) if isinstance(outcome, BaseException) else outcome
            self.append(record)
            records[record.key] = record
            report()
        return [records.get(key) for key in keys]

    def _key(self, point: Point) -> str:
        """Return the digest of everything that determines a run."""
        names = [name for name in point.values() if isinstance(name, str)]
        if any(":" in name and name.partition(":")[0] not in sys.modules for name in names):
            _import_laws(lambda: self.base.at(point))
        digests = [_content_digest(f"the value {name}", name, warn=self.path is not None) for name in names]
        return str(joblib.hash((self.digest, dict(point), digests)))

    def _failed(self, key: str, point: Point, error: BaseException) -> RunRecord:
        """Return the record of a run that killed its workers, or raise if the executor failed."""
        if isinstance(error, KilledRun) or type(error).__name__ == "KilledWorker":
            return RunRecord(key, dict(point), FAILED, f"the workers that ran it died: {error}", {}, 0.0)
        advice = "; give an output to keep what it has finished" if self.path is None else ""
        raise ExecutorError(f"the executor cannot go on: {error_line(error)}{advice}")

    def append(self, record: RunRecord) -> None:
        """Keep a record, also on disk if there is a folder."""
        if self.path is not None:
            with filelock.FileLock(self.path.with_name(_LOCK_FILE)), self.path.open("ab+") as file:
                _remove_unfinished_line(file)
                file.write(json.dumps(vars(record)).encode() + b"\n")
                file.flush()
                os.fsync(file.fileno())
        self.records[record.key] = record


@contextmanager
def open_study(
    base: BaseScenario,
    metrics: Sequence[Metric],
    output: str | Path | None,
    products: Sequence[str],
    executor: Executor | None,
    stop: Stop | None,
    restart: bool,
) -> Iterator[Study]:
    """Open a study in a folder, which other processes may share, or in memory alone.

    ``products`` are patterns of the files that are made of its records, such as ``figures/sweep.png``; ``restart``
    removes both. The executor is by default one thread for each core.

    Warns:
        UserWarning: If runs cannot be found again, or lines are no records.
    """
    with CancelToken(stop) as token, open_executor(executor) as pool:
        path, records = (None, {}) if output is None else _open_folder(Path(output), products, restart)
        common = _common_digest(base, metrics, warn=path is not None)
        yield Study(base, tuple(metrics), path, common, records, pool, token)


def _open_folder(folder: Path, products: Sequence[str], restart: bool) -> tuple[Path, dict[str, RunRecord]]:
    path, records = folder / _RECORDS_FILE, dict[str, RunRecord]()
    try:
        existing = [file_path for pattern in (*products, _RECORDS_FILE) for file_path in folder.glob(pattern)]
        foreign_names = [file_path.name for file_path in folder.glob("study.toml")]
        if existing and not (path.exists() and _RECORD_START.startswith(path.read_bytes()[: len(_RECORD_START)])):
            foreign_names.append(existing[0].name)
        if foreign_names:
            problem = f"holds a {foreign_names[0]} of an earlier version or of something else; name another folder"
            raise InputError("output", problem, str(folder))
        for stale_file in existing if restart else ():
            stale_file.unlink()
        folder.mkdir(parents=True, exist_ok=True)
        with filelock.FileLock(folder / _LOCK_FILE), path.open("ab+") as file:
            dropped_count = _remove_unfinished_line(file)
            file.seek(0)
            lines = file.read().splitlines()
    except OSError as error:
        raise InputError("output", f"cannot be written: {error.strerror or error}", str(folder)) from None
    for line in lines:
        try:
            record = RunRecord(**json.loads(line))
            records[record.key] = record
        except (TypeError, ValueError):
            dropped_count += 1
    if dropped_count:
        message = f"{path}: lines that are not whole, or no records: {dropped_count}; their runs are done again"
        warnings.warn(message, stacklevel=5)
    return path, records


def _remove_unfinished_line(file: BinaryIO) -> int:
    """Cut off a line that a killed process has left unfinished; return the number of such lines."""
    file.seek(max(file.seek(0, os.SEEK_END) - 1, 0))
    if file.read() in (b"", b"\n"):
        return 0
    file.seek(0)
    file.truncate(file.read().rfind(b"\n") + 1)
    return 1


def _common_digest(base: BaseScenario, metrics: Sequence[Metric], warn: bool) -> str:
    """Return a digest of the inputs that all runs share."""
    _import_laws(lambda: base.scenario)
    parts: dict[str, Any] = {f"the metric {metric.name}": metric for metric in metrics}
    parts |= {"the scenario": base.scenario, "the finger": base.finger}
    return str(joblib.hash([source_digest(), *(_content_digest(name, part, warn) for name, part in parts.items())]))


def _import_laws(scenario: Callable[[], Scenario]) -> None:
    """Import the laws that a scenario names, so that their content is known."""
    # The run itself reports why a scenario cannot be simulated.
    with suppress(FingerPinError):
        Finger(scenario().finger)


def _content_digest(name: str, part: Any, warn: bool) -> str:
    """Return the digest of a part of a study, a unique one if its content cannot be known."""
    try:
        return digest(part)
    except UnknownDependency as error:
        if warn:
            warnings.warn(f"{name} uses {error}, so its runs are done anew whenever they are asked for", stacklevel=6)
        return uuid.uuid4().hex


def execute(
    task: tuple[str, Point], stop: Stop, base: BaseScenario, metrics: tuple[Metric, ...], source: str
) -> RunRecord:
    """Simulate a point and measure it; an exception becomes the reason of a failed run.

    Raises:
        ExecutorError: If this package differs from that of the study.
        Interrupted: If the study was stopped.
    """
    if source != source_digest():
        own_version = f"{__version__}, source {source_digest()}"
        raise ExecutorError(f"a worker has another finger_pin ({own_version}), not that of source {source}")
    key, point = task
    start, values, reason = time.perf_counter(), dict[str, float](), ""
    try:
        scenario = base.at(point)
        run = Run(scenario, stop, base.finger_at(scenario))
        values = {metric.name: float(metric.measure(run)) for metric in metrics}
    except Exception as error:
        reason = error_line(error)
    return RunRecord(key, dict(point), FAILED if reason else DONE, reason, values, time.perf_counter() - start)
