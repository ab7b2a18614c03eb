"""Identification: numbers that others found in the same data, truths that made-up data hide, clear refusals."""

import numpy as np
import pytest
from scipy.stats import t as student

import finger_pin as fp
from finger_pin.commands.application import run
from finger_pin.description.recordings.columns import in_si
from finger_pin.identification.search.checkpoint import FILE_NAME
from finger_pin.views.report import summarize_identification, write_report

COULOMB, DRAG = "finger.tendon_friction.coulomb", "finger.tendon_friction.drag"
BOUNDS = {COULOMB: (0.005, 1.0), DRAG: (0.0, 3.0)}


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
    given = {"recordings": {"pull": steady()}, "data": {"pull": data}, "overrides": changed, "starts": 1}
    return fp.identify("canal", parameters=parameters, **(given | {"refits": False} | more))


@pytest.mark.slow
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


def regression(data):
    """Slope of a line through readings, and how far the ends of its 95 % interval are from it (Student)."""
    count = len(data["in"])
    design = np.stack([data["in"], np.ones(count)], axis=1)
    (slope, _), rest, *_ = np.linalg.lstsq(design, data["out"], rcond=None)
    deviation = np.sqrt(np.linalg.inv(design.T @ design)[0, 0] * rest[0] / (count - 2))
    return slope, student.ppf(0.975, count - 2) * deviation


@pytest.mark.parametrize("repeats", [1, 6])
def test_intervals_are_those_of_linear_regression_where_the_law_is_a_line(repeats):
    """A line's slope has an interval in closed form, for five readings as for thirty."""
    data = readings(np.random.default_rng(3), repeats=repeats)
    result = found(data)
    slope, half = regression(data)
    ends = -np.log(slope + np.array([half, -half])) / 2.5
    np.testing.assert_allclose([result.lower[0], result.upper[0]], ends, rtol=2e-3)


@pytest.mark.parametrize("repeats", [1, 6])
def test_intervals_without_profiles_are_those_of_the_variance_of_a_regression(repeats):
    """Of a line's slope s = exp(-mu phi), with mu sought as its logarithm: mu exp(-+t sd(s) / (s phi mu))."""
    data = readings(np.random.default_rng(3), repeats=repeats)
    result = found(data, profiles=False)
    slope, half = regression(data)
    estimate = -np.log(slope) / 2.5
    ends = estimate * np.exp(np.array([-half, half]) / (slope * 2.5 * estimate))
    np.testing.assert_allclose([result.lower[0], result.upper[0]], ends, rtol=2e-3)
    assert "those of slopes at the estimate" in summarize_identification(result)


@pytest.mark.slow
def test_95_percent_intervals_hold_the_truth_that_often():
    rng, held = np.random.default_rng(11), []
    for _ in range(40):
        truth = {"coulomb": rng.uniform(0.05, 0.3), "drag": rng.uniform(0.2, 1.0)}
        result = found(readings(rng, **truth))
        held.append((result.lower.values <= [*truth.values()]) & ([*truth.values()] <= result.upper.values))
    # Of 80, each with 95 %: fewer than 68 or all of them happen once in a thousand times or so.
    assert 68 <= np.sum(held) <= 79


def test_parameters_that_data_cannot_separate_are_named_and_left_open():
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


@pytest.mark.slow
def test_weights_on_a_servo_tell_what_its_gears_lose_either_way():
    """Written out by hand: 12 mN m, 4.6 mN m s/rad, 0.22 lifting, 0.08 letting down, a noise of 4 mA."""
    result = fp.identify("weights", starts=1, refits=False)
    truth = [0.012, 4.6e-3, 0.22, 0.08]
    assert np.all((result.lower.values <= truth) & (truth <= result.upper.values)) and result.determined.all()
    assert result.noise.values == pytest.approx([4e-3], rel=0.2)
    # Equal readings are those of one weight, one direction and one speed.
    assert result.replicate_noise.values == pytest.approx([4e-3], rel=0.2)
    assert np.diff(result.law_bic)[0] > 50.0


@pytest.fixture(scope="module")
def with_outliers():
    """Readings with outliers, and what is found without and with them."""
    clean = readings(np.random.default_rng(9))
    spoilt = {**clean, "out": clean["out"] + np.where(np.arange(30) % 7 == 0, 1.0, 0.0)}
    return spoilt, found(clean), found(spoilt)


@pytest.mark.slow
@pytest.mark.parametrize("loss", ["soft_l1", "cauchy"])
def test_outliers_count_less_under_a_loss_that_is_robust(loss, with_outliers):
    spoilt, expected, plain = with_outliers
    robust = found(spoilt, loss=loss)
    away = [np.abs(each.estimate.values - expected.estimate.values) for each in (plain, robust)]
    assert away[1][1] < 0.5 * away[0][1]
    assert robust.lower[0] <= robust.estimate[0] <= robust.upper[0] < plain.upper[0]


@pytest.mark.slow
@pytest.mark.parametrize("loss", ["linear", "soft_l1"])
def test_a_reading_that_is_far_from_all_others_is_named_and_alters_no_robust_fit(loss):
    clean = readings(np.random.default_rng(9))
    assert "outlier" not in summarize_identification(found(clean, loss=loss))
    spoilt = {**clean, "out": clean["out"] + np.where(np.arange(30) == 17, 1400.0, 0.0)}
    robust = found(spoilt, loss=loss)
    assert "tendon_tension.T1 has 1 outlier, the worst at row 18, " in summarize_identification(robust)
    if loss != "linear":
        expected = found(clean)
        width = (expected.upper - expected.lower).values
        assert np.all(np.abs(robust.estimate - expected.estimate).values < 0.5 * width)
        assert np.all((robust.upper - robust.lower).values < 2.0 * width)


