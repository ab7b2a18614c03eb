"""Results of analyses in print: large arrays by shape and range."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

# Largest size of an array that is printed in full.
_MAX_PRINTED = 8


class BriefRepr:
    """A dataclass that prints its large arrays by shape and range, one entry a line."""

    def __repr__(self) -> str:
        """Return the entries, one a line."""
        entries = [f"  {each.name}: {_brief(getattr(self, each.name))}" for each in fields(self)]  # type: ignore[arg-type]
        return "\n".join([type(self).__name__, *entries])


def _brief(value: object) -> str:
    if isinstance(value, tuple) and any(isinstance(each, np.ndarray) for each in value):
        return "; ".join(map(_brief, value))
    if not isinstance(value, np.ndarray) or not value.size:
        return f"{value:.4g}" if isinstance(value, float) else str(value)
    if value.size <= _MAX_PRINTED:
        return np.array2string(value, precision=4, separator=", ").replace("\n", "")
    numbers = value[np.isfinite(value)]
    extent = f", {numbers.min():.4g} to {numbers.max():.4g}" if numbers.size else ", not finite"
    return f"shape {value.shape}{extent}"
