"""Ctrl-C in a script or notebook: the run ends, and its result so far is kept."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType
from typing import Self, TypeVar

import xarray as xr

from finger_pin.core.stepping.trajectory import Stop
from finger_pin.exceptions import Interrupted
from finger_pin.simulation.recording import RunArrays

Found = TypeVar("Found", "xr.Dataset", RunArrays)


class CtrlC:
    """Ctrl-C while entered: a `Stop` that is due once it is pressed, or with the caller's own stop.

    A second Ctrl-C ends at once, without a result. Where others than Python handle the signal, such as a command of
    this package, and in threads, which get none, it is theirs.

    Attributes:
        pressed: Whether it was.
    """

    def __init__(self, stop: Stop | None = None) -> None:
        """Take the caller's own."""
        self.pressed, self._own, self._caught = False, stop or (lambda: False), False

    def __call__(self) -> bool:
        """Return whether to end."""
        return self.pressed or self._own()

    def __enter__(self) -> Self:
        """Catch the signal, if it is Python's."""
        main = threading.current_thread() is threading.main_thread()
        self._caught = main and signal.getsignal(signal.SIGINT) is signal.default_int_handler
        if self._caught:
            signal.signal(signal.SIGINT, self._catch)
        return self

    def __exit__(self, *error: object) -> None:
        """Leave the signal as it was."""
        if self._caught:
            signal.signal(signal.SIGINT, signal.default_int_handler)

    def _catch(self, number: int, frame: FrameType | None) -> None:
        if self.pressed:
            raise KeyboardInterrupt
        self.pressed = True


def interruptible(run: Callable[[Stop], Found], stop: Stop | None) -> Found:
    """Return the result of a run that Ctrl-C or a `Stop` can end.

    Raises:
        Interrupted: After Ctrl-C or such a stop, with what the run has computed.
    """
    with CtrlC(stop) as asked:
        found = run(asked)
    if asked.pressed:
        # It came after the last step.
        whole = found.dataset() if isinstance(found, RunArrays) else found
        raise Interrupted(float(found.attrs["end_time"]), whole)
    return found
