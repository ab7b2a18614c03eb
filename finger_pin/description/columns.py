"""Columns of a CSV file: a header with ``time`` first, then rows of numbers."""

from __future__ import annotations

import csv
import math

from finger_pin.description.signals import MOST_POINTS
from finger_pin.exceptions import InputError


def read_columns(what: str, text: str) -> dict[str, list[float]]:
    """Return the columns of a CSV text by their names, ``time`` first.

    Args:
        what: Names the file in messages.
        text: A header and rows, separated by commas.

    Raises:
        InputError: Naming the line and column that is wrong.
    """
    try:
        rows = [
            (number, row) for number, row in enumerate(csv.reader(text.splitlines()), 1) if any(map(str.strip, row))
        ]
    except csv.Error as error:
        raise InputError(what, f"is not valid CSV: {error}") from None
    header = [name.strip() for name in rows[0][1]] if rows else []
    if len(header) < 2 or header[0] != "time" or len(set(header)) < len(header):
        allowed = "the first line must name the columns: time, then one for each signal, each once"
        raise InputError(what, allowed, ",".join(header))
    if not 2 <= len(rows) - 1 <= MOST_POINTS:
        raise InputError(what, f"must have 2 to {MOST_POINTS} rows of numbers, not {len(rows) - 1}")
    columns: dict[str, list[float]] = {name: [] for name in header}
    for number, row in rows[1:]:
        if len(row) != len(header):
            raise InputError(what, f"line {number} has {len(row)} values, the header names {len(header)}")
        for name, cell in zip(header, row, strict=True):
            columns[name].append(_number(what, f"line {number}, column {name}", cell))
        if len(columns["time"]) > 1 and columns["time"][-1] <= columns["time"][-2]:
            raise InputError(what, f"line {number}: times must increase", columns["time"][-1])
    return columns


def _number(what: str, where: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(what, f"{where}: must be a finite number", cell.strip())
    return value
