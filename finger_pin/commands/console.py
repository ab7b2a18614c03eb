"""A simulation at a terminal: signals that stop it, a progress bar, and output to a pipe that may be closed."""

from __future__ import annotations

import logging
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, Self

import typer

from finger_pin.exceptions import FingerPinError, InputError


class Unsuccessful(FingerPinError):
    """Runs were made, and none of them serves."""


class Interrupts:
    """SIGINT and SIGTERM, while entered.

    In a patient phase the first of them sets `requested`. Every other one raises KeyboardInterrupt.

    Attributes:
        requested: Whether an end has been asked for; patient phases check it.
    """

    def __init__(self) -> None:
        """Begin without a request."""
        self.requested = False
        self._patient = False

    @contextmanager
    def patient(self) -> Iterator[None]:
        """Enter a patient phase."""
        self._patient = True
        try:
            yield
        finally:
            self._patient = False

    def __enter__(self) -> Self:
        """Catch the signals."""
        self._former = {number: signal.signal(number, self._catch) for number in (signal.SIGINT, signal.SIGTERM)}
        return self

    def __exit__(self, *error: object) -> None:
        """Leave the signals as they were."""
        for number, handler in self._former.items():
            signal.signal(number, handler)

    def _catch(self, number: int, frame: FrameType | None) -> None:
        if self.requested or not self._patient:
            raise KeyboardInterrupt
        self.requested = True


@contextmanager
def bar(shown: bool, *texts: str, **fields: Any) -> Iterator[Callable[..., None]]:
    """Show a bar on standard error if asked, between two texts and times, and give a function that sets its fields.

    Args:
        shown: Whether to show it.
        texts: Before the bar and after it, with fields of ``task``.
        fields: Those of its task at first, ``total`` among them.
    """
    if not shown:
        yield lambda **fields: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TimeElapsedColumn, TimeRemainingColumn

    before, after = texts
    columns = (before, BarColumn(), after, TimeElapsedColumn(), "so far, left", TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task, total = progress.add_task("", **fields), fields["total"]

        def show(**fields: Any) -> None:
            nonlocal total
            # What was finished before there was a total took no time: the time that is left does not follow from it.
            change = progress.reset if total is None else progress.update
            total = fields.get("total", total)
            change(task, **fields)

        yield show


@contextmanager
def progress_bar(shown: bool, duration: float) -> Iterator[Callable[[float], None] | None]:
    """Show a bar if asked, and give a function that takes the simulated time, s, out of a duration, s, or None."""
    with bar(shown, "", "{task.completed:.3f} of {task.total:g} s simulated", total=duration) as show:
        yield (lambda time: show(completed=time)) if shown else None


@contextmanager
def count_bar(shown: bool, total: int) -> Iterator[Callable[[int], None]]:
    """Show a bar if asked, and give a function that takes the number of further runs that are finished."""
    with bar(shown, "", "{task.completed} of {task.total} runs", total=total) as show:
        yield lambda further: show(advance=further)


@contextmanager
def runs_bar(shown: bool, what: str) -> Iterator[Callable[[int, int, int], None] | None]:
    """Show a bar if asked, and give a function that takes the numbers of finished, failed and all runs, or None."""
    with bar(shown, what, "{task.completed} of {task.total} runs{task.fields[note]}", total=None, note="") as show:

        def count(finished: int, failed: int, total: int) -> None:
            show(completed=finished, total=total, note=f", {failed} failed" if failed else "")

        yield count if shown else None


def complain(program: str, message: str) -> None:
    """Print one line on standard error."""
    print(f"{program}:", "".join(c if c.isprintable() else repr(c)[1:-1] for c in message), file=sys.stderr)


@contextmanager
def noted(note: str) -> Iterator[None]:
    """Add a note to any exception raised meanwhile, such as the folder of finished work."""
    try:
        yield
    except BaseException as error:
        if not isinstance(error, InputError | Unsuccessful | typer.TyperException):
            error.add_note(note)
        raise


def talks(quiet: bool) -> bool:
    """Return whether to show progress; without it the package's log is kept silent up to errors."""
    shown = sys.stderr.isatty() and not quiet
    if not shown:
        logging.getLogger("finger_pin").setLevel(logging.ERROR)
    return shown


def print_text(text: str) -> None:
    """Print to standard output, which may be closed and whose encoding may lack characters."""
    encoding = sys.stdout.encoding or "utf-8"
    try:
        print(text.encode(encoding, "backslashreplace").decode(encoding), flush=True)
    except OSError as error:
        # Python flushes standard output once more at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            print(f"standard output cannot be written: {error.strerror}", file=sys.stderr)
