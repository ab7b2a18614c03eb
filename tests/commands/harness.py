"""Helpers of the tests of the command simulate."""

import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "simulate.py"
ALL = {"scenario.toml", "trajectory.nc", "animation.html"}


def quick_figures(result, folder, names=None, format=None):
    """In place of figures."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{name}.png" for name in ("fig6", "energy")]
    for path in paths:
        path.write_text(path.stem)
    return paths


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
