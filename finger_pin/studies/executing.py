"""Work given to an executor of `concurrent.futures`: threads of this process, unless a caller has another one.

Compiled code holds no lock of Python, so that threads run side by side: nothing is sent, no process is started, and a
script needs no ``if __name__ == "__main__":``. What goes to another executor goes by value, as cloudpickle writes it:
a metric may be defined in a script or a notebook.
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
from typing import Any, Self, TypeVar

import cloudpickle

from finger_pin.core.stepping.trajectory import Stop
from finger_pin.core.threads import usable_cores
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import FingerPinError, InputError, Interrupted, ScenarioWarning
from finger_pin.simulation.simulate import simulate

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")
# How often a request to stop is looked at, s, and how long compiled code is tried for, in simulated time, s.
_POLL, _GLANCE = 0.1, 1e-3


@dataclass(frozen=True)
class Lost:
    """Stands for a result that there is not.

    Attributes:
        reason: Why, in one line.
        error: Exception raised.
    """

    reason: str
    error: BaseException = field(compare=False, repr=False)

    @property
    def undone(self) -> bool:
        """Whether the work has not been done, for it was the executor that failed."""
        return isinstance(self.error, BrokenExecutor | CancelledError | Interrupted)


class Crew:
    """An executor at work: the caller's, or threads for the time of a ``with`` statement."""

    def __init__(self, executor: Executor | None = None, workers: int | None = None) -> None:
        """Take an executor, or threads, by default one for each core that this process may use.

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
        self._given, self._count = executor, workers or usable_cores()
        self._threads = executor is None or isinstance(executor, ThreadPoolExecutor)

    def __enter__(self) -> Self:
        """Return itself; warnings of single scenarios are silent meanwhile, in all threads."""
        self._silence = warnings.catch_warnings(action="ignore", category=ScenarioWarning)
        self._silence.__enter__()
        self._executor = self._given or ThreadPoolExecutor(self._count, "finger_pin")
        return self

    def compile(self, scenario: Scenario) -> None:
        """Compile code that other processes then find in the cache, rather than each of them on its own."""
        if self._threads:
            return
        # Its run reports why a scenario cannot be simulated.
        with suppress(FingerPinError):
            simulate(scenario.updated(simulation={"duration": min(_GLANCE, scenario.simulation.duration)}))

    def __exit__(self, *error: object) -> None:
        """End the threads; another executor is its owner's."""
        if self._given is None:
            self._executor.shutdown(cancel_futures=True)
        self._silence.__exit__(None, None, None)

    def do(
        self, function: Callable[[_Item, Stop], _Result], items: Sequence[_Item], stop: Stop
    ) -> Iterator[tuple[int, _Result | Lost]]:
        """Call a function for every item, and yield index and result of each as soon as it is there.

        Args:
            function: Takes an item, and what it may ask whether to stop.
            items: Its arguments.
            stop: Asked now and then; when it returns true, what has not been begun is left.

        Raises:
            InputError: If what the executor returns is no future.
        """
        answers: queue.SimpleQueue[tuple[int, Future[Any]]] = queue.SimpleQueue()
        ended, futures = threading.Event(), list[Future[Any]]()
        mark = Path(tempfile.gettempdir()) / f"finger_pin-{uuid.uuid4().hex}"
        try:
            for index, item in enumerate(items):
                if stop():
                    return
                future = self._submit(function, item, ended, mark)
                futures.append(future)
                future.add_done_callback(partial(_answer, answers, index))
            for _ in items:
                found = None
                while found is None:
                    if stop():
                        return
                    try:
                        found = answers.get(timeout=_POLL)
                    except queue.Empty:
                        continue
                result = _result(found[1])
                if isinstance(result, Lost) and result.undone and stop():
                    # Ctrl-C ends processes of an executor too.
                    return
                yield found[0], result
        finally:
            ended.set()
            left = [future for future in futures if not future.cancel() and not future.done()]
            if left and not self._threads:
                _tell(mark, left)

    def _submit(
        self, function: Callable[[_Item, Stop], _Result], item: _Item, ended: threading.Event, mark: Path
    ) -> Future[_Result]:
        if self._threads:
            work: tuple[Any, ...] = (function, item, ended.is_set)
        else:
            work = (_call, cloudpickle.dumps((function, item)), str(mark))
        try:
            future = self._executor.submit(*work)
        except Exception as error:
            # It is shut down, or broken.
            future = Future()
            future.set_exception(error if isinstance(error, BrokenExecutor) else BrokenExecutor(str(error)))
        if not callable(getattr(future, "add_done_callback", None)):
            raise _no_executor(f"{type(self._executor).__name__}, whose submit returns {type(future).__name__}")
        return future


def _no_executor(given: str) -> InputError:
    return InputError("executor", "must be a concurrent.futures.Executor, such as ThreadPoolExecutor(4)", given)


def _call(work: bytes, mark: str) -> Any:
    stop = partial(os.path.exists, mark)
    # Executors fetch work in advance, which they cannot take back.
    if stop():
        raise CancelledError
    function, item = pickle.loads(work)
    with quiet():
        return function(item, stop)


def _tell(mark: Path, running: Sequence[Future[Any]]) -> None:
    """Put a mark where other processes of this machine look for it, until they have ended their runs."""
    left, lock = len(running), threading.Lock()

    def remove(_: Future[Any]) -> None:
        nonlocal left
        with lock:
            left -= 1
            if not left:
                mark.unlink(missing_ok=True)

    # Processes on other machines, and those without such a folder, go on to the end of their runs.
    with suppress(OSError):
        mark.touch()
        for future in running:
            future.add_done_callback(remove)


@contextmanager
def quiet() -> Iterator[None]:
    """Ignore warnings of single scenarios, unless in a thread: filters are those of the whole process."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    with warnings.catch_warnings(action="ignore", category=ScenarioWarning):
        yield


def _answer(answers: queue.SimpleQueue[tuple[int, Future[Any]]], index: int, future: Future[Any]) -> None:
    answers.put((index, future))


def _result(future: Future[Any]) -> Any:
    try:
        return future.result()
    except (Exception, CancelledError, Interrupted) as error:
        return Lost(" ".join(f"{type(error).__name__}: {error}".split()), error)
