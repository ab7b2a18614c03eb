"""The process that writes and draws: what it says, and that nothing is lost with it."""

import os
import re
import shutil
import signal
import sys

import pytest
from test_files import contents

import finger_pin as fp
from finger_pin.commands.writing import NotDrawn, Writing
from finger_pin.simulation.results import ResultFolder
from finger_pin.views.summary import summarize


def test_the_process_that_writes_says_what_went_wrong_and_leaves_with_the_one_that_started_it(
    tmp_path, monkeypatch, capfd
):
    result = fp.simulate(fp.load_scenario("fig6", {"simulation.duration": 0.01}))
    with ResultFolder(tmp_path / "out") as folder:
        with monkeypatch.context() as broken:
            broken.setitem(sys.modules, "finger_pin.views.plots", None)
            with Writing(figures=True) as writing:
                writing.process.join()
                writing.start(result, folder)
                assert writing.written() is None
                with pytest.raises(NotDrawn, match="plots"):
                    writing.wait()
        with Writing(figures=True) as writing:
            # No figure without it.
            writing.start(result.drop_vars("joint_reference"), folder)
            assert writing.written() is not None
            with pytest.raises(NotDrawn, match="joint_reference"):
                writing.wait()
        with Writing(figures=True) as writing:
            os.kill(writing.process.pid, signal.SIGKILL)
            writing.process.join()
            writing.start(result, folder)
            assert writing.written() is None
            with pytest.raises(NotDrawn, match="killed"):
                writing.wait()
        shutil.rmtree(folder.stage / "figures")
        for figures, drawn, large in ((False, True, 1e8), (True, False, 1e8), (True, False, 0.0), (True, True, 0.0)):
            assert not (folder.stage / "figures").exists()
            monkeypatch.setattr("finger_pin.commands.writing._LARGE", large)
            with Writing(figures) as writing:
                writing.start(result, folder, drawn)
                assert writing.written() == summarize(result)
                assert fp.load_result(folder.stage).equals(result)
                writing.wait()
        found = {path.name for path in (folder.stage / "figures").iterdir()}
        assert found == {"fig6.png", "losses.png", "energy.png"}
        shutil.rmtree(folder.stage / "figures")
        (folder.stage / "figures").touch()
        with Writing(figures=True) as writing:
            writing.start(result, folder)
            assert writing.written() == summarize(result)
            with pytest.raises(FileExistsError):
                writing.wait()
        shutil.rmtree(folder.stage)
        folder.stage.touch()
        with Writing(figures=True) as writing:
            writing.start(result, folder)
            with pytest.raises(FileExistsError, match=re.escape(str(folder.stage))):
                writing.written()
    with Writing(figures=True) as writing:
        pass
    assert writing.process.exitcode == -signal.SIGKILL
    assert capfd.readouterr().err == ""


def test_data_are_written_though_the_process_that_writes_is_killed(run, here, monkeypatch):
    started = Writing.start

    def killed(writing, *given):
        os.kill(writing.process.pid, signal.SIGKILL)
        writing.process.join()
        started(writing, *given)

    monkeypatch.setattr(Writing, "start", killed)
    code, out, lines = run("s.toml", "--output", "out")
    assert (code, lines) == (
        1,
        [
            "simulate.py: animation and figures cannot be drawn: the process that draws was killed; "
            "what was computed is in out"
        ],
    )
    assert set(contents(here / "out")) == {"scenario.toml", "trajectory.nc"}
    assert fp.load_result("out").sizes["time"] > 1
    assert "Tracking error" in out
