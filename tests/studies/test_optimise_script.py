"""The search on the command line: what it writes, how it ends, and that killing it costs nothing that was done."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import finger_pin as fp

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "optimise.py"
QUICK = (
    "--over", "controller.gain=0.5:2", "--minimise", "tracking_rms", "--minimise", "tension_peak",
    "--constraint", "self_locking_margin>=1.1", "--population", "8", "--set", "simulation.duration=0.1",
    "--output", "out",
)  # fmt: skip


def start(folder, *arguments):
    return subprocess.Popen(
        [sys.executable, str(SCRIPT), *map(str, arguments)],
        cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, encoding="utf-8",
    )  # fmt: skip


def lines(path):
    data = path.read_bytes() if path.exists() else b""
    return [json.loads(line) for line in data[: data.rfind(b"\n") + 1].splitlines()]


@pytest.fixture
def script(monkeypatch):
    """The script's module, for what ends before anything runs."""
    monkeypatch.syspath_prepend(str(SCRIPT.parent))
    monkeypatch.setattr(sys, "argv", [str(SCRIPT)])
    sys.modules.pop("optimise", None)
    yield __import__("optimise")
    sys.modules.pop("optimise", None)


def test_a_search_killed_in_mid_run_goes_on_and_ends_with_a_front_that_can_be_simulated(
    script, tmp_path, monkeypatch, capsys
):
    path = tmp_path / "out" / "runs.jsonl"
    killed = start(tmp_path, *QUICK, "--generations", "3")
    while len(lines(path)) < 11:
        assert killed.poll() is None, killed.communicate()
        time.sleep(0.005)
    os.kill(killed.pid, signal.SIGKILL)
    killed.communicate()
    before = path.read_bytes()
    monkeypatch.chdir(tmp_path)
    assert script.main([*QUICK, "--generations", "3"]) == 0
    assert path.read_bytes().startswith(before[: before.rfind(b"\n") + 1])
    # The start is a design of the first generation as well, and run once.
    assert len({line["key"] for line in lines(path)}) == len(lines(path)) == 24
    assert "25 designs: 25 keep all bounds" in capsys.readouterr().out
    found = {each.relative_to(tmp_path / "out").as_posix() for each in (tmp_path / "out").rglob("*") if each.is_file()}
    assert {"study.toml", "optimise.nc", "front.csv", "front/01.toml", "figures/pareto.png"} <= found
    result = fp.load_result(tmp_path / "out" / "optimise.nc")
    best = result.isel(sample=int((result["front"].values == 1).argmax()))
    again = fp.simulate(fp.load_scenario(tmp_path / "out" / "front" / "01.toml"))
    assert float(again["tendon_command"][:, :4].max()) <= float(best["tension_peak"])


def test_a_search_without_a_design_that_keeps_the_bounds_has_its_own_exit_code(script, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    arguments = ["--over", "controller.gain=0.5:2", "--minimise", "self_locking_margin", "--population", "4"]
    arguments += [
        "--generations",
        "1",
        "--constraint",
        "self_locking_margin<=1e-3",
        "--set",
        "simulation.duration=0.02",
    ]
    assert script.main([*arguments, "--quiet"]) == 3
    assert capsys.readouterr().err == "optimise.py: no design keeps all constraints\n"
    assert (tmp_path / "results" / "optimise-fig6" / "figures" / "pareto.png").exists()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--over", "controller.gain=1"), "LOW:HIGH"),
        (("--over", "controller.gain=2:1"), "lower one first"),
        (("--over", "controler.gain=1:2"), "did you mean controller.gain"),
        (("--minimise", "loses"), "did you mean losses"),
        (("--constraint", "losses"), "NAME>=VALUE"),
        (("--constraint", "loses<=1"), "did you mean losses"),
        (("--constraint", "losses<=1", "--no-constraints"), "contradicts"),
        (("--population", "2"), "at least 4"),
        (("--generations", "0"), "at least 1"),
        (("--seed", "-1"), "at least 0"),
        (("--workers", "0"), "workers"),
        (("--workers", "2", "--scheduler", "tcp://h:1"), "--workers"),
        (("--scheduler", "nonsense://h"), "scheduler"),
        (("--set", "simulation.duration=-1"), "must be above 0"),
        (("--minimize", "losses"), "did you mean --minimise"),
        (("fig7",), "did you mean fig6"),
        (("--output", "file"), "cannot be written"),
    ],
)
def test_wrong_options_are_one_line_and_write_nothing(script, tmp_path, monkeypatch, capsys, arguments, says):
    monkeypatch.chdir(tmp_path)
    Path("file").touch()
    try:
        code = script.main(list(arguments))
    except SystemExit as end:
        code = end.code
    printed = capsys.readouterr()
    assert code == 2
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert printed.err.startswith("optimise.py: ")
    assert says in printed.err
    assert [each.name for each in tmp_path.iterdir()] == ["file"]
