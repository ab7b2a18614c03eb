"""Figures drawn by a process of their own, which gets ready while the simulation runs.

Run as a module it is that process: it takes the folder of a trajectory from standard input, and answers on standard
output what went wrong.
"""

from __future__ import annotations

import gc
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Self

from finger_pin.exceptions import FingerPinError


class NotDrawn(FingerPinError):
    """Figures or animation cannot be drawn; the data are kept."""


@contextmanager
def without_dask() -> Iterator[None]:
    """Keep xarray from importing Dask, which takes half a second, only because it is installed.

    xarray remembers what there is: this is for a process that has not imported it yet, and does nothing in another.
    """
    if {"xarray", "dask"} & sys.modules.keys():
        yield
        return
    sys.modules["dask"] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        del sys.modules["dask"]


class Drawing:
    """The process that draws. It is killed when the ``with`` statement ends.

    Attributes:
        process: The process.
    """

    def __enter__(self) -> Self:
        """Start the process."""
        pipe = subprocess.PIPE
        command = [sys.executable, "-P", "-m", __name__]
        # In a session of its own it gets no interrupt from the terminal; only the process that started it does.
        self.process = subprocess.Popen(
            command, stdin=pipe, stdout=pipe, stderr=pipe, text=True, start_new_session=True
        )
        return self

    def __exit__(self, *error: object) -> None:
        """End the process."""
        self.process.kill()
        self.process.communicate()

    def start(self, folder: Path) -> None:
        """Have the figures of ``trajectory.nc`` in a folder drawn into ``figures`` there."""
        assert self.process.stdin is not None
        try:
            print(json.dumps(str(folder.absolute())), file=self.process.stdin, flush=True)
        except BrokenPipeError:
            pass  # `wait` reports why it ended.

    def wait(self) -> None:
        """Wait until the figures are drawn.

        Raises:
            OSError: If they cannot be written.
            NotDrawn: If they cannot be drawn.
        """
        assert self.process.stdout is not None and self.process.stderr is not None
        # Its answer is enough; its end takes a while.
        answer = self.process.stdout.readline()
        if answer:
            number, text = json.loads(answer)
        else:
            number, text = 0, (self.process.stderr.read().strip().splitlines() or ["killed"])[-1]
        if number:
            raise OSError(number, os.strerror(number))
        if text:
            raise NotDrawn(text)


def serve() -> None:
    """Draw the figures of the folder that standard input names, and answer an error number and a text."""
    # Imports leave no garbage to look for, and the process does not live long.
    gc.disable()
    with without_dask():
        import xarray as xr

        from finger_pin.views.plots import draw_all

        folder = sys.stdin.readline()
        if not folder:
            return
        answer: tuple[int, str] = (0, "")
        try:
            stage = Path(json.loads(folder))
            draw_all(xr.load_dataset(stage / "trajectory.nc", engine="netcdf4"), stage / "figures")
        except Exception as error:
            # The netCDF library has negative numbers of its own.
            number = getattr(error, "errno", None) or 0
            answer = (max(number, 0), f"{type(error).__name__}: {error}")
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    serve()
