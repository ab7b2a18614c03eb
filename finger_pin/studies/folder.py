"""The folder of a study: its question, a record of every finished run, and its results.

A record is a line of ``runs.jsonl``, written by one append and synced before its run counts as finished. A process
that is killed in the middle of one leaves a torn last line. The next process that opens the file cuts it off, and the
run is done again.
"""

from __future__ import annotations

import contextlib
import os
import tomllib
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import filelock
import tomli_w
import xarray as xr

from finger_pin.exceptions import InputError
from finger_pin.files import write_text
from finger_pin.simulation.netcdf import save
from finger_pin.studies.fingerprint import UnknownDependency, code_digest, versions
from finger_pin.studies.keys import Starting
from finger_pin.studies.metrics import Metric
from finger_pin.studies.runs import RunRecord

STUDY, RUNS = "study.toml", "runs.jsonl"
_LOCK = ".lock"
# Windows would write other line ends.
_BINARY = getattr(os, "O_BINARY", 0)
_MARK = "# What the study in this folder asks for. The same again goes on where it stopped; runs.jsonl has every run.\n"


class Store:
    """Records by key; in a file, or in memory alone.

    with Store("runs.jsonl") as store:
        store.append(record)
    """

    def __init__(self, path: str | Path | None = None) -> None:
        """Read the records of the folder.

        Args:
            path: A file, made if need be, that no other process writes; by default nothing outlives this object.

        Raises:
            OSError: If it cannot be read or written.
        """
        self._records: dict[str, RunRecord] = {}
        self._file: int | None = None
        if path is not None:
            self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | _BINARY, 0o666)
            self._read(Path(path))

    @property
    def records(self) -> Mapping[str, RunRecord]:
        """All records by key."""
        return self._records

    def append(self, record: RunRecord) -> None:
        """Keep a record; once this returns it is on disk.

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

    def __exit__(self, *error: object) -> None:
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
                record = RunRecord.from_json(line.decode())
            except ValueError:
                # Not a record: its run is done again.
                continue
            self._records[record.key] = record


class StudyFolder:
    """A folder that holds one study, and that one process at a time works in.

        with StudyFolder("results/sweep-fig6", asked, products=["sweep.nc"]) as folder:
            folder.store.append(record)

    Attributes:
        path: The folder.
        store: The records of its runs, while entered.
    """

    store: Store

    def __init__(
        self, path: str | Path, asked: Mapping[str, Any], products: list[str], *, restart: bool = False
    ) -> None:
        """Name the study.

        Args:
            path: The folder; it may exist.
            asked: Settings that determine the study, for a TOML file.
            products: Patterns of the files that are made of the runs, such as ``figures/sweep.png``.
            restart: Whether to begin anew what is there already.
        """
        self.path = Path(path)
        self._text = _MARK + tomli_w.dumps(asked)
        self._artifacts = [*products, RUNS, STUDY]
        self._restart = restart
        self._lock = filelock.FileLock(self.path / _LOCK)

    def __enter__(self) -> Self:
        """Make and lock the folder, and read the runs that are there.

        Raises:
            InputError: If it cannot be written, holds another study or files of these names that no study wrote, or
                another process works in it; nothing has changed then.
        """
        made = [each for each in (self.path, *self.path.parents) if not each.exists()]
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            self._lock.acquire(blocking=False)
            self._prepare()
            self.store = Store(self.path / RUNS)
        except BaseException as error:
            self._leave(made)
            if isinstance(error, filelock.Timeout):
                raise InputError("output", "another process is at work there", str(self.path)) from None
            if isinstance(error, OSError):
                reason = f"cannot be written: {error.strerror or error}"
                raise InputError("output", reason, str(self.path)) from None
            raise
        return self

    def __exit__(self, *error: object) -> None:
        """Close and unlock."""
        self.store.__exit__()
        self._leave([])

    def _prepare(self) -> None:
        study = self.path / STUDY
        present = [each for pattern in self._artifacts for each in self.path.glob(pattern)]
        if present:
            text = study.read_text("utf-8", "replace") if study.is_file() else ""
            if not text.startswith(_MARK):
                what = f"holds a {present[0].name} that is not of a study; name another folder"
                raise InputError("output", what, str(self.path))
            if text != self._text and not self._restart:
                what = f"holds another study ({_difference(text, self._text)}); name another folder, or use --restart"
                raise InputError("output", what, str(self.path))
        if self._restart:
            # What says whose the files are goes last.
            for each in present:
                each.unlink()
        if self._restart or not present:
            write_text(study, self._text)

    def _leave(self, made: list[Path]) -> None:
        if self._lock.is_locked:
            with contextlib.suppress(OSError):
                # Where a file that is open cannot be removed, the name of a lock that nobody has stays.
                (self.path / _LOCK).unlink()
            self._lock.release()
        for folder in made:
            with contextlib.suppress(OSError):
                folder.rmdir()


def describe_study(starting: Starting, metrics: Sequence[Metric], design: Mapping[str, Any]) -> dict[str, Any]:
    """Return the request of a study, for a TOML file.

    Warns:
        UserWarning: If what a metric depends on cannot be known, so that its runs cannot be reused.
    """
    for metric in metrics:
        try:
            code_digest(metric.measure)
        except UnknownDependency as error:
            what = f"the metric {metric.name} uses {error}, so its runs are done anew whenever they are asked for"
            warnings.warn(what, stacklevel=3)
    scenario = starting.scenario.model_dump(mode="json", exclude_none=True)
    names = [metric.name for metric in metrics]
    return {"finger_pin": versions()["finger-pin"], "metrics": names, **design, "scenario": scenario}


def write(dataset: xr.Dataset, path: Path) -> None:
    """Write a Dataset, whole or not at all.

    Raises:
        OSError: If it cannot be written, such as on a full disk.
    """
    try:
        save(dataset, path)
    except RuntimeError as error:
        # What the netCDF library makes of a full disk.
        raise OSError(f"{path.name}: {error}") from error


def _difference(before: str, after: str) -> str:
    """Return the first entries in which two studies differ, in words."""
    try:
        earlier, wanted = _flat(tomllib.loads(before)), _flat(tomllib.loads(after))
    except ValueError:
        return "its study.toml cannot be read"
    keys = [key for key in {**wanted, **earlier} if earlier.get(key) != wanted.get(key)]
    return f"{', '.join(keys[:3])} {'differs' if len(keys) == 1 else 'differ'}" if keys else "differently written"


def _flat(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in table.items():
        flat |= _flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else {f"{prefix}{key}": value}
    return flat
