"""Identification: numbers that others found in the same data, truths that made-up data hide, clear refusals."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.commands.application import run
from finger_pin.description.recordings.units import in_si
from finger_pin.laws.spring import JOINT_SPRING
from finger_pin.studies.identification.ledger import NAME
from finger_pin.studies.identification.recordings import read_table
from finger_pin.views.report import summarize_identification, write_report

COULOMB, DRAG = "finger.tendon_friction.coulomb", "finger.tendon_friction.drag"
BOUNDS = {COULOMB: (0.005, 1.0), DRAG: (0.0, 3.0)}
BENCH = """
extends = "canal"
[identify.parameters]
"finger.tendon_friction.coulomb" = [0.005, 1.0]
[identify.recordings.table]
file = "mine.csv"
kind = "steady"
speed = 0.05
inputs = { "tendon_command.T1" = "in" }
outputs = { "tendon_tension.T1" = "out" }
"""


def readings(rng, coulomb=0.12, drag=0.4, turn=2.5, noise=0.05, loads=(3.0, 6.0, 9.0, 12.0, 15.0), repeats=6):
    """Readings by the capstan law and a drag, written out, with noise."""
    load = np.repeat(loads, repeats)
    exact = load * np.exp(-coulomb * turn) - drag / (1.0 + np.tanh(coulomb * turn / 2.0))
    return {"in": load, "out": exact + rng.normal(0.0, noise, load.size)}


def steady(**more):
    """A recording of one canal."""
    columns = {"inputs": {"tendon_command.T1": "in"}, "outputs": {"tendon_tension.T1": "out"}}
    return {"kind": "steady", "speed": 0.05, **columns, **more}


def found(data, parameters=BOUNDS, **more):
    changed = {"finger.tendons.T1.curvature_offset": 2.5}
    given = {"recordings": {"pull": steady()}, "data": {"pull": data}, "overrides": changed, "starts": 1, **more}
    return fp.identify("canal", parameters=parameters, **given)


def test_sixty_real_readings_give_the_published_friction_and_reject_the_capstan_alone():
    """E. Broge's readings: a straight line through them has 0.7496 F - 0.559 N and leaves 0.189 N rms."""
    result = fp.identify("transmission")
    (coulomb, drag), turn = result.estimate.values, np.pi
    data = np.stack([result.applied.values, result.measured.values])
    slope, offset = np.polyfit(*data, 1)
    assert np.exp(-coulomb * turn) == pytest.approx(slope, rel=1e-6) and slope == pytest.approx(0.7496, abs=5e-5)
    assert -drag / (1.0 + np.tanh(coulomb * turn / 2.0)) == pytest.approx(offset, rel=1e-5)
    assert (coulomb, drag) == (pytest.approx(0.0917, abs=5e-5), pytest.approx(0.639, abs=1e-3))
    assert result.noise.values == pytest.approx([0.189], abs=5e-4)
    assert result.replicate_noise.values == pytest.approx([0.174], abs=5e-4)
    bic = dict(zip(result.law.values, result.law_bic.values, strict=True))
    assert bic == pytest.approx({"as described": -191.7, "capstan": -136.6, "floor": -173.2}, abs=0.1)
    held_out = dict(zip(result.law.values, result.law_held_out.values, strict=True))
    assert held_out["as described"] < min(held_out["capstan"], held_out["floor"])
    assert result.determined.all() and not result.attrs["undetermined"]


def test_intervals_are_those_of_linear_regression_where_the_law_is_a_line():
    """A line's offset and slope have intervals in closed form; the profile has chi-squared in place of Student's t."""
    data = readings(np.random.default_rng(3))
    result = found(data)
    design = np.stack([data["in"], np.ones(30)], axis=1)
    slope = np.linalg.lstsq(design, data["out"], rcond=None)[0][0]
    rest = data["out"] - design @ np.linalg.lstsq(design, data["out"], rcond=None)[0]
    # The rise 30 log(SSE / SSE*) of a line is 30 log(1 + t^2 / SSE*) with t in units of the slope's own scale.
    scale = np.sqrt(np.linalg.inv(design.T @ design)[0, 0] * (rest @ rest) * np.expm1(3.841 / 30))
    ends = -np.log(slope + np.array([scale, -scale])) / 2.5
    np.testing.assert_allclose([result.lower[0], result.upper[0]], ends, rtol=2e-3)


