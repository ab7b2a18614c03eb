"""Tasks run by an executor of `concurrent.futures`: by default threads of this process.

Compiled code releases the GIL, so that threads run side by side: nothing is sent, no process is started, and a script
needs no ``if __name__ == "__main__":``. Other executors get their tasks by value, as cloudpickle writes them: a metric
may be defined in a script or a notebook.
"""

from __future__ import annotations

import os
import pickle
import queue
import tempfile
import threading
import uuid
import warnings
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager, nullcontext, suppress
from functools import lru_cache, partial
from numbers import Integral
from pathlib import Path
from typing import Any, TypeVar

import cloudpickle

from finger_pin.cancellation import CancelToken, Stop
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import FingerPinError, InputError, ScenarioWarning
from finger_pin.simulation.simulate import simulate
from finger_pin.threads import usable_cores

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")
# Period of the checks for a stop, s, and length of the run that compiles, in simulated time, s.
_POLL_PERIOD, _COMPILE_DURATION = 0.1, 1e-3
_EXECUTOR_MESSAGE = "must be a concurrent.futures.Executor, such as ThreadPoolExecutor(4)"


class KilledRun(FingerPinError):
    """A run killed the process that did it, such as by the memory that it took."""


@contextmanager
def open_executor(executor: Executor | None = None, workers: int | None = None) -> Iterator[Executor]:
    """Provide an executor, by default threads, one for each usable core; in it single scenarios do not warn."""
    if workers is not None and executor is not None:
        raise InputError("workers", "are the executor's own", workers)
    if workers is not None and (not isinstance(workers, Integral) or isinstance(workers, bool) or workers < 1):
        raise InputError("workers", "must be a whole number of at least 1", workers)
    if executor is not None and (isinstance(executor, type) or not callable(getattr(executor, "submit", None))):
        raise InputError("executor", _EXECUTOR_MESSAGE, executor)
    pool = ThreadPoolExecutor(workers or usable_cores(), "finger_pin") if executor is None else nullcontext(executor)
    with warnings.catch_warnings(action="ignore", category=ScenarioWarning), pool as active_pool:
        yield active_pool


def compile_for(executor: Executor, scenario: Callable[[], Scenario]) -> None:
    """Compile for a scenario here, so that other processes find the code in the cache."""
    # The run itself reports why a scenario cannot be simulated.
    with suppress(FingerPinError):
        if not isinstance(executor, ThreadPoolExecutor):
            example = scenario()
            simulate(example.updated(simulation={"duration": min(_COMPILE_DURATION, example.simulation.duration)}))


def run_tasks(
    executor: Executor, function: Callable[[_Item, Stop], _Result], items: Sequence[_Item], stop: Stop
) -> Iterator[tuple[int, _Result | BaseException]]:
    """Call a function with each item and a `Stop`, and yield indices with results or exceptions as they come.

    When ``stop``, which is checked every tenth of a second, returns true, tasks that have not started are left. Tasks
    that were at work when a process died are done again, each alone in a process of its own; of one that dies again
    the exception is a `KilledRun`, and the others go on in new processes of this machine, one for each core.
    """
    # A file that tells processes of this machine to stop; others go on to the end of their runs.
    stop_file = Path(tempfile.gettempdir()) / f"finger_pin-{uuid.uuid4().hex}"
    left = dict(enumerate(items))
    broken = yield from _run_in(executor, function, left, stop, stop_file)
    while broken and not stop():
        running = [index for index in broken if _mark(stop_file, index).exists()]
        if not running:
            yield from broken.items()
            return
        for index in running:
            with ProcessPoolExecutor(1) as process:
                error = (yield from _run_in(process, function, {index: left[index]}, stop, stop_file)).get(index)
            _mark(stop_file, index).unlink(missing_ok=True)
            if error is not None:
                yield index, KilledRun(f"it killed its process twice, with no other run beside it: {error_line(error)}")
        left = {index: left[index] for index in broken if index not in running}
        with ProcessPoolExecutor() as pool:
            broken = yield from _run_in(pool, function, left, stop, stop_file)


