"""Figures drawn by a process of their own, which gets ready while the simulation runs.

Run as a module it is that process: it takes a result and a folder from standard input, pickled, and answers on standard
output what went wrong.
"""

from __future__ import annotations

import gc
import json
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Self

from finger_pin.commands.imports import without
from finger_pin.exceptions import FingerPinError

if TYPE_CHECKING:
    import xarray as xr

#: An error number, and what went wrong; (0, "") if nothing did.
Answer = tuple[int, str]


class NotDrawn(FingerPinError):
    """Figures or animation cannot be drawn; the data are kept."""


class Drawing:
    """The process that draws. It is killed when the ``with`` statement ends.

    Attributes:
        process: The process.
    """

    def __enter__(self) -> Self:
        """Start the process."""
        pipe = subprocess.PIPE
        command = [sys.executable, "-P", "-m", __name__]
        # In a session of its own it gets no interrupt from the terminal; only the process that started it does.
        self.process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, start_new_session=True)
        return self

    def __exit__(self, *error: object) -> None:
        """End the process."""
        self.stop()
        self.process.communicate()

    def stop(self) -> None:
        """Draw no more: nothing is written after this."""
        with suppress(ProcessLookupError):
            if hasattr(os, "killpg"):
                # With the copies of itself that it may have made.
                os.killpg(self.process.pid, signal.SIGKILL)
            self.process.kill()

    def start(self, result: xr.Dataset, folder: Path) -> None:
        """Have the figures of a result drawn into a folder."""
        assert self.process.stdin is not None
        with suppress(BrokenPipeError):  # `wait` reports why it ended.
            pickle.dump((result, folder.absolute()), self.process.stdin, pickle.HIGHEST_PROTOCOL)
            self.process.stdin.flush()

    def wait(self) -> None:
        """Wait until the figures are drawn.

        Raises:
            OSError: If they cannot be written.
            NotDrawn: If they cannot be drawn.
        """
        assert self.process.stdout is not None and self.process.stderr is not None
        # Its answer is enough; its end takes a while.
        answer = self.process.stdout.readline()
        if answer:
            number, text = json.loads(answer)
        else:
            number, text = (
                0,
                (self.process.stderr.read().decode(errors="replace").strip().splitlines() or ["killed"])[-1],
            )
        if number:
            raise OSError(number, os.strerror(number))
        if text:
            raise NotDrawn(text)


def serve() -> None:
    """Draw the figures of the result that standard input gives, and answer an error number and a text."""
    # It lives too shortly for garbage.
    gc.disable()
    with without("dask", "xarray"):
        from finger_pin.views.plots import saving
    with suppress(EOFError):
        result, folder = pickle.load(sys.stdin.buffer)
        names = list(saving.figures_of(result))
        print(json.dumps(_drawn_side_by_side(partial(saving.draw_all, result, folder), names)), flush=True)


def _drawn_side_by_side(draw: Callable[[list[str]], object], names: list[str]) -> Answer:
    """Draw figures, each in a copy of this process where there are copies."""

    def drawn(own: list[str]) -> Answer:
        try:
            draw(own)
        except Exception as error:
            # Some libraries have negative numbers of their own.
            return max(getattr(error, "errno", None) or 0, 0), f"{type(error).__name__}: {error}"
        return 0, ""

    if "fork" not in multiprocessing.get_all_start_methods():
        return drawn(names)
    context = multiprocessing.get_context("fork")
    others = []
    for name in names[1:]:
        ours, theirs = context.Pipe(duplex=False)
        other = context.Process(target=lambda pipe, own: pipe.send(drawn(own)), args=(theirs, [name]))
        other.start()
        theirs.close()
        others.append((other, ours))
    answers = [drawn(names[:1])]
    for other, ours in others:
        try:
            answers.append(ours.recv())
        except EOFError:
            answers.append((0, "a process that draws was killed"))
        other.join()
    return next((each for each in answers if each != (0, "")), (0, ""))


if __name__ == "__main__":
    serve()