def test_95_percent_intervals_hold_the_truth_that_often():
    rng, held = np.random.default_rng(11), []
    for _ in range(40):
        truth = {"coulomb": rng.uniform(0.05, 0.3), "drag": rng.uniform(0.2, 1.0)}
        result = found(readings(rng, **truth))
        held.append((result.lower.values <= [*truth.values()]) & ([*truth.values()] <= result.upper.values))
    # Of 80, each with 95 %: fewer than 68 or all of them happen once in a thousand times or so.
    assert 68 <= np.sum(held) <= 79


def test_what_cannot_be_told_apart_is_said_and_left_open():
    turn = "finger.tendons.T1.curvature_offset"
    data = readings(np.random.default_rng(5), drag=0.0)
    result = found(data, {COULOMB: (0.02, 1.0), turn: (0.5, 10.0)})
    assert result.attrs["undetermined"] == [f"of {COULOMB} and {turn} only the product is determined"]
    assert not result.determined.any() and np.isinf(result.upper[1])
    assert "only the product" in summarize_identification(result)
    np.testing.assert_allclose(np.prod(result.estimate), 0.3, rtol=0.1)


def test_columns_have_units_scales_and_offsets():
    data = readings(np.random.default_rng(7))
    plain = found(data)
    grams = {"in": data["in"] / 9.80665e-3, "out": 2.0 * (data["out"] - 0.3)}
    columns = {
        "inputs": {"tendon_command.T1": {"column": "in", "unit": "gf"}},
        "outputs": {"tendon_tension.T1": {"column": "out", "scale": 0.5, "offset": 0.3}},
    }
    other = found(grams, recordings={"pull": steady(**columns)})
    np.testing.assert_allclose(other.estimate, plain.estimate, rtol=1e-5)
    assert in_si("x", "deg", "rad") * 180.0 == pytest.approx(np.pi)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"recordings": {"pull": steady(outputs={"tendon_tension.T1": "uot"})}}, "did you mean out?"),
        (
            {"recordings": {"pull": steady(outputs={"tendon_tension.T1": {"column": "out", "unit": "mm"}})}},
            "is a unit of what is in m, and this is in N",
        ),
        ({"recordings": {"pull": steady(outputs={"tendon_tension.T9": "out"})}}, "there is no T9; there are T1"),
        ({"recordings": {"pull": steady(speed=0.0)}}, "friction has the sign of sliding"),
        ({"data": {"pull": {"in": [3.0, 6.0], "out": [2.0, 4.0]}}}, "2 readings for 2 parameters"),
        ({"parameters": {COULOMB: (0.005, 20.0)}}, "must be at most 10"),
        (
            {"parameters": {"finger.joint_friction.coulomb": (0.0, 0.01)}},
            "with it finger.joint_friction.stiction must be",
        ),
        ({"parameters": {"finger.tendon_friction.colomb": (0.1, 1.0)}}, "finger.tendon_friction.coulomb"),
        ({"parameters": {**BOUNDS, "finger.joint_friction.viscous": (1e-5, 1e-3)}}, "no output of any recording feels"),
        ({"parameters": {COULOMB: (1.0, 0.1)}}, "the least value must be below the greatest"),
    ],
)
def test_wrong_benches_are_refused_in_one_line(change, said):
    given = {"data": readings(np.random.default_rng(1)), **change}
    data = given.pop("data")
    with pytest.raises(fp.InputError) as refused:
        found(data["pull"] if "pull" in data else data, **given)
    assert said in str(refused.value) and "\n" not in str(refused.value)


