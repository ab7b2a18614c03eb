"""The convergence check: what it measures, when it warns, and how the command line tells."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from test_files import contents
from wrong_inputs import PLANAR

import finger_pin as fp
from finger_pin.commands.application import run as run_command
from finger_pin.exceptions import InputError, IntegrationError, Interrupted
from finger_pin.simulation.convergence import scenario_to_repeat
from finger_pin.views import plots
from finger_pin.views.summary import summarize

pytestmark = pytest.mark.slow

SHORT = {"simulation.duration": 0.3}
#: A stiff loop on joints with twice the friction at which this finger would lock itself, and six times its own.
HUNTING = {
    "controller.gain": 10.0,
    "finger.joint_friction.coulomb": 1.5e-3,
    "finger.joint_friction.stiction": 2.1e-3,
    "simulation.duration": 1.0,
}


@pytest.fixture(scope="module")
def calm():
    scenario = fp.load_scenario("reversals", SHORT)
    result = fp.simulate(scenario)
    return scenario, result, fp.check_convergence(scenario, result)


@pytest.fixture(scope="module")
def hunting():
    scenario = fp.load_scenario("reversals", HUNTING)
    result = fp.simulate(scenario)
    return scenario, result, fp.check_convergence(scenario, result)


def test_the_difference_is_the_error_of_the_run(calm):
    """Against a motion at 1e-11 by the other method."""
    _, result, found = calm
    settings = {"simulation.method": "Rodas4", "simulation.rtol": 1e-11, "simulation.atol_scale": 1e-11}
    truth = fp.simulate(fp.load_scenario("reversals", SHORT | settings))
    error = (result.joint_position - truth.joint_position).values
    assert np.abs(error).max() > 1e-8
    np.testing.assert_allclose(found.difference, error, rtol=0.0, atol=0.05 * np.abs(error).max())
    np.testing.assert_array_equal(found.largest, np.abs(found.difference).max(axis=0))
    np.testing.assert_array_equal(found.time, result.time)


def test_the_main_job_does_not_depend_on_its_tolerance(calm):
    _, _, found = calm
    assert found.converged and found.parting_time is None
    assert found.verdict.startswith("Converged: repeated at rtol 1e-08")
    assert repr(found) == f"<Convergence: {found.verdict}>"


def test_a_stiff_loop_with_high_joint_friction_hunts_and_parts_from_its_repetition(calm, hunting):
    _, quiet, _ = calm
    _, busy, found = hunting

    def reversals(result):
        velocity = result.joint_velocity.sel(joint="distal", time=slice(0.05, 0.3)).values
        return np.count_nonzero(np.diff(np.sign(velocity)))

    assert reversals(busy) > 5 * max(reversals(quiet), 1)
    assert not found.converged
    assert 0.05 < found.parting_time < 1.0
    before = np.searchsorted(found.time, found.parting_time)
    assert np.abs(found.difference[:before]).max() <= found.limit < np.abs(found.difference[before]).max()
    assert "Warning" in found.verdict and f"parts at t = {found.parting_time:.6g} s" in found.verdict


def test_where_a_run_parts_a_smaller_tolerance_helps():
    tighter = {"simulation.rtol": 1e-8, "simulation.atol_scale": 1e-8}
    assert fp.check_convergence(fp.load_scenario("reversals", HUNTING | tighter)).converged


def test_the_limit_says_what_parting_is(calm):
    scenario, result, found = calm
    strict = fp.check_convergence(scenario, result, limit=0.5 * float(found.largest.max()))
    assert not strict.converged
    np.testing.assert_array_equal(strict.difference, found.difference)


def test_a_coarse_run_is_told_from_a_fine_one():
    coarse = {"simulation.rtol": 0.1, "simulation.atol_scale": 0.1, "simulation.duration": 0.3}
    assert not fp.check_convergence(fp.load_scenario("reversals", coarse), limit=1e-4).converged


def test_tolerances_are_divided_as_far_as_they_go():
    scenario = fp.load_scenario("reversals", {"simulation.rtol": 1e-11, "simulation.atol_scale": 1e-9})
    settings = scenario_to_repeat(scenario).simulation
    assert (settings.rtol, settings.atol_scale) == (1e-12, pytest.approx(1e-11))
    assert scenario_to_repeat(scenario, 10.0).simulation.atol_scale == pytest.approx(1e-10)
    assert settings.duration == scenario.simulation.duration


@pytest.mark.parametrize(
    ("overrides", "options", "entry"),
    [
        ({"simulation.rtol": 1e-12}, {}, "simulation.rtol"),
        ({"simulation.atol_scale": 1e-15}, {}, "simulation.atol_scale"),
        ({}, {"factor": 1.0}, "factor"),
        ({}, {"factor": float("nan")}, "factor"),
        ({}, {"limit": 0.0}, "limit"),
        ({"controller.gain": 2.0}, {"result": True}, "result"),
    ],
)
def test_a_check_that_cannot_be_made_is_refused_by_name(calm, overrides, options, entry):
    if "result" in options:
        options = {"result": calm[1]}
    with pytest.raises(InputError) as caught:
        fp.check_convergence(fp.load_scenario("reversals", SHORT | overrides), **options)
    assert caught.value.entry == entry


def test_a_sampled_controller_is_sampled_in_both_runs(monkeypatch):
    seen = []

    def watch(scenario, **options):
        seen.append((scenario.simulation.rtol, options["control_period"]))
        return fp.simulate(scenario, **options)

    monkeypatch.setattr("finger_pin.simulation.convergence.simulate", watch)
    found = fp.check_convergence(fp.load_scenario("reversals", {"simulation.duration": 0.02}), control_period=2e-3)
    assert seen == [(1e-6, 2e-3), (pytest.approx(1e-8), 2e-3)]
    assert found.converged


def test_difference_and_verdict_are_in_the_dataset_survive_its_file_and_are_summed_up(hunting, calm, tmp_path):
    for _, result, found in (hunting, calm):
        checked = found.attach(result)
        assert "convergence_difference" not in result
        assert checked.convergence_difference.attrs["units"] == "rad"
        fp.save(checked, tmp_path / "r.nc")
        kept = fp.load(tmp_path / "r.nc")
        xr.testing.assert_identical(kept.convergence_difference, checked.convergence_difference)
        assert kept.attrs["convergence"] == found.verdict
        assert np.isnan(kept.attrs["convergence_parting_time"]) == found.converged
        lines = summarize(kept).splitlines()
        assert max(map(len, lines)) <= 80
        assert found.verdict in " ".join(lines)
        assert f"distal        {found.largest[3]:.1e}" in summarize(kept)
        assert "tighter" not in summarize(result)


def test_the_figure_shows_the_greatest_differences_and_where_the_runs_part(hunting, calm, tmp_path):
    for _, result, found in (hunting, calm):
        checked = found.attach(result)
        (axes,) = plots.plot_convergence(checked).axes
        drawn = {line.get_label(): line.get_ydata() for line in axes.get_lines()}
        for joint, largest in zip(found.joints, found.largest, strict=True):
            assert max(drawn[joint]) == pytest.approx(np.rad2deg(largest), rel=1e-12)
        written = [text.get_text() for text in axes.texts]
        assert written == ([] if found.converged else [f" parts at {found.parting_time:.3g} s"])
        names = {path.name for path in plots.draw_all(checked, tmp_path)}
        assert names == {"fig6.png", "losses.png", "energy.png", "convergence.png"}


def test_an_interrupted_repetition_is_drawn_and_summed_up_as_far_as_it_goes(calm):
    _, result, found = calm
    part = replace(found, time=found.time[:100], difference=found.difference[:100])
    checked = part.attach(result)
    assert int(checked.convergence_difference.notnull().all("joint").sum()) == 100
    assert f"{part.largest[0]:.1e}" in summarize(checked)
    (axes,) = plots.plot_convergence(checked).axes
    assert axes.get_lines()[0].get_xdata().max() <= found.time[99]


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Run the script without views on the planar finger; return exit code, output, and lines of standard error."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(PLANAR, encoding="utf-8")
    monkeypatch.setattr("finger_pin.views.viewer.write_animation", lambda result, path: path.write_text("animation"))

    def run(*arguments, scenario="s.toml"):
        code = run_command("simulate", [scenario, "--check", "--no-figures", "--output", "out", *arguments])
        printed = capsys.readouterr()
        return code, printed.out, printed.err.splitlines()

    return run


def test_the_command_line_checks_on_request_and_stores_what_it_found(run, tmp_path):
    code, out, lines = run()
    assert (code, lines) == (0, [])
    assert "Converged: repeated at rtol 1e-05" in out
    kept = fp.load(tmp_path / "out" / "trajectory.nc")
    assert 0.0 < float(abs(kept.convergence_difference).max()) < 1e-3
    # The repetition leaves no trace in what is resolved: it is the run that was asked for.
    assert fp.load_scenario(tmp_path / "out" / "scenario.toml").simulation.rtol == 1e-3


def test_a_run_that_parts_is_a_warning_and_no_error(run, tmp_path, hunting):
    sets = [part for key, value in HUNTING.items() for part in ("--set", f"{key}={value}")]
    code, out, lines = run(*sets, scenario="reversals")
    assert (code, lines) == (0, [])
    assert "Warning: repeated at rtol 1e-08" in out
    assert f"the run parts at t = {hunting[2].parting_time:.6g} s" in " ".join(out.split())


@pytest.mark.parametrize(
    ("error", "expected", "says"),
    [
        (IntegrationError(0.002, "too stiff", "another method"), 0, "convergence could not be checked: the"),
        (Interrupted(0.002), 130, "interrupted at t = 0.002 s; before convergence was checked; what was"),
    ],
)
def test_a_check_that_fails_keeps_the_run(run, tmp_path, monkeypatch, error, expected, says):
    def fail(*arguments, **options):
        raise error

    monkeypatch.setattr("finger_pin.simulation.convergence.check_convergence", fail)
    code, out, lines = run()
    assert (code, len(lines)) == (expected, 1)
    assert says in lines[0]
    assert "Tension" in out
    assert "convergence_difference" not in fp.load(tmp_path / "out" / "trajectory.nc")


def test_a_tolerance_that_cannot_be_tightened_is_refused_before_anything_is_simulated(run, tmp_path):
    before = contents(tmp_path)
    code, out, lines = run("--set", "simulation.rtol=1e-12")
    assert (code, out, len(lines)) == (2, "", 1)
    assert "simulation.rtol = 1e-12: must be above 1e-12" in lines[0]
    assert contents(tmp_path) == before
