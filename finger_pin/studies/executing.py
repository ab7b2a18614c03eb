"""Work given to an executor of `concurrent.futures`: threads of this process, unless a caller has another one.

Compiled code holds no lock of Python, so that threads run side by side: nothing is sent, no process is started, and a
script needs no ``if __name__ == "__main__":``. What goes to another executor goes by value, as cloudpickle writes it:
a metric may be defined in a script or a notebook.
"""

from __future__ import annotations

import pickle
import queue
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Self, TypeVar

import cloudpickle

from finger_pin.core.stepping.textbook import Stop
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
        if workers is not None and (executor is not None or workers < 1):
            raise InputError("workers", "must be at least 1" if executor is None else "are the executor's own", workers)
        if executor is not None and not callable(getattr(executor, "submit", None)):
            allowed = "must be a concurrent.futures.Executor, such as ThreadPoolExecutor(4)"
            raise InputError("executor", allowed, type(executor).__name__)
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
        """
        answers: queue.SimpleQueue[tuple[int, Future[Any]]] = queue.SimpleQueue()
        ended, futures = threading.Event(), []
        try:
            for index, item in enumerate(items):
                future = self._submit(function, item, ended)
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
            # Threads end their runs where these are; what another executor has begun it ends.
            ended.set()
            for future in futures:
                future.cancel()

    def _submit(
        self, function: Callable[[_Item, Stop], _Result], item: _Item, ended: threading.Event
    ) -> Future[_Result]:
        try:
            if self._threads:
                return self._executor.submit(function, item, ended.is_set)
            return self._executor.submit(_call, cloudpickle.dumps((function, item)))
        except BrokenExecutor as error:
            broken: Future[_Result] = Future()
            broken.set_exception(error)
            return broken


def _call(work: bytes) -> Any:
    function, item = pickle.loads(work)
    with quiet():
        return function(item, lambda: False)


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
