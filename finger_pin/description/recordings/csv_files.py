"""CSV files as spreadsheets, loggers and other programs write them: their format, and their columns as they stand."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field

from finger_pin.description.validation import Description, choice, problem, quantity, suggestion
from finger_pin.exceptions import InputError
from finger_pin.files import read_text

# What stands in a cell, besides nothing, where nothing was measured.
_MISSING = ("na", "n/a", "null", "none", "-")
_MOST_LINES = 1_000_000


def _encoding(value: Any) -> str:
    try:
        "a".encode(value)
    except (LookupError, TypeError, ValueError):
        raise problem("", "must be the name of a text encoding, such as utf-8, cp1252, utf-16", value) from None
    return str(value)


def _skipped(value: Any) -> int | tuple[int, ...]:
    numbers = value if isinstance(value, list | tuple) else [value]
    if not all(type(number) is int and 0 <= number <= _MOST_LINES for number in numbers):
        raise problem("", "must be a number of lines before the header, or a list of numbers of lines from 1", value)
    if numbers is value and 0 in numbers:
        raise problem("", "counts lines from 1", value)
    return value if isinstance(value, int) else tuple(value)


class TableFormat(Description):
    """The format of a CSV file, and the reading of its rows."""

    encoding: Annotated[str, BeforeValidator(_encoding)] = Field(
        "utf-8", description="Of the text, such as cp1252 or utf-16."
    )
    skip_rows: Annotated[int | tuple[int, ...], BeforeValidator(_skipped)] = Field(
        0, description="Lines before the header that are no part of the table, or a list of lines, counted from 1."
    )
    repeated_times: Annotated[Literal["refuse", "mean"], choice("refuse", "mean")] = quantity(
        "refuse", unit="1", source="the recording", doc="Rows of one time are refused, or their mean is one row."
    )


def read_columns(entry: str, path: Path, form: TableFormat | None = None) -> dict[str, Any]:
    """Return the columns of a CSV file with a header, by name; empty cells are not numbers, and words stay words.

    Columns stand apart by commas, semicolons or tabs, which may also end a line; where not by commas, decimals may have
    one. Lines that begin with # are comments. Numbers are read all at once; cell by cell is for what is missing or
    wrong.

    Raises:
        InputError: Naming the row that is wrong.
    """
    form = form or TableFormat()
    encoding = "utf-8-sig" if form.encoding.casefold() in ("utf-8", "utf8") else form.encoding
    text = read_text(entry, path, encoding, '; another one is named by encoding, such as "cp1252"')
    skip = {*range(1, form.skip_rows + 1)} if isinstance(form.skip_rows, int) else {*form.skip_rows}
    numbered = ((number, line.strip(" ")) for number, line in enumerate(text.splitlines(), 1) if number not in skip)
    lines = [line for _, line in numbered if line.strip() and not line.lstrip().startswith("#")]
    if len(lines) < 2:
        raise InputError(entry, "must have a header and rows of numbers")
    separator = max(",;\t", key=lines[0].count)
    header = [name.strip() for name in next(csv.reader(lines[:1], delimiter=separator))]
    while len(header) > 1 and not header[-1]:
        header.pop()
    if len(set(header)) < len(header) or not all(header):
        raise InputError(entry, "the first line must name every column, each once", lines[0])
    while lines[1].count(separator) >= len(header) and all(line.endswith(separator) for line in lines[1:]):
        lines = [line.removesuffix(separator).rstrip(" ") for line in lines]
    if separator != ",":
        lines = [line.replace(",", ".") for line in lines]
    try:
        table = np.loadtxt(lines[1:], delimiter=separator, comments=None, ndmin=2, quotechar='"').T
    except ValueError:
        table = np.zeros((0, 0))
    if len(table) == len(header):
        return dict(zip(header, table, strict=True))
    try:
        rows = list(csv.reader(lines[1:], delimiter=separator))
    except csv.Error as error:
        raise InputError(entry, f"is not valid CSV: {error}") from None
    for number, row in enumerate(rows, 1):
        while len(row) > len(header) and not row[-1].strip():
            row.pop()
        if len(row) != len(header):
            raise InputError(entry, f"row {number} has {len(row)} values, the header names {len(header)}")
    return {name: [_cell(row[k].strip()) for row in rows] for k, name in enumerate(header)}


def chosen_rows(entry: str, columns: Mapping[str, Any], rows: Mapping[str, float | str]) -> Mapping[str, Any]:
    """Return the rows of columns in which some of these have given numbers or words.

    Raises:
        InputError: If there is no such column, or no such row.
    """
    if not rows:
        return columns
    chosen = np.flatnonzero(row_mask(f"{entry}.rows", columns, rows))
    return {name: [cells[k] for k in chosen] for name, cells in columns.items()}


def row_mask(entry: str, columns: Mapping[str, Any], rows: Mapping[str, Any]) -> NDArray[np.bool_]:
    """Return the rows of columns in which all that are named have a number or word, or one of a list; shape (m,).

    Raises:
        InputError: If there is no such column, or no such row.
    """
    chosen = np.ones(len(next(iter(columns.values()))), dtype=bool)
    for name, value in rows.items():
        if name not in columns:
            allowed = f"no such column; there are {', '.join(columns)}{suggestion(name, columns)}"
            raise InputError(f"{entry}.{name}", allowed)
        cells, matching = columns[name], np.zeros(len(chosen), dtype=bool)
        for one in value if isinstance(value, list | tuple) else [value]:
            equal = np.array([cell == one for cell in cells])
            if not equal.any():
                values = list(dict.fromkeys(str(cell) for cell in cells))[:12]
                raise InputError(f"{entry}.{name}", f"no row has it; there are {', '.join(values)}", one)
            matching |= equal
        chosen &= matching
    if not chosen.any():
        raise InputError(entry, "no row has all of them")
    return chosen


def _cell(cell: str) -> float | str:
    """Return the number in a cell, NaN for an empty one; a word as it stands."""
    try:
        return float(cell or "nan")
    except ValueError:
        return math.nan if cell.lower() in _MISSING else cell
