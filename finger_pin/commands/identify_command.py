"""The command identify: find the numbers of a scenario in recordings, with intervals."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from finger_pin.cancellation import CancelToken
from finger_pin.commands.console import bar, error_note, print_text, shows_progress
from finger_pin.commands.options import Quiet, Restart, Settings, folder_name, overrides


def identify(
    bench: Annotated[str, typer.Argument(metavar="BENCH", help="Name of a bench, or path of a .toml file.")],
    settings: Settings = [],  # noqa: B006
    starts: Annotated[int, typer.Option(min=1, metavar="N", help="From how many points to search.")] = 3,
    seed: Annotated[int, typer.Option(min=0, metavar="S", help="Of those points.")] = 0,
    robust: Annotated[bool, typer.Option("--robust", help="Let outliers count less.")] = False,
    profiles: Annotated[
        bool, typer.Option(help="Whether intervals follow the likelihood, or only its curvature, which is faster.")
    ] = True,
    refits: Annotated[
        bool, typer.Option(help="Whether refits without each recording or load judge bands, and open combinations.")
    ] = True,
    output: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where results go; default results/identify-<bench>.")
    ] = None,
    restart: Restart = False,
    quiet: Quiet = False,
    listed: Annotated[bool, typer.Option("--list", help="List the benches that ship, and exit.")] = False,
) -> None:
    """Find the numbers of a scenario in recordings, with intervals.

    BENCH has a table [identify]: which numbers, and which columns of which files. The same command again goes on where
    an earlier one was interrupted. For example: identify transmission
    """
    from finger_pin.identification.identify import identify

    if listed:
        from finger_pin.description.tables import list_benches

        print_text("\n".join(["Benches", *(f"  {name:18}{title}" for name, title in list_benches().items())]))
        return
    changes = overrides(settings)
    folder = output or Path("results", folder_name(f"identify-{Path(bench).stem}", *settings))
    token = CancelToken()
    with error_note("the same command goes on from what is finished"):
        with _progress(shows_progress(quiet)) as progress, token:
            result = identify(
                bench,
                overrides=changes,
                output=folder,
                starts=starts,
                seed=seed,
                loss="soft_l1" if robust else "linear",
                profiles=profiles,
                refits=refits,
                restart=restart,
                progress=progress,
                stop=token,
            )
        from finger_pin.views.report import summarize_identification, write_report

        write_report(result, folder / "identification.html")
        if not quiet:
            print_text(f"{summarize_identification(result)}\n\nResults are in {folder}")
        if "unfinished" in result.attrs:
            raise KeyboardInterrupt


@contextmanager
def _progress(visible: bool) -> Iterator[Callable[[str, int, int], None]]:
    """Show a bar if asked, and yield a function of the name of a piece of work, the finished part, and its size."""
    with bar(visible, "pieces") as show:
        yield lambda label, done, total: show(done, total, text=label)
