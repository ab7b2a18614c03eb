"""Tables of numbers over time or of readings: CSV files as spreadsheets write them, or arrays; their columns in SI."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from finger_pin.description.recordings.bench import Column, RecordingSettings
from finger_pin.description.recordings.csv_files import TableFormat, read_columns
from finger_pin.description.recordings.times import check_seconds, seconds_of_dates
from finger_pin.description.recordings.units import APPENDED, BRACKETED, check_header, in_si, parse_unit, split_unit
from finger_pin.description.tables import Series
from finger_pin.description.validation import suggestion, validate
from finger_pin.exceptions import InputError
from finger_pin.files import expand

_TIMES = ("time", "t")
# Times from here on, s, are of an epoch, and counted from the first: three years are no motion.
_EPOCH = 1e8
# The part of a period, from one sample to the next, from which on the way round is not clear.
_AMBIGUOUS = 0.45


class SignalFile(TableFormat):
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
        # The number of the instant of every row, where several have one time.
        self._instants: NDArray[np.intp] | None = None
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
        return self.at_instants(self._all_rows(key, column, si, missing=missing))

    def at_instants(self, values: NDArray[Any]) -> NDArray[np.float64]:
        """Return numbers of all rows, or where several have one time the means of those."""
        return values if self._instants is None else _means(values, self._instants)

    def _all_rows(self, key: str, column: Column, si: str, *, missing: bool = False) -> NDArray[np.float64]:
        """Return a column in SI with a number for every row, of those of one time as well."""
        entry = f"{self.entry}.{key}"
        name, _ = self._find(entry, column)
        cells = self._columns[name]
        if cells.dtype == object:
            row = next(k for k, cell in enumerate(cells) if isinstance(cell, str))
            raise InputError(entry, f"column {name} has no number in row {row + 1}", cells[row])
        unit, factor = self._unit(entry, column, si)
        wrong = np.flatnonzero(np.isinf(cells) if missing else ~np.isfinite(cells))
        if len(wrong):
            raise InputError(entry, f"column {name} has no number in row {wrong[0] + 1}")
        if column.period is not None:
            cells = _unwrapped(f"{entry}.period", cells, column.period)
        values: NDArray[np.float64] = column.scale * factor * cells
        if column.supply is not None:
            if si != "V" or unit is not None:
                raise InputError(f"{entry}.supply", "is for a part of a voltage, without a unit", column.supply)
            values = values * self._all_rows(f"{key}.supply", Column(column=column.supply), "V")
        return values + column.offset

    def _unit(self, entry: str, column: Column, si: str) -> tuple[str | None, float]:
        """Return the unit of a column, None if it has none or one that its scale leads to SI from, and its factor.

        Raises:
            InputError: If it does not fit.
        """
        name, header_unit = self._find(entry, column)
        unit = column.unit or header_unit
        if column.unit is None and not (column.scale != 1.0 and header_unit and parse_unit(header_unit) is None):
            check_header(entry, name, header_unit, si, asked=column.scale == 1.0)
        elif column.unit is None:
            # The scale leads from a unit of its own, such as ticks, to SI.
            unit = None
        factor = 1.0 if unit is None else in_si(f"{entry}.unit" if column.unit else entry, unit, si)
        if column.unit is None and factor != 1.0 and column.scale != 1.0:
            raise InputError(entry, f"has a scale, and its header a unit; write unit too, such as {unit}", column.scale)
        return unit, factor

    def turn(self, key: str, column: Column) -> float:
        """Return by how much a column of angles differs after a turn: its period where it tells angles within one."""
        return 2.0 * np.pi / abs(column.scale * self._unit(f"{self.entry}.{key}", column, "rad")[1])

    def _find(self, entry: str, column: Column) -> tuple[str, str | None]:
        """Return the name of a column in the header, and its unit there."""
        if column.column not in self._headers:
            allowed = f"no such column; there are {', '.join(self._columns)}{suggestion(column.column, self._columns)}"
            raise InputError(entry, allowed, column.column)
        return self._headers[column.column]

    def names_unit(self, column: Column) -> bool:
        """Return whether a column that is there has a unit or a scale, in its header or beside its name."""
        return column.unit is not None or column.scale != 1.0 or self._headers[column.column][1] is not None

    def row_times(self, recording: RecordingSettings) -> NDArray[np.float64]:
        """Return the times of the rows of a recording, shape (m,), s: from its column, or by its sample rate from 0."""
        if recording.time is None:
            return np.arange(self.rows) / (recording.sample_rate or np.inf)
        return self.times("time", recording.time, recording.repeated_times)

    def times(
        self, key: str, column: Column, repeated: str = "refuse", *, by_hand: bool = False
    ) -> NDArray[np.float64]:
        """Return a column of times, s, shape (m,); dates, and seconds of an epoch, are counted from the first.

        Args:
            key: Where it is asked for, below the table's entry.
            column: Numbers, or dates and times of ISO 8601.
            repeated: ``mean`` where the mean of rows of one time is one row from now on, in all columns.
            by_hand: Whether a few rows may be written by hand, so that nothing is asked about whole seconds.

        Raises:
            InputError: Also if they do not increase, or may be milliseconds or less and no unit says which.
        """
        entry = f"{self.entry}.{key}"
        for key in ("delay", "hold"):
            if getattr(column, key):
                raise InputError(f"{entry}.{key}", "is for signals, not for their times", getattr(column, key))
        name, header_unit = self._find(entry, column)
        dated = self._columns[name].dtype == object
        times = seconds_of_dates(entry, column, name, self._columns[name]) if dated else self.column(key, column, "s")
        start = abs(times[0])
        if start >= _EPOCH:
            times = times - times[0]
        steps = np.diff(times)
        if repeated == "mean" and np.any(steps == 0.0) and not np.any(steps < 0.0):
            self._instants = np.append(0, np.cumsum(steps > 0.0))
            times = _means(times, self._instants)
            self.rows = len(times)
        back = np.flatnonzero(np.diff(times) <= 0.0)
        if len(times) < 2 or len(back):
            where = f", and do not from row {back[0] + 1} to the next" if len(back) else ""
            if len(back) and steps[back[0]] == 0.0:
                where += ', which has the same time; repeated_times = "mean" takes the mean of such rows'
            raise InputError(entry, f"times must increase, two rows at least{where}")
        if not (dated or column.unit or header_unit or column.scale != 1.0):
            check_seconds(entry, column.column, start, times, by_hand=by_hand)
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
        time_header = self._headers.get(time.column, (None,))[0]
        yield from file.columns.items() or [each for each in named if each[1].column != time_header]


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
    table = Table(entry, read_columns(f"{entry} {file.path}", folder / expand(file.path), file))
    (_, time), *signals = table.signals(file)
    times = table.times("time", time, file.repeated_times, by_hand=True)
    shared = Series(times)
    samples: dict[str, dict[str, Any]] = {}
    for name, column in signals:
        if name in samples:
            raise InputError(entry, "two columns are of the same signal", name)
        values = Series(table.column(f"columns.{name}", column, unit_of(name)))
        # A column that lags behind its quantity is of earlier times.
        at = Series(times - column.delay) if column.delay else shared
        samples[name] = {"kind": column.signal_kind, "times": at, "values": values}
    return samples


def _unwrapped(entry: str, cells: NDArray[np.float64], period: float) -> NDArray[np.float64]:
    """Return the unwrapped values of a periodic column; missing ones stay missing.

    Raises:
        InputError: If they span more than a period, or it is not clear which way they went round.
    """
    finite = np.flatnonzero(np.isfinite(cells))
    span = float(np.ptp(cells[finite])) if len(finite) else 0.0
    if span > period:
        raise InputError(entry, f"must be above {span:g}, the difference of the greatest number and the least", period)
    unwrapped = cells.copy()
    unwrapped[finite] = np.unwrap(cells[finite], period=period)
    wide = np.flatnonzero(np.abs(np.diff(unwrapped[finite])) > _AMBIGUOUS * period)
    if len(wide):
        row = finite[wide[0]] + 1
        raise InputError(entry, f"is too short to tell the way from row {row} to the next: nearly half of it", period)
    return unwrapped


def _means(values: NDArray[np.float64], instants: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return the mean of the numbers of every instant; not a number where there is none."""
    finite = np.isfinite(values)
    count = np.bincount(instants, finite)
    return np.where(count > 0, np.bincount(instants, np.where(finite, values, 0.0)) / np.maximum(count, 1), np.nan)


def _as_array(values: Any) -> NDArray[Any]:
    """Return a column as an array, of objects if it has words."""
    words = not isinstance(values, np.ndarray) and any(isinstance(each, str) for each in values)
    return np.array(list(values), dtype=object) if words else np.asarray(values, dtype=float)
