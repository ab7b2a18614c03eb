"""The command line: what it writes, what it says, how it ends, and what it leaves alone."""

import os
import re
import signal
import subprocess
import sys
import time
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
from test_files import contents
from test_loading import FILES, OTHER_OVERRIDES, PLANAR

import finger_pin as fp
from finger_pin.commands import application
from finger_pin.commands.drawing import Drawing, NotDrawn
from finger_pin.commands.options import overrides
from finger_pin.description.loading import load_scenario
from finger_pin.exceptions import IntegrationError
from finger_pin.views.summary import summarize

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "simulate.py"
ALL = {"scenario.toml", "trajectory.nc", "animation.html"}


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A working directory with a scenario in it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(PLANAR, encoding="utf-8")
    return tmp_path


@pytest.fixture
def run(capsys, here):
    """Run the command in this process; return exit code, standard output and the lines of standard error."""

    def run(*arguments):
        code = application.run("simulate", [str(each) for each in arguments])
        printed = capsys.readouterr()
        return code, printed.out, printed.err.splitlines()

    return run


class Quick:
    """In place of the process that draws."""

    def start(self, folder):
        (folder / "figures").mkdir()
        for name in ("fig6", "energy"):
            (folder / "figures" / f"{name}.png").write_text(name)

    def wait(self):
        pass


@pytest.fixture
def quick(monkeypatch):
    """Views that cost nothing: the real ones have tests of their own."""

    def write_animation(result, path):
        Path(path).write_text("animation")

    monkeypatch.setattr("finger_pin.views.viewer.write_animation", write_animation)
    monkeypatch.setattr("finger_pin.commands.simulate.Drawing", lambda: nullcontext(Quick()))


def refused(answer, *says):
    code, out, lines = answer
    assert code == 2
    assert out == ""
    assert len(lines) == 1
    assert lines[0].isprintable()
    for each in says:
        assert each in lines[0]


def subprocess_of(*arguments, folder, **options):
    return subprocess.Popen(
        [sys.executable, str(SCRIPT), *map(str, arguments)],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
        **options,
    )


def test_a_run_writes_all_results_and_says_where(run, here):
    code, out, lines = run("s.toml", "--output", "out")
    assert (code, lines) == (0, [])
    found = contents(here / "out")
    assert ALL <= set(found)
    assert "figures/fig6.png" in found
    assert all(data is None or len(data) > 1000 for data in found.values())
    assert found["figures/fig6.png"].startswith(b"\x89PNG")
    assert b"http" not in re.findall(rb"<script[^>]*src=[^>]*>", found["animation.html"])
    assert "Results are in out" in out


def test_results_go_to_a_folder_of_the_scenarios_name_unless_told_otherwise(run, here, quick):
    assert run("s.toml", "--quiet")[0] == 0
    assert set(contents(here / "results")) >= {"s/trajectory.nc", "s/scenario.toml"}
    assert run("s.toml", "--quiet", "--set", "name=other")[0] == 0
    assert (here / "results" / "other" / "trajectory.nc").exists()


def test_a_variant_leaves_the_results_of_the_scenario_alone_and_says_where_its_own_are(run, here, quick):
    assert run("s.toml", "--quiet")[0] == 0
    before = contents(here / "results" / "s")
    code, out, lines = run("s.toml", "--set", "controller.gain=0.7", "--duration", "0.003")
    assert (code, lines) == (0, [])
    assert "Results are in results/s,controller.gain=0.7,duration=0.003" in out
    assert set(contents(here / "results")) >= {"s,controller.gain=0.7,duration=0.003/trajectory.nc"}
    assert contents(here / "results" / "s") == before


def test_the_resolved_scenario_gives_the_same_trajectory(run, here, quick):
    assert run("s.toml", "--set", "controller.gain=[1.1, 0.7]", "--output", "first")[0] == 0
    assert run("first/scenario.toml", "--output", "second")[0] == 0
    first, second = (fp.load_result(here / name / "trajectory.nc") for name in ("first", "second"))
    assert first.equals(second)
    assert (here / "first" / "scenario.toml").read_bytes() == (here / "second" / "scenario.toml").read_bytes()


