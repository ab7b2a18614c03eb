"""The frame of commands that make a study of many runs: a bar, Ctrl-C, a figure, a summary."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from finger_pin.cancellation import CancelToken, Stop
from finger_pin.commands.console import noted, print_text, runs_bar, talks

if TYPE_CHECKING:
    import xarray as xr

    from finger_pin.studies.records import Progress


def conduct(
    what: str,
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
    """Make a study, draw it and print its summary; return its result.

    Args:
        what: Word before the progress bar.
        run: Makes it, with what takes its progress and what says that it is to stop.
        summary: Of its result.
        figure: Name of the file, and after ``plot_`` of what draws it.
        output: Folder of the study.
        figures: Whether to draw.
        format: Of the figure.
        quiet: Whether to print nothing.
        unfinished: Whether a result that was interrupted lacks something.

    Raises:
        KeyboardInterrupt: After all that, if it was interrupted.
    """
    shown = talks(quiet)
    token = CancelToken()
    with noted("the same command continues from what is recorded"):
        with runs_bar(shown, what) as progress, token:
            result = run(progress, token)
        if figures and not token.cancelled:
            from finger_pin.views import plots

            plots.save_figure(getattr(plots, f"plot_{figure}")(result), output / "figures" / figure, format)
        if not quiet:
            print_text(f"{summary(result)}\n\nResults are in {output}")
        if token.cancelled and unfinished(result):
            raise KeyboardInterrupt
    return result
