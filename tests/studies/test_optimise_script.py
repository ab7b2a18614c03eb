"""The search on the command line: what it writes, how it ends, and that a kill costs nothing that was done."""

import json
from pathlib import Path

import pytest

import finger_pin as fp
from finger_pin.studies import METRICS, Run

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "optimise.py"
QUICK = (
    "--over", "controller.gain=0.5:2", "--minimise", "tracking_rms", "--minimise", "tension_peak",
    "--constraint", "self_locking_margin>=1.1", "--population", "8", "--generations", "3", "--output", "out",
    "--set", "simulation.duration=0.1",
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.filterwarnings("default:out/runs.jsonl")
def test_a_search_goes_on_from_what_a_kill_leaves_and_ends_with_the_same_front(script, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    folder = Path("out")
    assert script.main(list(QUICK)) == 0
    assert "25 designs: 25 keep all bounds" in capsys.readouterr().out
    found = {each.relative_to(folder).as_posix() for each in folder.rglob("*") if each.is_file()}
    assert {"runs.jsonl", "optimise.nc", "front.csv", "front/01.toml", "figures/pareto.png"} <= found
    whole, table = fp.load(folder / "optimise.nc"), (folder / "front.csv").read_text()
    lines = (folder / "runs.jsonl").read_bytes().splitlines(keepends=True)
    # The start is a design of the first generation as well, and run once.
    assert len(lines) == 24
    # Killed while the twelfth record was being written.
    for each in folder.rglob("*"):
        if each.is_file():
            each.unlink()
    (folder / "runs.jsonl").write_bytes(b"".join(lines[:11]) + lines[11][:40])
    assert script.main([*QUICK, "--quiet"]) == 0
    again = (folder / "runs.jsonl").read_bytes().splitlines(keepends=True)
    assert again[:11] == lines[:11]
    assert len(again) == len({json.loads(line)["key"] for line in again}) == 24
    assert fp.load(folder / "optimise.nc").equals(whole)
    assert (folder / "front.csv").read_text() == table


@pytest.mark.slow
def test_a_design_of_the_front_can_be_simulated_and_gives_its_numbers(script, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert script.main([*QUICK, "--population", "4", "--generations", "1", "--quiet"]) == 0
    result = fp.load(Path("out", "optimise.nc"))
    best = result.isel(sample=int((result["front"].values == 1).argmax()))
    run = Run(fp.load_scenario(Path("out", "front", "01.toml")))
    for name in ("tracking_rms", "tension_peak"):
        assert METRICS[name].measure(run) == float(best[name])


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
    assert list(tmp_path.glob("results/optimise-reversals-*/figures/pareto.png"))


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
def test_wrong_options_are_one_line_and_write_nothing(script, refuses, arguments, says):
    refuses(script, arguments, says)
