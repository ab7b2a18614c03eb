"""Terminal output: progress bars, errors, and text to a pipe that may be closed."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager

import typer

from finger_pin.exceptions import FingerPinError, InputError


class Unsuccessful(FingerPinError):
    """Raised when no run of a study is usable."""


@contextmanager
def bar(visible: bool, unit: str, total: float | None = None) -> Iterator[Callable[..., None]]:
    """Show a progress bar on standard error if asked, and give the function that moves it (`ProgressBar`)."""
    if not visible:
        yield lambda *numbers, **texts: None
        return
    from finger_pin.progress import ProgressBar

    with closing(ProgressBar(unit, total)) as update:
        yield update


@contextmanager
def progress_bar(visible: bool, duration: float) -> Iterator[Callable[[float], None] | None]:
    """Show a bar if asked, and give a function that takes the simulated time, s, out of a duration, s, or None."""
    with bar(visible, "s", duration) as update:
        yield update if visible else None


@contextmanager
def count_bar(visible: bool, total: int) -> Iterator[Callable[[int], None]]:
    """Show a bar if asked, and give a function that takes the number of further runs that are finished."""
    finished = 0
    with bar(visible, "runs", total) as update:

        def advance(new_runs: int) -> None:
            nonlocal finished
            finished += new_runs
            update(finished)

        yield advance


@contextmanager
def runs_bar(visible: bool, label: str) -> Iterator[Callable[[int, int, int], None] | None]:
    """Show a bar if asked, and give a function that takes the numbers of finished, failed and all runs, or None."""
    with bar(visible, "runs") as update:

        def count(finished: int, failed: int, total: int) -> None:
            update(finished, total, text=label, note=f"{failed} failed" if failed else "")

        yield count if visible else None


def print_error(program: str, message: str) -> None:
    """Print one line on standard error."""
    print(f"{program}:", "".join(c if c.isprintable() else repr(c)[1:-1] for c in message), file=sys.stderr)


@contextmanager
def error_note(note: str) -> Iterator[None]:
    """Add a note to any exception raised meanwhile, such as the folder of finished work."""
    try:
        yield
    except BaseException as error:
        if not isinstance(error, InputError | Unsuccessful | typer.TyperException):
            error.add_note(note)
        raise


def shows_progress(quiet: bool) -> bool:
    """Return whether to show progress; without it the package's log is kept silent up to errors."""
    visible = sys.stderr.isatty() and not quiet
    if not visible:
        logging.getLogger("finger_pin").setLevel(logging.ERROR)
    return visible


def print_text(text: str) -> None:
    """Print to standard output, tolerating a closed pipe and a limited encoding."""
    encoding = sys.stdout.encoding or "utf-8"
    try:
        print(text.encode(encoding, "backslashreplace").decode(encoding), flush=True)
    except OSError as error:
        # Python flushes standard output again at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            print(f"standard output cannot be written: {error.strerror}", file=sys.stderr)