GOOD = "in,out\n3,2.1\n6,4.4\n9,6.9\n12,9.3\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (GOOD.replace("\n6,", "\nsix,"), "column in has no number in row 2"),
        (GOOD.replace("4.4", "4.4.1"), "column out has no number in row 2"),
        ('in,out\n"3,0","2,1"\n"6,0","4,4"\n', '"3,0": column in has no number in row 1'),
        (GOOD.replace("3,", "-3,"), "a tendon only pulls"),
        (GOOD.replace("out", "in"), "must name every column, each once"),
        (GOOD + "1\n", "row 5 has 1 values, the header names 2"),
        ("", "must have a header"),
        ("in,out\n", "must have a header"),
        (GOOD.replace("out", "aus°").encode("cp1252"), "cannot be read: no text in UTF-8"),
        (None, "there is no such file"),
    ],
)
def test_wrong_files_are_refused_in_one_line_and_nothing_is_written(tmp_path, capsys, text, said):
    bench = tmp_path / "bench.toml"
    bench.write_text(BENCH)
    if text is not None:
        (tmp_path / "mine.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    assert run("identify", [str(bench), "--output", str(tmp_path / "out"), "--quiet"]) == 2
    told = capsys.readouterr().err.strip()
    assert said in told and "\n" not in told and not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "text",
    [
        GOOD,
        "\ufeff" + GOOD,
        GOOD.replace("in,out", '"in","out"').replace("\n", "\r\n"),
        GOOD.replace(",", ";"),
        GOOD.replace(",", ";").replace(".", ","),
        GOOD.replace(",", "\t"),
    ],
    ids=["plain", "byte order mark", "quoted, carriage returns", "semicolons", "decimal commas", "tabs"],
)
def test_files_are_read_as_spreadsheets_write_them(tmp_path, text):
    path = tmp_path / "mine.csv"
    path.write_bytes(text.encode())
    table = read_table("file", path)
    np.testing.assert_array_equal([table["in"], table["out"]], [[3, 6, 9, 12], [2.1, 4.4, 6.9, 9.3]])


def test_weights_on_a_servo_tell_what_its_gears_lose_either_way():
    """Written out by hand: 12 mN m, 4.6 mN m s/rad, 0.22 lifting, 0.08 letting down, a noise of 4 mA."""
    result = fp.identify("weights", starts=1)
    truth = [0.012, 4.6e-3, 0.22, 0.08]
    assert np.all((result.lower.values <= truth) & (truth <= result.upper.values)) and result.determined.all()
    assert result.noise.values == pytest.approx([4e-3], rel=0.2)
    # Equal readings are those of one weight, one direction and one speed.
    assert result.replicate_noise.values == pytest.approx([4e-3], rel=0.2)
    assert np.diff(result.law_bic)[0] > 50.0


def test_few_searches_that_agree_are_said_before_the_numbers(tmp_path):
    result = found(readings(np.random.default_rng(2)), starts=3)
    assert (result.attrs["searches"], result.attrs["searches_alike"]) == (3, 3)
    assert "3 of 3 searches end at the same place." in summarize_identification(result)
    result.attrs["searches_alike"] = 1
    told = summarize_identification(result)
    assert told.startswith("Do not trust these intervals: only 1 of 3 searches end at this place")
    page = write_report(result, tmp_path / "page.html").read_text("utf-8")
    assert page.index("Do not trust these intervals") < page.index("estimate")


def test_an_interrupted_search_keeps_its_best_and_goes_on_where_it_was(tmp_path):
    data, asked = readings(np.random.default_rng(2)), []
    whole = found(data, starts=3)

    def stop():
        asked.append(0)
        return len(asked) == 60

    part = found(data, starts=3, output=tmp_path, stop=stop)
    assert "unfinished" in part.attrs and (tmp_path / NAME).exists() and len(asked) == 60
    assert "determine every parameter" not in summarize_identification(part)
    again = found(data, starts=3, output=tmp_path)
    assert "unfinished" not in again.attrs and again.attrs["evaluations"] < whole.attrs["evaluations"]
    np.testing.assert_allclose(again.estimate, whole.estimate, rtol=1e-5)
    np.testing.assert_allclose(again.upper, whole.upper, rtol=1e-3)


def test_a_search_that_is_interrupted_goes_on_from_where_it_was(tmp_path):
    """Stopped again and again after six evaluations it gets there; begun anew every time, it never would."""
    data = readings(np.random.default_rng(2))
    whole = found(data)

    def stop_after(count):
        asked = []
        return lambda: len(asked) >= count or bool(asked.append(0))

    reached = [found(data, output=tmp_path, stop=stop_after(6)).estimate.values for _ in range(3)]
    np.testing.assert_allclose(reached[-1], whole.estimate, rtol=1e-3)
    assert np.abs(reached[0] / whole.estimate.values - 1.0).max() > 0.01


