"""Figures drawn by a process of its own, which gets ready while the simulation runs."""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from finger_pin.commands.imports import undocumented, without
from finger_pin.exceptions import FingerPinError

if TYPE_CHECKING:
    import xarray as xr

    from finger_pin.simulation.recorded import Recording

#: An error number, and what went wrong; (0, "") if nothing did.
Answer = tuple[int, str]

# Where a process can safely be copied, the one that draws has what this one has imported.
_COPIED = sys.platform == "linux"
_CONTEXT: Any = multiprocessing.get_context("fork" if _COPIED else "spawn")


class NotDrawn(FingerPinError):
    """Figures or animation cannot be drawn; the data are kept."""


class Drawing:
    """The process that draws. It is killed when the ``with`` statement ends.

    Attributes:
        process: The process.
    """

    def __enter__(self) -> Self:
        """Start the process."""
        self._pipe, theirs = _CONTEXT.Pipe()
        self.process = _CONTEXT.Process(target=_serve, args=(theirs, self._pipe))
        self.process.start()
        theirs.close()
        return self

    def __exit__(self, *error: object) -> None:
        """End the process."""
        self.stop()
        self.process.join()
        self._pipe.close()

    def stop(self) -> None:
        """Draw no more: nothing is written after this."""
        with suppress(ProcessLookupError):
            if hasattr(os, "killpg") and self.process.pid is not None:
                # With the copies of itself that it may have made.
                os.killpg(self.process.pid, signal.SIGKILL)
        self.process.kill()

    def start(self, result: Recording | xr.Dataset, folder: Path) -> None:
        """Have the figures of a result drawn into a folder."""
        with suppress(BrokenPipeError):  # `wait` reports why it ended.
            self._pipe.send((result, folder.absolute()))

    def wait(self) -> None:
        """Wait until the figures are drawn.

        Raises:
            OSError: If they cannot be written.
            NotDrawn: If they cannot be drawn.
        """
        try:
            number, text = self._pipe.recv()
        except (EOFError, ConnectionResetError):
            number, text = 0, "the process that draws was killed"
        if number:
            raise OSError(number, os.strerror(number))
        if text:
            raise NotDrawn(text)


def _serve(pipe: Connection, other: Connection) -> None:
    """Draw the figures of the result that comes through a pipe, and answer an error number and a text."""
    # Its copy of the other end would keep the pipe open when the process that started it is no more.
    other.close()
    if hasattr(os, "setsid"):
        # In a session of its own it gets no interrupt from the terminal; only the process that started it does.
        os.setsid()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)
    # It lives too shortly for garbage.
    gc.disable()
    try:
        with without("dask", "xarray"), undocumented():
            from finger_pin.simulation.recorded import Recording
            from finger_pin.views.plots import saving
        given, folder = pipe.recv()
        result = given.dataset() if isinstance(given, Recording) else given
    except EOFError:
        return
    except Exception as error:
        pipe.send(_told(error))
        return
    pipe.send(_drawn_side_by_side(partial(saving.draw_all, result, folder), list(saving.figures_of(result))))


def _told(error: Exception) -> Answer:
    # Some libraries have negative numbers of their own.
    return max(getattr(error, "errno", None) or 0, 0), f"{type(error).__name__}: {error}"


def _drawn_side_by_side(draw: Callable[[list[str]], object], names: list[str]) -> Answer:
    """Draw figures, each in a copy of this process of its own where there are copies: they take unlike times."""

    def drawn(own: list[str]) -> Answer:
        try:
            draw(own)
        except Exception as error:
            return _told(error)
        return 0, ""

    alone = names[:1] if _COPIED else names
    others = []
    for name in names[len(alone) :]:
        ours, theirs = _CONTEXT.Pipe(duplex=False)
        other = _CONTEXT.Process(target=lambda pipe, name: pipe.send(drawn([name])), args=(theirs, name))
        other.start()
        theirs.close()
        others.append((other, ours))
    answers = [drawn(alone)]
    for other, ours in others:
        try:
            answers.append(ours.recv())
        except EOFError:
            answers.append((0, "a process that draws was killed"))
        other.join()
    return next((each for each in answers if each != (0, "")), (0, ""))
