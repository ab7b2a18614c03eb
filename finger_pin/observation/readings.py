"""Readings over time for an observer: from a CSV file, arrays, or a recording of a bench."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from finger_pin.description.recordings.bench import RecordingSettings
from finger_pin.description.recordings.columns import SignalFile, Table
from finger_pin.description.recordings.csv_files import read_columns
from finger_pin.description.recordings.motions import check_plain, read_motion
from finger_pin.description.validation import choices, validate
from finger_pin.exceptions import InputError
from finger_pin.files import expand
from finger_pin.observation.sensors import Sensors
from finger_pin.typing import Array

#: A CSV file with columns ``time`` and ``motor_position.M1``, or a table of `SignalFile` that tells its columns and
#: units, or a recording, ``BENCH:RECORDING``, or times, shape (m,), and columns by name, shape (m,).
ReadingsLike = str | os.PathLike[str] | Mapping[str, Any] | tuple[ArrayLike, Mapping[str, ArrayLike]]
# Units of the quantities that sensors read; of inputs of actuators none is known.
_UNITS = {
    "motor_position": "rad",
    "motor_velocity": "rad/s",
    "motor_current": "A",
    "joint_position": "rad",
    "joint_velocity": "rad/s",
    "fingertip_force": "N",
    "tensions": "N",
    "tendon_winding": "m",
}


class Readings(NamedTuple):
    """Readings over time.

    Attributes:
        times: Shape (m,), s; finite, and they may go back.
        columns: By name of a sensor, shape (m,), in SI; NaN where nothing was read.
        left_out: Columns that no sensor of the finger has, and rows without a time.
    """

    times: Array
    columns: dict[str, Array]
    left_out: list[str]


def read_readings(source: ReadingsLike | RecordingSettings, sensors: Sensors) -> Readings:
    """Read readings.

    Raises:
        InputError: Naming what is wrong.
    """
    known = {*sensors.inputs, *sensors.states}
    if isinstance(source, RecordingSettings):
        # Joints and forces of a bench are what estimates are compared with.
        known = {*sensors.inputs, *(name for name in sensors.states if name.startswith("motor_"))}
        names = {
            key: key.replace("tendon_command.", "tensions.").replace("actuator_input.", "inputs.")
            for key in (*source.inputs, *source.outputs)
        }
        units = {key: _UNITS.get(name.partition(".")[0], "") for key, name in names.items() if name in known}
        times, read = read_motion("readings", source, units)
        columns = {name: read.get(key, np.zeros(len(times))) for key, name in names.items()}
    elif isinstance(source, tuple):
        times = np.asarray(source[0], dtype=float)
        columns = {name: np.asarray(values, dtype=float) for name, values in source[1].items()}
        for name, values in columns.items():
            if values.shape != times.shape or times.ndim != 1:
                raise InputError(
                    f"readings.{name}", f"must be as many numbers as there are times, {times.shape}", values.shape
                )
    else:
        table = dict(source) if isinstance(source, Mapping) else {"path": os.fspath(source)}
        times, columns = _read_file(validate(SignalFile, table, ("readings",)), known)
    left_out = [name for name in columns if name not in known]
    columns = {name: np.where(np.isfinite(values), values, np.nan) for name, values in columns.items() if name in known}
    timed = np.isfinite(times)
    if not timed.all():
        left_out.append(f"{np.count_nonzero(~timed)} rows without a time")
    if not columns:
        raise InputError(
            "readings", f"must have a column that a sensor of the finger has: {choices('', known)}", left_out
        )
    sensors.check(columns)
    if np.count_nonzero(timed) < 2:
        raise InputError("readings", "must have two rows with a time at least", len(times))
    return Readings(times[timed], {name: values[timed] for name, values in columns.items()}, left_out)


def _read_file(file: SignalFile, known: set[str]) -> tuple[Array, dict[str, Array]]:
    """Return times and columns of a CSV file, those of unknown names as zeros."""
    table = Table("readings", read_columns(f"readings {file.path}", Path(expand(file.path)), file))
    (_, time), *signals = table.signals(file)
    columns = {}
    for name, column in signals:
        check_plain(f"readings.{name}", column)
        unit = _UNITS.get(name.partition(".")[0], "")
        columns[name] = table.column(name, column, unit, missing=True) if name in known else np.zeros(table.rows)
    return table.column("time", time, "s", missing=True), columns


def regular(times: Sequence[float] | Array) -> tuple[Any, int]:
    """Return the rows whose times are later than all before, and how many are not."""
    latest = np.maximum.accumulate(times)
    forward = np.append(True, np.diff(latest) > 0.0)
    return np.flatnonzero(forward), int(np.count_nonzero(~forward))