def test_the_command_writes_a_page_and_a_scenario_with_the_numbers_found(tmp_path, capsys):
    folder = tmp_path / "out"
    assert run("identify", ["transmission", "--output", str(folder), "--starts", "1"]) == 0
    assert "better than floor by 18, capstan by 55" in capsys.readouterr().out
    found = fp.load_scenario(folder / "identified.toml")
    assert found.finger.tendon_friction.drag == pytest.approx(0.639, abs=1e-3)
    assert found.finger.tendons["T1"].curvature_offset == pytest.approx(np.pi)
    page = (folder / "identification.html").read_text("utf-8")
    for word in ("0.091734", "data:image/png", "By BIC", "95 %"):
        assert word in page
    assert fp.load(folder / "identification.nc").units.values.tolist() == ["1", "N"]
    assert write_report(fp.load(folder / "identification.nc"), tmp_path / "again.html").exists()
    assert run("identify", ["no_such_bench"]) == 2


@pytest.mark.parametrize("whole", [True, False], ids=["a scenario", "a name and overrides"])
def test_a_scenario_that_no_file_has_is_written_out_with_the_numbers_found(tmp_path, whole):
    turn = {"finger.tendons.T1.curvature_offset": 2.5}
    data = readings(np.random.default_rng(3))
    bench = {"bench": fp.load_scenario("canal", turn)} if whole else {"bench": "canal", "overrides": turn}
    recorded = {"recordings": {"pull": steady()}, "data": {"pull": data}}
    result = fp.identify(**bench, parameters=BOUNDS, **recorded, starts=1, output=tmp_path)
    numbers = dict(zip(result.parameter.values.tolist(), result.estimate.values.tolist(), strict=True))
    assert fp.load_scenario(tmp_path / "identified.toml") == fp.load_scenario("canal", turn | numbers)


def ramp(rng, coulomb, drag, correlation=0.0, rate=100.0):
    """The scenario canal drawn in evenly, in closed form: k theta + c theta' = r f, f by the capstan law and a drag.

    Bristles follow friction F that grows later: F' = s v (1 - F / level) leaves F F' / (s v (1 + d)), where
    d = tanh(mu phi / 2).
    """
    turn, radius, stiffness, viscous, rise, bristles = np.pi / 2.0, 0.02, 0.2, 2e-3, 4.0, 5e4
    time = np.arange(0.5, 3.0, 1.0 / rate)
    pull = 3.0 + rise * time
    passing, share = np.exp(-coulomb * turn), np.tanh(coulomb * turn / 2.0)
    out = pull * passing - drag / (1.0 + share)
    sliding = radius**2 * rise * passing / stiffness
    out += (pull - out) * rise * (1.0 - passing) / (bristles * sliding * (1.0 + share))
    angle = (radius * out - viscous * radius * rise * passing / stiffness) / stiffness
    noise = np.zeros((2, time.size))
    for k, fresh in enumerate(rng.normal(size=(time.size, 2))):
        noise[:, k] = correlation * noise[:, k - 1] + np.sqrt(1.0 - correlation**2) * fresh
    return {"t": time, "in": pull, "f": out + 0.03 * noise[0], "q": np.degrees(angle + 2e-3 * noise[1])}


MOTION = {
    "time": "t",
    "start": "recorded",
    "settle": 0.2,
    "inputs": {"tendon_command.T1": "in"},
    "outputs": {"tendon_tension.T1": "f", "joint_position.drum": {"column": "q", "unit": "deg"}},
}


@pytest.mark.parametrize("more", [{}, {"window": 1.0}, {"start": "found"}], ids=["whole", "windows", "start found"])
def test_a_recorded_motion_gives_the_friction_that_it_was_made_with(more):
    truth = {COULOMB: 0.15, DRAG: 0.5}
    data = ramp(np.random.default_rng(4), *truth.values())
    recordings = {"pull": {**MOTION, **more}}
    result = fp.identify("canal", parameters=BOUNDS, recordings=recordings, data={"pull": data}, starts=1)
    np.testing.assert_allclose(result.estimate, list(truth.values()), rtol=0.05)
    np.testing.assert_allclose(result.noise, [0.03, 2e-3], rtol=0.2)
    assert result.parameter.size == 2 and result.signal.size == 2


