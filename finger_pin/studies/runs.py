"""One run of a study: what is to be done, doing it in whatever process, and what is kept of it."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from importlib import metadata
from typing import Any, Protocol, Self

from finger_pin.description.loading import to_toml
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import FingerPinError, InputError
from finger_pin.studies.keys import Starting
from finger_pin.studies.metrics import Metric, Run

DONE, FAILED = "done", "failed"
Stop = Callable[[], bool]


@dataclass(frozen=True)
class Record:
    """What is kept of a run.

    Attributes:
        key: Digest of everything that determines the run.
        point: The numbers that were varied.
        status: `DONE` or `FAILED`.
        reason: Why it failed; empty if it did not.
        metrics: By name; none if it failed.
        seconds: Wall time, s.
    """

    key: str
    point: Mapping[str, float]
    status: str
    reason: str
    metrics: Mapping[str, float]
    seconds: float

    def to_json(self) -> str:
        """Return it as one line of JSON; infinity is spelt as Python spells it."""
        return json.dumps(vars(self))

    @classmethod
    def from_json(cls, line: str) -> Self:
        """Read what `to_json` wrote.

        Raises:
            ValueError: If it did not.
        """
        try:
            return cls(**json.loads(line))
        except TypeError as error:
            raise ValueError(str(error)) from None


@dataclass(frozen=True)
class Task:
    """A run to be done.

    Attributes:
        key: Digest of everything that determines it.
        point: The numbers that were varied.
        scenario: With these numbers.
        metrics: To be measured.
        version: Of the package that asks.
    """

    key: str
    point: Mapping[str, float]
    scenario: Scenario
    metrics: tuple[Metric, ...]
    version: str

    def failed(self, reason: str, seconds: float = 0.0) -> Record:
        """Return the record of a run that failed."""
        return Record(self.key, dict(self.point), FAILED, " ".join(reason.split()), {}, seconds)


class Workers(Protocol):
    """What does tasks, once started."""

    def run(self, tasks: Sequence[Task], stop: Stop) -> Iterator[Record]:
        """Do tasks in any order and yield the record of each as soon as it is done; end early when told to stop."""


class Executor(Protocol):
    """Where tasks are done."""

    def start(self) -> AbstractContextManager[Workers]:
        """Return workers for the time of a ``with`` statement."""


class VersionError(FingerPinError):
    """A worker has another version of the package than the process that asks."""


def version() -> str:
    """Return the version of this package."""
    return metadata.version("finger-pin")


def plan(starting: Starting, point: Mapping[str, float], metrics: tuple[Metric, ...]) -> Task | Record:
    """Return the task at a point, or the record of its failure if there is no such scenario."""
    measured = [[m.name, m.unit, m.long_name, m.measure.__module__, m.measure.__qualname__] for m in metrics]
    try:
        scenario = starting.at(point)
    except InputError as error:
        key = _digest(to_toml(starting.scenario), dict(point), measured)
        return Record(key, dict(point), FAILED, str(error), {}, 0.0)
    return Task(_digest(to_toml(scenario), measured), dict(point), scenario, metrics, version())


def execute(task: Task) -> Record:
    """Do a task.

    Raises:
        VersionError: If this package is not the one that asked.
    """
    if task.version != version():
        raise VersionError(f"a worker has finger_pin {version()}, not {task.version}")
    begin = time.perf_counter()
    run = Run(task.scenario)
    try:
        values = {metric.name: float(metric.measure(run)) for metric in task.metrics}
    except Exception as error:
        # Whatever goes wrong with one point is kept with it, and the others go on.
        kind = "" if isinstance(error, FingerPinError) else f"{type(error).__name__}: "
        return task.failed(f"{kind}{error}", time.perf_counter() - begin)
    return Record(task.key, dict(task.point), DONE, "", values, time.perf_counter() - begin)


def _digest(*parts: Any) -> str:
    return hashlib.sha256(json.dumps([*parts, version()], sort_keys=True).encode()).hexdigest()[:32]
