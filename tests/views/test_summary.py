"""The summary of a result: its numbers from the result's own variables."""

import re

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.description.loading import load_scenario
from finger_pin.views.summary import summarize


@pytest.fixture(scope="module")
def result():
    return fp.simulate(load_scenario("reversals", {"simulation.duration": 0.02}))


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


def test_a_run_under_given_tensions_tells_errors_only_of_a_reference_that_moves():
    brief = {"simulation.duration": 0.05}
    alone = fp.simulate(fp.load_scenario("canal", brief))
    assert "Tracking error" not in summarize(alone)
    degrees = alone["joint_position"].sel(joint="drum").values
    np.testing.assert_allclose(row(alone, "drum"), [degrees.min(), degrees.max()], atol=5e-4)
    assert [axes.get_title(loc="left") for axes in fp.plot_fig6(alone).axes][:2] == [
        "(a) joint angles",
        "(b) joint velocities",
    ]
    moving = {"kind": "samples", "times": [0.0, 0.05], "values": [0.0, 0.1]}
    recorded = fp.simulate(fp.load_scenario("canal", brief | {"reference.joints.drum": moving}))
    assert "Tracking error" in summarize(recorded)


def test_the_summary_tells_least_and_greatest_tensions(result):
    tension = result["tendon_tension"].sel(tendon="T3")
    pulled = result["tendon_command"].sel(tendon="T3").max()
    np.testing.assert_allclose(row(result, "T3"), [tension.min(), tension.max(), pulled], atol=5e-4)
    proximal = result["passive_tension_proximal"]
    np.testing.assert_allclose(row(result, "T5, proximal half"), [proximal.min(), proximal.max()], atol=5e-4)


@pytest.mark.parametrize(("gravity", "twist", "weighs"), [("z", 0.0, False), ("y", 0.0, True), ("z", 0.1, True)])
def test_the_summary_says_so_where_gravity_is_along_all_axes(gravity, twist, weighs):
    """The first axis is z; a twist alpha of the link before turns the next one by as much out of it."""
    link = {"length": 0.03, "width": 0.01, "mass": 0.01}
    chain = {
        "name": "chain",
        "gravity": [-9.81 * (gravity == axis) for axis in "xyz"],
        "joints": {name: {"range": [0.0, 1.0], "link": link | {"twist": twist}} for name in ("first", "second")},
        "tendons": {"T": {"crossings": {"first": {"radius": 0.005}}}},
    }
    table = {"name": "chain", "finger": chain, "controller": {"kind": "tensions"}, "simulation": {"duration": 1e-3}}
    text = summarize(fp.simulate(fp.Scenario.model_validate(table)))
    assert ("moves no joint" in text) != weighs


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
    assert {"lost: tendons sliding", "lost: joints sliding", "stored, end less start"} <= set(shares)


def test_the_summary_tells_the_cost(result):
    text, attributes = summarize(result), result.attrs
    assert f"{attributes['solver_steps']} steps, {attributes['solver_evaluations']} evaluations" in text
    factor = attributes["end_time"] / attributes["solver_wall_time"]
    assert f"Wall time {attributes['solver_wall_time']:.3g} s, real-time factor {factor:.3g}" in text


def test_one_instant_has_a_summary_and_a_saved_result_has_that_of_the_result(result, tmp_path):
    assert "abduction" in summarize(result.isel(time=[0]).assign_attrs(end_time=0.0))
    fp.save(result, tmp_path / "r.nc")
    assert summarize(fp.load(tmp_path / "r.nc")) == summarize(result)


def test_positions_of_joints_stand_under_their_units_and_none_is_minus_zero():
    text = summarize(fp.simulate(fp.load_scenario("underactuated", {"simulation.duration": 0.6})))
    blocks = dict(block.split("\n", 1) for block in text.split("\n\n") if block.startswith("Positions"))
    names = {head: [line.split()[0] for line in rows.splitlines()[1:]] for head, rows in blocks.items()}
    assert names == {
        "Positions of the joints, m": ["block"],
        "Positions of the joints, rad": ["left_proximal", "left_distal", "right_proximal", "right_distal"],
    }
    assert not re.search(r"-0\.0+( |$)", text, re.MULTILINE)
