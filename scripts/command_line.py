"""What the scripts of studies have in common: errors of one line, overrides, and how they end."""

from __future__ import annotations

import argparse
import re
import sys
import tomllib
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NoReturn

DONE, NOT_WRITTEN, WRONG_INPUT, FAILED, INTERRUPTED = 0, 1, 2, 3, 130
# A string without quotes: it begins like a name or a path, and holds nothing that has a meaning in TOML.
BARE_STRING = re.compile(r"(?:[^\W\d]|/|~|\.{1,2}/)[^\"'\[\]{}=,#\x00-\x1f\x7f]*")


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        """Print one line and exit."""
        complain(message)
        self.exit(WRONG_INPUT)

    def parse(self, arguments: list[str] | None) -> argparse.Namespace:
        """Parse a command line, or exit; a misspelt option is told the nearest one."""
        options, surplus = self.parse_known_args(arguments)
        if surplus:
            wrong = next((each for each in surplus if each.startswith("-")), surplus[0])
            known = [name for action in self._actions for name in action.option_strings]
            near = get_close_matches(wrong.split("=")[0], known, n=1)
            hint = f"; did you mean {near[0]}?" if near else ""
            self.error(f"{wrong}: no such argument; there are one SCENARIO, {', '.join(known)}{hint}")
        return options


def override(text: str) -> tuple[str, Any]:
    """Parse KEY=VALUE; VALUE is TOML, or a string without quotes."""
    key, equals, value = text.partition("=")
    key, value = key.strip(), value.strip()
    if not equals or not key:
        raise argparse.ArgumentTypeError(f"{text}: must be KEY=VALUE, such as controller.gain=2")
    try:
        table = tomllib.loads(f"value = {value}")
        if table.keys() == {"value"}:
            return key, table["value"]
    except (ValueError, RecursionError):
        if BARE_STRING.fullmatch(value):
            return key, value
    raise argparse.ArgumentTypeError(f"{key} = {value[:80]}: must be TOML, such as 2.0, true, [1, 2] or a name")


def tell_compilation() -> None:
    """Say that the first run ever takes its time."""
    from finger_pin.core.compilation import is_cached

    if not is_cached():
        print("Compiling the model, once for this version: about half a minute ...", file=sys.stderr)


def complain(message: str) -> None:
    """Print one line on standard error."""
    text = "".join(c if c.isprintable() else repr(c)[1:-1] for c in message)
    print(f"{Path(sys.argv[0]).name}: {text}", file=sys.stderr)