def test_a_run_may_be_repeated_in_its_own_folder(run, here, quick):
    assert run("s.toml")[0] == 0
    before = contents(here / "results" / "s")
    assert run("results/s/scenario.toml")[0] == 0
    after = contents(here / "results" / "s")
    assert after["scenario.toml"] == before["scenario.toml"]
    assert set(after) == set(before)


def test_without_figures_those_of_an_earlier_run_are_gone_and_the_animation_is_new(run, here, quick):
    assert run("s.toml", "--output", "out")[0] == 0
    assert "figures/fig6.png" in contents(here / "out")
    assert run("s.toml", "--output", "out", "--no-figures")[0] == 0
    assert set(contents(here / "out")) == ALL


def test_a_finger_that_locks_itself_is_told_in_one_line_of_the_summary_and_nowhere_else(run, quick):
    stuck = ("fig6", "--duration", "0.01")
    for name in ("coulomb", "stiction"):
        stuck += ("--set", f"finger.joint_friction.{name}=5e-3")
    code, out, lines = run(*stuck)
    assert (code, lines) == (0, [])
    (told,) = [line for line in out.splitlines() if line.startswith("Warning:")]
    assert "of what locks the finger: tensions run away" in told and len(told) <= 80
    assert run(*stuck, "--quiet") == (0, "", [])
    assert "Warning" not in run("fig6", "--duration", "0.01")[1]


def test_quiet_prints_nothing(run, quick):
    assert run("s.toml", "--quiet") == (0, "", [])


def test_set_takes_toml_and_bare_words(run, here, quick):
    sets = ("simulation.method=BDF", "title=a bare title", "controller.gain = [1.0, 2.0]", "simulation.rtol=1e-5")
    assert run("s.toml", *(part for each in sets for part in ("--set", each)), "--output", "out")[0] == 0
    scenario = load_scenario(here / "out" / "scenario.toml")
    assert (scenario.simulation.method, scenario.title) == ("BDF", "a bare title")
    assert (scenario.controller.gain, scenario.simulation.rtol) == ((1.0, 2.0), 1e-5)


def test_set_names_a_finger_by_name_or_path():
    for text, value in (
        ("planar", "planar"),
        ("../my fingers/é.toml", "../my fingers/é.toml"),
        ("~/f.toml", "~/f.toml"),
        ("/a/f.toml", "/a/f.toml"),
        ("'quoted'", "quoted"),
        ("{base = 'ub'}", {"base": "ub"}),
        ("[1,\n2]", [1, 2]),
    ):
        assert overrides([f"finger={text}"]) == {"finger": value}


def test_duration_and_method_are_short_for_set_and_win_over_it(run, here, quick):
    changed = ("--duration", "0.003", "--method", "LSODA", "--set", "simulation.duration=9", "--output", "out")
    assert run("s.toml", *changed)[0] == 0
    scenario = load_scenario(here / "out" / "scenario.toml")
    assert (scenario.simulation.duration, scenario.simulation.method) == (0.003, "LSODA")
    assert fp.load_result(here / "out" / "trajectory.nc")["time"][-1] == 0.003


def test_list_names_scenarios_fingers_and_methods(run, here):
    code, out, lines = run("--list")
    assert (code, lines) == (0, [])
    for name in ("fig6", "stick_slip", "ub", "planar", "dexmart_index", "Radau"):
        assert re.search(rf"^  {name}\b", out, re.MULTILINE)
    assert set(contents(here)) == {"s.toml"}


def test_help_tells_every_option(run):
    code, out, lines = run("--help")
    assert (code, lines) == (0, [])
    for option in ("--set", "--duration", "--method", "--output", "--view", "--no-view", "--figures", "--no-figures"):
        assert option in out
    assert "--quiet" in out and "--list" in out and "--check" in out


