"""The folder of a run's results: it holds the files of one run, the earlier ones or the new ones, never a mix."""

from __future__ import annotations

import contextlib
import os
import shutil
from pathlib import Path
from types import TracebackType
from typing import Self

import xarray as xr

from finger_pin.exceptions import InputError
from finger_pin.publishing import Stage, settle
from finger_pin.simulation.recording import save

_MARK = "# The input that led to the results in this folder, complete: running it again gives the same trajectory.\n"
_MARK_OF_OWN = (
    "# The scenario of the results in this folder, run with a {} of its own: alone it gives another motion.\n"
)
_FILES = ("scenario.toml", "trajectory.nc", "animation.html")
_FIGURES = "figures"


class ResultFolder:
    """A folder whose results are replaced as a whole.

    Results are written into `stage`, a hidden folder inside, and `publish` moves them into place. Without `publish`
    the folder stays as it was. Other files in it, and those in ``figures`` that are not images, are left alone.

        with ResultFolder("results/fig6") as folder:
            folder.write(result)
            folder.publish()

    Attributes:
        path: The folder.
        stage: Where to write; it has the layout of the folder.
    """

    def __init__(self, path: str | Path) -> None:
        """Make the folder and the stage.

        Args:
            path: The folder; it may exist.

        Raises:
            InputError: If it cannot be written, or holds files of these names that no run wrote.
        """
        self.path = Path(path)
        self._made: list[Path] = []
        try:
            settle(self.path)
            self._refuse_foreign()
            self._made = [each for each in (self.path, *self.path.parents) if not each.exists()]
            self.path.mkdir(parents=True, exist_ok=True)
            self._stage = Stage(self.path)
            self.stage = self._stage.path
        except (OSError, ValueError) as error:
            self._remove_made()
            if isinstance(error, InputError):
                raise
            reason = getattr(error, "strerror", None) or error
            raise InputError("output", f"cannot be written: {reason}", str(path)) from None

    def write(self, result: xr.Dataset) -> None:
        """Write the trajectory and the scenario that led to it into the stage.

        Raises:
            OSError: If they cannot be written, such as on a full disk.
        """
        own = result.attrs.get("own")
        mark = _MARK_OF_OWN.format(own) if own else _MARK
        (self.stage / "scenario.toml").write_text(mark + result.attrs["scenario"], encoding="utf-8", newline="\n")
        try:
            save(result, self.stage / "trajectory.nc")
        except RuntimeError as error:
            # What the netCDF library makes of a full disk.
            raise OSError(f"trajectory.nc: {error}") from error

    def publish(self) -> None:
        """Move what is in the stage into place, and what an earlier run left out of the way.

        Of a process that is killed meanwhile, either the earlier results are in place or the new ones: what is
        half moved is finished by the next run in the folder, and by `load_result` and `load_scenario`.

        Raises:
            OSError: If a file cannot be moved; the earlier results are then back in place.
        """
        settle(self.path)
        self._stage.publish(_artifacts(self.stage), _artifacts(self.path))

    def discard_views(self) -> None:
        """Remove figures and animation from the stage, such as those that an interruption left half drawn."""
        shutil.rmtree(self.stage / _FIGURES, ignore_errors=True)
        (self.stage / "animation.html").unlink(missing_ok=True)

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Remove the stage, and folders that were made and stayed empty."""
        self._stage.discard()
        self._remove_made()

    def _refuse_foreign(self) -> None:
        """Raise where writing here would replace files that no run wrote."""
        given = str(self.path)
        for folder in (self.path, self.path / _FIGURES):
            if folder.exists() and not folder.is_dir():
                raise InputError("output", f"{folder} is a file; name a folder", given)
        present = _artifacts(self.path)
        if present and not _is_marked(self.path):
            raise InputError("output", f"holds a {present[0].name} that is not from a run; name another folder", given)

    def _remove_made(self) -> None:
        for folder in self._made:
            _remove_if_empty(folder)


def _artifacts(folder: Path) -> list[Path]:
    """Return the results in a folder, the scenario first because it marks the folder as one of results."""
    files = [folder / name for name in _FILES if os.path.lexists(folder / name)]
    return files + sorted((folder / _FIGURES).glob("*.png"))


def _is_marked(folder: Path) -> bool:
    try:
        with open(folder / "scenario.toml", "rb") as file:
            line = file.readline(1000).decode("utf-8", "replace")
            return any(line.startswith(mark.split("{")[0]) for mark in (_MARK, _MARK_OF_OWN))
    except OSError:
        return False


def _remove_if_empty(folder: Path) -> None:
    with contextlib.suppress(OSError, ValueError):
        folder.rmdir()
