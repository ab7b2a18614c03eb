"""Store of a study: a folder with its settings, a record of every finished run, and its results.

A record is a line of ``runs.jsonl``, written by one append and synced before its run counts as finished. A process
that is killed in the middle of one leaves a broken last line. The next process that opens the file cuts it off, and the
run is done again.
"""

from __future__ import annotations

import json
import os
import tomllib
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import filelock
import tomli_w
import xarray as xr

from finger_pin.exceptions import InputError
from finger_pin.files import write_text
from finger_pin.simulation.netcdf import save
from finger_pin.studies.fingerprint import UnknownDependency, code_digest, versions
from finger_pin.studies.keys import BaseScenario, Point
from finger_pin.studies.metrics import Metric

DONE, FAILED = "done", "failed"
STUDY, RUNS = "study.toml", "runs.jsonl"
_LOCK = ".lock"
_MARK = "# What the study in this folder asks for. The same again goes on where it stopped; runs.jsonl has every run.\n"


@dataclass(frozen=True)
class RunRecord:
    """The record of a run.

    Attributes:
        key: Digest of everything that determines the run.
        point: Values of the varied keys.
        status: `DONE` or `FAILED`.
        reason: Why it failed; empty if it did not.
        metrics: By name; none if it failed.
        seconds: Wall time, s.
    """

    key: str
    point: Point
    status: str
    reason: str
    metrics: Mapping[str, float]
    seconds: float

    def to_json(self) -> str:
        """Return it as one line of JSON; infinity is spelt as Python spells it."""
        return json.dumps(vars(self))


class Store:
    """Records by key, in a file or in memory alone.

    Attributes:
        records: All records by key.
    """

    def __init__(self, path: Path | None = None) -> None:
        """Read the records of a file, if one is given.

        Raises:
            OSError: If it cannot be read or written.

        Warns:
            UserWarning: If a line is not whole, or no record.
        """
        self.records: dict[str, RunRecord] = {}
        self._path = path
        if path is None:
            return
        path.touch()
        data = path.read_bytes()
        whole = data.rfind(b"\n") + 1
        if whole < len(data):
            os.truncate(path, whole)
        dropped = int(whole < len(data))
        for line in data[:whole].splitlines():
            try:
                record = RunRecord(**json.loads(line))
            except (TypeError, ValueError):
                dropped += 1
                continue
            self.records[record.key] = record
        if dropped:
            message = f"{path}: lines that are not whole, or no records: {dropped}; their runs are done again"
            warnings.warn(message, stacklevel=2)

    def append(self, record: RunRecord) -> None:
        """Keep a record; once this returns it is on disk.

        Raises:
            OSError: If it cannot be written, such as on a full disk.
        """
        if self._path is not None:
            with self._path.open("ab") as file:
                file.write(f"{record.to_json()}\n".encode())
                file.flush()
                os.fsync(file.fileno())
        self.records[record.key] = record


@contextmanager
def open_store(
    path: str | Path, asked: Mapping[str, Any], products: Sequence[str], *, restart: bool = False
) -> Iterator[Store]:
    """Lock the folder of a study for this process, and provide its records.

    Args:
        path: The folder; it may exist.
        asked: Settings that determine the study, for a TOML file.
        products: Patterns of the files that are made of the runs, such as ``figures/sweep.png``.
        restart: Whether to drop what is there of a study.

    Raises:
        InputError: If it cannot be written, holds another study or files of these names that no study wrote, or
            another process works in it; nothing has changed then.
    """
    folder = Path(path)
    lock = filelock.FileLock(folder / _LOCK)
    made = [each for each in (folder, *folder.parents) if not each.exists()]
    with ExitStack() as left:
        left.callback(_tidy, lock, made)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            lock.acquire(blocking=False)
            _prepare(folder, asked, [*products, RUNS, STUDY], restart)
            store = Store(folder / RUNS)
        except filelock.Timeout:
            raise InputError("output", "another process is at work there", str(folder)) from None
        except OSError as error:
            raise InputError("output", f"cannot be written: {error.strerror or error}", str(folder)) from None
        made.clear()
        yield store


def _tidy(lock: filelock.BaseFileLock, made: Sequence[Path]) -> None:
    """Release a lock; remove its file and folders made in vain."""
    if lock.is_locked:
        with suppress(OSError):
            # Where a file that is open cannot be removed, the name of a lock that nobody has stays.
            Path(lock.lock_file).unlink()
        lock.release()
    for folder in made:
        with suppress(OSError):
            folder.rmdir()


def _prepare(folder: Path, asked: Mapping[str, Any], artifacts: Sequence[str], restart: bool) -> None:
    """Check the folder of a study, and write its settings if it is new."""
    study, asked_text = folder / STUDY, _MARK + tomli_w.dumps(asked)
    present = [each for pattern in artifacts for each in folder.glob(pattern)]
    if present:
        text = study.read_text("utf-8", "replace") if study.is_file() else ""
        if not text.startswith(_MARK):
            what = f"holds a {present[0].name} that is not of a study; name another folder"
            raise InputError("output", what, str(folder))
        if text != asked_text and not restart:
            what = f"holds another study ({_difference(text, asked_text)}); name another folder, or use --restart"
            raise InputError("output", what, str(folder))
    if restart:
        # What says whose the files are goes last.
        for each in present:
            each.unlink()
    if restart or not present:
        write_text(study, asked_text)


def describe_study(base: BaseScenario, metrics: Sequence[Metric], design: Mapping[str, Any]) -> dict[str, Any]:
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
    scenario = base.scenario.model_dump(mode="json", exclude_none=True)
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