def test_view_is_shown_after_the_results_are_written_and_only_if_asked(run, here, quick, monkeypatch):
    seen = []
    monkeypatch.setattr("finger_pin.views.viewer.view", lambda result: seen.append(set(contents(here / "out"))))
    assert run("s.toml", "--output", "other")[0] == 0
    assert seen == []
    assert run("s.toml", "--output", "out", "--view", "--no-figures")[0] == 0
    assert seen == [ALL]


def test_spaces_and_letters_beyond_ascii_in_paths(run, here, quick):
    folder = here / "mes résultats ∂"
    folder.mkdir()
    (folder / "mon scénario.toml").write_text(PLANAR, encoding="utf-8")
    code, out, lines = run("mes résultats ∂/mon scénario.toml", "--output", "mes résultats ∂/sortie θ")
    assert (code, lines) == (0, [])
    assert "sortie θ" in out
    assert set(contents(folder / "sortie θ")) >= ALL


@pytest.fixture(scope="module")
def result():
    return fp.simulate(load_scenario("fig6", {"simulation.duration": 0.02}))


def test_the_summary_names_every_joint_and_tendon_and_fits_a_terminal(result):
    lines = summarize(result).splitlines()
    for name in ("abduction", "proximal", "medial", "distal", "T1", "T2", "T3", "T4", "T5, proximal half"):
        assert any(line.startswith(f"  {name} ") for line in lines)
    assert max(map(len, lines)) <= 80
    assert all(line.isascii() for line in lines)


def row(result, name):
    line = next(line for line in summarize(result).splitlines() if line.startswith(f"  {name} "))
    return [float(each) for each in re.findall(r"-?\d+\.?\d*(?:e[+-]?\d+)?", line.removeprefix(f"  {name}"))]


def test_the_summary_tells_rms_and_largest_error_in_degrees(result):
    error = result["tracking_error"].sel(joint="medial").values * 180 / np.pi
    np.testing.assert_allclose(row(result, "medial"), [np.sqrt(np.mean(error**2)), abs(error).max()], atol=5e-5)
    assert "Tracking error, deg (whole run)" in summarize(result)


def test_the_first_second_of_a_long_run_is_left_out_and_that_is_said(result):
    long = result.isel(time=[0, 5, 10, 15, 20]).assign_coords(time=[0.0, 0.5, 1.0, 2.0, 3.0]).assign_attrs(end_time=3.0)
    values = np.deg2rad([50.0, 40.0, 3.0, -4.0, 0.0])
    long["tracking_error"] = long["tracking_error"].copy(data=np.repeat(values[:, None], 4, axis=1))
    assert "Tracking error, deg (after the first 1 s)" in summarize(long)
    np.testing.assert_allclose(row(long, "abduction"), [5.0 / np.sqrt(3.0), 4.0], atol=5e-5)


def test_the_summary_tells_least_and_greatest_tensions(result):
    tension = result["tendon_tension"].sel(tendon="T3")
    np.testing.assert_allclose(row(result, "T3"), [tension.min(), tension.max()], atol=5e-4)
    proximal = result["passive_tension_proximal"]
    np.testing.assert_allclose(row(result, "T5, proximal half"), [proximal.min(), proximal.max()], atol=5e-4)


def test_the_shares_of_the_energy_account_add_up(result):
    lines = summarize(result).splitlines()
    start = next(index for index, line in enumerate(lines) if line.startswith("Energy"))
    end = lines.index("", start)
    shares = {
        re.split(r"\s{2,}", line.strip())[0]: float(line.removesuffix(" %").split()[-1])
        for line in lines[start + 2 : end]
    }
    supplied = sum(share for name, share in shares.items() if name.startswith("supplied"))
    gone = sum(share for name, share in shares.items() if not name.startswith("supplied"))
    assert supplied == pytest.approx(gone, abs=0.05)
    assert abs(shares["residual, not accounted for"]) < 0.1
    assert {"lost by tendons sliding", "lost by joints sliding", "stored, end less start"} <= set(shares)


