"""Arguments and options of several commands, parsers of their texts, and how commands run a study."""

from __future__ import annotations

import hashlib
import logging
import re
import tomllib
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from finger_pin.cancellation import CancelToken, Stop
from finger_pin.commands.console import error_note, print_text, runs_bar, shows_progress
from finger_pin.version import installing

if TYPE_CHECKING:
    import xarray as xr

    from finger_pin.studies.records import Progress

# A string without quotes: it begins like a name or a path, and holds nothing that has a meaning in TOML.
_BARE_STRING = re.compile(r"(?:[^\W\d]|/|~|\.{1,2}/)[^\"'\[\]{}=,#\x00-\x1f\x7f]*")

# Tables that the name of a folder leaves out: what stands in them has other names than what stands elsewhere.
_OMITTED_TABLES = re.compile(r"^(?:controller|finger|simulation)\.")
_MAX_NAME_LENGTH = 60
# How long a scheduler is tried to be reached, s.
_CONNECTION_TIMEOUT = 10.0

ScenarioName = Annotated[str, typer.Argument(metavar="SCENARIO", help="Name, or path of a .toml file.")]
Settings = Annotated[list[str], typer.Option("--set", metavar="KEY=VALUE", help="Override an entry; repeatable.")]
Output = Annotated[Path, typer.Option(metavar="DIR", help="Where results go.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Print errors only.")]
Figures = Annotated[bool, typer.Option(help="Draw the figures.")]
Format = Annotated[
    Literal["png", "pdf", "svg"] | None, typer.Option(help="Format of the figures; default png.", show_default=False)
]
Workers = Annotated[int | None, typer.Option(metavar="N", help="Threads; default one per core.")]
Scheduler = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Run on the Dask cluster of a scheduler, such as tcp://host:8786.")
]
Restart = Annotated[bool, typer.Option("--restart", help="Drop the records of a study in the folder, and begin anew.")]


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


def invalid(option: str, allowed: str) -> typer.TyperException:
    """Return the error of an option."""
    return typer.TyperException(f"{option}: {allowed}")


def refuse_format(figures: bool, format: str | None) -> None:
    """Refuse a format of figures that are not drawn."""
    if format is not None and not figures:
        raise invalid("--format", "has no effect with --no-figures")


def pairs(option: str, texts: list[str], form: str) -> dict[str, str]:
    """Return the texts on both sides of the first equals sign of each text of a repeatable option.

    Args:
        option: Its name.
        texts: Such as ``KEY=VALUE``.
        form: What a text must be, in words.

    Raises:
        TyperException: If a text is wrong, or two begin alike.
    """
    values: dict[str, str] = {}
    for text in texts:
        key, equals, value = text.partition("=")
        if not equals or not key.strip():
            raise invalid(option, f"{text}: must be {form}")
        if key.strip() in values:
            raise invalid(option, f"{text}: an earlier one sets the same entry")
        values[key.strip()] = value
    return values


def overrides(settings: list[str], **short_options: str | None) -> dict[str, Any]:
    """Return overrides of `load_scenario` from texts KEY=VALUE, the value in TOML or a string without quotes.

    Args:
        settings: Texts of ``--set``.
        short_options: Texts of short options for entries of ``simulation``, by name.

    Raises:
        TyperException: If a text is wrong, or an entry is set twice.
    """
    texts = pairs("--set", settings, "KEY=VALUE, such as controller.gain=2")
    entries = {key: _parse_value(key, value) for key, value in texts.items()}
    short_entries = {f"simulation.{name}": text for name, text in short_options.items() if text is not None}
    if repeated := [key for key in short_entries if key in entries]:
        raise invalid("--set", f"{repeated[0]}: --{repeated[0].rpartition('.')[2]} sets the same entry")
    return entries | {key: _parse_value(key, text) for key, text in short_entries.items()}


def _parse_value(key: str, text: str) -> Any:
    text = text.strip()
    try:
        table = tomllib.loads(f"value = {text}")
        if table.keys() == {"value"}:
            return table["value"]
    except (ValueError, RecursionError):
        if _BARE_STRING.fullmatch(text):
            return text
    raise invalid(key, f"{text[:80]}: must be TOML, such as 2.0, true, [1, 2] or a name")


def open_pool(workers: int | None, scheduler: str | None) -> AbstractContextManager[Executor]:
    """Return the executor of a study's runs, open while entered: threads, or the workers of a Dask scheduler."""
    if scheduler is not None:
        if workers is not None:
            raise invalid("--workers", "are local; those of a scheduler are its own")
        return _dask(scheduler)
    from finger_pin.threads import usable_cores

    if workers is not None and workers < 1:
        raise invalid("--workers", f"must be at least 1, not {workers}")
    return ThreadPoolExecutor(workers or usable_cores())


@contextmanager
def _dask(address: str) -> Iterator[Executor]:
    try:
        distributed: Any = import_module("distributed")
    except ImportError:
        raise invalid("--scheduler", f"needs Dask: {installing('dask')}") from None
    # The error reports what the client would log about a lost scheduler.
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    try:
        client = distributed.Client(address, timeout=_CONNECTION_TIMEOUT, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        problem = f"{address}: cannot be reached: {str(error) or type(error).__name__}"
        raise invalid("--scheduler", problem) from None
    with client:
        yield client.get_executor(pure=False)


def numbers(option: str, text: str) -> list[float]:
    """Return the finite numbers of a text with commas between."""
    return [number(option, part) for part in text.split(",")]


def number(option: str, text: str | float, *, positive: bool = False) -> float:
    """Return a finite number, above zero if asked."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not abs(value) < float("inf"):
        raise invalid(option, f"{text}: must be a finite number")
    if positive and not value > 0.0:
        raise invalid(option, f"{text}: must be above 0")
    return value


def folder_name(name: str, *variants: str) -> str:
    """Return the name of a folder for a scenario and its changes.

    Args:
        name: Name of the scenario, or of a study on it.
        variants: Changes such as ``controller.gain=2``. Characters that a shell would need quoted are replaced; names
            that are too long, or changed that way, end with a digest.
    """
    unquoted = [re.sub(r"[\s\[\]{}\"']", "", each) for each in variants]
    words = [_OMITTED_TABLES.sub("", each).replace("=", "-").replace(":", "to").replace(",", "_") for each in unquoted]
    text = "-".join([name, *words])
    ascii_text = re.sub(r"[^\w.+-]+", "_", text, flags=re.ASCII)
    if ascii_text == text and len(text) <= _MAX_NAME_LENGTH:
        return text
    digest = hashlib.sha256(",".join(unquoted).encode(errors="surrogateescape")).hexdigest()[:6]
    return f"{ascii_text[:_MAX_NAME_LENGTH]}-{digest}"
