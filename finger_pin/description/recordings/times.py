"""Times of tables: dates in seconds, and numbers whose unit is asked about."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.recordings.units import UNITS
from finger_pin.exceptions import InputError

if TYPE_CHECKING:
    from finger_pin.description.recordings.bench import Column

# Rows that are so far apart on average are asked about where no unit is named, and those of an epoch so far apart, s.
_LARGE_PERIOD, _LARGE_EPOCH_PERIOD = 1.0, 60.0
# Fewer and shorter signals than that may be written by hand, in seconds.
_MANY_ROWS, _LARGE_DURATION = 10, 60.0
# The units that they may be in instead, where they are then so far apart at least, s.
_SMALL_UNITS, _SMALL_PERIOD = ("ns", "us", "ms"), 1e-4
# Seconds of the Unix epoch from 2001 to 2100.
_UNIX_EPOCH = (1e9, 4.1e9)
# A date and a time of ISO 8601, and the difference of its zone from UTC.
_ISO_DATE = re.compile(r"(\d{4}-\d\d-\d\d[T ]\d\d:\d\d(?::\d\d(?:[.,]\d{1,9})?)?)\s*(?:Z|(?:([+-])(\d\d):?(\d\d)?))?")


def check_seconds(entry: str, name: str, start: float, times: NDArray[np.float64], *, by_hand: bool) -> None:
    """Ask about times without a unit that may be in a smaller one than seconds; those of an epoch tell theirs.

    Args:
        entry: Their entry.
        name: Their column.
        start: The first number of the column.
        times: Shape (m,), s, if they are in seconds.
        by_hand: Whether a few of them may be written by hand, in whole seconds.
    """
    length, factors = times[-1] - times[0], UNITS["s"]
    period = length / (len(times) - 1)
    if by_hand and len(times) < _MANY_ROWS and length < _LARGE_DURATION:
        return
    of_epoch = [unit for unit in (*_SMALL_UNITS, "s") if _UNIX_EPOCH[0] <= start * factors[unit] < _UNIX_EPOCH[1]]
    if period < (_LARGE_EPOCH_PERIOD if "s" in of_epoch else _LARGE_PERIOD):
        return
    # Periods that differ from a limit by rounding alone are within.
    low, high = _SMALL_PERIOD * (1.0 - 1e-9), _LARGE_PERIOD * (1.0 + 1e-9)
    possible = [unit for unit in _SMALL_UNITS if low <= period * factors[unit] <= high] or ["ns"]
    possible = [unit for unit in possible if unit in of_epoch] or possible
    spans = " or ".join(f"{length * factors[unit]:g} s in {unit}" for unit in [*possible, "s"])
    answer = f'write {{ column = "{name}", unit = "{possible[0]}" }}, or the unit that is right'
    raise InputError(entry, f"names no unit, and its {len(times)} rows take {spans}: {answer}", name)


def seconds_of_dates(entry: str, column: Column, name: str, cells: NDArray[Any]) -> NDArray[np.float64]:
    """Return dates and times of ISO 8601 in seconds from the first, shape (m,); those without a zone are all of one."""
    for key, default in (("unit", None), ("period", None), ("supply", None), ("scale", 1.0), ("offset", 0.0)):
        if getattr(column, key) != default:
            raise InputError(f"{entry}.{key}", f"is for numbers, and column {name} has dates", getattr(column, key))
    instants = np.zeros(len(cells), dtype="datetime64[ns]")
    zones = set()
    for row, cell in enumerate(cells):
        match = _ISO_DATE.fullmatch(cell.strip()) if isinstance(cell, str) else None
        try:
            instants[row] = np.datetime64(match[1].replace(",", "."), "ns")  # type: ignore[index]
        except (TypeError, ValueError):
            allowed = f"column {name} has no number and no date of ISO 8601 in row {row + 1}"
            raise InputError(entry, allowed, cell) from None
        assert match is not None
        zones.add(match[1] == match[0].strip())
        if match[2]:
            ahead = np.timedelta64(60 * int(match[3]) + int(match[4] or 0), "m")
            instants[row] += ahead if match[2] == "-" else -ahead
    if len(zones) > 1:
        raise InputError(entry, f"column {name} has dates with a zone and dates without one")
    seconds: NDArray[np.float64] = (instants - instants[0]).astype(float) * 1e-9
    return seconds