def test_the_summary_tells_the_cost(result):
    text, attributes = summarize(result), result.attrs
    assert f"{attributes['solver_steps']} steps, {attributes['solver_evaluations']} evaluations" in text
    factor = attributes["end_time"] / attributes["solver_wall_time"]
    assert f"Wall time {attributes['solver_wall_time']:.3g} s, real-time factor {factor:.3g}" in text


def test_the_summary_of_one_instant_and_of_a_saved_result(result, tmp_path):
    assert "abduction" in summarize(result.isel(time=[0]).assign_attrs(end_time=0.0))
    fp.save(result, tmp_path / "r.nc")
    assert summarize(fp.load_result(tmp_path / "r.nc")) == summarize(result)


@pytest.mark.parametrize(("text", "entry", "says"), OTHER_OVERRIDES, ids=[text[:50] for text, _, _ in OTHER_OVERRIDES])
def test_a_wrong_value_ends_with_one_line_and_leaves_everything_as_it_was(run, here, text, entry, says):
    (here / "results" / "fig6").mkdir(parents=True)
    (here / "results" / "fig6" / "trajectory.nc").write_text("earlier")
    before = contents(here)
    answer = run("fig6", "--set", text)
    refused(answer, entry)
    assert any(each in answer[2][0] for each in ((says,) if isinstance(says, str) else says))
    assert contents(here) == before


@pytest.mark.parametrize("case", FILES)
def test_a_wrong_file_ends_with_one_line_and_writes_nothing(run, here, case):
    data, names, says = FILES[case]
    (here / "case.toml").write_bytes(data)
    refused(run("case.toml"), names, says)
    assert set(contents(here)) == {"s.toml", "case.toml"}


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--hlep"], "did you mean --help?"),
        (["--figure"], "did you mean --figures?"),
        (["--no-figure"], "did you mean --no-figures?"),
        (["--durations", "1"], "did you mean --duration?"),
        (["--out", "x"], "--out: no such option"),
        (["-x"], "-x: no such option"),
        (["--bogus=1\n2"], "--bogus"),
        (["fig6", "fig6"], "unexpected extra argument(s) (fig6)"),
        (["--set"], "'--set' requires an argument"),
        (["--duration"], "'--duration' requires an argument"),
        (["--output"], "'--output' requires an argument"),
        (["--view=yes"], "--view"),
        (["--quiet=1"], "--quiet"),
        (["--set", "controller.gain"], "controller.gain: must be KEY=VALUE"),
        (["--set", "=2"], "must be KEY=VALUE"),
        (["--set", ""], "must be KEY=VALUE"),
        (["--set", "controller.gain="], "controller.gain: : must be TOML"),
        (["--set", "controller.gain=[1,"], "controller.gain: [1,: must be TOML"),
        (["--set", "controller.gain=1.0.0"], "controller.gain: 1.0.0: must be TOML"),
        (["--set", "controller.gain=1,2"], "controller.gain: 1,2: must be TOML"),
        (["--set", 'title="open'], "must be TOML"),
        (["--set", "controller.gain=1\nother = 2"], "must be TOML"),
        (["--set", "controller.gain=1\n[simulation]\nduration = 2"], "must be TOML"),
        (["--set", "controller.gain=" + "[" * 5000], "must be TOML"),
        (["--set", "controller.gain=" + "9" * 5000], "must be TOML"),
        (["--set", "controller.gain=two"], 'controller.gain = "two": must be a number'),
        (["--duration", "long"], 'simulation.duration = "long": must be a number'),
        (["--duration", "-1"], "simulation.duration = -1: must be above 0"),
        (["--duration", "0"], "simulation.duration = 0: must be above 0"),
        (["--duration", "nan"], "simulation.duration = nan: must be a finite number"),
        (["--duration", ""], "simulation.duration"),
        (["--method", "radau5"], "did you mean Radau?"),
        (["--method", "3"], "simulation.method = 3: must be one of"),
        (["fgi6"], "did you mean fig6?"),
        (["absent.toml"], "absent.toml: there is no such file"),
        (["."], "no such scenario"),
        (["./"], "cannot be read"),
        ([""], "no such scenario"),
        (["../../etc/passwd"], "scenario file ../../etc/passwd"),
        (["s.toml", "--set", "title=\udcff"], "title"),
        (["s.toml", "--output", "s.toml"], 'output = "s.toml": s.toml is a file'),
        (["s.toml", "--output", "."], "holds a s"),
    ],
    ids=lambda value: " ".join(value)[:50].encode("unicode_escape").decode() if isinstance(value, list) else "",
)
def test_a_wrong_command_line_ends_with_one_line_and_writes_nothing(run, here, arguments, says):
    if says == "holds a s":
        # Somebody's own scenario must not be replaced by the resolved one.
        (here / "scenario.toml").write_text(PLANAR)
    before = contents(here)
    refused(run(*arguments), says)
    assert contents(here) == before


