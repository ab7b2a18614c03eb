"""Tasks given to an executor of `concurrent.futures`: threads of this process, unless a caller has another one.

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
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from numbers import Integral
from pathlib import Path
from typing import Any, TypeVar

import cloudpickle

from finger_pin.cancellation import CancelToken, Stop
from finger_pin.core.threads import usable_cores
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import FingerPinError, InputError, Interrupted, ScenarioWarning
from finger_pin.simulation.simulate import simulate

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")
# Period of the checks for a stop, s, and length of the run that compiles, in simulated time, s.
_POLL, _GLANCE = 0.1, 1e-3


@dataclass(frozen=True)
class FailedTask:
    """Placeholder for the result of a failed task.

    Attributes:
        reason: Why, in one line.
        error: Exception raised.
    """

    reason: str
    error: BaseException = field(compare=False, repr=False)

    @property
    def undone(self) -> bool:
        """True if the executor failed, not the task."""
        return isinstance(self.error, BrokenExecutor | CancelledError | Interrupted)


@contextmanager
def open_executor(executor: Executor | None = None, workers: int | None = None) -> Iterator[Executor]:
    """Provide an executor, by default threads that end with the ``with`` statement; single scenarios do not warn in it.

    Args:
        executor: The caller's, which stays open.
        workers: Number of threads; by default one for each core that this process may use.

    Raises:
        InputError: If it is none, or there are no threads.
    """
    if workers is not None and executor is not None:
        raise InputError("workers", "are the executor's own", workers)
    if workers is not None and (not isinstance(workers, Integral) or isinstance(workers, bool) or workers < 1):
        raise InputError("workers", "must be a whole number of at least 1", workers)
    if isinstance(executor, type):
        raise _no_executor(f"the class {executor.__name__} itself")
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise _no_executor(type(executor).__name__)
    with warnings.catch_warnings(action="ignore", category=ScenarioWarning):
        if executor is not None:
            yield executor
            return
        threads = ThreadPoolExecutor(workers or usable_cores(), "finger_pin")
        try:
            yield threads
        finally:
            threads.shutdown(cancel_futures=True)


def compile_for(executor: Executor, scenario: Callable[[], Scenario]) -> None:
    """Compile for a scenario here, so that other processes find the code in the cache."""
    if isinstance(executor, ThreadPoolExecutor):
        return
    # Its run reports why a scenario cannot be simulated.
    with suppress(FingerPinError):
        first = scenario()
        simulate(first.updated(simulation={"duration": min(_GLANCE, first.simulation.duration)}))


def run_tasks(
    executor: Executor, function: Callable[[_Item, Stop], _Result], items: Sequence[_Item], stop: Stop
) -> Iterator[tuple[int, _Result | FailedTask]]:
    """Call a function for every item, and yield each index and result in the order of completion.

    Args:
        executor: The executor.
        function: Takes an item, and a `Stop`.
        items: Its arguments.
        stop: Checked every tenth of a second; when it returns true, tasks that have not started are left.

    Raises:
        InputError: If what the executor returns is no future.
    """
    answers: queue.SimpleQueue[tuple[int, Future[Any]]] = queue.SimpleQueue()
    ended, futures = CancelToken(), list[Future[Any]]()
    threads = isinstance(executor, ThreadPoolExecutor)
    # A file that tells processes of this machine to stop; others go on to the end of their runs.
    mark = Path(tempfile.gettempdir()) / f"finger_pin-{uuid.uuid4().hex}"
    try:
        for index, item in enumerate(items):
            if stop():
                return
            if threads:
                future = _submit(executor, function, item, ended)
            else:
                future = _submit(executor, _call, cloudpickle.dumps((function, item)), str(mark))
            futures.append(future)
            future.add_done_callback(partial(_answer, answers, index))
        for _ in items:
            found = None
            while found is None:
                if stop():
                    return
                with suppress(queue.Empty):
                    found = answers.get(timeout=_POLL)
            result = _result(found[1])
            if isinstance(result, FailedTask) and result.undone and stop():
                # Ctrl-C ends processes of an executor too.
                return
            yield found[0], result
    finally:
        ended.cancel()
        left = [future for future in futures if not future.cancel() and not future.done()]
        if left and not threads:
            with suppress(OSError):
                mark.touch()
                for future in left:
                    future.add_done_callback(partial(_remove, mark, left))


def _submit(executor: Executor, *task: Any) -> Future[Any]:
    try:
        future = executor.submit(*task)
    except Exception as error:
        # It is shut down, or broken.
        future = Future()
        future.set_exception(error if isinstance(error, BrokenExecutor) else BrokenExecutor(str(error)))
    if not callable(getattr(future, "add_done_callback", None)):
        raise _no_executor(f"{type(executor).__name__}, whose submit returns {type(future).__name__}")
    return future


def _answer(answers: queue.SimpleQueue[tuple[int, Future[Any]]], index: int, future: Future[Any]) -> None:
    answers.put((index, future))


def _remove(mark: Path, left: Sequence[Future[Any]], _: Future[Any]) -> None:
    if all(future.done() for future in left):
        mark.unlink(missing_ok=True)


def _no_executor(given: str) -> InputError:
    return InputError("executor", "must be a concurrent.futures.Executor, such as ThreadPoolExecutor(4)", given)


def _call(task: bytes, mark: str) -> Any:
    stop = partial(os.path.exists, mark)
    # Executors fetch tasks in advance, which they cannot take back.
    if stop():
        raise CancelledError
    function, item = pickle.loads(task)
    with quiet():
        return function(item, stop)


@contextmanager
def quiet() -> Iterator[None]:
    """Ignore warnings of single scenarios, unless in a thread: filters are those of the whole process."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    with warnings.catch_warnings(action="ignore", category=ScenarioWarning):
        yield


def _result(future: Future[Any]) -> Any:
    try:
        return future.result()
    except (Exception, CancelledError, Interrupted) as error:
        return FailedTask(" ".join(f"{type(error).__name__}: {error}".split()), error)
