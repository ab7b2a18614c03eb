"""Tasks in processes of this machine, one thread each.

Every process has a pipe of its own, so that a process that dies is known by its task. The processes leave interrupts to
the one that started them, and end with it even when it is killed.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from types import TracebackType
from typing import Self

from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import FingerPinError, InputError
from finger_pin.simulation.simulate import simulate
from finger_pin.studies.processes import process_context, single_threaded, usable_cores
from finger_pin.studies.runs import Record, Stop, Task, execute

# How often a request to stop is looked at, s, and how long compiled code is tried for, in simulated time, s.
_POLL, _GLANCE = 0.1, 1e-3
# A process may die for a reason outside, such as memory that others took; the same task twice is told.
_ATTEMPTS = 2


@dataclass(frozen=True)
class LocalProcesses:
    """Processes of this machine.

    A script that starts them needs the usual guard ``if __name__ == "__main__":``.

    Attributes:
        workers: Number of processes; by default one per core that this process may use.
    """

    workers: int | None = None

    def __post_init__(self) -> None:
        """Check.

        Raises:
            InputError: If there are none.
        """
        if self.workers is not None and self.workers < 1:
            raise InputError("workers", "must be at least 1", self.workers)

    def start(self) -> LocalWorkers:
        """Return workers for the time of a ``with`` statement."""
        return LocalWorkers(self.workers or usable_cores())


@dataclass(eq=False)
class _Worker:
    process: BaseProcess
    connection: Connection[Task, Record]
    task: Task | None = None


@dataclass(eq=False)
class LocalWorkers:
    """Processes, started when there is work for them.

    Attributes:
        count: How many at most.
    """

    count: int
    _workers: list[_Worker] = field(default_factory=list, init=False, repr=False)

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End all processes, in the midst of whatever they do."""
        for worker in list(self._workers):
            self._remove(worker)

    def run(self, tasks: Sequence[Task], stop: Stop) -> Iterator[Record]:
        """Do tasks in any order and yield the record of each as soon as it is done; end early when told to stop."""
        for worker in [each for each in self._workers if each.task]:
            # It is still at what an earlier call was stopped in.
            self._remove(worker)
        if not self._workers and tasks:
            _compile(tasks[0].scenario)
        waiting = deque(tasks)
        deaths: dict[str, int] = {}
        while (waiting or any(worker.task for worker in self._workers)) and not stop():
            self._assign(waiting)
            busy = [worker for worker in self._workers if worker.task]
            ready = wait([each for w in busy for each in (w.connection, w.process.sentinel)], _POLL)
            for worker in busy:
                if worker.connection not in ready and worker.process.sentinel not in ready:
                    continue
                task, worker.task = worker.task, None
                assert task is not None
                record = _receive(worker.connection)
                if record is None:
                    self._remove(worker)
                    deaths[task.key] = deaths.get(task.key, 0) + 1
                    if deaths[task.key] < _ATTEMPTS:
                        waiting.append(task)
                        continue
                    record = task.failed(f"its process ended {_ATTEMPTS} times, {_exit(worker.process)}")
                yield record

    def _assign(self, waiting: deque[Task]) -> None:
        idle = [worker for worker in self._workers if worker.task is None]
        while waiting and (idle or len(self._workers) < self.count):
            worker = idle.pop() if idle else self._add()
            worker.task = waiting.popleft()
            try:
                worker.connection.send(worker.task)
            except OSError:
                # It has died; what comes of that is seen where results are received.
                continue

    def _add(self) -> _Worker:
        context = process_context()
        ours, theirs = context.Pipe()
        with single_threaded():
            process = context.Process(target=_work, args=(theirs,), daemon=True)  # type: ignore[attr-defined]
            process.start()
        theirs.close()
        worker = _Worker(process, ours)
        self._workers.append(worker)
        return worker

    def _remove(self, worker: _Worker) -> None:
        self._workers.remove(worker)
        worker.process.kill()
        worker.process.join()
        worker.connection.close()


def _work(connection: Connection[Record, Task]) -> None:
    """Do the tasks that come, one after the other, until no more can come."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    while True:
        try:
            connection.send(execute(connection.recv()))
        except (EOFError, BrokenPipeError):
            return


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def _receive(connection: Connection[Task, Record]) -> Record | None:
    """Return the record that a process sent, or None if it died before."""
    try:
        return connection.recv() if connection.poll() else None
    except (EOFError, OSError):
        return None


def _exit(process: BaseProcess) -> str:
    code = process.exitcode or 0
    return f"killed by {signal.Signals(-code).name}" if code < 0 else f"with exit code {code}"


def _compile(scenario: Scenario) -> None:
    """Compile what the processes then find in the cache, rather than each of them on its own."""
    glance = min(_GLANCE, scenario.simulation.duration)
    settings = scenario.simulation.model_copy(update={"duration": glance})
    try:
        simulate(scenario.model_copy(update={"simulation": settings}))
    except FingerPinError:
        # Why this scenario cannot be simulated is told with its run.
        return
