"""The sweep on the command line: what it writes, how it ends, and that killing it costs nothing that was done."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import finger_pin as fp

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "sweep.py"
SHORT = ("--set", "simulation.duration=0.02")


def start(folder, *arguments):
    return subprocess.Popen(
        [sys.executable, str(SCRIPT), *map(str, arguments)],
        cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, encoding="utf-8",
        start_new_session=True,
    )  # fmt: skip


def finish(process):
    out, err = process.communicate(timeout=600)
    return process.returncode, out, err


def lines(path):
    data = path.read_bytes() if path.exists() else b""
    return [json.loads(line) for line in data[: data.rfind(b"\n") + 1].splitlines()]


def wait_for_lines(process, path, count):
    while len(lines(path)) < count:
        assert process.poll() is None, process.communicate()
        time.sleep(0.005)


def test_a_sweep_writes_its_results_and_says_what_came_out(script, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    radius = "finger.tendons.T3.crossings.medial.radius"
    over = ["--over", "controller.gain=0.5:2:2", "--over", f"{radius}=-0.005,0.0063"]
    assert script.main([*over, "--metric", "tracking_rms", *SHORT]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    assert "4 runs: 2 done, 2 failed" in printed.out
    assert "force closure" in printed.out
    (folder,) = (tmp_path / "results").iterdir()
    assert folder.name.startswith("sweep-reversals-duration-0.02-gain-0.5to2to2-tendons.T3.")
    found = {str(each.relative_to(folder)) for each in folder.rglob("*") if each.is_file()}
    assert found == {".lock", "runs.jsonl", "sweep.nc", "figures/sweep.png"}
    assert dict(fp.load(folder / "sweep.nc").sizes) == {"controller.gain": 2, radius: 2}


@pytest.mark.slow
@pytest.mark.filterwarnings("default:out/runs.jsonl")
def test_a_sweep_killed_in_mid_run_goes_on_without_repeating_or_losing_a_run(script, tmp_path, monkeypatch, capsys):
    arguments = (
        "--over", "controller.gain=0.5:2:7", "--over", "finger.tendon_friction.coulomb=0.05,0.1", "--workers", "2",
        "--metric", "tracking_rms", "--set", "simulation.duration=0.3", "--output", "out", "--no-figures",
    )  # fmt: skip
    path = tmp_path / "out" / "runs.jsonl"
    killed = start(tmp_path, *arguments)
    wait_for_lines(killed, path, 3)
    os.kill(killed.pid, signal.SIGKILL)
    finish(killed)
    before = path.read_bytes()
    assert 3 <= len(lines(path)) < 14
    assert not (tmp_path / "out" / "sweep.nc").exists()
    with path.open("ab") as file:
        file.write(b'{"key": "torn')
    monkeypatch.chdir(tmp_path)
    assert script.main(list(arguments)) == 0
    printed = capsys.readouterr()
    assert "14 runs: 14 done" in printed.out and "runs.jsonl: lines that are not whole" in printed.err
    whole = before[: before.rfind(b"\n") + 1]
    assert path.read_bytes().startswith(whole)
    assert len({line["key"] for line in lines(path)}) == len(lines(path)) == 14
    assert np.isfinite(fp.load(tmp_path / "out" / "sweep.nc")["tracking_rms"]).all()


@pytest.mark.slow
def test_an_interrupt_keeps_what_was_done_and_says_so(tmp_path):
    arguments = ("--over", "controller.gain=0.5:2:40", "--set", "simulation.duration=0.3", "--output", "out")
    path = tmp_path / "out" / "runs.jsonl"
    process = start(tmp_path, *arguments, "--quiet")
    wait_for_lines(process, path, 2)
    # As a terminal does: to all processes at once.
    os.killpg(process.pid, signal.SIGINT)
    code, out, err = finish(process)
    assert (code, out) == (130, "")
    assert re.fullmatch(r"sweep\.py: interrupted; .*\n", err)
    result = fp.load(tmp_path / "out" / "sweep.nc")
    assert int((result["status"] == "done").sum()) == len(lines(path)) >= 2
    assert (result["status"] == "missing").any()


@pytest.mark.slow
def test_every_run_failing_has_its_own_exit_code(script, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    static = ["--over", "finger.joint_friction.stiction=3e-4,3.4e-4"]
    kinetic = ["--over", "finger.joint_friction.coulomb=3.2e-4,3.5e-4"]
    assert script.main(["--design", "list", *static, *kinetic, *SHORT]) == 3
    error = capsys.readouterr().err
    assert "every run failed" in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((), "--over"),
        (("--over", "controller.gain"), "START:STOP:N"),
        (("--over", "controller.gain=1:2"), "START:STOP:N"),
        (("--over", "controler.gain=1,2"), "did you mean controller.gain"),
        (("--over", "controller.kind=1,2"), "must be one of"),
        (("--over", "controller.gain=1,2", "--over", "controller.gain=3"), "twice"),
        (("--over", "controller.gain=1,2", "--metric", "loses"), "did you mean losses"),
        (("--over", "controller.gain=1,2", "--metric", "losses", "--metric", "losses"), "twice"),
        (("--over", "controller.gain=1,2", "--design", "latin"), "--samples"),
        (("--over", "controller.gain=1,2", "--samples", "3"), "--samples"),
        (("--over", "controller.gain=1:2", "--design", "latin", "--samples", "0"), "at least 1"),
        (("--over", "controller.gain=1,2", "--seed", "3"), "--seed"),
        (("--over", "controller.gain=1,2", "--design", "gird"), "is not one of"),
        (("--over", "controller.gain=1,2", "--workers", "0"), "workers"),
        (("--over", "controller.gain=1,2", "--workers", "x"), "--workers = x: "),
        (
            ("--over", "controller.gain=1,2", "--format=gif"),
            "--format = gif: 'gif' is not one of 'png', 'pdf', 'svg'\n",
        ),
        (("--over", "controller.gain=1,2", "--workers", "2", "--scheduler", "tcp://h:1"), "--workers"),
        (("--over", "controller.gain=1,2", "--scheduler", "nonsense://h"), "scheduler"),
        (("--over", "controller.gain=1,2", "--set", "controller"), "KEY=VALUE"),
        (("--over", "controller.gain=1,2", "--set", "simulation.duration=-1"), "must be above 0"),
        (("--over", "controller.gain=1,2", "--ouput", "x"), "did you mean --output"),
        (("fig7", "--over", "controller.gain=1,2"), "did you mean fig6"),
        (("--over", "controller.gain=1,2", "--output", "file"), "cannot be written"),
    ],
)
def test_wrong_options_are_one_line_and_write_nothing(script, refuses, arguments, says):
    refuses(script, arguments, says)


@pytest.mark.slow
def test_another_study_in_the_folder_does_its_own_runs_and_one_of_an_earlier_version_is_left_as_it_is(
    script, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    common = ["--metric", "self_locking_margin", "--workers", "1", "--output", "out", "--quiet", *SHORT]
    assert script.main(["--over", "controller.gain=1,2", *common]) == 0
    before = Path("out/runs.jsonl").read_bytes()
    assert script.main(["--over", "controller.gain=1,3", *common]) == 0
    after = Path("out/runs.jsonl").read_bytes()
    assert after.startswith(before)
    assert [line["point"]["controller.gain"] for line in lines(Path("out/runs.jsonl"))] == [1, 2, 3]
    assert fp.load("out/sweep.nc")["controller.gain"].values.tolist() == [1.0, 3.0]
    Path("out/study.toml").touch()
    assert script.main(["--over", "controller.gain=1,4", *common]) == 2
    assert "name another folder" in capsys.readouterr().err
    assert Path("out/runs.jsonl").read_bytes() == after


def test_metrics_are_listed(script, capsys):
    assert script.main(["--list"]) == 0
    assert "self_locking_margin" in capsys.readouterr().out
