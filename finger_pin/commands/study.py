"""Common part of commands that run a study: a progress bar, Ctrl-C, a figure, a summary."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from finger_pin.cancellation import CancelToken, Stop
from finger_pin.commands.console import error_note, print_text, runs_bar, shows_progress

if TYPE_CHECKING:
    import xarray as xr

    from finger_pin.studies.records import Progress


def run_study(
    label: str,
    run: Callable[[Progress | None, Stop], xr.Dataset],
    summary: Callable[[xr.Dataset], str],
    figure: str,
    output: Path,
    *,
    figures: bool,
    format: str | None,
    quiet: bool,
    unfinished: Callable[[xr.Dataset], bool] = lambda result: True,
) -> xr.Dataset:
    """Run a study, draw it and print its summary; return its result.

    Args:
        label: Word before the progress bar.
        run: Function of the progress callback and the stop check that returns the result of the study.
        summary: Function that returns the summary of the result.
        figure: Name of the file, and after ``plot_`` of the function that draws it.
        output: Folder of the study.
        figures: Whether to draw.
        format: Of the figure.
        quiet: Whether to print nothing.
        unfinished: Function that returns whether an interrupted result lacks runs.

    Raises:
        KeyboardInterrupt: After all that, if it was interrupted.
    """
    visible = shows_progress(quiet)
    token = CancelToken()
    with error_note("the same command continues from what is recorded"):
        with runs_bar(visible, label) as progress, token:
            result = run(progress, token)
        if figures and not token.cancelled:
            from finger_pin.views import plots

            plots.save_figure(getattr(plots, f"plot_{figure}")(result), output / "figures" / figure, format)
        if not quiet:
            print_text(f"{summary(result)}\n\nResults are in {output}")
        if token.cancelled and unfinished(result):
            raise KeyboardInterrupt
    return result
