"""Cancellation of work: one token, set by Ctrl-C, by SIGTERM in commands, or by a caller, and read between steps."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Self

#: Asked between steps; once it is true, the work ends there.
Stop = Callable[[], bool]
_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class CancelToken:
    """Request to end a computation, which then ends soon with the results so far.

    While the token is entered, the first Ctrl-C sets it; a second one raises KeyboardInterrupt at once. Where others
    than Python handle the signal, such as another token, and in threads, which get none, it is theirs.

    Attributes:
        cancelled: Whether `cancel` was called, or Ctrl-C was pressed.
    """

    def __init__(self, stop: Stop | None = None) -> None:
        """Take a condition of the caller's, which is checked as well."""
        self.cancelled, self._stop, self._stopped = False, stop, False
        self._caught: list[int] = []

    def __call__(self) -> bool:
        """Return whether to end; it stays true, so that all threads end."""
        if not (self.cancelled or self._stopped) and self._stop is not None:
            self._stopped = self._stop()
        return self.cancelled or self._stopped

    def cancel(self) -> None:
        """Request the end of the computation."""
        self.cancelled = True

    def __enter__(self) -> Self:
        """Catch the signals that would raise KeyboardInterrupt."""
        if threading.current_thread() is threading.main_thread():
            self._caught = [number for number in _SIGNALS if signal.getsignal(number) is signal.default_int_handler]
        for number in self._caught:
            signal.signal(number, self._catch)
        return self

    def __exit__(self, *error: object) -> None:
        """Leave the signals as they were."""
        for number in self._caught:
            signal.signal(number, signal.default_int_handler)

    def _catch(self, number: int, frame: FrameType | None) -> None:
        if self.cancelled:
            raise KeyboardInterrupt
        self.cancel()


@contextmanager
def signals_interrupt() -> Iterator[None]:
    """Let SIGTERM raise KeyboardInterrupt, as Ctrl-C does; leave the signals as they were at the end."""
    main = threading.current_thread() is threading.main_thread()
    former = {each: signal.signal(each, signal.default_int_handler) for each in _SIGNALS} if main else {}
    try:
        yield
    finally:
        for number, handler in former.items():
            signal.signal(number, handler)
