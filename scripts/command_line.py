"""Command lines whose errors are one line: what is wrong, what is allowed, and the nearest valid name."""

from __future__ import annotations

import argparse
import re
import sys
import tomllib
from collections.abc import Callable, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NoReturn

DONE, NOT_WRITTEN, WRONG_INPUT, FAILED, INTERRUPTED = 0, 1, 2, 3, 130
# A string without quotes: it begins like a name or a path, and holds nothing that has a meaning in TOML.
BARE_STRING = re.compile(r"(?:[^\W\d]|/|~|\.{1,2}/)[^\"'\[\]{}=,#\x00-\x1f\x7f]*")


class Parser(argparse.ArgumentParser):
    """A parser that complains in one line, and that knows what a misspelt option may have meant."""

    def error(self, message: str) -> NoReturn:
        """Print one line and exit."""
        complain(self.prog, message)
        self.exit(WRONG_INPUT)

    def read(self, arguments: Sequence[str] | None = None) -> argparse.Namespace:
        """Parse a command line, or exit."""
        options, surplus = self.parse_known_args(arguments)
        if surplus:
            wrong = next((each for each in surplus if each.startswith("-")), surplus[0])
            known = [name for action in self._actions for name in action.option_strings]
            positional = [f"one {action.metavar}" for action in self._actions if not action.option_strings]
            near = get_close_matches(wrong.split("=")[0], known, n=1)
            hint = f"; did you mean {near[0]}?" if near else ""
            self.error(f"{wrong}: no such argument; there are {', '.join([*positional, *known])}{hint}")
        return options


def number(text: str) -> float:
    """Parse a finite number."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not abs(value) < float("inf"):
        raise argparse.ArgumentTypeError(f"{text[:80]}: must be a finite number")
    return value


def positive(text: str) -> float:
    """Parse a finite number above zero."""
    value = number(text)
    if not value > 0.0:
        raise argparse.ArgumentTypeError(f"{text[:80]}: must be above 0")
    return value


def override(text: str) -> tuple[str, Any]:
    """Parse KEY=VALUE."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise argparse.ArgumentTypeError(f"{text}: must be KEY=VALUE, such as controller.gain=2")
    return shorthand(key.strip())(value)


def shorthand(key: str) -> Callable[[str], tuple[str, Any]]:
    """Return a parser of the VALUE of a key: TOML, or a string without quotes."""

    def parse_value(text: str) -> tuple[str, Any]:
        text = text.strip()
        try:
            table = tomllib.loads(f"value = {text}")
            if table.keys() == {"value"}:
                return key, table["value"]
        except (ValueError, RecursionError):
            if BARE_STRING.fullmatch(text):
                return key, text
        raise argparse.ArgumentTypeError(f"{key} = {text[:80]}: must be TOML, such as 2.0, true, [1, 2] or a name")

    return parse_value


def read_study(parser: Parser, arguments: Sequence[str] | None) -> argparse.Namespace:
    """Add what all studies of many runs take, and parse a command line, or exit."""
    add, flag = parser.add_argument, argparse.BooleanOptionalAction
    add("--set", action="append", default=[], type=override, metavar="KEY=VALUE", help="override an entry; repeatable")
    add("--workers", type=int, metavar="N", help="processes; default one per core")
    add("--scheduler", metavar="ADDRESS", help="run on the Dask cluster of this scheduler, such as tcp://host:8786")
    add("--restart", action="store_true", help="drop what the folder holds of a study, and begin anew")
    add("--figures", action=flag, default=True, help="draw the figure")
    add("--quiet", action="store_true", help="print errors only")
    options = parser.read(arguments)
    if options.scheduler is not None and options.workers is not None:
        parser.error("--workers: are local; those of a scheduler are its own")
    return options


def tell_compilation() -> None:
    """Say that the first run ever takes its time."""
    from finger_pin.core.compilation import is_cached

    if not is_cached():
        print("Compiling the model, once for this version: about half a minute ...", file=sys.stderr)


def complain(program: str, message: str) -> None:
    """Print one line on standard error."""
    print(f"{program}:", "".join(c if c.isprintable() else repr(c)[1:-1] for c in message), file=sys.stderr)


def told(program: str, error: Exception, output: Path) -> int:
    """Tell in one line what stopped a script whose results go to a folder; return the exit code."""
    from finger_pin.exceptions import InputError

    if isinstance(error, OSError):
        complain(program, f"--output = {output}: cannot be written: {error.strerror or error}")
        return NOT_WRITTEN
    complain(program, str(error))
    return WRONG_INPUT if isinstance(error, InputError) else FAILED
