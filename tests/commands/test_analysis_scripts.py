"""The scripts of the design questions and of the conclusions: what they write, and one clear line where they refuse."""

import csv
import importlib

import pytest

import finger_pin as fp
from finger_pin.views.locking_text import summarize_locking

SCRIPTS = ("conclusions", "self_locking", "force_capability")


@pytest.fixture
def run(capsys, tmp_path, monkeypatch):
    """Run a script in an empty folder; return its exit code, standard output and the lines of standard error."""
    monkeypatch.chdir(tmp_path)

    def run(name, *arguments):
        code = importlib.import_module(name).main([str(each) for each in arguments])
        printed = capsys.readouterr()
        return code, printed.out, printed.err.splitlines()

    return run


def refused(answer, folder, *says):
    code, out, lines = answer
    assert (code, out) == (2, "")
    assert len(lines) == 1 and lines[0].isprintable()
    for each in says:
        assert each in lines[0]
    assert not any(folder.iterdir())


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_misspelt_option_is_told_the_nearest_one(run, tmp_path, name):
    refused(run(name, "--ouput", "x"), tmp_path, f"{name}.py: --ouput: no such option", "did you mean --output?")


@pytest.mark.parametrize("name", SCRIPTS)
def test_an_option_without_its_value_and_a_second_name_are_refused(run, tmp_path, name):
    refused(run(name, "--output"), tmp_path, "--output", "requires an argument")
    refused(run(name, "ub_stand_in", "reversals"), tmp_path, "unexpected extra argument", "reversals")


@pytest.mark.parametrize(
    ("name", "given"), [("conclusions", "fig7"), ("self_locking", "fig7"), ("force_capability", "up")]
)
def test_an_unknown_name_is_refused_in_one_line(run, tmp_path, name, given):
    refused(run(name, given), tmp_path, f"{name}.py: ", given)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--limit", "many"), "--limit"),
        (("--limit", "-3"), "must be above 0"),
        (("--limit", "nan"), "must be a finite number"),
        (("--force", "1,2"), "--force = [1.0, 2.0]: must be 3 finite numbers"),
        (("--force", "1,2,inf"), "must be a finite number"),
        (("--posture", "1,x"), "--posture: x: must be a finite number"),
        (("--posture", "10,20"), "must be 4 angles with commas between"),
        (("--posture", "0,300,30,20"), "proximal must be from 0 to 90 deg"),
    ],
)
def test_wrong_numbers_of_the_force_script_are_named(run, tmp_path, arguments, says):
    refused(run("force_capability", *arguments), tmp_path, "force_capability.py: ", says)


def test_an_unknown_conclusion_is_refused_with_the_list_of_conclusions(run, tmp_path):
    refused(run("conclusions", "--only", "d"), tmp_path, "--only", "'a', 'b', 'c'")


def test_a_finger_without_passive_tendon_is_refused_before_anything_is_written(run, tmp_path):
    (tmp_path / "s").mkdir()
    scenario = tmp_path / "s" / "plain.toml"
    scenario.write_text('finger = "planar"\n[reference.joints.proximal]\namplitude = 0.2\nfrequency = 1.0\n')
    code, out, lines = run("conclusions", scenario)
    assert (code, out) == (2, "") and len(lines) == 1 and "passive" in lines[0]
    assert [each.name for each in tmp_path.iterdir()] == ["s"]


@pytest.mark.slow
def test_one_conclusion_is_written_as_figure_and_table_and_shown(run, tmp_path):
    scenario = tmp_path / "short.toml"
    scenario.write_text('extends = "reversals"\n[simulation]\nduration = 0.5\n')
    code, out, lines = run("conclusions", scenario, "--only", "a", "--output", "out")
    assert (code, lines) == (0, [])
    assert {each.name for each in (tmp_path / "out").iterdir()} == {"transmission.png", "conclusions.csv"}
    with (tmp_path / "out" / "conclusions.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["part"] for row in rows] == ["a", "a", "a"]
    assert "holds in part" in out and "Figures and table are in out" in out
    assert run("conclusions", scenario, "--only", "a", "--output", "quiet", "--quiet") == (0, "", [])


@pytest.mark.slow
def test_self_locking_prints_every_number_with_its_conditions_and_draws_three_figures(run, tmp_path, monkeypatch):
    monkeypatch.setattr("finger_pin.commands.self_locking.FRICTION_FACTORS", (0.5,))
    scenario = tmp_path / "short.toml"
    scenario.write_text('extends = "reversals"\n[simulation]\nduration = 0.1\n')
    code, out, lines = run("self_locking", scenario, "--output", "out")
    assert (code, lines) == (0, [])
    loaded = fp.load_scenario(scenario)
    found = fp.analysis.self_locking_map(fp.Finger(loaded.finger))
    assert out == f"{summarize_locking(loaded, found)}\n\nFigures are in out\n"
    assert {each.stem for each in (tmp_path / "out").iterdir()} == {"critical_friction", "map", "runs"}


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_sections")
@pytest.mark.parametrize(("name", "arguments"), [("conclusions", ("--only", "a", "--quiet")), ("force_capability", ())])
def test_a_folder_that_cannot_be_made_is_refused_in_one_line(run, tmp_path, name, arguments):
    (tmp_path / "file").write_text("")
    scenario = tmp_path / "short.toml"
    scenario.write_text('extends = "reversals"\n[simulation]\nduration = 0.1\n')
    code, _, lines = run(
        name, "ub_stand_in" if name == "force_capability" else scenario, *arguments, "--output", "file/out"
    )
    assert code == 1 and len(lines) == 1 and "cannot be written: file/out" in lines[0]
