"""The script that draws the paper's figures, with a short simulation in place of the long one."""

import numpy as np
import pytest
import xarray as xr
from paper.reproduce import comparison, reproduce

import finger_pin as fp
from finger_pin.commands.application import run_function
from finger_pin.exceptions import IntegrationError

pytestmark = pytest.mark.slow

FIGURES = {"fig2.png", "fig3.png", "fig6.png", "losses.png", "energy.png"}


@pytest.fixture(scope="module")
def short():
    return fp.simulate(fp.load_scenario("fig6", {"simulation.duration": 0.01}))


def test_all_figures_of_the_paper_land_in_one_folder(short, monkeypatch, tmp_path, capsys):
    asked = []

    def simulate(scenario, progress):
        asked.append(scenario)
        return short

    monkeypatch.setattr("finger_pin.simulation.simulate.simulate", simulate)
    assert run_function(reproduce, ["--output", str(tmp_path / "paper")]) == 0
    assert {path.name for path in (tmp_path / "paper").iterdir()} == FIGURES
    assert asked == [fp.load_scenario("fig6")]
    output = capsys.readouterr().out
    for name in FIGURES:
        assert str(tmp_path / "paper" / name) in output


def test_the_comparison_gives_the_largest_errors_and_tensions_after_the_first_second():
    time = np.array([0.0, 0.9, 1.0, 2.0])
    error = np.deg2rad([[9.0, 9.0], [9.0, 9.0], [0.5, -1.25], [-0.75, 0.5]])
    tension = [[90.0, 90.0], [90.0, 90.0], [1.5, 2.0], [8.5, 3.0]]
    result = xr.Dataset(
        {"tracking_error": (("time", "joint"), error), "tendon_tension": (("time", "tendon"), tension)},
        {"time": time, "joint": ["abduction", "other"], "tendon": ["T3", "T9"]},
    )
    header, *rows = [line.split() for line in comparison(result)]
    assert header == ["After", "the", "first", "1", "s", "simulated", "expected"]
    assert rows[0] == ["largest", "error,", "abduction", "(°)", "0.75", "near", "0.5"]
    assert rows[1] == ["largest", "error,", "other", "(°)", "1.25"]
    assert rows[2] == ["tension,", "T3", "(N)", "1.5", "to", "8.5", "up", "to", "about", "9"]
    assert rows[3] == ["tension,", "T9", "(N)", "2.0", "to", "3.0"]


def test_a_run_shorter_than_a_second_says_that_there_is_nothing_to_compare(short):
    (line,) = comparison(short)
    assert "nothing to compare" in line


def test_a_folder_that_cannot_be_made_is_told_in_one_line(tmp_path, capsys):
    blocked = tmp_path / "file"
    blocked.write_text("")
    assert run_function(reproduce, ["--output", str(blocked)]) == 1
    error = capsys.readouterr().err
    assert str(blocked) in error and error.count("\n") == 1


def test_a_failed_integration_has_its_own_exit_code(monkeypatch, tmp_path, capsys):
    def simulate(scenario, progress):
        raise IntegrationError(0.5, "step size too small", "a smaller simulation.rtol")

    monkeypatch.setattr("finger_pin.simulation.simulate.simulate", simulate)
    assert run_function(reproduce, ["--output", str(tmp_path)]) == 3
    assert "0.5 s" in capsys.readouterr().err
