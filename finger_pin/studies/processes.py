"""Work in processes of this machine: one pool, for studies and for `simulate_many`.

Every process has a pipe of its own, so one that dies, even while it sends a result, loses its own piece of
work and nothing else. In pebble, loky and `concurrent.futures` the processes of a pool share pipes and locks. Tried
with loky 3.7: one of two workers killed in the third of eight tasks cost five; one killed while it sent 20 MB hung the
pool in two of three trials; and the first results came after 6.2 s, not 2.9 s, as every worker imports what it needs.

Processes are copied from a server that has all code loaded, and what they are to do comes by value where a script or
notebook defines it. So they never import the script that asks, and it needs no ``if __name__ == "__main__":``.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from types import TracebackType
from typing import Any, Self, TypeVar

import cloudpickle

from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import FingerPinError, InputError
from finger_pin.simulation.simulate import simulate
from finger_pin.studies.machine import process_context, usable_cores
from finger_pin.studies.runs import Record, Stop, Task, execute

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")
# How often a request to stop is looked at, s, and how long compiled code is tried for, in simulated time, s.
_POLL, _GLANCE = 0.1, 1e-3
# A process may die for a reason outside, such as memory that others took; work that ends two of them is reported.
_ATTEMPTS = 2


@dataclass(frozen=True)
class LocalProcesses:
    """Processes of this machine, one thread each.

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

    def start(self) -> Pool:
        """Return a pool for the time of a ``with`` statement."""
        return Pool(self.workers or usable_cores())


@dataclass(frozen=True)
class Lost:
    """Stands for a result that there is not.

    Attributes:
        reason: Why, in one line.
    """

    reason: str


@dataclass(eq=False)
class _Worker:
    process: BaseProcess
    connection: Connection[Any, Any]
    ready: bool = False
    index: int | None = None


class Pool:
    """Processes, started when there is work for them. They leave interrupts to this one, and end with it."""

    def __init__(self, count: int) -> None:
        """Say how many at most."""
        self._count = count
        self._workers: list[_Worker] = []
        self._context = process_context()

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End all processes at once, whatever they are doing."""
        for worker in list(self._workers):
            self._remove(worker)

    def run(self, tasks: Sequence[Task], stop: Stop) -> Iterator[Record]:
        """Do tasks in any order and yield the record of each as soon as it is done; end early when told to stop."""
        if tasks and not self._workers:
            _compile(tasks[0].scenario)
        for index, done in self.do(execute, tasks, stop):
            yield tasks[index].failed(done.reason) if isinstance(done, Lost) else done

    def do(
        self, function: Callable[[_Item], _Result], items: Sequence[_Item], stop: Stop, *, helping: bool = False
    ) -> Iterator[tuple[int, _Result | Lost]]:
        """Call a function for every item, and yield index and result of each as soon as it is there.

        Args:
            function: Of a module or of the script that asks.
            items: What it takes.
            stop: Asked now and then; when it returns true what has not been done is left.
            helping: Whether this process does the first item, and others until the first process is there.

        Raises:
            InputError: If processes cannot be started.
        """
        for worker in [each for each in self._workers if each.index is not None]:
            # It is still busy with what an earlier call asked for.
            self._remove(worker)
        waiting, deaths = deque(range(len(items))), Counter[int]()
        if helping:
            # It compiles what the processes then find, in the cache or in themselves.
            yield waiting.popleft(), function(items[0])
        starter = threading.Thread(target=self._grow, args=(len(waiting),))
        starter.start()
        try:
            if not helping:
                starter.join()
            alone = helping
            while waiting or any(worker.index is not None for worker in self._workers):
                if stop():
                    return
                if alone and waiting:
                    index = waiting.popleft()
                    yield index, function(items[index])
                elif not starter.is_alive():
                    self._grow(len(waiting))
                for worker in list(self._workers):
                    if waiting and worker.ready and worker.index is None:
                        worker.index = waiting.popleft()
                        _send(worker, cloudpickle.dumps((function, items[worker.index])))
                for worker in self._answering(0.0 if alone else _POLL):
                    answer = _receive(worker)
                    at, worker.index = worker.index, None
                    if answer is None:
                        self._remove(worker)
                        # One that dies while it starts is counted apart.
                        deaths[-1] += not worker.ready
                        if deaths[-1] >= _ATTEMPTS:
                            what = 'no process can be started; put what is run under if __name__ == "__main__":'
                            raise InputError("workers", what)
                        if at is not None:
                            deaths[at] += 1
                            if deaths[at] < _ATTEMPTS:
                                waiting.append(at)
                            else:
                                yield at, Lost(f"its process ended {_ATTEMPTS} times, {_exit(worker.process)}")
                    elif at is not None:
                        yield at, answer[0]
                    else:
                        worker.ready, alone = True, False
        finally:
            starter.join()

    def _grow(self, work: int) -> None:
        """Start processes for so many pieces of work that no process is free for, as far as there may be."""
        free = sum(worker.index is None for worker in self._workers)
        for _ in range(min(work - free, self._count - len(self._workers))):
            ours, theirs = self._context.Pipe()
            process = self._context.Process(target=_serve, args=(theirs,), daemon=True)  # type: ignore[attr-defined]
            process.start()
            theirs.close()
            self._workers.append(_Worker(process, ours))

    def _answering(self, seconds: float) -> list[_Worker]:
        workers = {worker.connection: worker for worker in self._workers}
        return [workers[each] for each in wait(list(workers), seconds)]  # type: ignore[index]

    def _remove(self, worker: _Worker) -> None:
        self._workers.remove(worker)
        worker.process.kill()
        worker.process.join()
        worker.connection.close()


def _serve(connection: Connection[Any, Any]) -> None:
    """Say that this process is there, then do what comes, one piece after the other, until no more can come."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        connection.send(())
        while True:
            connection.send((_answer(connection.recv_bytes()),))
    except (EOFError, BrokenPipeError):
        return


def _answer(work: bytes) -> Any:
    try:
        function, item = pickle.loads(work)
        return function(item)
    except Exception as error:
        return Lost(" ".join(f"{type(error).__name__}: {error}".split()))


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def _send(worker: _Worker, work: bytes) -> None:
    try:
        worker.connection.send_bytes(work)
    except OSError:
        # It has died; that is handled where answers are received.
        return


def _receive(worker: _Worker) -> tuple[Any, ...] | None:
    """Return what a process sent, or None if it died before it had sent all."""
    try:
        return worker.connection.recv()  # type: ignore[no-any-return]
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
        # Its run reports why this scenario cannot be simulated.
        return
