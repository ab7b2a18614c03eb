"""The command identify: find the numbers of a scenario in recordings, with intervals."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from finger_pin.cancellation import CancelToken
from finger_pin.commands.console import bar, noted, print_text, talks
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
        print_text(_listing())
        return
    changed = overrides(settings)
    folder = output or Path("results", folder_name(f"identify-{Path(bench).stem}", *settings))
    token = CancelToken()
    with noted("the same command goes on from what is finished"):
        with _progress(talks(quiet)) as progress, token:
            result = identify(
                bench,
                overrides=changed,
                output=folder,
                starts=starts,
                seed=seed,
                loss="soft_l1" if robust else "linear",
                profiles=profiles,
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


def _listing() -> str:
    from finger_pin.description.tables import list_benches

    return "\n".join(["Benches", *(f"  {name:18}{title}" for name, title in list_benches().items())])


@contextmanager
def _progress(shown: bool) -> Iterator[Callable[[str, int, int], None]]:
    """Show a bar if asked, and give a function that takes the piece of work, how much of it is done, and its size."""
    with bar(shown, "pieces") as show:
        yield lambda words, done, total: show(done, total, text=words)
