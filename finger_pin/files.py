"""Files that appear whole or not at all: single ones (`replacing`), and sets at one instant (`publish`); texts read.

A new set is complete in a hidden folder inside the one that it is for, beside hard links to the earlier set, and a
symbolic link ``now`` says which of the two is valid. While files change places every name in the folder leads through
``now``: switching that one link publishes the new set. Then the links give way to the files themselves. At whatever
instant a process is killed, every name leads to a file of the same set; the next process that publishes tidies up.
"""

from __future__ import annotations

import contextlib
import csv
import errno
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from finger_pin.exceptions import InputError

_HIDDEN, _NOW, _OLD = ".publishing", "now", "old"
#: Where to write the new set in a folder that is to be published.
NEW = "new"
# Publishing takes milliseconds: what takes longer, s, was killed.
_PATIENCE = 5.0
# Of a text that is read, bytes.
_LARGEST = 100_000_000


@contextlib.contextmanager
def replacing(path: str | Path) -> Iterator[str]:
    """Give a temporary path beside a file, and move it into place only if all went well.

    An earlier file of that name stays untouched until the new one is complete. A device or a pipe is itself written to.
    """
    target = Path(path)
    if target.exists() and not (target.is_file() or target.is_dir()):
        yield str(target)
        return
    handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{target.stem}-", suffix=target.suffix)
    os.close(handle)
    try:
        # mkstemp makes files private; a result is an ordinary file.
        os.chmod(temporary, 0o666 & ~_umask())
        yield temporary
        os.replace(temporary, target)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def write_text(path: str | Path, text: str) -> None:
    """Write a text, whole or not at all."""
    with replacing(path) as temporary:
        Path(temporary).write_text(text, encoding="utf-8", newline="\n")


def write_table(path: str | Path, rows: Iterable[Iterable[object]]) -> None:
    """Write rows as comma-separated text, whole or not at all."""
    with replacing(path) as temporary, open(temporary, "w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def publish(stage: Path, folder: Path, earlier: Callable[[], Iterable[str]]) -> None:
    """Put a set of files in the place of another.

    Args:
        stage: A folder inside the other one, on the same file system; the set is below ``stage / NEW``. Gone after it.
        folder: Folder of the files.
        earlier: Lists the names, relative to the folder, that the earlier set has.

    Raises:
        OSError: If a file cannot be written; the earlier set then stays in place.
    """
    hidden = folder / _HIDDEN
    _claim(stage, hidden)
    try:
        for name in earlier():
            (hidden / _OLD / name).parent.mkdir(parents=True, exist_ok=True)
            _link(folder / name, hidden / _OLD / name)
        try:
            os.symlink(_OLD, hidden / _NOW)
        except OSError:
            # A file system without links: file by file, each of them whole.
            os.rename(hidden / NEW, hidden / _NOW)
            for name in set(_names(hidden / _OLD)) - set(_names(hidden / _NOW)):
                os.unlink(folder / name)
            return
        for name in _names(hidden / NEW) + _names(hidden / _OLD):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            os.symlink(os.path.relpath(hidden / _NOW / name, (folder / name).parent), hidden / "link")
            os.replace(hidden / "link", folder / name)
        os.symlink(NEW, hidden / "next")
        os.replace(hidden / "next", hidden / _NOW)
    finally:
        # Every name leads to the right file by now; what cannot be tidied up, the next process does.
        with contextlib.suppress(OSError):
            _tidy(folder)


def _claim(stage: Path, hidden: Path) -> None:
    """Rename a stage; wait for a process that is publishing, and tidy up for one that was killed."""
    deadline = time.monotonic() + _PATIENCE
    while True:
        try:
            os.rename(stage, hidden)
            return
        except OSError as error:
            # Who was publishing may have finished meanwhile.
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST) and not hidden.is_dir():
                raise
        with contextlib.suppress(FileNotFoundError):
            if time.monotonic() > deadline or time.time() > hidden.stat().st_mtime + _PATIENCE:
                _tidy(hidden.parent)
        time.sleep(0.01)


def _tidy(folder: Path) -> None:
    """Put the files that count in the place of the links to them, and remove the rest."""
    hidden = folder / _HIDDEN
    for name in _names(hidden / NEW) + _names(hidden / _OLD) + _names(hidden / _NOW):
        target = folder / name
        if (hidden / _NOW / name).exists():
            target.parent.mkdir(parents=True, exist_ok=True)
            os.replace(hidden / _NOW / name, target)
        elif target.is_symlink() and not target.exists():
            target.unlink()
            if target.parent != folder:
                with contextlib.suppress(OSError):
                    target.parent.rmdir()
    shutil.rmtree(hidden)


def _names(folder: Path) -> list[str]:
    return sorted(each.relative_to(folder).as_posix() for each in folder.rglob("*") if each.is_file())


def _link(source: Path, target: Path) -> None:
    """Give a file a second name, or copy it on systems without them."""
    try:
        os.link(source.resolve(), target)
    except OSError:
        shutil.copy2(source, target)


def read_text(what: str, path: Path, encoding: str = "utf-8-sig", hint: str = "") -> str:
    """Return the text of a file; the hint ends the message of one in another encoding."""
    try:
        if path.is_fifo():
            raise InputError(what, "is a pipe, which may never end; give a file")
        with open(path, "rb") as file:
            data = file.read(_LARGEST + 1)
    except FileNotFoundError:
        raise InputError(what, "there is no such file") from None
    except (OSError, ValueError) as error:
        raise InputError(what, f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(data) > _LARGEST:
        raise InputError(what, f"is larger than {_LARGEST} bytes")
    try:
        return data.decode(encoding)
    except UnicodeError:
        raise InputError(what, f"is not a text file in {encoding.removesuffix('-sig').upper()}{hint}") from None


def expand(name: str) -> Path:
    """Return a path with ~ expanded where there is a home folder."""
    try:
        return Path(name).expanduser()
    except RuntimeError:
        return Path(name)
