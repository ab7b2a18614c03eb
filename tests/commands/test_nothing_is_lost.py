"""A run that is killed leaves the old results or the new ones, whole; one that can still speak keeps what it has."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from wrong_inputs import PLANAR

import finger_pin as fp
from finger_pin.commands import application

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "simulate.py"


@pytest.fixture
def started(tmp_path):
    """Start runs of the planar finger that go to the same folder; wait until the simulation has begun."""
    (tmp_path / "s.toml").write_text(PLANAR, encoding="utf-8")

    def start(*arguments):
        command = [sys.executable, str(SCRIPT), "s.toml", "--output", "out", "--no-figures", *arguments]
        process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        before = set(tmp_path.glob("out/.unfinished-*"))
        deadline = time.monotonic() + 600.0
        while process.poll() is None and not set(tmp_path.glob("out/.unfinished-*")) - before:
            assert time.monotonic() < deadline
            time.sleep(0.002)
        return process

    return start


def whole(folder: Path) -> float:
    """Return the duration asked for by the results in a folder, which belong together."""
    result = fp.load(folder / "trajectory.nc")
    assert (folder / "scenario.toml").read_text(encoding="utf-8").endswith(result.attrs["scenario"])
    return fp.load_scenario(folder / "scenario.toml").simulation.duration


@pytest.mark.slow
def test_a_run_killed_at_any_moment_leaves_whole_results(started, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert application.run("simulate", ["s.toml", "--output", "out", "--no-figures", "--quiet"]) == 0
    for delay in (0.0, 0.3):
        process = started("--duration", "0.01")
        time.sleep(delay)
        process.kill()
        process.communicate(timeout=600)
        assert whole(tmp_path / "out") in (0.005, 0.01)


@pytest.mark.slow
def test_ctrl_c_in_a_real_run_ends_it_with_a_trajectory(started, tmp_path):
    # At rest a thousand seconds are over in no time.
    (tmp_path / "s.toml").write_text('extends = "reversals"\n', encoding="utf-8")
    process = started("--duration", "1000", "--set", "simulation.sample_rate=100")
    time.sleep(0.7)
    process.send_signal(signal.SIGINT)
    out, said = process.communicate(timeout=600)
    assert process.returncode == 130
    assert re.fullmatch(r"simulate.py: interrupted at t = [\d.e-]+ s; what was computed is in out\n", said)
    assert "Tracking error" in out
    assert whole(tmp_path / "out") == 1000.0
    result = fp.load(tmp_path / "out" / "trajectory.nc")
    assert 0.0 <= float(result["time"][-1]) <= result.attrs["end_time"] < 1000.0
    assert {each.name for each in (tmp_path / "out").iterdir()} == {"scenario.toml", "trajectory.nc"}