def test_an_output_that_cannot_be_written_is_refused_before_anything_is_simulated(run, here, monkeypatch):
    mkdir = os.mkdir

    def refuse(path, *arguments):
        if str(path).startswith("a/b"):
            raise PermissionError(13, "Permission denied", str(path))
        mkdir(path, *arguments)

    monkeypatch.setattr(os, "mkdir", refuse)
    monkeypatch.setattr("finger_pin.simulation.simulate.simulate", lambda *a, **o: pytest.fail("simulated"))
    for output, says in (("a/b", "Permission denied"), ("s.toml/c", "Not a directory"), ("o" * 300, "too long")):
        code, out, lines = run("s.toml", "--output", output)
        assert (code, out, len(lines)) == (1, "", 1)
        assert "the results cannot be written: " in lines[0] and says in lines[0] and output in lines[0]
        assert set(contents(here)) == {"s.toml"}


def test_of_a_failed_integration_what_was_computed_is_saved(run, here, quick, monkeypatch):
    partial = fp.simulate(load_scenario("s.toml", {"simulation.duration": 0.002}))

    def fail(scenario, **options):
        raise IntegrationError(0.002, "the step size became too small", "a smaller simulation.rtol", partial)

    monkeypatch.setattr("finger_pin.simulation.simulate.simulate", fail)
    code, out, lines = run("s.toml", "--output", "out")
    assert code == 3
    assert len(lines) == 1
    for says in ("t = 0.002 s", "the step size became too small", "a smaller simulation.rtol", "is in out"):
        assert says in lines[0]
    assert fp.load_result("out/trajectory.nc").equals(partial)
    assert "flexor_distal" in out


#: A rope as stiff and a mass as small as may be, without friction, at a tolerance that rounding errors exceed.
TOO_STIFF = {
    "finger.passive_tendon.stiffness": 1e10,
    "finger.passive_tendon.mass": 1e-18,
    "finger.tendon_friction.coulomb": 0.0,
    "finger.tendon_friction.viscous": 0.0,
    "simulation.rtol": 1e-9,
    "simulation.atol_scale": 1e-9,
}


def test_an_integration_that_fails_by_itself_ends_with_3_says_when_and_what_to_try_and_saves_what_it_has(
    run, here, quick
):
    sets = [part for key, value in TOO_STIFF.items() for part in ("--set", f"{key}={value}")]
    code, out, lines = run("fig6", "--output", "out", "--duration", "1", *sets)
    assert (code, len(lines)) == (3, 1)
    said = re.fullmatch(
        r"simulate.py: the integration stopped at t = ([\d.e-]+) s: .* largest in passive_velocity\[T5\]; "
        r"try a larger simulation.rtol and simulation.atol_scale, .*; what was computed is in out",
        lines[0],
    )
    assert said
    kept, scenario = fp.load_result("out/trajectory.nc"), load_scenario("out/scenario.toml")
    assert 0.0 < kept.attrs["end_time"] < 1.0 == scenario.simulation.duration
    assert kept.attrs["end_time"] == pytest.approx(float(said[1]), rel=1e-5)
    assert len(kept.time) > 10 and kept.time[-1] <= kept.attrs["end_time"]
    assert all(np.isfinite(values).all() for values in kept.data_vars.values())
    assert "Tension" in out
    # What it says helps.
    loose = ("--set", "simulation.rtol=1e-7", "--set", "simulation.atol_scale=1e-7")
    assert run("out/scenario.toml", "--output", "out", *loose)[::2] == (0, [])


