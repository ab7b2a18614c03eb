"""The command simulate in an empty folder, with and without views."""

from pathlib import Path

import pytest
from harness import quick_figures
from wrong_inputs import PLANAR

from finger_pin.commands import application


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A working directory with a scenario in it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(PLANAR, encoding="utf-8")
    return tmp_path


@pytest.fixture
def run(capsys, here):
    """Run the command in this process; return exit code, standard output and the lines of standard error."""

    def run(*arguments):
        code = application.run("simulate", [str(each) for each in arguments])
        printed = capsys.readouterr()
        return code, printed.out, printed.err.splitlines()

    return run


@pytest.fixture
def quick(monkeypatch):
    """Views that cost nothing: the real ones have tests of their own."""

    def write_animation(result, path):
        Path(path).write_text("animation")

    monkeypatch.setattr("finger_pin.views.viewer.write_animation", write_animation)
    monkeypatch.setattr("finger_pin.views.plots.figure_files.draw_all", quick_figures)
