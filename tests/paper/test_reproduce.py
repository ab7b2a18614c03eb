"""The script that draws the paper's figures, with a short simulation in place of the long one."""

import pytest
from paper.reproduce import reproduce

import finger_pin as fp
from finger_pin.commands.application import run_function
from finger_pin.exceptions import IntegrationError

pytestmark = pytest.mark.slow

FIGURES = {"fig2.png", "fig3.png", "fig6.png", "fig6_printed.png", "losses.png", "energy.png"}


@pytest.fixture(scope="module")
def short():
    return fp.simulate(fp.load_scenario("fig6", {"simulation.duration": 0.5, "simulation.sample_rate": 50.0}))


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


def test_a_folder_that_cannot_be_made_is_refused_in_one_line(tmp_path, capsys):
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
