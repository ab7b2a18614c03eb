"""Ctrl-C in a script or notebook: a run ends where it is, and what it has computed is kept."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType
from typing import TYPE_CHECKING, TypeVar

from finger_pin.core.stepping.textbook import Stop
from finger_pin.exceptions import Interrupted, InterruptedByKeyboard
from finger_pin.simulation.run_arrays import RunArrays

if TYPE_CHECKING:
    import xarray as xr

Found = TypeVar("Found", "xr.Dataset", RunArrays)


def interruptible(run: Callable[[Stop], Found], stop: Stop | None) -> Found:
    """Return what a run returns, given what it asks whether it is to stop: after Ctrl-C, or when the caller says so.

    A second Ctrl-C ends at once, without a result. Where others than Python handle the signal, such as a command of
    this package, and in threads, which get none, it is theirs.

    Args:
        run: The run.
        stop: The caller's own.

    Raises:
        InterruptedByKeyboard: After Ctrl-C, with what the run has computed.
    """
    asked = stop or (lambda: False)
    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        return run(asked)
    pressed = False

    def catch(number: int, frame: FrameType | None) -> None:
        nonlocal pressed
        if pressed:
            raise KeyboardInterrupt
        pressed = True

    signal.signal(signal.SIGINT, catch)
    try:
        found = run(lambda: pressed or asked())
    except Interrupted as error:
        if pressed:
            raise InterruptedByKeyboard(error.time, error.result) from None
        raise
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if pressed:
        # It came after the last step.
        whole = found.dataset() if isinstance(found, RunArrays) else found
        raise InterruptedByKeyboard(float(found.attrs["end_time"]), whole)
    return found