def test_a_finger_of_ones_own_is_identified_with_the_rows_that_it_has():
    """Half of the drum's spring is a row of its own: the motion is the same, and so is the friction found in it."""
    truth, half = {COULOMB: 0.15, DRAG: 0.5}, {"finger.joints.drum.spring.stiffness": 0.1}
    spring = fp.Rows("drum_spring", JOINT_SPRING, ("drum",), [[0.1], [0.0], [0.0]], np.ones((1, 1)))
    finger = fp.Finger(fp.load_scenario("canal", half).finger, rows=[spring])
    data = {"pull": ramp(np.random.default_rng(4), *truth.values())}
    result = fp.identify("canal", parameters=BOUNDS, recordings={"pull": MOTION}, data=data, starts=1, finger=finger)
    np.testing.assert_allclose(result.estimate, list(truth.values()), rtol=0.05)
    np.testing.assert_allclose(result.noise, [0.03, 2e-3], rtol=0.2)


def test_estimates_from_motions_scatter_about_the_truth_as_their_intervals_say():
    truth, rows = np.array([0.15, 0.5]), []
    for seed in range(100, 112):
        data = ramp(np.random.default_rng(seed), *truth)
        found = fp.identify("canal", parameters=BOUNDS, recordings={"pull": MOTION}, data={"pull": data}, starts=1)
        rows.append([found.estimate.values, found.lower.values, found.upper.values])
    estimate, lower, upper = np.array(rows).transpose(1, 0, 2)
    # Of 24, each with 95 %: fewer than 19 happen once in a thousand times. A mean of 12 beyond 3 / sqrt(12) likewise.
    assert np.sum((lower <= truth) & (truth <= upper)) >= 19
    away = (estimate - truth) / ((upper - lower) / 3.92)
    assert np.all(np.abs(away.mean(axis=0)) < 3.0 / np.sqrt(12.0))


def test_the_made_up_recording_that_ships_tells_the_numbers_it_was_made_with():
    result = fp.identify("to_and_fro", starts=1)
    truth = [0.12, 0.4, 0.03]
    assert np.all((result.lower.values <= truth) & (truth <= result.upper.values))
    assert result.signal_correlation.values == pytest.approx([0.6, 0.0], abs=0.15)


def test_two_recordings_with_gaps_share_the_friction_and_go_on_after_an_interruption(tmp_path):
    """A third of the samples is missing in one; the other is another pull of the same canal."""
    rng, truth, asked, before = np.random.default_rng(12), [0.15, 0.5], [], []
    data = {name: ramp(rng, *truth) for name in ("one", "two")}
    missing = rng.uniform(size=data["one"]["t"].size) < 1.0 / 3.0
    data["one"]["f"] = np.where(missing, np.nan, data["one"]["f"])
    given = {"parameters": BOUNDS, "recordings": dict.fromkeys(data, MOTION), "data": data, "starts": 1}
    whole = fp.identify("canal", **given, stop=lambda: bool(before.append(0)))
    np.testing.assert_allclose(whole.estimate, truth, rtol=0.03)
    later = data["one"]["t"] - data["one"]["t"][0] >= MOTION["settle"]
    samples = dict(zip(whole.signal.values, whole.signal_samples.values, strict=True))
    assert samples["one.tendon_tension.T1"] == np.sum(later & ~missing)
    assert samples["two.tendon_tension.T1"] == np.sum(later)

    def stop():
        asked.append(0)
        return len(asked) == len(before) - 2

    part = fp.identify("canal", **given, output=tmp_path, stop=stop)
    assert "unfinished" in part.attrs and len(asked) == len(before) - 2
    again = fp.identify("canal", **given, output=tmp_path)
    assert "unfinished" not in again.attrs and again.attrs["evaluations"] < whole.attrs["evaluations"]
    for name in ("estimate", "lower", "upper"):
        np.testing.assert_allclose(again[name], whole[name], rtol=1e-3)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"start": "recorded", "outputs": {"joint_position.drum": "q"}}, "cannot be reached: drum begins at"),
        ({"start": "recorded", "outputs": {"tendon_tension.T1": "f"}}, "needs joint_position among the outputs"),
        ({"inputs": {"joint_position.drum": "q"}}, "a motion is given tendon_command, joint_reference"),
        ({"time": "f"}, "times must increase"),
        ({"start": "rest", "outputs": {"joint_position.wheel": "f"}}, "there is no wheel; there are drum"),
        ({"start": "rest", "outputs": {"joint_positon.drum": "f"}}, "did you mean joint_position?"),
    ],
)
def test_wrong_recordings_of_motions_are_refused_in_one_line(change, said):
    recordings = {"pull": {**MOTION, **change}}
    data = ramp(np.random.default_rng(1), 0.15, 0.5)
    data["f"][3:5] = data["f"][3]
    data["q"] = data["q"] + 500.0
    with pytest.raises(fp.InputError) as refused:
        fp.identify("canal", parameters=BOUNDS, recordings=recordings, data={"pull": data}, starts=1)
    assert said in str(refused.value) and "\n" not in str(refused.value)


