"""The comparison of controllers: its figures from their definitions, and the claim that it makes."""

from functools import partial

import numpy as np
import pytest
import xarray as xr
from paper.comparison import CASES, compare, csv_rows
from paper.controllers import controllers
from paper.plot_controllers import plot_controllers

import finger_pin as fp
from finger_pin.commands.application import run_function

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def coupling(routing):
    return routing.coupling


@pytest.fixture(scope="module")
def runs():
    names = ("paper", "all friction", "all friction, f5d 4 N, loop")
    return {
        name: fp.simulate(fp.load_scenario("reversals", {**CASES[name], "simulation.duration": 4.0})) for name in names
    }


@pytest.fixture(scope="module")
def rows(runs, coupling):
    return {name: compare(name, result, coupling) for name, result in runs.items()}


def test_every_case_is_sampled_alike_and_no_two_are_the_same():
    cases = [fp.load_scenario("reversals", overrides) for overrides in CASES.values()]
    for scenario in cases:
        assert scenario.controller.sampling.period == 1e-3
        looped = isinstance(fp.control.build_controller(scenario), fp.control.PassiveTensionLoop)
        assert looped == (scenario.controller.passive_tension_loop is not None)
    assert all(one.controller != other.controller for k, one in enumerate(cases) for other in cases[:k])


def test_friction_compensation_cuts_the_error_by_three_at_no_more_than_1_3_times_the_peak_tension(rows):
    """A whole period of the motion, four seconds after the first, with every minimum tension as in the paper's run."""
    paper, best = rows["paper"], rows["all friction, f5d 4 N, loop"]
    assert best.error < paper.error / 3.0
    assert best.peak_tension < 1.3 * paper.peak_tension
    assert best.passive_tension[0] == pytest.approx(4.0, abs=0.1)


def test_with_the_passive_tension_left_to_itself_the_rest_of_the_error_is_its_stretch(rows):
    row = rows["all friction"]
    assert row.error < rows["paper"].error / 2.2
    assert row.passive_error > 0.9 * row.error


def test_the_figures_are_those_of_their_definitions(runs, rows, coupling):
    result, row = runs["paper"].sel(time=slice(1.0, None)), rows["paper"]
    error = np.rad2deg(result.tracking_error.values)
    np.testing.assert_allclose(row.joint_error, [np.sqrt(np.mean(each**2)) for each in error.T], rtol=1e-12)
    assert row.error == pytest.approx(np.sqrt(np.mean(row.joint_error**2)), rel=1e-12)
    assert row.peak_tension == result.tendon_command[:, :4].max()
    # Least error e with the same stretch, -3.5 e3 + 5 e4 in mm: along (-3.5, 5), by Cauchy and Schwarz.
    stretch = error[:, 3] * 5.0 - error[:, 2] * 3.5
    assert row.passive_error == pytest.approx(np.sqrt(np.mean(stretch**2) / (3.5**2 + 5.0**2) / 4.0), rel=1e-9)
    power = sum(result[f"power_tendon_{law}"].values for law in ("coulomb", "viscous", "micro_damping"))
    assert row.tendon_loss == pytest.approx(1e3 * np.trapezoid(power, result.time.values), rel=0.01)


def test_the_csv_file_has_a_header_and_a_line_per_controller(rows):
    joints = ["abduction", "proximal", "medial", "distal"]
    lines = list(csv_rows(list(rows.values()), joints, ["T5"]))
    assert len(lines) == 4 and len({len(line) for line in lines}) == 1
    assert [line[0] for line in lines[1:]] == list(rows)
    column = lines[0].index("peak command (N)")
    assert float(lines[1][column]) == pytest.approx(rows["paper"].peak_tension, rel=1e-5)


def test_the_figure_shows_the_errors_and_the_bars(runs, rows):
    short: dict[str, xr.Dataset] = {name: result.isel(time=slice(0, 100)) for name, result in runs.items()}
    figure = plot_controllers(short, list(rows.values()))
    error = np.rad2deg(short["paper"].tracking_error.values)
    np.testing.assert_allclose(figure.axes[2].lines[0].get_ydata(), error[:, 2])
    # Rms errors do not add up, so that no bar lies on another.
    below, *others = sorted((bar.get_y(), bar.get_y() + bar.get_height()) for bar in figure.axes[4].patches)
    for above in others:
        assert above[0] > below[1]
        below = above
    assert len(others) == 2 * len(rows) - 1
    widths = [bar.get_width() for bar in figure.axes[5].patches]
    np.testing.assert_allclose(widths, [row.peak_tension for row in rows.values()])


@pytest.fixture
def script(monkeypatch):
    short = {"controller.sampling.period": 1e-3, "simulation.duration": 1.02}
    monkeypatch.setattr("paper.comparison.CASES", {"paper": short, "all friction": {**short, **CASES["all friction"]}})
    return partial(run_function, controllers)


def test_the_script_shows_the_table_and_writes_it_with_the_figure(script, tmp_path, capsys):
    assert script(["--output", str(tmp_path / "made")]) == 0
    assert sorted(each.name for each in (tmp_path / "made").iterdir()) == ["controllers.csv", "controllers.png"]
    shown = capsys.readouterr()
    assert "paper" in shown.out and str(tmp_path) in shown.out.replace("\n", "")
    assert shown.err == ""


def test_the_script_says_in_one_line_that_it_cannot_write(script, tmp_path, capsys):
    (tmp_path / "taken").write_text("")
    assert script(["--output", str(tmp_path / "taken")]) == 1
    assert capsys.readouterr().err.count("\n") == 1


def test_the_script_keeps_the_rows_that_it_has_when_interrupted(script, tmp_path, monkeypatch, capsys):
    whole, done = fp.simulate, []

    def second_is_interrupted(scenario, **options):
        done.append(scenario)
        if len(done) == 2:
            raise KeyboardInterrupt
        return whole(scenario, **options)

    monkeypatch.setattr("finger_pin.simulation.simulate.simulate", second_is_interrupted)
    assert script(["--output", str(tmp_path)]) == 130
    assert len((tmp_path / "controllers.csv").read_text().splitlines()) == 2
    assert "interrupted" in capsys.readouterr().err
