"""Recordings: tables of numbers as they were written down, in SI, by the names that a result has."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.recordings.bench import Column, RecordingSettings
from finger_pin.description.recordings.units import in_si
from finger_pin.description.routing import Array
from finger_pin.description.validation import suggestion
from finger_pin.exceptions import InputError

#: SI units of what is recorded most; of anything else a column is in SI.
VARIABLES = {
    "tendon_command": "N",
    "tendon_tension": "N",
    "tendon_friction": "N",
    "spool_tension": "N",
    "passive_tension_proximal": "N",
    "contact_force": "N",
    "contact_normal_force": "N",
    "fingertip_force": "N",
    "fingertip_position": "m",
    "tendon_velocity": "m/s",
    "joint_position": "rad",
    "joint_reference": "rad",
    "joint_velocity": "rad/s",
    "joint_torque": "N m",
    "motor_position": "rad",
    "motor_velocity": "rad/s",
    "motor_current": "A",
    "motor_voltage": "V",
    "motor_torque": "N m",
}
_MOST_ROWS = 5_000_000
# What stands in a cell, besides nothing, where nothing was measured.
_MISSING = ("na", "n/a", "null", "none", "-")


@dataclass(frozen=True, eq=False)
class RecordedSignal:
    """An output of a recording.

    Attributes:
        recording: Name of the recording.
        name: variable.label.
        unit: SI unit.
        measured: Shape (m,), those that are numbers.
        rows: Which rows of the recording they are, shape (m,).
        instant: Time of each, s; of steady readings its number.
        load: Input of the model there; not a number where there are several.
        alike: The number of the group of equal readings that each is of, shape (m,).
        ordered: Whether its samples follow each other in time, so that neighbours may err alike.
    """

    recording: str
    name: str
    unit: str
    measured: Array
    rows: NDArray[np.intp]
    instant: Array
    load: Array
    alike: NDArray[np.intp]
    ordered: bool


@dataclass(frozen=True, eq=False)
class Recording:
    """A recording in SI; m rows.

    Attributes:
        name: Its name.
        settings: As described.
        inputs: By variable.label, shape (m,).
        outputs: By variable.label, shape (m,); not a number where nothing was measured.
        time: Of a motion, shape (m,), s, from zero.
        speed: Of steady readings, shape (m,), m/s.
    """

    name: str
    settings: RecordingSettings
    inputs: dict[str, Array]
    outputs: dict[str, Array]
    time: Array
    speed: Array


def unit_of(name: str) -> str:
    """Return the SI unit of ``variable.label``; empty for an unknown one."""
    return VARIABLES.get(name.partition(".")[0], "")


def read_recording(
    name: str, settings: RecordingSettings, data: Mapping[str, Sequence[float] | Array] | None = None
) -> Recording:
    """Read a recording from its file, or from arrays by the names of columns.

    Raises:
        InputError: If the file cannot be read, a column is missing or not of numbers, or a unit does not fit.
    """
    entry = f"identify.recordings.{name}"
    if data is None and settings.file is None:
        raise InputError(f"{entry}.file", "is missing: the path of a CSV file")
    given_as = read_table(f"{entry}.file", Path(str(settings.file))) if data is None else data
    table = {key: _numbers(values) for key, values in given_as.items()}
    if len({values.shape for values in table.values()}) != 1:
        raise InputError(entry, "all columns must have as many rows")

    def column(key: str, given: Column, si: str, missing: bool = False) -> Array:
        if given.column not in table:
            hint = suggestion(given.column, table)
            raise InputError(f"{entry}.{key}", f"no such column; there are {', '.join(table)}{hint}", given.column)
        words = table[given.column]
        if words.dtype == object:
            row = next(k for k, cell in enumerate(words) if isinstance(cell, str))
            raise InputError(f"{entry}.{key}", f"column {given.column} has no number in row {row + 1}", words[row])
        unit = 1.0 if given.unit is None else in_si(f"{entry}.{key}.unit", given.unit, si)
        values: Array = given.scale * unit * table[given.column] + given.offset
        if not missing and not np.isfinite(values).all():
            row = int(np.flatnonzero(~np.isfinite(values))[0]) + 1
            raise InputError(f"{entry}.{key}", f"column {given.column} has no number in row {row}")
        return values

    rows = len(next(iter(table.values())))
    time, speed = np.zeros(rows), np.zeros(rows)
    if settings.time is not None:
        time = column("time", settings.time, "s")
        back = np.flatnonzero(np.diff(time) <= 0.0)
        if len(time) < 2 or len(back):
            where = f", and do not from row {back[0] + 1} to the next" if len(back) else ""
            raise InputError(f"{entry}.time", f"times must increase, two rows at least{where}")
        time = time - time[0]
    if isinstance(settings.speed, Column):
        speed = column("speed", settings.speed, "m/s")
        if np.any(speed == 0.0):
            raise InputError(f"{entry}.speed", "must not be zero: friction has the sign of sliding")
    elif settings.speed is not None:
        speed = np.full(rows, settings.speed)
    return Recording(
        name,
        settings,
        {key: column(f"inputs.{key}", given, unit_of(key)) for key, given in settings.inputs.items()},
        {key: column(f"outputs.{key}", given, unit_of(key), True) for key, given in settings.outputs.items()},
        time,
        speed,
    )


def read_table(entry: str, path: Path) -> dict[str, Array | Sequence[float | str]]:
    """Return the columns of a CSV file with a header, by name; empty cells are not numbers, and words stay words.

    Columns stand apart by commas, semicolons or tabs; where not by commas, decimals may have one.

    Raises:
        InputError: Naming the line that is wrong.
    """
    try:
        text = path.read_text("utf-8-sig")
    except FileNotFoundError:
        raise InputError(entry, "there is no such file", str(path)) from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(entry, f"cannot be read: {getattr(error, 'strerror', None) or 'no text in UTF-8'}") from None
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if not 2 <= len(lines) <= _MOST_ROWS:
        raise InputError(entry, f"{path.name} must have a header and 1 to {_MOST_ROWS} rows")
    separator = max(",;\t", key=lines[0].count)
    rows = list(csv.reader(lines, delimiter=separator))
    header = [each.strip() for each in rows[0]]
    if len(set(header)) < len(header) or not all(header):
        raise InputError(entry, f"{path.name}: the first line must name every column, each once")
    for number, row in enumerate(rows[1:], 1):
        if len(row) != len(header):
            raise InputError(entry, f"{path.name}: row {number} has {len(row)} values, the header names {len(header)}")
    point = "," if separator != "," else "."
    return {each: [_number(row[k].strip(), point) for row in rows[1:]] for k, each in enumerate(header)}


def _number(cell: str, point: str) -> float | str:
    """Return the number in a cell, NaN for an empty one; a word as it stands."""
    try:
        return float(cell.replace(point, ".") or "nan")
    except ValueError:
        return math.nan if cell.lower() in _MISSING else cell


def _numbers(values: Any) -> Any:
    """Return a column as an array, of objects if it has words."""
    words = not isinstance(values, np.ndarray) and any(isinstance(each, str) for each in values)
    return np.array(list(values), dtype=object) if words else np.asarray(values, dtype=float)
