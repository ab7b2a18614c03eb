"""Progress in a notebook: a bar below the cell. It needs no widgets, so that it works on a hub elsewhere as well."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

# What is over sooner needs no bar, s; and from one picture of it to the next, s.
_PATIENCE, _INTERVAL = 1.0, 0.2


def in_notebook() -> bool:
    """Return whether a notebook's kernel runs this."""
    return "ipykernel" in sys.modules


def notebook_bar(unit: str, total: float | None = None) -> Callable[..., None] | None:
    """Return the function that moves a bar in a notebook; None elsewhere.

    Args:
        unit: Unit of the count, such as ``s``.
        total: The whole count; by default the last number of every call.

    Returns:
        To be called with how much is done.
    """
    return _Bar(unit, total) if in_notebook() else None


class _Bar:
    def __init__(self, unit: str, total: float | None) -> None:
        self._unit, self._total = unit, total
        self._due = time.monotonic() + _PATIENCE
        self._shown: Any = None

    def __call__(self, done: float, *further: float) -> None:
        total = further[-1] if further else self._total
        now = time.monotonic()
        if total is None or (now < self._due and (self._shown is None or done < total)):
            return
        from IPython import display

        shown: Any = display
        self._due = now + _INTERVAL
        text = f'<progress max="{total:g}" value="{done:g}"></progress> {done:.4g} of {total:g} {self._unit}'
        if self._shown is None:
            self._shown = shown.display(shown.HTML(text), display_id=True)
        else:
            self._shown.update(shown.HTML(text))
