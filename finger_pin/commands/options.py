"""Arguments and options of several commands, and the readers of their text."""

from __future__ import annotations

import hashlib
import logging
import re
import tomllib
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from finger_pin.version import installing

# A string without quotes: it begins like a name or a path, and holds nothing that has a meaning in TOML.
_BARE_STRING = re.compile(r"(?:[^\W\d]|/|~|\.{1,2}/)[^\"'\[\]{}=,#\x00-\x1f\x7f]*")

# Tables that the name of a folder leaves out: what stands in them has other names than what stands elsewhere.
_OUTER = re.compile(r"^(?:controller|finger|simulation)\.")
_LONGEST = 60
# How long a scheduler is tried to be reached, s.
_PATIENCE = 10.0

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


def wrong(option: str, allowed: str) -> typer.TyperException:
    """Return the error of an option."""
    return typer.TyperException(f"{option}: {allowed}")


def refuse_format(figures: bool, format: str | None) -> None:
    """Refuse a format of figures that are not drawn."""
    if format is not None and not figures:
        raise wrong("--format", "has no effect with --no-figures")


def overrides(settings: list[str], **short: str | None) -> dict[str, Any]:
    """Return overrides of `load_scenario` from texts KEY=VALUE, the value in TOML or a string without quotes.

    Args:
        settings: Of ``--set``.
        short: By the name of a short option for an entry of ``simulation``, its text.

    Raises:
        TyperException: If a text is none, or an entry is set twice.
    """
    entries = {}
    for text in settings:
        key, equals, value = text.partition("=")
        if not equals or not key.strip():
            raise wrong("--set", f"{text}: must be KEY=VALUE, such as controller.gain=2")
        if key.strip() in entries:
            raise wrong("--set", f"{text}: an earlier one sets the same entry")
        entries[key.strip()] = _value(key.strip(), value)
    short_entries = {f"simulation.{name}": text for name, text in short.items() if text is not None}
    if twice := [key for key in short_entries if key in entries]:
        raise wrong("--set", f"{twice[0]}: --{twice[0].rpartition('.')[2]} sets the same entry")
    return entries | {key: _value(key, text) for key, text in short_entries.items()}


def _value(key: str, text: str) -> Any:
    text = text.strip()
    try:
        table = tomllib.loads(f"value = {text}")
        if table.keys() == {"value"}:
            return table["value"]
    except (ValueError, RecursionError):
        if _BARE_STRING.fullmatch(text):
            return text
    raise wrong(key, f"{text[:80]}: must be TOML, such as 2.0, true, [1, 2] or a name")


def pool(workers: int | None, scheduler: str | None) -> AbstractContextManager[Executor]:
    """Return the executor of a study's runs, open while entered: threads, or the workers of a Dask scheduler.

    Raises:
        InputError: If there are no workers; and, as it is entered, if the scheduler cannot be reached.
    """
    if scheduler is not None:
        if workers is not None:
            raise wrong("--workers", "are local; those of a scheduler are its own")
        return _dask(scheduler)
    from finger_pin.core.threads import usable_cores

    if workers is not None and workers < 1:
        raise wrong("--workers", f"must be at least 1, not {workers}")
    return ThreadPoolExecutor(workers or usable_cores())


@contextmanager
def _dask(address: str) -> Iterator[Executor]:
    try:
        distributed: Any = import_module("distributed")
    except ImportError:
        raise wrong("--scheduler", f"needs Dask: {installing('dask')}") from None
    # An error says what the client would log about a lost scheduler.
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    try:
        client = distributed.Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        what = f"{address}: cannot be reached: {str(error) or type(error).__name__}"
        raise wrong("--scheduler", what) from None
    with client:
        yield client.get_executor(pure=False)


def numbers(option: str, text: str) -> list[float]:
    """Return the finite numbers of a text with commas between."""
    return [number(option, each) for each in text.split(",")]


def number(option: str, text: str | float, *, positive: bool = False) -> float:
    """Return a finite number, above zero if asked."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not abs(value) < float("inf"):
        raise wrong(option, f"{text}: must be a finite number")
    if positive and not value > 0.0:
        raise wrong(option, f"{text}: must be above 0")
    return value


def folder_name(name: str, *variants: str) -> str:
    """Return the name of a folder for a scenario and its changes.

    Args:
        name: Of the scenario, or of a study on it.
        variants: Such as ``controller.gain=2``. What a shell would want to have quoted is replaced; what is
            too long, or lost that way, is told apart by a digest.
    """
    unquoted = [re.sub(r"[\s\[\]{}\"']", "", each) for each in variants]
    words = [_OUTER.sub("", each).replace("=", "-").replace(":", "to").replace(",", "_") for each in unquoted]
    text = "-".join([name, *words])
    plain = re.sub(r"[^\w.+-]+", "_", text, flags=re.ASCII)
    if plain == text and len(text) <= _LONGEST:
        return text
    return f"{plain[:_LONGEST]}-{hashlib.sha256(','.join(unquoted).encode(errors='surrogateescape')).hexdigest()[:6]}"
