"""Checkpoint of an identification: its finished pieces, stored in its folder to resume after a stop."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Self

import numpy as np

from finger_pin.description.recordings.bench import IdentifySettings
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.files import write_text
from finger_pin.identification.comparison import LawComparison
from finger_pin.identification.estimate import Fit, fit
from finger_pin.identification.intervals import ProfileBound
from finger_pin.identification.problem import Problem, Stopped
from finger_pin.identification.recordings import Recording
from finger_pin.typing import Array
from finger_pin.version import __version__

FILE_NAME = "identification.json"


def digest(
    scenario: Scenario, settings: IdentifySettings, recordings: Sequence[Recording], options: tuple[Any, ...]
) -> str:
    """Return the digest of an identification: scenario, table, data, options, version."""
    text = [__version__, scenario.model_dump_json(), settings.model_dump_json(), repr(options)]
    hasher = hashlib.sha256("\0".join(text).encode())
    for recording in recordings:
        for values in (*recording.inputs.values(), *recording.outputs.values(), recording.time, recording.speed):
            hasher.update(np.ascontiguousarray(values).tobytes())
    return hasher.hexdigest()


class Checkpoint:
    """Finished pieces of work by name, stored in a folder, or only in memory without one."""

    def __init__(self, folder: Path | None, request: str, restart: bool) -> None:
        """Load the pieces of the same identification, by the digest of the request; discard those of another one."""
        self._path = None if folder is None else folder / FILE_NAME
        self._request, self._created = request, False
        self._results: dict[str, Any] = {}
        if self._path is not None and not restart:
            try:
                saved = json.loads(self._path.read_text("utf-8"))
                self._results = saved["done"] if saved["asked"] == request else {}
            except (OSError, ValueError, KeyError, TypeError):
                self._results = {}

    def __enter__(self) -> Self:
        """Make the folder."""
        if self._path is not None:
            try:
                self._created = not self._path.parent.exists()
                self._path.parent.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                reason = f"cannot be written: {error.strerror or error}"
                raise InputError("output", reason, str(self._path.parent)) from None
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        """Write the finished pieces, also after an error, unless the request itself was wrong."""
        if self._path is None:
            return
        if isinstance(error, InputError):
            if self._created and not any(self._path.parent.iterdir()):
                self._path.parent.rmdir()
        elif self._results:
            write_text(self._path, json.dumps({"asked": self._request, "done": self._results}))

    def fit(self, name: str, problem: Problem, work: Callable[[], Fit]) -> Fit:
        """Return the stored minimum of a name, or compute and store it."""
        if name in self._results:
            z: Array = np.array(self._results[name])
            return fit(problem, z, fixed=dict(enumerate(z)))
        try:
            minimum = work()
        except Stopped:
            if len(problem.best[1]):
                self._results[f"{name} so far"] = problem.best[1].tolist()
            raise
        self._results[name] = minimum.z.tolist()
        return minimum

    def last_point(self, name: str, start: Array) -> Array:
        """Return the last point of an interrupted search, shape (p,), or its start."""
        return np.array(self._results.get(f"{name} so far", start), dtype=float)

    def interval_end(self, name: str, work: Callable[[], ProfileBound]) -> ProfileBound:
        """Return the stored end of an interval, or compute and store it."""
        if name in self._results:
            end, path = self._results[name]
            return ProfileBound(math.nan if end is None else float(end), np.array(path))
        bound = work()
        if bound.lower_minimum is None:
            self._results[name] = (bound.end, bound.path.tolist())
        return bound

    def comparison(self, work: Callable[[], LawComparison]) -> LawComparison:
        """Return the stored comparison of laws, or compute and store it."""
        if "comparison" not in self._results:
            self._results["comparison"] = asdict(work())
        return LawComparison(**self._results["comparison"])
