"""What libraries import for what a command does not do, and a command does not wait for."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def without(name: str, seeker: str) -> Iterator[None]:
    """Let a package seem not to be installed to one that would import it only because it is.

    What the seeker has not found it does not look for again: this is for a process that has imported neither yet, and
    does nothing in another.
    """
    if {name, seeker} & sys.modules.keys():
        yield
        return
    sys.modules[name] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        del sys.modules[name]
