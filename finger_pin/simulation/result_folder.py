"""The folder of a run's results: it holds the files of one run, the earlier ones or the new ones, never a mix."""

from __future__ import annotations

import contextlib
import shutil
import time
import uuid
from pathlib import Path
from typing import Self

import xarray as xr

from finger_pin.exceptions import InputError
from finger_pin.files import NEW, publish
from finger_pin.simulation.netcdf import save
from finger_pin.simulation.recording import recorded_custom_parts

_HEADER = "# The input that led to the results in this folder, complete: running it again gives the same trajectory.\n"
_CUSTOM_HEADER = (
    "# The scenario of the results in this folder, run with a {} of its own: alone it gives another motion.\n"
)
_FILES = ("scenario.toml", "trajectory.nc", "animation.html")
_FIGURES = "figures"
# What has not been touched for so long, s, is from a run that was killed; a run makes its stage anew where need be.
_STAGE_PREFIX, _STALE_AGE = ".unfinished-", 3600.0


class ResultFolder:
    """A folder whose results are replaced as a whole.

    Results are written into `stage`, a hidden folder inside, and `publish` puts them into place. Without `publish`
    the folder stays as it was. Other files in it, and those in ``figures`` that are not images, are left alone.

        with ResultFolder("results/fig6") as folder:
            folder.write(result)
            folder.publish()

    Attributes:
        path: The folder.
        stage: Temporary folder with the layout of the final one.
    """

    def __init__(self, path: str | Path) -> None:
        """Make the folder and the stage.

        Args:
            path: The folder; it may exist.

        Raises:
            InputError: If it is no folder, or holds files of these names that no run wrote.
            OSError: If it cannot be written.
        """
        self.path = Path(path)
        self._staging = self.path / f"{_STAGE_PREFIX}{uuid.uuid4().hex[:12]}"
        self.stage = self._staging / NEW
        if "\0" in str(path):
            raise InputError("output", "is no name of a folder", str(path))
        self._check_contents()
        self._new_folders = [each for each in (self.path, *self.path.parents) if not each.exists()]
        try:
            self.stage.mkdir(parents=True)
        except OSError as error:
            self.discard()
            raise OSError(error.errno, error.strerror, str(path)) from None
        for stale in self.path.glob(f"{_STAGE_PREFIX}*"):
            with contextlib.suppress(OSError):
                if stale.stat().st_mtime < time.time() - _STALE_AGE:
                    shutil.rmtree(stale)

    def write(self, result: xr.Dataset) -> None:
        """Write the trajectory and the scenario that led to it into the stage.

        Raises:
            OSError: If they cannot be written, such as on a full disk.
        """
        self.stage.mkdir(parents=True, exist_ok=True)
        self._staging.touch()
        custom = recorded_custom_parts(result)
        header = _CUSTOM_HEADER.format(custom) if custom else _HEADER
        (self.stage / "scenario.toml").write_text(header + result.attrs["scenario"], encoding="utf-8", newline="\n")
        save(result, self.stage / "trajectory.nc")

    def publish(self) -> None:
        """Put the files of the stage in the place of an earlier run's, at one instant.

        Raises:
            OSError: If a file cannot be written; the earlier results are then in place.
        """
        publish(self._staging, self.path, lambda: _artifacts(self.path))

    def discard(self) -> None:
        """Remove the stage, and folders that were made and stayed empty."""
        shutil.rmtree(self._staging, ignore_errors=True)
        for folder in self._new_folders:
            with contextlib.suppress(OSError):
                folder.rmdir()

    def discard_views(self) -> None:
        """Remove figures and animation from the stage, such as those that an interruption left half drawn."""
        shutil.rmtree(self.stage / _FIGURES, ignore_errors=True)
        (self.stage / "animation.html").unlink(missing_ok=True)

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *error: object) -> None:
        """Remove the rest of the stage."""
        self.discard()

    def _check_contents(self) -> None:
        """Refuse to replace files that no run wrote."""
        path_text = str(self.path)
        for folder in (self.path, self.path / _FIGURES):
            if folder.exists() and not folder.is_dir():
                raise InputError("output", f"{folder} is a file; name a folder", path_text)
        existing = _artifacts(self.path)
        if existing and not _has_header(self.path):
            raise InputError(
                "output", f"holds a {Path(existing[0]).name} that is not from a run; name another folder", path_text
            )


def _artifacts(folder: Path) -> list[str]:
    """Return the names of the results in a folder."""
    figures = sorted(f"{_FIGURES}/{each.name}" for each in (folder / _FIGURES).glob("*.png"))
    return [name for name in [*_FILES, *figures] if (folder / name).exists()]


def _has_header(folder: Path) -> bool:
    try:
        with open(folder / "scenario.toml", "rb") as file:
            line = file.readline(1000).decode("utf-8", "replace")
            return any(line.startswith(header.split("{")[0]) for header in (_HEADER, _CUSTOM_HEADER))
    except OSError:
        return False
