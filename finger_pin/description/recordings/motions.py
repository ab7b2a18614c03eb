"""Recordings of benches by name, and their motions as numbers over time."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from finger_pin.description.loading import load_bench
from finger_pin.description.recordings.bench import Column, RecordingSettings
from finger_pin.description.recordings.columns import Table
from finger_pin.description.recordings.csv_files import chosen_rows, read_columns
from finger_pin.description.tables import shipped
from finger_pin.description.validation import choices
from finger_pin.exceptions import InputError
from finger_pin.typing import Array


def find_recording(entry: str, source: object) -> RecordingSettings | None:
    """Return the recording that a text names, ``BENCH`` or ``BENCH:RECORDING``; None of all that names no bench.

    Args:
        entry: That names it, for messages.
        source: A bench is one that ships, or the path of a TOML file.

    Raises:
        InputError: If the bench is wrong, has no such recording, or has several and none is named.
    """
    text = os.fspath(source) if isinstance(source, str | Path) else ""
    benches = shipped("benches")
    bench, name = (text, "") if text.endswith(".toml") or text in benches else text.rpartition(":")[::2]
    if bench not in benches and not bench.endswith(".toml"):
        return None
    recordings = load_bench(bench)[1].recordings
    if not name and len(recordings) == 1:
        return next(iter(recordings.values()))
    if name not in recordings:
        raise InputError(entry, f"must be {bench}:RECORDING; there are {choices(name, recordings)}", text)
    return recordings[name]


def read_motion(entry: str, recording: RecordingSettings, units: Mapping[str, str]) -> tuple[Array, dict[str, Array]]:
    """Return times, s, and columns of a motion in SI, shape (m,) each; not a number where nothing was measured.

    Args:
        entry: That names the recording, for messages.
        recording: The recording, with a file.
        units: SI units of the inputs and outputs that are read, by variable.label; empty where it is not known.

    Raises:
        InputError: If it is of steady readings, or its file or a column is wrong.
    """
    if recording.kind != "motion" or recording.file is None:
        wrong = recording.kind if recording.kind != "motion" else "no file"
        raise InputError(entry, "must be a recording of a motion, with a file", wrong)
    path, columns = Path(recording.file), recording.inputs | recording.outputs
    cells = read_columns(f"{entry} {path.name}", path, recording)
    table = Table(entry, chosen_rows(entry, cells, recording.rows))
    times = table.row_times(recording)
    for key in units:
        check_plain(f"{entry}.{key}", columns[key])
    return times, {key: table.column(key, columns[key], unit, missing=True) for key, unit in units.items()}


def check_plain(entry: str, column: Column) -> None:
    """Refuse a column whose numbers are not those of its quantity at the times beside them.

    Raises:
        InputError: Naming the key that says so.
    """
    for key in ("delay", "hold", "integrate"):
        if value := getattr(column, key):
            raise InputError(f"{entry}.{key}", "is not for readings, which are of the times beside them", value)
