"""The finished pieces of an identification, kept in its folder, so that the same call goes on after a stop."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Sequence
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

NAME = "identification.json"


def digest(
    scenario: Scenario, settings: IdentifySettings, recordings: Sequence[Recording], more: tuple[Any, ...]
) -> str:
    """Return the digest of an identification: scenario, table, data, options, version."""
    text = [__version__, scenario.model_dump_json(), settings.model_dump_json(), repr(more)]
    hasher = hashlib.sha256("\0".join(text).encode())
    for recording in recordings:
        for values in (*recording.inputs.values(), *recording.outputs.values(), recording.time, recording.speed):
            hasher.update(np.ascontiguousarray(values).tobytes())
    return hasher.hexdigest()


class Checkpoint:
    """Finished pieces of work by name, kept in a folder, or only in memory without one."""

    def __init__(self, folder: Path | None, asked: str, restart: bool) -> None:
        """Read the pieces of the same identification; those of another one are forgotten."""
        self._path = None if folder is None else folder / NAME
        self._asked, self._done = asked, {}
        if self._path is not None and not restart:
            try:
                saved = json.loads(self._path.read_text("utf-8"))
                self._done = saved["done"] if saved["asked"] == asked else {}
            except (OSError, ValueError, KeyError, TypeError):
                self._done = {}

    _done: dict[str, Any]
    _made: bool

    def __enter__(self) -> Self:
        """Make the folder.

        Raises:
            InputError: If it cannot be made.
        """
        if self._path is not None:
            try:
                self._made = not self._path.parent.exists()
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
            if self._made and not any(self._path.parent.iterdir()):
                self._path.parent.rmdir()
        elif self._done:
            write_text(self._path, json.dumps({"asked": self._asked, "done": self._done}))

    def fit(self, name: str, problem: Problem, work: Callable[[], Fit]) -> Fit:
        """Return a minimum, or the stored one."""
        if name in self._done:
            z: Array = np.array(self._done[name])
            return fit(problem, z, fixed=dict(enumerate(z)))
        try:
            minimum = work()
        except Stopped:
            if len(problem.best[1]):
                self._done[f"{name} so far"] = problem.best[1].tolist()
            raise
        self._done[name] = minimum.z.tolist()
        return minimum

    def reached(self, name: str, start: Array) -> Array:
        """Return the last place of a search that was stopped, shape (p,), or its start."""
        return np.array(self._done.get(f"{name} so far", start), dtype=float)

    def side(self, name: str, work: Callable[[], ProfileBound]) -> ProfileBound:
        """Return an end of an interval."""
        if name in self._done:
            end, path = self._done[name]
            return ProfileBound(math.nan if end is None else float(end), np.array(path))
        bound = work()
        if bound.better is None:
            self._done[name] = (bound.end, bound.path.tolist())
        return bound

    def comparison(self, work: Callable[[], LawComparison]) -> LawComparison:
        """Return a comparison of laws."""
        if "comparison" not in self._done:
            self._done["comparison"] = work().plain()
        return LawComparison.from_table(self._done["comparison"])
