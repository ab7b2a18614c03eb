"""Checkpoint of a search: its finished pieces, stored in a folder to resume after a stop."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, Self

import numpy as np

from finger_pin.exceptions import InputError
from finger_pin.files import write_text
from finger_pin.identification.search.gauss_newton import Fit, fit_at
from finger_pin.identification.search.objective import Objective, Stopped
from finger_pin.typing import Array

FILE_NAME = "identification.json"


class Checkpoint:
    """Finished pieces of work by name, stored in a folder, or only in memory without one."""

    def __init__(self, folder: Path | None, request: str, restart: bool) -> None:
        """Load the pieces of the same search, by the digest of the request; discard those of another one."""
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

    def stored(self, name: str, work: Callable[[], Any]) -> Any:
        """Return the stored piece of a name, what JSON can say, or compute and store it; None is not stored."""
        if name not in self._results:
            if (piece := work()) is None:
                return None
            self._results[name] = piece
        return self._results[name]

    def fit(self, name: str, objective: Objective[Any], work: Callable[[], Fit]) -> Fit:
        """Return the stored minimum of a name, or compute and store it."""
        if name in self._results:
            return fit_at(objective, np.array(self._results[name]))
        try:
            minimum = work()
        except Stopped:
            if len(objective.best[1]):
                self._results[f"{name} so far"] = objective.best[1].tolist()
            raise
        self._results[name] = minimum.z.tolist()
        return minimum

    def last_point(self, name: str, start: Array) -> Array:
        """Return the last point of an interrupted search, shape (p,), or its start."""
        return np.array(self._results.get(f"{name} so far", start), dtype=float)
