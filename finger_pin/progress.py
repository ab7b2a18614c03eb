"""Progress bars of tqdm, in terminals and notebooks."""

from __future__ import annotations

import sys
import warnings
from typing import Any

# In notebooks, what is over sooner needs no bar, s.
_PATIENCE = 1.0
_SIMULATED = "{percentage:3.0f}%|{bar}| {n:.3f} of {total:g} s simulated [{elapsed}<{remaining}]"


def in_notebook() -> bool:
    """Return whether a notebook's kernel runs this."""
    ipython = sys.modules.get("IPython")
    return ipython is not None and hasattr(ipython.get_ipython(), "kernel")


def notebook_bar(unit: str, total: float | None = None) -> ProgressBar | None:
    """Return a bar in a notebook; None elsewhere."""
    return ProgressBar(unit, total) if in_notebook() else None


class ProgressBar:
    """Bar on standard error or in a notebook's cell, called with the finished part."""

    def __init__(self, unit: str, total: float | None = None) -> None:
        """Show a bar.

        Args:
            unit: Unit of the count; ``s`` is simulated time.
            total: The whole count; by default the last number of every call.
        """
        with warnings.catch_warnings():
            # Where a notebook lacks widgets the bar is text.
            warnings.simplefilter("ignore")
            from tqdm.auto import tqdm

        patience = _PATIENCE if in_notebook() else 0.0
        options: dict[str, Any] = {"unit": f" {unit}", "bar_format": _SIMULATED if unit == "s" else None}
        self._bar = tqdm(total=total, delay=patience, leave=in_notebook(), dynamic_ncols=True, **options)

    def __call__(self, done: float, *further: float, text: str = "", note: str = "") -> None:
        """Show the finished part, with a text before the bar and a note after it."""
        bar = self._bar
        if further:
            if bar.total is None:
                # What was finished before there was a total took no time, which the rate must not count.
                bar.initial = bar.last_print_n = bar.n = done
            bar.total = further[-1]
        bar.set_description(text, refresh=False)
        bar.set_postfix_str(note, refresh=False)
        bar.update(done - bar.n)

    def close(self) -> None:
        """End the bar."""
        self._bar.close()