def _mark(stop_file: Path, index: int) -> Path:
    """Return the file that is there while a process is at a task."""
    return stop_file.with_name(f"{stop_file.name}-{index}")


def _run_in(
    executor: Executor, function: Callable[[_Item, Stop], _Result], items: Mapping[int, _Item], stop: Stop, path: Path
) -> Generator[tuple[int, _Result | BaseException], None, dict[int, BrokenExecutor]]:
    """Yield what `run_tasks` does, and return the errors of the tasks that a broken executor has not done."""
    token, futures, broken = CancelToken(), dict[Future[Any], int](), dict[int, BrokenExecutor]()
    finished: queue.SimpleQueue[Future[Any]] = queue.SimpleQueue()
    threads = isinstance(executor, ThreadPoolExecutor)
    # What all tasks share is written once, and read once by each process.
    written = b"" if threads else cloudpickle.dumps(function)
    try:
        for index, item in items.items():
            if stop():
                return broken
            task: tuple[Any, ...] = (function, item, token)
            if not threads:
                task = (_call, written, cloudpickle.dumps(item), str(path), str(_mark(path, index)))
            future = _submit(executor, *task)
            futures[future] = index
            future.add_done_callback(finished.put)
        count = 0
        while count < len(futures) and not stop():
            with suppress(queue.Empty):
                future = finished.get(timeout=_POLL_PERIOD)
                count += 1
                result = CancelledError() if future.cancelled() else future.exception() or future.result()
                # Ctrl-C ends processes of an executor too.
                if isinstance(result, BrokenExecutor):
                    broken[futures[future]] = result
                elif not (isinstance(result, BaseException) and stop()):
                    yield futures[future], result
    finally:
        token.cancel()
        running = [future for future in futures if not future.cancel() and not future.done()]
        if running and not threads:
            with suppress(OSError):
                path.touch()
            for future in running:
                future.add_done_callback(partial(_remove, path, running))
    return broken


def _remove(stop_file: Path, running: Sequence[Future[Any]], _: Future[Any]) -> None:
    if all(future.done() for future in running):
        stop_file.unlink(missing_ok=True)


def _submit(executor: Executor, *task: Any) -> Future[Any]:
    try:
        future = executor.submit(*task)
    except Exception as error:
        # The executor is shut down, or broken.
        future = Future()
        future.set_exception(error)
    if not callable(getattr(future, "add_done_callback", None)):
        raise InputError("executor", f"{_EXECUTOR_MESSAGE}: its submit returns no future", executor)
    return future


@lru_cache(2)
def _read(function: bytes) -> Callable[[Any, Stop], Any]:
    """Return a function that was sent; with the same objects in it for all tasks of a process."""
    loaded: Callable[[Any, Stop], Any] = pickle.loads(function)
    return loaded


def _call(function: bytes, item: bytes, stop_file: str, mark: str) -> Any:
    stop = partial(os.path.exists, stop_file)
    # Executors fetch tasks in advance, which they cannot take back.
    if stop():
        raise CancelledError
    with suppress(OSError):
        Path(mark).touch()
    try:
        with without_scenario_warnings():
            return _read(function)(pickle.loads(item), stop)
    finally:
        with suppress(OSError):
            Path(mark).unlink(missing_ok=True)


def error_line(error: BaseException) -> str:
    """Return an exception in one line, with its type unless it is of this package."""
    kind = "" if isinstance(error, FingerPinError) else f"{type(error).__name__}: "
    return " ".join(f"{kind}{error}".split())


@contextmanager
def without_scenario_warnings() -> Iterator[None]:
    """Ignore warnings of single scenarios, unless in a thread: filters are those of the whole process."""
    main = threading.current_thread() is threading.main_thread()
    with warnings.catch_warnings(action="ignore", category=ScenarioWarning) if main else nullcontext():
        yield
