"""The command simulate when something goes wrong on the way: how it ends, and that nothing is lost."""

import os
import re
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from harness import ALL, subprocess_of
from test_files import contents

import finger_pin as fp
from finger_pin.description.loading import load_scenario
from finger_pin.exceptions import IntegrationError


def test_a_failed_integration_saves_its_computed_part(run, here, quick, monkeypatch):
    partial = fp.simulate(load_scenario("s.toml", {"simulation.duration": 0.002}))

    def fail(scenario, **options):
        raise IntegrationError(0.002, "the step size became too small", "a smaller simulation.rtol", partial)

    monkeypatch.setattr("finger_pin.simulation.simulate.run", fail)
    code, out, lines = run("s.toml", "--output", "out")
    assert code == 3
    assert len(lines) == 1
    for says in ("t = 0.002 s", "the step size became too small", "a smaller simulation.rtol", "is in out"):
        assert says in lines[0]
    assert fp.load("out/trajectory.nc").equals(partial)
    assert "flexor_distal" in out


#: A rope as stiff and a mass as small as may be, without friction, at a tolerance that rounding errors exceed.
TOO_STIFF = {
    "finger.passive_tendon.stiffness": 1e10,
    "finger.passive_tendon.mass": 1e-18,
    "finger.tendon_friction.coulomb": 0.0,
    "finger.tendon_friction.viscous": 0.0,
    "simulation.rtol": 1e-12,
    "simulation.atol_scale": 1e-15,
    "simulation.sample_rate": 1e7,
}


@pytest.mark.slow
def test_an_integration_that_fails_by_itself_ends_with_3_says_when_and_what_to_try_and_saves_what_it_has(
    run, here, quick
):
    sets = [part for key, value in TOO_STIFF.items() for part in ("--set", f"{key}={value}")]
    code, out, lines = run("reversals", "--output", "out", "--duration", "0.1", *sets)
    assert (code, len(lines)) == (3, 1)
    said = re.fullmatch(
        r"simulate.py: the integration stopped at t = ([\d.e-]+) s: .* largest in passive_velocity\[T5\]; .*"
        r"try a larger simulation.rtol and simulation.atol_scale, .*; what was computed is in out",
        lines[0],
    )
    assert said
    kept, scenario = fp.load("out/trajectory.nc"), load_scenario("out/scenario.toml")
    assert 0.0 < kept.attrs["end_time"] < 0.1 == scenario.simulation.duration
    assert kept.attrs["end_time"] == pytest.approx(float(said[1]), rel=1e-5)
    assert len(kept.time) > 10 and kept.time[-1] <= kept.attrs["end_time"]
    assert all(np.isfinite(values).all() for values in kept.data_vars.values())
    assert "Tension" in out
    # What it says helps.
    loose = [part for key in ("rtol", "atol_scale") for part in ("--set", f"simulation.{key}=1e-7")]
    loose += ["--set", "simulation.sample_rate=1000"]
    assert run("out/scenario.toml", "--output", "out", *loose)[::2] == (0, [])


def test_a_run_that_computes_nothing_keeps_earlier_results(run, here, quick, monkeypatch):
    assert run("s.toml", "--output", "out")[0] == 0
    before = contents(here)

    def fail(scenario, **options):
        raise IntegrationError(0.0, "not finite", "another method", None)

    monkeypatch.setattr("finger_pin.simulation.simulate.run", fail)
    code, out, lines = run("s.toml", "--output", "out")
    assert (code, out, len(lines)) == (3, "", 1)
    assert "nothing was computed" in lines[0]
    assert contents(here) == before


