"""The validation: how it judges, what it writes, how it ends; and the comparisons that no other test makes."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from validate import FAMILIES, import_module, validate
from validation import methods, servo, stiffness, symmetry
from validation.check import Section, Verdict, compare, skipped
from validation.families import Family, Report
from validation.page import page
from validation.report import headline, text

from finger_pin.commands.application import run_function
from finger_pin.description.actuators import PositionLoop

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def stiffened():
    return stiffness.stiffen()


def test_an_infinitely_stiff_passive_tendon_is_the_gear_of_equation_4(stiffened):
    """The distance r35 theta3 / r45 - theta4 falls as 1 / K_t."""
    np.testing.assert_allclose(stiffened.orders, 1.0, atol=0.02)
    assert stiffened.gap[-1] < 2e-5 < 1e-3 < stiffened.gap[0]
    # The gear turns meanwhile.
    assert np.ptp(stiffened.motion[-1, :, 3]) > 0.3


def test_the_motion_of_all_joints_settles_in_proportion_to_one_over_the_stiffness(stiffened):
    assert stiffened.motion_order == pytest.approx(1.0, abs=0.05)


def test_the_distance_from_the_gear_is_the_stretch_that_the_tensions_make(stiffened):
    for each in stiffened.stretch:
        np.testing.assert_allclose(each.measured, each.expected, rtol=1e-6, atol=1e-12)


@pytest.fixture(scope="module")
def swung():
    return servo.swing()


def test_an_xl330_swings_a_weight_as_its_published_equations_do(swung):
    """But for gears that give: 12 recordings are missed by as much."""
    np.testing.assert_allclose(swung.ours, swung.added, atol=servo.GIVING)


def test_gears_carry_the_sum_of_what_they_hold_and_what_holds_it(swung):
    """|T + tau| is nearer to all recordings but one, and to all together, than |T - tau|; so are ours."""
    for each in (swung.ours, swung.added):
        assert np.count_nonzero(each < swung.subtracted) >= 11
        assert np.mean(each**2) < 0.8 * np.mean(swung.subtracted**2)


def test_the_gain_of_a_position_loop_is_that_of_the_recorded_servo():
    """Of 400 in its register: 4096 steps a turn, over 885 for all of the voltage, over some divisor."""
    assert PositionLoop().proportional == pytest.approx(servo.measured_gain(), rel=1e-2)
    assert 400.0 * servo.STEPS / servo.measured_gain() == pytest.approx(256.0, rel=5e-3)


@pytest.mark.parametrize(("scenario", "window"), [("reversals", 0.001), ("stick_slip", 0.0005)])
def test_every_method_converges_to_one_motion_as_its_tolerance_shrinks(scenario, window, monkeypatch):
    """From 1e-4 to 1e-8, 20 times nearer at least for every hundredth, and all end within 2e-8 rad of one truth."""
    monkeypatch.setitem(methods.WINDOWS, scenario, window)
    found = list(methods.approaches(scenario))
    assert {each.method for each in found} == set(methods.METHODS)
    for each in found:
        assert each.errors[-1] < methods.LIMIT, each
        assert each.errors[0] > methods.GAIN**2 * each.errors[2], each
        assert sorted(each.errors, reverse=True) == list(each.errors), each


@pytest.mark.parametrize(
    ("measured", "known", "verdict"),
    [
        (1.0, 0.0, Verdict.PASS),
        (1.1, 0.0, Verdict.PASS),
        (1.11, 0.0, Verdict.FAIL),
        (0.8, 0.3, Verdict.DIFFERS),
        (0.6, 0.3, Verdict.FAIL),
        (np.nan, 0.3, Verdict.FAIL),
        (np.inf, 0.3, Verdict.FAIL),
    ],
)
def test_a_number_passes_within_its_tolerance_and_differs_only_as_far_as_is_known(measured, known, verdict):
    found = compare("x", "y", measured, 0.1 + 1e-12, "1", expected=1.0, known=known)
    assert found.verdict is verdict


def family(*checks):
    return Family("one", "One & all", "What <this> is.", Section.of(checks))


PASSING = compare("length", "a ruler", 1.0, 0.1, "m", expected=1.05)
FAILING = compare("width <b>", "a ruler", 2.0, 0.1, "m", expected=1.0)
ODD = compare("depth", "a book", 2.0, 0.1, "m", expected=1.5, known=1.0, note="a known misprint")
LEFT_OUT = skipped("weight", "a balance", "there is no balance")


def test_the_summary_counts_every_outcome_and_tells_what_did_not_pass():
    report = Report((family(PASSING, FAILING, ODD, LEFT_OUT),), "today", {})
    assert headline(report) == "1 of 4 checks pass, 1 differs by a known amount, 1 skipped, 1 FAIL"
    told = text(report)
    for says in ("fail: width <b>: 2 m, a ruler: 1 m", "differs: depth", "a known misprint", "there is no balance"):
        assert says in told
    assert "length" not in told


def test_the_page_needs_nothing_else_and_escapes_what_it_shows():
    found = page(Report((family(PASSING, FAILING, LEFT_OUT),), "today", {"pin": "4", "mujoco": None}), "1 of 3")
    assert not re.search(r"(src|href)=\"(?!data:|#)", found)
    assert "width &lt;b&gt;" in found and "One &amp; all" in found and "<this>" not in found
    assert "Not installed: mujoco" in found


@pytest.fixture
def run(tmp_path, capsys):
    """Run the script; return exit code, standard output and standard error."""

    def run(*arguments):
        code = run_function(validate, [*arguments, "--output", str(tmp_path / "out")])
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return run


def test_a_validation_writes_a_page_with_its_figures_and_the_same_as_data(run, tmp_path):
    code, out, err = run("--only", "kinematics,order")
    assert (code, err) == (0, "")
    assert "all" not in out and "10 of 10 checks pass" in out
    found = (tmp_path / "out" / "validation.html").read_text(encoding="utf-8")
    assert "data:image/png;base64," in found and "equation (1)" in found
    data = json.loads((tmp_path / "out" / "validation.json").read_text(encoding="utf-8"))
    assert data["counts"] == {"pass": 10, "differs": 0, "skipped": 0, "fail": 0}
    assert {each["family"] for each in data["checks"]} == {"kinematics", "order"}
    assert all(abs(each["measured"] - each["expected"]) <= each["tolerance"] for each in data["checks"])
    assert data["versions"]["pin"]


def test_a_failed_check_ends_with_1_and_is_in_the_report(run, tmp_path, monkeypatch):
    monkeypatch.setattr(symmetry, "measure", lambda: Section.of([PASSING, FAILING]))
    code, out, _ = run("--only", "symmetry")
    assert code == 1
    assert "fail: width" in out
    assert "1 FAIL" in (tmp_path / "out" / "validation.html").read_text(encoding="utf-8")


def test_a_known_difference_or_a_missing_package_is_no_failure(run, monkeypatch):
    monkeypatch.setattr(symmetry, "measure", lambda: Section.of([PASSING, ODD, LEFT_OUT]))
    assert run("--only", "symmetry")[0] == 0


def test_a_family_that_breaks_is_a_failure_and_the_others_are_reported(run, tmp_path, monkeypatch):
    def broken():
        raise RuntimeError("no such posture")

    monkeypatch.setattr(symmetry, "measure", broken)
    code, out, _ = run("--only", "kinematics,symmetry")
    assert code == 1
    assert "fail: Mirror and units: RuntimeError: no such posture" in out and "6 of 7 checks pass" in out
    assert "no such posture" in (tmp_path / "out" / "validation.html").read_text(encoding="utf-8")


def test_an_interrupted_validation_writes_nothing(run, tmp_path, monkeypatch):
    def interrupted():
        raise KeyboardInterrupt

    monkeypatch.setattr(symmetry, "measure", interrupted)
    code, out, err = run("--only", "symmetry")
    assert (code, out) == (130, "")
    assert "interrupted" in err
    assert not list((tmp_path / "out").iterdir())


def test_an_output_that_cannot_be_written_is_refused_before_anything_is_measured(run, tmp_path, monkeypatch):
    (tmp_path / "out").write_text("a file")
    monkeypatch.setattr(symmetry, "measure", lambda: pytest.fail("measured"))
    code, out, err = run("--only", "symmetry")
    assert (code, out) == (1, "")
    assert err.count("\n") == 1 and "out: File exists" in err


def test_a_family_that_does_not_exist_is_named_with_the_nearest(run):
    code, _, err = run("--only", "kinematic")
    assert code == 2
    assert "did you mean kinematics?" in err


def test_every_family_has_a_module_with_a_title(monkeypatch):
    for name in FAMILIES.values():
        module = import_module(f"validation.{name}")
        assert module.TITLE and module.measure.__doc__


def test_where_mujoco_is_missing_its_family_says_so_in_a_line(monkeypatch):
    from validation import mujoco_motion

    monkeypatch.setattr(mujoco_motion.importlib.util, "find_spec", lambda name: None)
    (check,) = mujoco_motion.measure().checks
    assert check.verdict is Verdict.SKIPPED
    assert check == replace(check, note="mujoco is not installed")


def test_random_models_that_fail_are_named_with_seed_door_and_the_features_that_matter(run, monkeypatch):
    import random_table

    def fails(model):
        assert "springs" not in model.features, "two answers"

    seed = next(k for k in range(99) if "springs" in random_table.random_model(k).features)
    monkeypatch.setattr(random_table, "DOORS", {"sound": random_table.Door(str), "broken": random_table.Door(fails)})
    code, out, err = run("--random", "1", "--seed", str(seed))
    assert (code, err) == (1, "")
    assert f"seed {seed}, broken: AssertionError: two answers" in out and "with springs\n" in out
    assert "2 doors: 1 checks failed" in out and "sound" not in out
    monkeypatch.setattr(random_table, "DOORS", {"sound": random_table.Door(str)})
    assert run("--random", "2")[0] == 0
