"""Columns of a CSV file: a header with ``time`` first, then rows of numbers."""

from __future__ import annotations

import csv
import io
import math

import numpy as np

from finger_pin.description.recordings.series import Series
from finger_pin.description.signals import MOST_POINTS
from finger_pin.exceptions import InputError


def read_columns(what: str, text: str) -> dict[str, Series]:
    """Return the columns of a CSV text by their names, ``time`` first.

    Numbers are read all at once; row by row is for what is not as it should be, or quoted.

    Args:
        what: Names the file in messages.
        text: A header and rows, separated by commas.

    Raises:
        InputError: Naming the line and column that is wrong.
    """
    first, _, rest = text.partition("\n")
    header = [name.strip() for name in first.split(",")]
    if '"' not in text and _named(header) and rest.strip():
        try:
            table = np.loadtxt(io.StringIO(rest), delimiter=",", comments=None, ndmin=2).T
        except ValueError:
            table = np.zeros((0, 0))
        whole = len(table) == len(header) and 2 <= table.shape[1] <= MOST_POINTS
        if whole and np.isfinite(table).all() and np.all(np.diff(table[0]) > 0.0):
            return {name: Series(column) for name, column in zip(header, table, strict=True)}
    return _read_rows(what, text)


def _named(header: list[str]) -> bool:
    return len(header) >= 2 and header[0] == "time" and len(set(header)) == len(header)


def _read_rows(what: str, text: str) -> dict[str, Series]:
    """Return the columns read row by row, or raise the error of a wrong one."""
    try:
        rows = [
            (number, row) for number, row in enumerate(csv.reader(text.splitlines()), 1) if any(map(str.strip, row))
        ]
    except csv.Error as error:
        raise InputError(what, f"is not valid CSV: {error}") from None
    header = [name.strip() for name in rows[0][1]] if rows else []
    if not _named(header):
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
    return {name: Series(column) for name, column in columns.items()}


def _number(what: str, where: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(what, f"{where}: must be a finite number", cell.strip())
    return value
