"""The command export: what other programs read is what was described and simulated."""

import csv

import numpy as np
import pinocchio as pin
import pytest

import finger_pin as fp
from finger_pin.commands.application import run


@pytest.fixture
def here(tmp_path, monkeypatch):
    (tmp_path / "results").mkdir()
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    return tmp_path / "here"


def test_a_finger_is_written_as_urdf_mjcf_and_toml(here):
    heavier = ["--set", "finger.joints.distal.link.mass=0.02"]
    for name in ("out/ub.urdf", "ub.xml", "ub.toml"):
        assert run("export", ["ub_stand_in", name, *heavier]) == 0
    model = pin.buildModelFromUrdf(str(here / "out" / "ub.urdf"))
    finger = fp.Finger("ub_stand_in").rigid_body.model
    assert pin.computeTotalMass(model) - pin.computeTotalMass(finger) == pytest.approx(
        0.02 - fp.load_finger("ub_stand_in").joints["distal"].link.mass
    )
    again = fp.load_finger(here / "ub.toml")
    assert again == fp.load_finger("ub_stand_in", {"finger.joints.distal.link.mass": 0.02})
    assert (here / "ub.xml").read_text() == fp.to_mjcf(again)
    # What was written is read again, and a scenario has its finger written.
    assert run("export", ["ub.toml", "again.xml"]) == 0 == run("export", ["reversals", "fig6.xml"])
    assert (here / "again.xml").read_text() == (here / "ub.xml").read_text() != (here / "fig6.xml").read_text()
    assert run("export", ["hand", "hand.xml"]) == 0 and "thumb" in (here / "hand.xml").read_text()


def test_the_signals_of_a_result_are_written_as_columns_with_their_units_to_the_last_digit(here):
    result = fp.simulate(fp.load_scenario("reversals", {"simulation.duration": 0.01}))
    fp.save(result, "trajectory.nc")
    assert run("export", ["trajectory.nc"]) == 0
    with open("trajectory.csv", newline="") as file:
        header, *rows = csv.reader(file)
    found = dict(zip(header, np.array(rows, dtype=float).T, strict=True))
    np.testing.assert_array_equal(found["time (s)"], result.time)
    np.testing.assert_array_equal(found["joint_position[distal] (rad)"], result.joint_position.sel(joint="distal"))
    np.testing.assert_array_equal(found["fingertip_position[z] (m)"], result.fingertip_position.sel(axis="z"))
    np.testing.assert_array_equal(found["energy_kinetic (J)"], result.energy_kinetic)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["ub_stand_in", "ub.step"], "must end with"),
        (["ub_stand_in", "ub.csv"], "simulate it"),
        (["../results", "x.csv", "--set", "controller.gain=2"], "--set: is for fingers, hands and scenarios"),
        (["hand", "hand.urdf"], "take one of its fingers"),
        (["fig7", "fig6.xml"], "reversals"),
    ],
)
def test_an_export_that_cannot_be_written_is_refused_in_one_line_and_leaves_no_file(here, capsys, arguments, says):
    assert run("export", arguments) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert says in line and not any(here.iterdir())


@pytest.mark.parametrize("source", ["empty", "junk.nc", "missing.nc"])
def test_results_that_cannot_be_read_are_a_wrong_input_and_not_one_that_cannot_be_written(here, capsys, source):
    (here / "empty").mkdir()
    (here / "junk.nc").write_text("no netCDF")
    assert run("export", [source, "folder/x.csv"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"SOURCE: {source}: cannot be read" in line and not (here / "folder").exists()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["uub", "x.urdf"], "SOURCE: uub: no such finger, hand or scenario; there are dexmart_index, planar, ub,"),
        (["results/none", "x.csv"], "SOURCE: results/none: there is no such file or folder"),
    ],
)
def test_an_unknown_source_is_refused_with_the_list_of_sources(arguments, says, here, capsys):
    assert run("export", arguments) == 2
    assert says in capsys.readouterr().err
    assert not list(here.iterdir())
