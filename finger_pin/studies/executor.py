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
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from numbers import Integral
from pathlib import Path
from typing import Any, TypeVar

import cloudpickle

from finger_pin.cancellation import CancelToken, Stop
from finger_pin.core.threads import usable_cores
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import FingerPinError, InputError, ScenarioWarning
from finger_pin.simulation.simulate import simulate

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")
# Period of the checks for a stop, s, and length of the run that compiles, in simulated time, s.
_POLL_PERIOD, _COMPILE_DURATION = 0.1, 1e-3
_EXECUTOR_MESSAGE = "must be a concurrent.futures.Executor, such as ThreadPoolExecutor(4)"


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

    When ``stop``, which is checked every tenth of a second, returns true, tasks that have not started are left.
    """
    token, futures = CancelToken(), dict[Future[Any], int]()
    finished: queue.SimpleQueue[Future[Any]] = queue.SimpleQueue()
    threads = isinstance(executor, ThreadPoolExecutor)
    # A file that tells processes of this machine to stop; others go on to the end of their runs.
    stop_file = Path(tempfile.gettempdir()) / f"finger_pin-{uuid.uuid4().hex}"
    try:
        for index, item in enumerate(items):
            if stop():
                return
            task = (function, item, token) if threads else (_call, cloudpickle.dumps((function, item)), str(stop_file))
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
                if not (isinstance(result, BaseException) and stop()):
                    yield futures[future], result
    finally:
        token.cancel()
        running = [future for future in futures if not future.cancel() and not future.done()]
        if running and not threads:
            with suppress(OSError):
                stop_file.touch()
            for future in running:
                future.add_done_callback(partial(_remove, stop_file, running))


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


def _call(task: bytes, stop_file: str) -> Any:
    stop = partial(os.path.exists, stop_file)
    # Executors fetch tasks in advance, which they cannot take back.
    if stop():
        raise CancelledError
    function, item = pickle.loads(task)
    with without_scenario_warnings():
        return function(item, stop)


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
