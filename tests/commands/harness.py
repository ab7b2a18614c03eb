"""What the tests of the command simulate share."""

import subprocess
import sys
from pathlib import Path

from finger_pin.simulation.recorded import as_dataset
from finger_pin.views.summary import summarize

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "simulate.py"
ALL = {"scenario.toml", "trajectory.nc", "animation.html"}


class Quick:
    """In place of the process that writes and draws."""

    def __init__(self, figures, format=None):
        """Prepare to draw figures or not."""
        self.figures = figures

    def __enter__(self):
        """Return itself."""
        return self

    def __exit__(self, *error):
        """Leave things as they are."""

    def start(self, result, folder, drawn):
        folder.write(as_dataset(result))
        self.summary = summarize(as_dataset(result))
        for name in ("fig6", "energy") if self.figures and drawn else ():
            (folder.stage / "figures").mkdir(exist_ok=True)
            (folder.stage / "figures" / f"{name}.png").write_text(name)

    def written(self):
        return self.summary

    def wait(self):
        pass

    def stop(self):
        pass


def refused(answer, *says):
    code, out, lines = answer
    assert code == 2
    assert out == ""
    assert len(lines) == 1
    assert lines[0].isprintable()
    for each in says:
        assert each in lines[0]


def subprocess_of(*arguments, folder, **options):
    return subprocess.Popen(
        [sys.executable, str(SCRIPT), *map(str, arguments)],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
        **options,
    )
