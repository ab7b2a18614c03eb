"""The store of a study: a line per finished run, written and synced before the run counts as finished.

A line appears by one append. Whoever is killed in the middle of one leaves a torn last line, which the next one to open
the store cuts off; the run that it was to record is done again.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

from finger_pin.studies.runs import Record


class Store:
    """Records by key; in a file, or in memory alone.

    with Store("runs.jsonl") as store:
        store.append(record)
    """

    def __init__(self, path: str | Path | None = None) -> None:
        """Read what is there.

        Args:
            path: A file, made if need be, that no other process writes; by default nothing outlives this object.

        Raises:
            OSError: If it cannot be read or written.
        """
        self._records: dict[str, Record] = {}
        self._file: int | None = None
        if path is not None:
            self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o666)
            self._read(Path(path))

    @property
    def records(self) -> Mapping[str, Record]:
        """All records by key."""
        return self._records

    def append(self, record: Record) -> None:
        """Keep a record; once this returns it outlives the process and the power.

        Raises:
            OSError: If it cannot be written, such as on a full disk.
        """
        if self._file is not None:
            line = f"{record.to_json()}\n".encode()
            while line:
                line = line[os.write(self._file, line) :]
            os.fsync(self._file)
        self._records[record.key] = record

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def _read(self, path: Path) -> None:
        assert self._file is not None
        data = path.read_bytes()
        whole = data.rfind(b"\n") + 1
        if whole < len(data):
            os.ftruncate(self._file, whole)
        for line in data[:whole].splitlines():
            try:
                record = Record.from_json(line.decode())
            except ValueError:
                # Not a record, whatever it is: its run is done again.
                continue
            self._records[record.key] = record
