"""The command simulate: what it writes and says, which options it takes, what it imports."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from harness import ALL, SCRIPT
from test_files import contents
from wrong_inputs import PLANAR

import finger_pin as fp
from finger_pin.commands.options import overrides
from finger_pin.description.loading import load_scenario


@pytest.mark.slow
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
    assert "Results are in results/s-gain-0.7-duration-0.003" in out
    assert set(contents(here / "results")) >= {"s-gain-0.7-duration-0.003/trajectory.nc"}
    assert contents(here / "results" / "s") == before


def test_the_resolved_scenario_gives_the_same_trajectory(run, here, quick):
    assert run("s.toml", "--set", "controller.gain=[1.1, 0.7]", "--output", "first")[0] == 0
    assert run("first/scenario.toml", "--output", "second")[0] == 0
    first, second = (fp.load(here / name / "trajectory.nc") for name in ("first", "second"))
    assert first.equals(second)
    assert (here / "first" / "scenario.toml").read_bytes() == (here / "second" / "scenario.toml").read_bytes()


def test_variables_that_are_not_asked_for_are_not_stored(run, here, quick):
    code, out, lines = run("s.toml", "--variables", "joint_position, tendon_tension", "--output", "out")
    assert (code, lines) == (0, []) and "residual" in out
    assert {*fp.load(here / "out").data_vars} == {"joint_position", "tendon_tension"}
    code, _, (line,) = run("s.toml", "--variables", "joint_positon", "--output", "none")
    assert code == 2 and "--variables" in line and "did you mean joint_position" in line
    assert not (here / "none").exists()


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


@pytest.mark.slow
def test_figures_come_in_the_format_that_was_asked_for(run, here):
    assert run("s.toml", "--output", "out", "--format", "svg")[0] == 0
    assert {Path(name).suffix for name in contents(here / "out") if name.startswith("figures/")} == {".svg"}
    code, _, lines = run("s.toml", "--output", "other", "--format", "gif")
    assert code == 2 and "'png', 'pdf', 'svg'" in lines[0] and not (here / "other").exists()


def test_a_finger_that_locks_itself_is_told_in_one_line_of_the_summary_and_nowhere_else(run, quick):
    stuck = ("reversals", "--duration", "0.01")
    for name in ("coulomb", "stiction"):
        stuck += ("--set", f"finger.joint_friction.{name}=5e-3")
    code, out, lines = run(*stuck)
    assert (code, lines) == (0, [])
    (told,) = [line for line in out.splitlines() if line.startswith("Warning:")]
    assert "times what locks the finger: tensions run away" in told and len(told) <= 80
    assert run(*stuck, "--quiet") == (0, "", [])
    assert "Warning" not in run("reversals", "--duration", "0.01")[1]


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
        ("{base = 'ub_stand_in'}", {"base": "ub_stand_in"}),
        ("[1,\n2]", [1, 2]),
    ):
        assert overrides([f"finger={text}"]) == {"finger": value}


def test_duration_and_method_are_short_for_set(run, here, quick):
    changed = ("--duration", "0.003", "--method", "LSODA", "--output", "out")
    assert run("s.toml", *changed)[0] == 0
    scenario = load_scenario(here / "out" / "scenario.toml")
    assert (scenario.simulation.duration, scenario.simulation.method) == (0.003, "LSODA")
    assert fp.load(here / "out" / "trajectory.nc")["time"][-1] == 0.003


def test_list_names_scenarios_fingers_and_methods(run, here):
    code, out, lines = run("--list")
    assert (code, lines) == (0, [])
    for name in ("reversals", "stick_slip", "ub_stand_in", "planar", "dexmart_index", "Radau"):
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
    monkeypatch.setattr("finger_pin.views.viewer.view", lambda result, block: seen.append(set(contents(here / "out"))))
    assert run("s.toml", "--output", "other")[0] == 0
    assert seen == []
    assert run("s.toml", "--output", "out", "--view", "--no-figures")[0] == 0
    assert seen == [ALL]


def test_paths_may_have_spaces_and_letters_beyond_ascii(run, here, quick):
    folder = here / "mes résultats ∂"
    folder.mkdir()
    (folder / "mon scénario.toml").write_text(PLANAR, encoding="utf-8")
    code, out, lines = run("mes résultats ∂/mon scénario.toml", "--output", "mes résultats ∂/sortie θ")
    assert (code, lines) == (0, [])
    assert "sortie θ" in out
    assert set(contents(folder / "sortie θ")) >= ALL


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


@pytest.mark.slow
def test_a_run_without_figures_does_not_import_what_draws_them(here):
    code = (
        "import sys\n"
        "from finger_pin.commands.application import run\n"
        "print(run('simulate', ['s.toml', '--no-figures', '--quiet']))\n"
        "print({'matplotlib'} & set(sys.modules))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=here, capture_output=True, text=True, check=True)
    assert done.stdout == "0\nset()\n"