def test_where_nothing_was_computed_earlier_results_stay(run, here, quick, monkeypatch):
    assert run("s.toml", "--output", "out")[0] == 0
    before = contents(here)

    def fail(scenario, **options):
        raise IntegrationError(0.0, "not finite", "another method", None)

    monkeypatch.setattr("finger_pin.simulation.simulate.simulate", fail)
    code, out, lines = run("s.toml", "--output", "out")
    assert (code, out, len(lines)) == (3, "", 1)
    assert "nothing was computed" in lines[0]
    assert contents(here) == before


def test_a_failed_run_leaves_no_figures_of_an_earlier_one(run, here, quick, monkeypatch):
    assert run("s.toml", "--output", "out")[0] == 0

    def fail(drawing):
        raise NotDrawn("ValueError: axis limits cannot be NaN")

    monkeypatch.setattr(Quick, "wait", fail)
    code, _, lines = run("s.toml", "--output", "out", "--duration", "0.003")
    assert code == 1
    assert len(lines) == 1
    assert "cannot be drawn: ValueError: axis limits cannot be NaN" in lines[0]
    assert set(contents(here / "out")) == {"scenario.toml", "trajectory.nc"}
    assert load_scenario("out/scenario.toml").simulation.duration == 0.003


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_simulating_saves_what_was_computed(run, here, quick, monkeypatch, number):
    simulate = fp.simulate

    def interrupted(scenario, *, stop, **options):
        asked = []

        def counted():
            asked.append(None)
            if len(asked) == 2:
                os.kill(os.getpid(), number)
            return stop()

        return simulate(scenario, stop=counted, **options)

    monkeypatch.setattr("finger_pin.simulation.simulate.simulate", interrupted)
    handler = signal.getsignal(number)
    code, out, lines = run("s.toml", "--output", "out", "--duration", "5")
    assert signal.getsignal(number) is handler
    assert code == 130
    assert len(lines) == 1
    assert re.search(r"interrupted at t = [\d.e-]+ s; what was computed is in out", lines[0])
    assert set(contents(here / "out")) == {"scenario.toml", "trajectory.nc"}
    assert fp.load_result("out/trajectory.nc").attrs["end_time"] < 5.0
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

    monkeypatch.setattr("finger_pin.simulation.simulate.simulate", stubborn)
    code, out, lines = run("s.toml", "--output", "out")
    assert (code, out, lines) == (130, "", ["simulate.py: interrupted"])
    assert contents(here) == before


def test_the_process_that_draws_says_what_went_wrong_and_leaves_with_the_one_that_started_it(tmp_path):
    with Drawing() as drawing:
        drawing.start(tmp_path / "no\nwhere é")
        with pytest.raises(FileNotFoundError):
            drawing.wait()
    with Drawing() as drawing:
        (tmp_path / "trajectory.nc").write_text("no netCDF")
        drawing.start(tmp_path)
        with pytest.raises(NotDrawn, match="Unknown file format"):
            drawing.wait()
    with Drawing() as drawing:
        os.kill(drawing.process.pid, signal.SIGKILL)
        drawing.process.wait()
        drawing.start(tmp_path)
        with pytest.raises(NotDrawn, match="killed"):
            drawing.wait()
    with Drawing() as drawing:
        pass
    assert drawing.process.returncode == -signal.SIGKILL


def test_a_signal_while_drawing_keeps_the_trajectory_and_no_half_drawn_figures(run, here, quick, monkeypatch):
    def slow(drawing):
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(1.0)
        pytest.fail("went on")

    monkeypatch.setattr(Quick, "wait", slow)
    code, _, lines = run("s.toml", "--output", "out")
    assert code == 130
    assert lines == ["simulate.py: interrupted; what was computed is in out"]
    assert set(contents(here / "out")) == {"scenario.toml", "trajectory.nc"}


