"""A set of files that takes the place of another as a whole, even if the process is killed on the way.

The new set is complete in a stage, a hidden folder inside the one that it is for, with a manifest of what comes and
what goes. Renaming the stage is the moment of decision: before it the earlier set stays, after it the new one comes.
Then files are moved one by one. Whoever finds a renamed stage whose owner is gone finishes the moves: the next writer,
or the next reader.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import shutil
import tempfile
from collections.abc import Iterable
from pathlib import Path

_STAGE, _DECIDED = ".unfinished-", ".publishing"
_MANIFEST, _EARLIER = ".manifest", ".earlier"


class Stage:
    """A folder in which a set of files is made. It is locked by its owner, so that others know whether he lives.

    Attributes:
        folder: What the files are for.
        path: Where to write them; gone after `publish` and `discard`.
    """

    def __init__(self, folder: Path) -> None:
        """Make a stage in a folder, finish what a killed process left half moved, and remove stages of the dead.

        Raises:
            OSError: If it cannot be written.
        """
        self.folder = folder
        settle(folder)
        for stale in folder.glob(f"{_STAGE}*"):
            _remove_ownerless(stale)
        self._lock: int | None = None
        while self._lock is None:
            self.path = Path(tempfile.mkdtemp(dir=folder, prefix=_STAGE))
            # Before it is locked, another process may take it for one of the dead, and remove it.
            self._lock = _locked(self.path)

    def publish(self, new: Iterable[Path], earlier: Iterable[Path]) -> None:
        """Move files into place and others out of the way; first all earlier ones go, then all new ones come.

        Args:
            new: Files in the stage.
            earlier: Files in the folder, listed when it was settled.

        Raises:
            OSError: If a file cannot be moved; the earlier ones are then back in place.
        """
        manifest = {
            "new": [each.relative_to(self.path).as_posix() for each in new],
            "earlier": [each.relative_to(self.folder).as_posix() for each in earlier],
        }
        with open(self.path / _MANIFEST, "w", encoding="utf-8") as file:
            json.dump(manifest, file)
            file.flush()
            os.fsync(file.fileno())
        decided = self.folder / _DECIDED
        os.rename(self.path, decided)
        done: list[tuple[Path, Path]] = []
        try:
            _move(self.folder, done)
            os.rename(decided, self.path)
        except BaseException:
            for source, target in reversed(done):
                os.rename(target, source)
            os.rename(decided, self.path)
            raise
        _remove_emptied(self.folder, manifest["earlier"])
        self.discard()

    def discard(self) -> None:
        """Remove the stage, and let go of it."""
        shutil.rmtree(self.path, ignore_errors=True)
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


def settle(folder: Path) -> None:
    """Finish what a process that was killed had begun to publish in a folder; wait for one that is at it.

    Raises:
        OSError: If a file cannot be moved.
    """
    decided = folder / _DECIDED
    while (lock := _locked(decided)) is not None:
        try:
            earlier = _move(folder, [])
            remains = tempfile.mkdtemp(dir=folder, prefix=_STAGE)
            os.rename(decided, remains)
            _remove_emptied(folder, earlier)
            shutil.rmtree(remains, ignore_errors=True)
        finally:
            os.close(lock)


def _move(folder: Path, done: list[tuple[Path, Path]]) -> list[str]:
    """Make the moves of a manifest that have not been made, and list them; return the names of the earlier files.

    Every state on the way is told from every other: a new file is either still in the stage or in place, and an
    earlier file is in place only as long as a new one of its name is not.
    """
    decided = folder / _DECIDED
    manifest = json.loads((decided / _MANIFEST).read_text(encoding="utf-8"))
    new, earlier = manifest["new"], manifest["earlier"]
    goes = [name for name in earlier if name not in new or os.path.lexists(decided / name)]
    moves = [(folder / name, decided / _EARLIER / name) for name in goes]
    moves += [(decided / name, folder / name) for name in new]
    for source, target in moves:
        if os.path.lexists(source):
            target.parent.mkdir(parents=True, exist_ok=True)
            os.rename(source, target)
            done.append((source, target))
    return list(earlier)


def _remove_emptied(folder: Path, names: Iterable[str]) -> None:
    """Remove folders that files have left empty."""
    for parent in {(folder / name).parent for name in names} - {folder}:
        with contextlib.suppress(OSError):
            parent.rmdir()


def _remove_ownerless(stage: Path) -> None:
    """Remove a stage whose owner was killed."""
    lock = _locked(stage, wait=False)
    if lock is not None:
        shutil.rmtree(stage, ignore_errors=True)
        os.close(lock)


def _locked(stage: Path, *, wait: bool = True) -> int | None:
    """Return the open lock of a stage; None where there is no stage, or it is another's and not waited for.

    Where locks are not supported one that is waited for is taken for granted, and no other.
    """
    while True:
        try:
            lock = os.open(stage, os.O_RDONLY | os.O_DIRECTORY)
        except (FileNotFoundError, NotADirectoryError):
            return None
        try:
            # The system lets go of it when its owner dies, however that happens.
            fcntl.flock(lock, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            if not wait:
                os.close(lock)
                return None
        with contextlib.suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(lock), os.stat(stage)):
                return lock
        # While we waited its owner renamed it, and there may be another of its name by now.
        os.close(lock)