def test_a_failed_run_leaves_no_figures_of_an_earlier_one(run, here, quick, monkeypatch):
    assert run("s.toml", "--output", "out")[0] == 0

    def fail(*arguments, **options):
        raise ValueError("axis limits cannot be NaN")

    monkeypatch.setattr("finger_pin.views.plots.figure_files.draw_all", fail)
    code, _, lines = run("s.toml", "--output", "out", "--duration", "0.003")
    assert code == 1
    assert len(lines) == 1
    assert "cannot be drawn: ValueError: axis limits cannot be NaN" in lines[0]
    assert set(contents(here / "out")) == {"scenario.toml", "trajectory.nc"}
    assert load_scenario("out/scenario.toml").simulation.duration == 0.003


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_simulating_saves_what_was_computed(run, here, quick, monkeypatch, number):
    # What takes it from there must have done so before it is replaced.
    from finger_pin.simulation.simulate import run as simulate

    def interrupted(scenario, *, stop, **options):
        asked = []

        def counted():
            asked.append(None)
            if len(asked) == 1:
                os.kill(os.getpid(), number)
            return stop()

        return simulate(scenario, stop=counted, **options)

    monkeypatch.setattr("finger_pin.simulation.simulate.run", interrupted)
    handler = signal.getsignal(number)
    code, out, lines = run("s.toml", "--output", "out", "--duration", "5")
    assert signal.getsignal(number) is handler
    assert code == 130
    assert len(lines) == 1
    assert re.search(r"interrupted at t = [\d.e-]+ s; what was computed is in out", lines[0])
    assert set(contents(here / "out")) == {"scenario.toml", "trajectory.nc"}
    assert fp.load("out/trajectory.nc").attrs["end_time"] < 5.0
    assert load_scenario("out/scenario.toml").simulation.duration == 5.0
    assert "Tension" in out


def test_a_second_signal_ends_at_once_and_leaves_earlier_results(run, here, quick, monkeypatch):
    assert run("s.toml", "--output", "out")[0] == 0
    before = contents(here)

    def stubborn(scenario, **options):
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(1.0)
        pytest.fail("went on")

    monkeypatch.setattr("finger_pin.simulation.simulate.run", stubborn)
    code, out, lines = run("s.toml", "--output", "out")
    assert (code, out, lines) == (130, "", ["simulate.py: interrupted"])
    assert contents(here) == before


def test_a_signal_while_drawing_keeps_the_trajectory_and_no_half_drawn_figures(run, here, quick, monkeypatch):
    def slow(*arguments, **options):
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(1.0)
        pytest.fail("went on")

    monkeypatch.setattr("finger_pin.views.plots.figure_files.draw_all", slow)
    code, _, lines = run("s.toml", "--output", "out")
    assert code == 130
    assert lines == ["simulate.py: interrupted; what was computed is in out"]
    assert set(contents(here / "out")) == {"scenario.toml", "trajectory.nc"}


@pytest.mark.parametrize("broken", ["saving", "drawing"])
def test_a_full_disk_ends_with_one_line_and_earlier_results_stay(run, here, quick, monkeypatch, broken):
    assert run("s.toml", "--output", "out")[0] == 0
    before = contents(here)

    def fail(*arguments, **options):
        raise OSError(28, "No space left on device")

    if broken == "saving":
        monkeypatch.setattr("finger_pin.simulation.result_folder.save", fail)
    else:
        monkeypatch.setattr("finger_pin.views.plots.figure_files.draw_all", fail)
    code, out, lines = run("s.toml", "--output", "out", "--duration", "0.003")
    assert (code, out, len(lines)) == (1, "", 1)
    assert "No space left on device; earlier results are as they were" in lines[0]
    assert contents(here) == before


@pytest.mark.slow
def test_a_reader_that_has_gone_is_no_error(here):
    process = subprocess_of("--list", folder=here)
    process.stdout.close()
    assert (process.stderr.read(), process.wait(timeout=600)) == ("", 0)
    process.stderr.close()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_output_that_cannot_be_printed_costs_one_line_and_results_are_kept(run, here, quick, monkeypatch):
    with open("/dev/full", "w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        code, _, lines = run("s.toml", "--output", "out")
    assert (code, lines) == (0, ["standard output cannot be written: No space left on device"])
    assert set(contents(here / "out")) >= ALL


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="limits of POSIX")
def test_a_disk_that_fills_up_in_a_real_run_ends_it_with_one_line(here):
    import resource

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

    with subprocess_of("s.toml", folder=here, preexec_fn=limit) as process:
        out, err = process.communicate(timeout=600)
    assert (process.returncode, out) == (1, "")
    assert err.count("\n") == 1
    assert "cannot be written" in err
    assert set(contents(here)) == {"s.toml"}