@pytest.mark.parametrize("broken", ["saving", "drawing"])
def test_a_full_disk_ends_with_one_line_and_earlier_results_stay(run, here, quick, monkeypatch, broken):
    assert run("s.toml", "--output", "out")[0] == 0
    before = contents(here)

    def fail(*arguments):
        raise OSError(28, "No space left on device")

    if broken == "saving":
        monkeypatch.setattr("finger_pin.simulation.results.save", fail)
    else:
        monkeypatch.setattr(Quick, "wait", fail)
    code, out, lines = run("s.toml", "--output", "out", "--duration", "0.003")
    assert (code, out, len(lines)) == (1, "", 1)
    assert "No space left on device; earlier results are as they were" in lines[0]
    assert contents(here) == before


def test_wrong_options_are_told_without_importing_anything_heavy(here):
    code = (
        "import runpy, sys\n"
        f"sys.argv = ['simulate.py', '--no-such-option']\n"
        "try:\n"
        f"    runpy.run_path({str(SCRIPT)!r}, run_name='__main__')\n"
        "except SystemExit as end:\n"
        "    heavy = {'numpy', 'scipy', 'matplotlib', 'meshcat', 'pinocchio', 'numba', 'pydantic', 'rich'}\n"
        "    print(end.code, heavy & set(sys.modules))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=here, capture_output=True, text=True, check=True)
    assert done.stdout == "2 set()\n"


def test_listing_imports_neither_matplotlib_nor_meshcat(here):
    code = (
        "import runpy, sys\n"
        f"sys.argv = ['simulate.py', '--list']\n"
        "try:\n"
        f"    runpy.run_path({str(SCRIPT)!r}, run_name='__main__')\n"
        "finally:\n"
        "    print({'matplotlib', 'meshcat', 'netCDF4'} & set(sys.modules), file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=here, capture_output=True, text=True, check=True)
    assert done.stderr == "set()\n"


def test_a_run_does_not_import_what_only_happens_to_be_installed(here):
    code = (
        "import sys\n"
        "from finger_pin.commands.application import run\n"
        "print(run('simulate', ['s.toml', '--no-figures', '--quiet']))\n"
        "print({'dask', 'distributed', 'matplotlib', 'scipy.optimize', 'scipy.integrate'} & set(sys.modules))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=here, capture_output=True, text=True, check=True)
    assert done.stdout == "0\nset()\n"


def test_a_reader_that_has_gone_is_no_error(here):
    process = subprocess_of("--list", folder=here)
    process.stdout.close()
    assert (process.stderr.read(), process.wait(timeout=60)) == ("", 0)
    process.stderr.close()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_output_that_cannot_be_printed_is_told_in_one_line_and_results_are_kept(run, here, quick, monkeypatch):
    with open("/dev/full", "w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        code, _, lines = run("s.toml", "--output", "out")
    assert (code, lines) == (0, ["standard output cannot be written: No space left on device"])
    assert set(contents(here / "out")) >= ALL


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_ctrl_c_in_a_real_run_ends_it_with_a_trajectory(here):
    arguments = ("s.toml", "--duration", "1000", "--set", "simulation.sample_rate=100", "--output", "results/s")
    with subprocess_of(*arguments, folder=here) as process:
        # The stage appears when the simulation begins.
        deadline = time.monotonic() + 60.0
        while not list(here.glob("results/s/.unfinished-*")) and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert re.fullmatch(r"simulate.py: interrupted at t = [\d.e-]+ s; what was computed is in results/s\n", err)
    assert set(contents(here / "results" / "s")) == {"scenario.toml", "trajectory.nc"}
    assert "Tracking error" in out


@pytest.mark.skipif(os.name != "posix", reason="limits of POSIX")
def test_a_disk_that_fills_up_in_a_real_run_is_told_in_one_line(here):
    import resource

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

    with subprocess_of("s.toml", folder=here, preexec_fn=limit) as process:
        out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (1, "")
    assert err.count("\n") == 1
    assert "cannot be written" in err
    assert set(contents(here)) == {"s.toml"}
