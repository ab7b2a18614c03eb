"""Results written and drawn by a process of its own, which gets ready while the simulation runs."""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import sys
from contextlib import nullcontext, suppress
from functools import partial
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any, Self

from finger_pin.commands.imports import undocumented, without
from finger_pin.exceptions import FingerPinError

if TYPE_CHECKING:
    import xarray as xr

    from finger_pin.simulation.recorded import Recording
    from finger_pin.simulation.results import ResultFolder

#: What went wrong: a file could not be written, or something else; "" if nothing did.
Trouble = OSError | str

# Where a process can safely be copied, the one that draws has what this one has imported.
_COPIED = sys.platform == "linux"
# More bytes than this are not sent.
_LARGE = 1e8
_CONTEXT: Any = multiprocessing.get_context("fork" if _COPIED else "spawn")


class NotDrawn(FingerPinError):
    """Figures or animation cannot be drawn; the data are kept."""


class Writing:
    """The process that writes and draws: it alone imports xarray and matplotlib.

    It is killed when the ``with`` statement ends.

    Attributes:
        process: The process.
    """

    def __init__(self, figures: bool, format: str | None = None) -> None:
        """Prepare to draw figures in a format, or to write the data alone."""
        self._figures, self._format = figures, format
        self._trouble: Trouble = ""

    def __enter__(self) -> Self:
        """Start the process."""
        self._begin()
        return self

    def _begin(self, *given: Any) -> None:
        self._pipe, theirs = _CONTEXT.Pipe()
        self.process = _CONTEXT.Process(target=_serve, args=(theirs, self._pipe, self._figures, self._format, *given))
        self.process.start()
        theirs.close()

    def __exit__(self, *error: object) -> None:
        """End the process."""
        self._end()

    def _end(self) -> None:
        self.stop()
        self.process.join()
        self._pipe.close()

    def stop(self) -> None:
        """Write and draw no more: nothing is written after this."""
        with suppress(ProcessLookupError):
            if hasattr(os, "killpg") and self.process.pid is not None:
                # With the copies of itself that it may have made.
                os.killpg(self.process.pid, signal.SIGKILL)
        self.process.kill()

    def start(self, result: Recording | xr.Dataset, folder: ResultFolder, drawn: bool = True) -> None:
        """Have a result written into the stage of a folder, and its figures beside it."""
        given = (result, folder, drawn)
        if _COPIED and result.nbytes > _LARGE:
            # A new copy of this process has it without a copy of it.
            self._end()
            self._begin(given)
            return
        with suppress(BrokenPipeError):  # `wait` reports why it ended.
            self._pipe.send(given)

    def written(self) -> str | None:
        """Wait until the data are written; return a summary, or None if the process could do neither.

        Raises:
            OSError: If they cannot be written.
        """
        self._trouble, summary = self._answer()
        if isinstance(self._trouble, OSError):
            raise self._trouble
        return None if self._trouble else summary

    def wait(self) -> None:
        """Wait until the figures are drawn, once the data are written.

        Raises:
            OSError: If they cannot be written.
            NotDrawn: If they cannot be drawn.
        """
        trouble = self._trouble or self._answer()[0]
        if isinstance(trouble, OSError):
            raise trouble
        if trouble:
            raise NotDrawn(trouble)

    def _answer(self) -> tuple[Trouble, str]:
        try:
            answer: tuple[Trouble, str] = self._pipe.recv()
            return answer
        except (EOFError, ConnectionResetError):
            return "the process that draws was killed", ""


def _serve(pipe: Connection, other: Connection, figures: bool, format: str | None, given: Any = None) -> None:
    """Write and draw the result that is given or comes through a pipe; answer twice, what went wrong and a summary."""
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
        with without("dask", "xarray"), undocumented() if figures else nullcontext():
            import netCDF4  # noqa: F401
            import xarray  # noqa: F401

            import finger_pin.simulation.results  # noqa: F401
            from finger_pin.simulation.recorded import as_dataset
            from finger_pin.views.summary import summarize

            if figures:
                from finger_pin.views.plots import saving
        recorded, folder, drawn = given or pipe.recv()
        result = as_dataset(recorded)
        names = list(saving.figures_of(result)) if figures and drawn else []
        draw = partial(saving.draw_all, result, folder.stage / "figures", format=format) if names else None
        begun = [_Copy(draw, name) for name in names] if _COPIED else []
        folder.write(result)
        pipe.send(("", summarize(result)))
    except EOFError:
        return
    except Exception as error:
        pipe.send((_told(error), ""))
        return
    troubles = [each.trouble() for each in begun] if _COPIED else [_tried(draw, names)]
    pipe.send((next(filter(None, troubles), ""), ""))


def _told(error: Exception) -> Trouble:
    return error if isinstance(error, OSError) else f"{type(error).__name__}: {error}"


def _tried(draw: Any, names: list[str]) -> Trouble:
    """Draw figures, and return what went wrong."""
    try:
        if names:
            draw(names)
    except Exception as error:
        return _told(error)
    return ""


class _Copy:
    """A copy of this process that draws one figure: figures take unlike times."""

    def __init__(self, draw: Any, name: str) -> None:
        self._pipe, theirs = _CONTEXT.Pipe(duplex=False)
        self._process = _CONTEXT.Process(target=lambda: theirs.send(_tried(draw, [name])))
        self._process.start()
        theirs.close()

    def trouble(self) -> Trouble:
        """Wait until it is drawn, and return what went wrong."""
        try:
            found: Trouble = self._pipe.recv()
        except EOFError:
            found = "a process that draws was killed"
        self._process.join()
        return found