def test_windows_of_one_motion_are_held_out_in_turn_where_laws_are_compared():
    data = ramp(np.random.default_rng(5), 0.15, 0.5)
    result = fp.identify(
        "canal",
        parameters=BOUNDS,
        recordings={"pull": {**MOTION, "window": 1.0}},
        compare={"capstan": {DRAG: 0.0}},
        data={"pull": data},
        starts=1,
    )
    own, capstan = result.law_held_out.values
    # What was not seen is met as well as noise allows; without the drag it is not.
    assert 0.8 < own < 1.2
    assert capstan > 1.5


def test_residuals_that_follow_each_other_count_as_fewer():
    """With a correlation of 0.9 between neighbours, one sample in 19 is independent (Bartlett)."""
    given = {"parameters": BOUNDS, "recordings": {"pull": MOTION}, "starts": 1}
    white, red = (
        fp.identify("canal", data={"pull": ramp(np.random.default_rng(8), 0.15, 0.5, rho)}, **given)
        for rho in (0.0, 0.9)
    )
    assert white.independent_share.values == pytest.approx([1.0, 1.0], abs=0.15)
    assert red.independent_share.values == pytest.approx([1 / 19, 1 / 19], rel=0.6)
    width = [float(each.upper[1] - each.lower[1]) for each in (white, red)]
    assert 2.5 < width[1] / width[0] < 8.0


def test_an_offset_and_a_delay_of_an_output_are_found():
    data = ramp(np.random.default_rng(6), 0.15, 0.5)
    data["f"] = np.interp(data["t"] - 0.05, data["t"], data["f"]) + 0.2
    key = "recordings.pull.tendon_tension.T1"
    parameters = {COULOMB: (0.005, 1.0), f"{key}.offset": (-1.0, 1.0)}
    columns = {**MOTION["outputs"], "tendon_tension.T1": {"column": "f", "delay": 0.05}}
    recordings = {"pull": {**MOTION, "outputs": columns}}
    given = {"data": {"pull": data}, "starts": 1, "overrides": {DRAG: 0.5}}
    result = fp.identify("canal", parameters=parameters, recordings=recordings, **given)
    np.testing.assert_allclose(result.estimate, [0.15, 0.2], rtol=0.05)
    assert result.units.values.tolist() == ["1", "N"]
    with pytest.raises(fp.InputError, match="must be recordings"):
        wrong = {**parameters, f"{key}.gain": (0.1, 2.0)}
        fp.identify("canal", parameters=wrong, recordings=recordings, **given)


def test_the_motion_that_tells_coulomb_from_drag_is_proposed():
    """At one load they cannot be told apart; a load that varies tells them."""
    steady = {"kind": "ramp", "time": 0.0, "duration": 0.2, "height": 8.0}
    rising = {"kind": "ramp", "time": 0.0, "duration": 1.0, "height": 16.0}
    candidates = {name: {"controller.tensions.T1": each} for name, each in (("held", steady), ("rising", rising))}
    overrides = {"simulation.duration": 1.0}
    given = {"parameters": {COULOMB: (0.05, 0.2), DRAG: (0.0, 1.0)}, "outputs": {"tendon_tension.T1": 0.05}}
    found = fp.propose("canal", candidates, **given, overrides=overrides)
    assert found.candidate.values[0] == "rising"
    assert (found.deviation[0] < found.deviation[1]).all() and (found.deviation < [0.0375, 0.25]).all()
    with pytest.raises(fp.InputError, match="at least one"):
        fp.propose("canal", {}, **given)


def test_a_column_of_tensions_with_the_wrong_sign_is_named():
    data = readings(np.random.default_rng(1))
    with pytest.raises(fp.InputError, match=r"identify\.recordings\.pull\.inputs\.tendon_command\.T1: .* scale = -1"):
        found({**data, "in": -data["in"]})
    column = {"column": "in", "scale": -1.0}
    turned = {"pull": steady(inputs={"tendon_command.T1": column})}
    result = found({**data, "in": -data["in"]}, recordings=turned)
    assert (result.estimate == found(data).estimate).all()
