"""The command observe: a log becomes the observation that `fp.observe` makes of it, a figure and a summary."""

import tomllib

import numpy as np
import pytest
import scipy.stats
import xarray as xr

import finger_pin as fp
from finger_pin.commands import application

COULOMB = "finger.tendon_friction.coulomb"


@pytest.fixture(scope="module")
def log():
    """The text of a log of 0.5 s: one column is of no sensor, one reading is missing, and one time."""
    run = fp.simulate(fp.load_scenario("wound", {"simulation.duration": 0.5}))
    columns = run.time.values, run.motor_position.values[:, 0], run.motor_current.values[:, 0]
    rows = [[f"{each:.6f}" for each in row] + ["31"] for row in zip(*columns, strict=True)]
    rows[100][1] = rows[200][0] = ""
    names = ["time (s)", "motor_position.servo (rad)", "motor_current.servo (A)", "temperature"]
    return "\n".join(",".join(row) for row in [names, *rows])


@pytest.fixture
def here(log, tmp_path, monkeypatch):
    """A working directory with the log, and results of identifications."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "log.csv").write_text(log)
    (tmp_path / "short.csv").write_text("\n".join(log.splitlines()[:20]))
    (tmp_path / "angles.csv").write_text("time,motor_position.servo\n0,0\n0.001,0\n")
    names = [COULOMB, "recordings.first.angle.offset"]
    columns = {"estimate": [0.2, 0.01], "lower": [0.18, 0.0], "upper": [0.22, 0.02]}
    fit = xr.Dataset({name: ("parameter", values) for name, values in columns.items()}, {"parameter": names})
    fp.save(fit, tmp_path / "identification.nc")
    fp.save(xr.Dataset({"other": 1.0}), tmp_path / "other.nc")
    return tmp_path


def files(folder):
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_a_log_becomes_a_file_a_figure_and_a_summary(here, capsys):
    before = files(here)
    assert application.run("observe", ["wound", "log.csv"]) == 0
    folder = here / "results" / "wound_observed"
    assert files(here) - before == {
        f"results/wound_observed/{name}" for name in ("observed.nc", "figures/observed.png")
    }
    observed, expected = fp.load(folder / "observed.nc"), fp.observe("wound", "log.csv")
    # How long steps took differs from time to time.
    xr.testing.assert_equal(observed.drop_vars("step_time"), expected.drop_vars("step_time"))
    said = capsys.readouterr().out
    assert "Skipped readings: motor_position.servo: 1\n" in said
    assert "Left out: temperature, 1 rows without a time\n" in said
    assert said.endswith("Results are in results/wound_observed\n")
    # A figure of an earlier result does not stay beside another one.
    assert application.run("observe", ["wound", "short.csv", "--no-figures", "--quiet"]) == 0
    assert capsys.readouterr().out == "" and not (folder / "figures" / "observed.png").exists()
    assert fp.load(folder / "observed.nc").sizes["time"] == 18


def test_options_say_what_is_uncertain_what_may_press_and_how_wide_bands_are(here):
    options = ["--force", "fingertip=0.4", "--uncertain", f"{COULOMB}=0.3", "--period", "0.002", "--level", "0.9"]
    changed = ["--set", "finger.joints.mcp.spring.stiffness=0.09", "--output", "out", "--no-figures"]
    assert application.run("observe", ["wound", "short.csv", *options, *changed]) == 0
    observed = fp.load(here / "out" / "observed.nc")
    assert (observed.attrs["level"], observed.attrs["period"]) == (0.9, 0.002)
    assert observed.attrs["uncertain"] == COULOMB
    finger = tomllib.loads(observed.attrs["scenario"])["finger"]
    assert finger["joints"]["mcp"]["spring"]["stiffness"] == 0.09
    # As long as the motor stands still nothing is known of a force but its size.
    half = 0.5 * (observed.fingertip_force_high - observed.fingertip_force_low)[0]
    np.testing.assert_allclose(half, 0.4 * scipy.stats.norm.ppf(0.95), rtol=1e-3)


def test_a_fit_gives_estimates_and_intervals_of_the_finger_and_says_what_is_not_of_it(here, capsys):
    line = ["wound", "short.csv", "--fit", "identification.nc", "--output", "out", "--no-figures"]
    assert application.run("observe", line) == 0
    observed = fp.load(here / "out" / "observed.nc")
    assert tomllib.loads(observed.attrs["scenario"])["finger"]["tendon_friction"]["coulomb"] == 0.2
    assert observed.attrs["uncertain"] == COULOMB
    assert "Left out: temperature, recordings.first.angle.offset of the fit\n" in capsys.readouterr().out


def test_what_was_observed_until_an_interruption_is_kept_without_a_figure(here, monkeypatch, capsys):
    from finger_pin.observation import observe as module

    observe, partial = module.observe, module.observe("wound", "short.csv")

    def interrupted(*arguments, **options):
        return observe(*arguments, **options, stop=iter([False] * 9 + [True]).__next__)

    monkeypatch.setattr(module, "observe", interrupted)
    assert application.run("observe", ["wound", "short.csv", "--output", "out"]) == 130
    (line,) = capsys.readouterr().err.splitlines()
    assert line == "observe.py: interrupted at t = 0.009 s; what was observed is in out"
    assert files(here / "out") == {"observed.nc"}
    np.testing.assert_array_equal(fp.load(here / "out" / "observed.nc").joint_position, partial.joint_position[:9])


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["wound"], "Missing argument 'LOG'"),
        (["wound", "none.csv"], "readings none.csv: there is no such file"),
        (["wond", "log.csv"], "did you mean wound?"),
        (["wound", "angles.csv"], "must have motor_current.servo: the model is driven by it"),
        (["wound", "log.csv", "--period", "1"], "period = 1.0: must be above 0 and at most 0.1 s"),
        (["wound", "log.csv", "--level", "high"], "--level = high: "),
        (["wound", "log.csv", "--force", "0.2"], "--force: 0.2: must be TIP=N, such as fingertip=0.15"),
        (["wound", "log.csv", "--force", "thumb=0.2"], "forces.thumb: no such tip"),
        (
            ["wound", "log.csv", "--uncertain", f"{COULOMB}=much"],
            f"--uncertain {COULOMB}: much: must be a finite number",
        ),
        (["wound", "log.csv", "--uncertain", "a.b=1", "--uncertain", "a.b=2"], "an earlier one sets the same entry"),
        (
            ["wound", "log.csv", "--uncertain", f"{COULOMB}=-1"],
            f"uncertain.{COULOMB} = -1.0: must be a part of the value",
        ),
        (["wound", "log.csv", "--fit", "identification.nc", "--uncertain", "a.b=1"], "--uncertain: has no effect"),
        (["wound", "log.csv", "--output", "other.nc"], 'output = "other.nc": is a file; name a folder'),
        (["wound", "log.csv", "--fit", "none.nc"], "--fit: none.nc: cannot be read: "),
        (["wound", "log.csv", "--fit", "other.nc"], "--fit: other.nc: must be the result of an identification"),
        (
            ["wound", "log.csv", "--fit", "identification.nc", "--set", f"{COULOMB}=0.1"],
            f"{COULOMB}: --fit sets the same",
        ),
    ],
)
def test_wrong_input_is_named_in_one_line_and_nothing_is_written(here, capsys, arguments, says):
    before = files(here)
    assert application.run("observe", arguments) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert says in line and files(here) == before
