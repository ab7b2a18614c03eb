"""Measurements as JSON files, one per part, so that an interrupted benchmark goes on where it stopped."""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import finger_pin
from finger_pin.files import write_text


def say(text: str) -> None:
    """Print a line of progress on standard error."""
    print(text, file=sys.stderr, flush=True)


def digest() -> str:
    """Return a digest of the sources of the package and of the benchmark."""
    package, here = Path(finger_pin.__file__).parent, Path(__file__).parent
    found = hashlib.sha256()
    for source in sorted([*package.rglob("*.py"), *package.rglob("*.toml"), *here.glob("*.py")]):
        found.update(source.read_bytes())
    return found.hexdigest()[:16]


class Store:
    """Parts of a benchmark, each measured once until the code changes.

    Attributes:
        folder: Folder of the parts.
        quick: Whether this is a quick run; its parts are kept apart from those of a full run.
    """

    def __init__(self, folder: Path, quick: bool, fresh: bool = False) -> None:
        """Open a folder; ``fresh`` measures every part anew."""
        self.folder = folder / "parts"
        self.quick = quick
        self._fresh = fresh
        self._code = digest()

    def part(self, name: str, measure: Callable[[], Any]) -> Any:
        """Return a part, measured now unless it is there from an earlier run of the same code."""
        path = self.folder / f"{name}{'-quick' if self.quick else ''}.json"
        if path.exists() and not self._fresh:
            kept = json.loads(path.read_text(encoding="utf-8"))
            if kept["code"] == self._code:
                say(f"{name}: taken from {path}")
                return kept["value"]
        say(f"{name}: measuring")
        # Through JSON, so that a part looks the same whether it was measured or read.
        text = json.dumps({"code": self._code, "value": measure()}, indent=1)
        if digest() == self._code:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_text(path, text + "\n")
        else:
            say(f"{name}: the code changed meanwhile; used, but not kept")
        return json.loads(text)["value"]