@pytest.mark.slow
def test_a_fit_that_meets_a_signal_no_better_than_a_constant_is_said_to_be_none():
    data = readings(np.random.default_rng(2))
    assert "no fit" not in summarize_identification(found(data))
    told = summarize_identification(found({**data, "out": data["out"][::-1]}))
    assert told.startswith("This is no fit of pull.tendon_tension.T1: what is left over is ")


def test_a_loss_that_is_none_is_refused():
    with pytest.raises(fp.InputError, match="must be one of linear, soft_l1"):
        found(readings(np.random.default_rng(9)), loss="square")


@pytest.mark.slow
def test_the_current_and_the_angle_of_a_servo_against_a_spring_tell_the_same():
    """Integrated apart from the package: 12 mN m, 4.6 mN m s/rad, 0.22 in, 0.08 out; noise 1 mrad, 4096 steps."""
    result = fp.identify("winding", starts=1, refits=False)
    truth = [0.012, 4.6e-3, 0.22, 0.08]
    assert np.all((result.lower.values <= truth) & (truth <= result.upper.values)) and result.determined.all()
    assert result.noise.values == pytest.approx([np.hypot(1e-3, 2.0 * np.pi / 4096 / np.sqrt(12.0))], rel=0.15)
    assert np.diff(result.law_bic)[0] > 50.0


@pytest.mark.slow
def test_few_searches_that_agree_are_said_before_the_numbers(tmp_path):
    result = found(readings(np.random.default_rng(2)), starts=3)
    assert (result.attrs["searches"], result.attrs["searches_alike"]) == (3, 3)
    assert "3 of 3 searches end at the same place." in summarize_identification(result)
    result.attrs["searches_alike"] = 1
    told = summarize_identification(result)
    assert told.startswith("Do not trust these intervals: only 1 of 3 searches end at this place")
    page = write_report(result, tmp_path / "page.html").read_text("utf-8")
    assert page.index("Do not trust these intervals") < page.index("estimate")


@pytest.mark.slow
def test_an_interrupted_search_keeps_its_best_and_goes_on_where_it_was(tmp_path):
    data, asked, before = readings(np.random.default_rng(2)), [], []
    whole = found(data, starts=3, stop=lambda: bool(before.append(0)))

    def stop():
        asked.append(0)
        return len(asked) == len(before) - 4

    part = found(data, starts=3, output=tmp_path, stop=stop)
    assert "unfinished" in part.attrs and (tmp_path / FILE_NAME).exists() and len(asked) == len(before) - 4
    assert "determine every parameter" not in summarize_identification(part)
    again = found(data, starts=3, output=tmp_path)
    assert "unfinished" not in again.attrs and again.attrs["evaluations"] < whole.attrs["evaluations"]
    np.testing.assert_allclose(again.estimate, whole.estimate, rtol=1e-5)
    np.testing.assert_allclose(again.upper, whole.upper, rtol=1e-3)


@pytest.mark.slow
def test_a_search_that_is_interrupted_goes_on_from_where_it_was(tmp_path):
    """Stopped again and again after three evaluations it gets there; begun anew every time, it never would."""
    data = readings(np.random.default_rng(2))
    whole = found(data)

    def stop_after(count):
        asked = []
        return lambda: len(asked) >= count or bool(asked.append(0))

    reached = [found(data, output=tmp_path, stop=stop_after(3)).estimate.values for _ in range(4)]
    np.testing.assert_allclose(reached[-1], whole.estimate, rtol=1e-3)
    assert np.abs(reached[0] / whole.estimate.values - 1.0).max() > 0.01


@pytest.mark.slow
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


@pytest.mark.slow
@pytest.mark.parametrize("whole", [True, False], ids=["a scenario", "a name and overrides"])
def test_a_scenario_that_no_file_has_is_written_out_with_the_numbers_found(tmp_path, whole):
    turn = {"finger.tendons.T1.curvature_offset": 2.5}
    data = readings(np.random.default_rng(3))
    bench = {"bench": fp.load_scenario("canal", turn)} if whole else {"bench": "canal", "overrides": turn}
    recorded = {"recordings": {"pull": steady()}, "data": {"pull": data}}
    result = fp.identify(**bench, parameters=BOUNDS, **recorded, starts=1, output=tmp_path)
    numbers = dict(zip(result.parameter.values.tolist(), result.estimate.values.tolist(), strict=True))
    assert fp.load_scenario(tmp_path / "identified.toml") == fp.load_scenario("canal", turn | numbers)


@pytest.mark.slow
def test_a_column_of_tensions_with_the_wrong_sign_is_named():
    data = readings(np.random.default_rng(1))
    with pytest.raises(fp.InputError, match=r"identify\.recordings\.pull\.inputs\.tendon_command\.T1: .* scale = -1"):
        found({**data, "in": -data["in"]})
    column = {"column": "in", "scale": -1.0}
    turned = {"pull": steady(inputs={"tendon_command.T1": column})}
    result = found({**data, "in": -data["in"]}, recordings=turned)
    assert (result.estimate == found(data).estimate).all()
