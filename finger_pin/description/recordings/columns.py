"""Tables of numbers over time or of readings: CSV files as spreadsheets write them, or arrays; their columns in SI."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from finger_pin.description.recordings.bench import Column
from finger_pin.description.recordings.series import Series
from finger_pin.description.recordings.units import APPENDED, BRACKETED, check_header, in_si, split_unit
from finger_pin.description.validation import Description, suggestion, validate
from finger_pin.exceptions import InputError
from finger_pin.files import expand, read_text

# What stands in a cell, besides nothing, where nothing was measured.
_MISSING = ("na", "n/a", "null", "none", "-")
_TIMES = ("time", "t")
# Rows that are so far apart on average, s, over so long a time are asked about.
_FAR_APART, _LONG = 1.0, 60.0


class SignalFile(Description):
    """A CSV file of signals over time; its path alone will do."""

    path: str = Field(strict=True, description="Relative to the file that names it.")
    time: Column | None = Field(None, description="The column of times; by default the one called time or t.")
    columns: dict[str, Column] = Field({}, description="By signal; by default all other columns, by their names.")

    @model_validator(mode="before")
    @classmethod
    def _path_alone(cls, value: Any) -> Any:
        return {"path": value} if isinstance(value, str) else value


class Table:
    """Columns of equally many rows, by their names in the header, with or without a unit in brackets."""

    def __init__(self, entry: str, columns: Mapping[str, Any]) -> None:
        """Take columns of numbers or words; the entry names the table in messages.

        Raises:
            InputError: If they differ in their number of rows.
        """
        self.entry = entry
        self._columns = {name: _as_array(values) for name, values in columns.items()}
        if len({values.shape for values in self._columns.values()}) != 1:
            raise InputError(entry, "all columns must have as many rows")
        self.rows = len(next(iter(self._columns.values())))
        split = [(name, *split_unit(name, BRACKETED)) for name in self._columns]
        bare = [each[1] for each in split]
        self._headers = {short: (name, unit) for name, short, unit in split if bare.count(short) == 1}
        self._headers |= {name: (name, unit) for name, _, unit in split}

    def column(self, key: str, column: Column, si: str, *, missing: bool = False) -> NDArray[np.float64]:
        """Return a column in SI, shape (m,).

        Args:
            key: Where it is asked for, below the table's entry.
            column: Its name, unit, scale and offset; without a unit that of the header counts, else SI.
            si: Unit of the result; empty for that of its own unit.
            missing: Whether cells may be empty; they are not a number.

        Raises:
            InputError: If there is no such column, a cell is no number, or the unit does not fit.
        """
        entry = f"{self.entry}.{key}"
        if column.column not in self._headers:
            allowed = f"no such column; there are {', '.join(self._columns)}{suggestion(column.column, self._columns)}"
            raise InputError(entry, allowed, column.column)
        name, header_unit = self._headers[column.column]
        cells = self._columns[name]
        if cells.dtype == object:
            row = next(k for k, cell in enumerate(cells) if isinstance(cell, str))
            raise InputError(entry, f"column {name} has no number in row {row + 1}", cells[row])
        unit = column.unit or header_unit
        if column.unit is None:
            check_header(entry, name, header_unit, si, asked=column.scale == 1.0)
        factor = 1.0 if unit is None else in_si(f"{entry}.unit" if column.unit else entry, unit, si)
        if column.unit is None and factor != 1.0 and column.scale != 1.0:
            raise InputError(entry, f"has a scale, and its header a unit; write unit too, such as {unit}", column.scale)
        wrong = np.flatnonzero(np.isinf(cells) if missing else ~np.isfinite(cells))
        if len(wrong):
            raise InputError(entry, f"column {name} has no number in row {wrong[0] + 1}")
        values: NDArray[np.float64] = column.scale * factor * cells
        if column.supply is not None:
            if si != "V" or unit is not None:
                raise InputError(f"{entry}.supply", "is for a part of a voltage, without a unit", column.supply)
            values = values * self.column(f"{key}.supply", Column(column=column.supply), "V")
        values = values + column.offset
        return values

    def names_unit(self, column: Column) -> bool:
        """Return whether a column that is there has a unit or a scale, in its header or beside its name."""
        return column.unit is not None or column.scale != 1.0 or self._headers[column.column][1] is not None

    def times(self, key: str, column: Column) -> NDArray[np.float64]:
        """Return a column of times, s, shape (m,).

        Raises:
            InputError: Also if they do not increase, or seem to be milliseconds and no unit says that they are not.
        """
        entry, times = f"{self.entry}.{key}", self.column(key, column, "s")
        if column.delay:
            raise InputError(f"{entry}.delay", "is for signals, not for their times", column.delay)
        back = np.flatnonzero(np.diff(times) <= 0.0)
        if len(times) < 2 or len(back):
            where = f", and do not from row {back[0] + 1} to the next" if len(back) else ""
            raise InputError(entry, f"times must increase, two rows at least{where}")
        length, unknown = times[-1] - times[0], (column.unit or self._headers[column.column][1]) is None
        if unknown and column.scale == 1.0 and length >= max(_FAR_APART * (len(times) - 1), _LONG):
            warning = (
                f'its {len(times)} rows take {length:g} s (is it in milliseconds?); write {{ column = "{column.column}"'
            )
            raise InputError(entry, f'{warning}, unit = "ms" }}, or unit = "s" if they do', column.column)
        return times

    def signals(self, file: SignalFile) -> Iterator[tuple[str, Column]]:
        """Yield the columns of signals over time, the times first.

        Raises:
            InputError: If no column is named as times are.
        """
        units = [(name, *split_unit(name, BRACKETED, APPENDED)) for name in self._columns]
        named = [(short, Column(column=name, unit=unit)) for name, short, unit in units]
        time = file.time or next((column for short, column in named if short.casefold() in _TIMES), None)
        if time is None:
            allowed = (
                f'no column is called time or t; there are {", ".join(self._columns)}; write time = "NAME" beside path'
            )
            raise InputError(self.entry, allowed)
        yield "time", time
        apart = self._headers.get(time.column, (None,))[0]
        yield from file.columns.items() or [each for each in named if each[1].column != apart]


def read_signals(entry: str, source: Any, folder: Path, unit_of: Callable[[str], str]) -> dict[str, dict[str, Any]]:
    """Return the columns of a CSV file as samples of signals, by name.

    Args:
        entry: That names the file.
        source: Its path, or a table of `SignalFile`.
        folder: That a relative path starts from.
        unit_of: SI unit of a signal by its name; empty for that of its own unit.

    Raises:
        InputError: If the file cannot be read, or a column is not of numbers, or times do not increase.
    """
    if not isinstance(source, str | dict):
        raise InputError(entry, "must be the path of a CSV file, or a table with path, time and columns", source)
    file = validate(SignalFile, source, tuple(entry.split(".")))
    table = Table(entry, read_columns(f"{entry} {file.path}", folder / expand(file.path)))
    (_, time), *signals = table.signals(file)
    times = table.times("time", time)
    shared = Series(times)
    samples: dict[str, dict[str, Any]] = {}
    for name, column in signals:
        if name in samples:
            raise InputError(entry, "two columns are of the same signal", name)
        values = Series(table.column(f"columns.{name}", column, unit_of(name)))
        # A column that lags behind its quantity is of earlier times.
        at = Series(times - column.delay) if column.delay else shared
        samples[name] = {"kind": "samples", "times": at, "values": values}
    return samples


def read_columns(what: str, path: Path) -> dict[str, Any]:
    """Return the columns of a CSV file with a header, by name; empty cells are not numbers, and words stay words.

    Columns stand apart by commas, semicolons or tabs; where not by commas, decimals may have one. Lines that begin with
    # are comments. Numbers are read all at once; cell by cell is for what is missing or wrong.

    Raises:
        InputError: Naming the row that is wrong.
    """
    lines = [line for line in read_text(what, path).splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if len(lines) < 2:
        raise InputError(what, "must have a header and rows of numbers")
    separator = max(",;\t", key=lines[0].count)
    header = [name.strip() for name in next(csv.reader(lines[:1], delimiter=separator))]
    if len(set(header)) < len(header) or not all(header):
        raise InputError(what, "the first line must name every column, each once", lines[0])
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
        raise InputError(what, f"is not valid CSV: {error}") from None
    for number, row in enumerate(rows, 1):
        if len(row) != len(header):
            raise InputError(what, f"row {number} has {len(row)} values, the header names {len(header)}")
    return {name: [_cell(row[k].strip()) for row in rows] for k, name in enumerate(header)}


def chosen_rows(entry: str, columns: Mapping[str, Any], rows: Mapping[str, float | str]) -> Mapping[str, Any]:
    """Return the rows of columns in which some of these have given numbers or words.

    Raises:
        InputError: If there is no such column, or no such row.
    """
    if not rows:
        return columns
    chosen = np.ones(len(next(iter(columns.values()))), dtype=bool)
    for name, value in rows.items():
        if name not in columns:
            allowed = f"no such column; there are {', '.join(columns)}{suggestion(name, columns)}"
            raise InputError(f"{entry}.rows.{name}", allowed)
        here = np.array([cell == value for cell in columns[name]])
        if not here.any():
            cells = list(dict.fromkeys(str(cell) for cell in columns[name]))[:12]
            raise InputError(f"{entry}.rows.{name}", f"no row has it; there are {', '.join(cells)}", value)
        chosen &= here
    if not chosen.any():
        raise InputError(f"{entry}.rows", "no row has all of them")
    return {name: [cells[k] for k in np.flatnonzero(chosen)] for name, cells in columns.items()}


def _cell(cell: str) -> float | str:
    """Return the number in a cell, NaN for an empty one; a word as it stands."""
    try:
        return float(cell or "nan")
    except ValueError:
        return math.nan if cell.lower() in _MISSING else cell


def _as_array(values: Any) -> NDArray[Any]:
    """Return a column as an array, of objects if it has words."""
    words = not isinstance(values, np.ndarray) and any(isinstance(each, str) for each in values)
    return np.array(list(values), dtype=object) if words else np.asarray(values, dtype=float)
