"""Predictions of what was held out, against closed forms, and clear refusals."""

import warnings

import numpy as np
import pytest
from scipy.stats import norm
from scipy.stats import t as student

import finger_pin as fp
from finger_pin.identification.likelihood import minus_twice_likelihood
from finger_pin.views.report import summarize_identification, write_report

COULOMB = "finger.tendon_friction.coulomb"
TURN, TRUE = np.pi / 2.0, 0.15


def table(seed, loads, repeats=4, noise=0.05):
    """Readings by the capstan law, with noise."""
    load = np.repeat(loads, repeats)
    exact = load * np.exp(-TRUE * TURN)
    return {"in": load, "out": exact + np.random.default_rng(seed).normal(0.0, noise, load.size)}


def steady(**more):
    columns = {"inputs": {"tendon_command.T1": "in"}, "outputs": {"tendon_tension.T1": "out"}}
    return {"kind": "steady", "speed": 0.05, **columns, **more}


def ramp(seed, noise=0.02):
    """The tension behind a canal whose tendon is drawn in evenly, in closed form but for its bristles' lag."""
    time = np.arange(0.0, 1.01, 0.02)
    pull = 3.0 + 4.0 * time
    out = pull * np.exp(-TRUE * TURN) + np.random.default_rng(seed).normal(0.0, noise, time.size)
    return {"t": time, "in": pull, "out": out}


def motion(**more):
    columns = {"inputs": {"tendon_command.T1": "in"}, "outputs": {"tendon_tension.T1": "out"}}
    return {"time": "t", "settle": 0.3, **columns, **more}


def found(recordings, data, **more):
    given = {"parameters": {COULOMB: (0.01, 1.0)}, "starts": 1, **more}
    return fp.identify("canal", recordings=recordings, data=data, **given)


def band_of(fitted, load):
    """Half the 95 % band of a line through the origin: by regression or without one load each, and holding these."""
    size = fitted["in"] @ fitted["in"]
    share, left = fitted["in"] @ fitted["out"] / size, len(fitted["in"]) - 1
    noise = student.ppf(0.975, left) * np.sqrt(np.sum((fitted["out"] - share * fitted["in"]) ** 2) / left)
    count = len(loads := np.unique(fitted["in"]))
    without = [np.linalg.lstsq(x[:, None], y, rcond=None)[0][0] for x, y in apart(fitted, loads)]
    deviation = np.sqrt((count - 1) * np.var(without))
    unsure = max(noise / np.sqrt(size), student.ppf(0.975, max(count - 1, 4)) * deviation)
    off = np.abs(fitted["out"] - np.array(without)[np.searchsorted(loads, fitted["in"])] * fitted["in"])
    factor = np.quantile(off / np.hypot(noise, unsure * fitted["in"]), 0.95, method="inverted_cdf")
    return max(1.0, factor) * np.hypot(noise, unsure * load)


def apart(fitted, loads):
    """Readings without those at one load each."""
    return [(fitted["in"][rest], fitted["out"][rest]) for rest in (fitted["in"] != load for load in loads)]


def test_readings_that_are_held_out_are_predicted_with_a_band_by_noise_and_covariance(tmp_path):
    data = {"light": table(1, [2.0, 3.0, 4.0]), "heavy": table(2, [10.0, 12.0, 15.0], repeats=40)}
    result = found({"light": steady(), "heavy": steady(held_out=True)}, data, output=tmp_path)
    fitted, other = data["light"], data["heavy"]
    # A line through the origin: share = exp(-mu phi), its variance noise^2 / sum(load^2).
    share = fitted["in"] @ fitted["out"] / (fitted["in"] @ fitted["in"])
    np.testing.assert_allclose(result.estimate, [-np.log(share) / TURN], rtol=1e-5)
    off = other["out"] - share * other["in"]
    band = band_of(fitted, other["in"])
    scatter = np.sqrt(np.sum(other["out"].reshape(3, 40).var(axis=1)) * 40 / 117)
    expected = {"rms": np.sqrt(np.mean(off**2)), "bias": off.mean(), "within": np.mean(np.abs(off) <= band)}
    for name, value in {**expected, "scatter": scatter, "samples": 120, "beyond": 1.0}.items():
        assert float(result[f"prediction_{name}"][0]) == pytest.approx(value, rel=1e-4), name
    np.testing.assert_allclose(result.predicted_band, band, rtol=6e-3)
    assert result.signal.values.tolist() == ["light.tendon_tension.T1"]
    told = summarize_identification(result)
    assert "Held out: heavy.tendon_tension.T1 is predicted to " in told and "repeats scatter by" in told
    assert told.index(COULOMB) < told.index("Held out: ")
    assert "100% of these loads are beyond those that were fitted" in told
    page = write_report(result, tmp_path / "page.html").read_text("utf-8")
    assert page.index("What was found") < page.index("What was predicted")
    again = fp.predict(fp.load(tmp_path / "identification.nc"), {"heavy": steady()}, data=data)
    np.testing.assert_allclose(again.predicted_value, result.predicted_value, rtol=1e-12)
    np.testing.assert_allclose(again.predicted_band, result.predicted_band, rtol=1e-12)


def test_a_part_of_a_motion_is_held_out_and_runs_with_equal_inputs_are_repeats():
    data = {"first": ramp(3), "second": ramp(4)}
    recordings = {"first": motion(held_out=list(np.array([0.6, 0.8]))), "second": motion()}
    result = found(recordings, data)
    apart = (data["first"]["t"] >= 0.6 - 1e-12) & (data["first"]["t"] <= 0.8 + 1e-12)
    assert np.sum(apart) == result.sizes["predicted"] == 11
    later = np.sum(data["first"]["t"] >= 0.3 - 1e-12)
    assert result.signal_samples.values.tolist() == [later - 11, later]
    np.testing.assert_array_equal(result.predicted_measured, data["first"]["out"][apart])
    # By the capstan law, but for bristles that lag by some mN.
    share = np.exp(-float(result.estimate[0]) * TURN)
    np.testing.assert_allclose(result.predicted_value, data["first"]["in"][apart] * share, atol=0.01)
    difference = (data["first"]["out"] - data["second"]["out"])[apart]
    # Two runs: the variance at a sample is half the square of their difference.
    scatter = np.sqrt(np.mean(difference**2 / 2.0))
    assert float(result.prediction_scatter[0]) == pytest.approx(scatter, rel=1e-9)
    alone = fp.predict(result, {"first": motion(held_out=[0.6, 0.8])}, data=data)
    np.testing.assert_allclose(alone.predicted_value, result.predicted_value, rtol=1e-12)
    assert np.isnan(alone.prediction_scatter[0])


def test_what_was_found_for_one_recording_counts_where_that_is_predicted():
    """The zero of the load cell is that of the first day alone: 0.5 N there, none for another name."""
    first = table(5, [3.0, 6.0, 9.0])
    first["out"] = first["out"] + 0.5
    own = steady(parameters={"tendon_tension.T1.offset": (-1.0, 1.0)})
    result = found({"day": own, "other": steady()}, {"day": first, "other": table(6, [3.0, 6.0, 9.0])})
    later = {"in": np.array([4.0, 8.0]), "out": np.array([4.0, 8.0])}
    by_name = [fp.predict(result, {name: steady()}, data={name: later}).predicted_value for name in ("day", "new")]
    np.testing.assert_allclose(by_name[0] - by_name[1], -float(result.estimate[1]), rtol=1e-9)
    assert float(result.estimate[1]) == pytest.approx(-0.5, abs=0.1)


def test_the_zero_of_what_pulls_counts_where_the_same_readings_are_predicted():
    """The load cell tells 0.6 N too much of the pull; what was fitted and what is predicted of it are the same."""
    data = table(7, [3.0, 6.0, 9.0])
    data["in"] = data["in"] + 0.6
    own = steady(parameters={"tendon_command.T1.offset": (-1.0, 1.0)})
    result = found({"day": own}, {"day": data})
    again = fp.predict(result, {"day": steady()}, data={"day": data})
    np.testing.assert_allclose(again.predicted_measured - again.predicted_value, result.residual.values, atol=1e-12)


def test_a_prediction_has_a_band_though_two_numbers_are_tied():
    """Of coefficient and turn only the product is told, by a line through the origin, and predictions need no more."""
    data, later = table(9, [3.0, 6.0, 9.0]), {"in": np.array([5.0, 20.0]), "out": np.array([4.0, 16.0])}
    tied = {COULOMB: (0.01, 1.0), "finger.tendons.T1.curvature_offset": (0.1, 6.0)}
    result = found({"day": steady()}, {"day": data}, parameters=tied)
    band = band_of(data, later["in"])
    bands = fp.predict(result, {"new": steady()}, data={"new": later}).predicted_band
    np.testing.assert_allclose(bands, band, rtol=1e-3)
    assert not result.determined.any()


def test_the_noise_of_a_recording_that_was_not_fitted_is_the_mean_of_all_with_their_degrees_of_freedom():
    """The mean of variances s^2 with f degrees of freedom each has (sum s^2)^2 / sum(s^4 / f) (Satterthwaite, 1946)."""
    names = {"fine": 0.02, "usual": 0.05, "coarse": 0.3}
    data = {name: table(40 + k, [3.0, 6.0, 9.0], noise=noise) for k, (name, noise) in enumerate(names.items())}
    result = found(dict.fromkeys(names, steady()), data)
    share = np.exp(-float(result.estimate[0]) * TURN)
    square = np.array([np.mean((each["out"] - share * each["in"]) ** 2) for each in data.values()])
    # Of 36 readings one is used up by the coefficient; each recording has a third of what is left.
    freedom = np.sum(square) ** 2 / np.sum(square**2 / (35.0 / 3.0))
    expected = student.ppf(0.975, freedom) * np.sqrt(np.mean(square) * 36.0 / 35.0)
    expected *= float(result.band_factor[0])
    # Hardly any load: nothing but noise, and the factor of readings that were left out.
    light = {"in": np.full(2, 1e-3), "out": np.zeros(2)}
    told = fp.predict(result, {"new": steady()}, data={"new": light})
    np.testing.assert_allclose(told.predicted_band, expected, rtol=1e-3)


@pytest.mark.parametrize(
    ("held", "said"),
    [
        (steady(held_out="yes"), 'identify.recordings.b.held_out = "yes": must be true, or the first and the last'),
        (steady(held_out=[0.0, 1.0]), "only a motion has parts"),
        (motion(held_out=[2.0, 1.0]), "must be true, or the first and the last second"),
        (motion(held_out=[5.0, 6.0]), "identify.recordings.b.held_out = [5.0, 6.0]: has no samples"),
        (steady(held_out=True, parameters={COULOMB: (0.1, 1.0)}), "and this one is held out"),
        (motion(held_out=True, outputs={"joint_position.wheel": "out"}), "there is no wheel; there are drum"),
    ],
)
def test_a_recording_that_cannot_be_held_out_is_refused_in_one_line_before_any_work(held, said):
    data = {"a": table(1, [2.0, 3.0]), "b": ramp(1)}
    with pytest.raises(fp.InputError) as refused:
        found({"a": steady(), "b": held}, data, progress=lambda *_: pytest.fail("work has begun"))
    assert said in str(refused.value) and "\n" not in str(refused.value)


def test_recordings_of_which_none_is_fitted_are_refused():
    with pytest.raises(fp.InputError, match="are all held out"):
        found({"a": steady(held_out=True)}, {"a": table(1, [2.0, 3.0])})


def line(tables):
    """Slope and zero of out over in by least squares."""
    load, out = (np.concatenate([each[name] for each in tables]) for name in ("in", "out"))
    return np.linalg.lstsq(np.stack([load, np.ones(load.size)], axis=1), out, rcond=None)[0]


def test_a_zero_that_recordings_share_is_one_number_and_counts_where_one_is_held_out():
    loads, zeros = [3.0, 6.0, 9.0], {"cell_a": 0.5, "cell_b": 0.5, "cell_c": 0.5, "other": -0.2}
    data = {name: table(10 + k, loads) for k, name in enumerate(zeros)}
    for name, zero in zeros.items():
        data[name]["out"] = data[name]["out"] + zero
    recordings = {"cell_a": steady(), "cell_b": steady(), "cell_c": steady(held_out=True)}
    shared = {COULOMB: (0.01, 1.0), "recordings.cell_*.tendon_tension.T1.offset": (-1.0, 1.0)}
    result = found(recordings, data, parameters=shared)
    share, zero = line([data["cell_a"], data["cell_b"]])
    # The noise of every recording is estimated, so that the line is weighed by it.
    np.testing.assert_allclose(np.exp(-float(result.estimate[0]) * TURN), share, atol=2e-3)
    np.testing.assert_allclose(result.estimate[1], -zero, atol=0.02)
    assert str(result.units[1].values) == "N" and result.sizes["parameter"] == 2
    predicted = -float(result.estimate[1]) + np.exp(-float(result.estimate[0]) * TURN) * data["cell_c"]["in"]
    np.testing.assert_allclose(result.predicted_value, predicted, rtol=1e-9)
    again = fp.predict(result, {"other": steady()}, data=data)
    np.testing.assert_allclose(again.predicted_value, predicted + float(result.estimate[1]), rtol=1e-9)


def test_rows_of_a_table_are_held_out_by_a_column():
    data = table(20, [3.0, 6.0, 9.0, 12.0])
    data |= {"out": data["out"] + 0.4, "day": np.tile(["mon", "tue", "wed", "thu"], 4).tolist()}
    zero = {"tendon_tension.T1.offset": (-1.0, 1.0)}
    result = found({"all": steady(held_out={"day": ["tue", "thu"]}, parameters=zero)}, {"all": data})
    apart = np.isin(data["day"], ["tue", "thu"])
    slope, offset = line([{name: data[name][~apart] for name in ("in", "out")}])
    np.testing.assert_allclose(
        [np.exp(-float(result.estimate[0]) * TURN), result.estimate[1]], [slope, -offset], rtol=1e-5
    )
    np.testing.assert_allclose(result.predicted_value, slope * data["in"][apart] + offset, rtol=1e-5)
    np.testing.assert_array_equal(result.predicted_measured, data["out"][apart])


@pytest.mark.parametrize(
    ("parameters", "more", "said"),
    [
        (
            {"recordings.x*.tendon_tension.T1.offset": (-1.0, 1.0)},
            {},
            "identify.parameters.recordings.x*.tendon_tension",
        ),
        (
            {"recordings.*.tendon_tension.T2.offset": (-1.0, 1.0)},
            {},
            "identify.parameters.recordings.*.tendon_tension.T2",
        ),
        (
            {"recordings.*.tendon_tension.T1.offset": (-1.0, 1.0)},
            {"parameters": {"tendon_tension.T1.offset": (-1.0, 1.0)}},
            "is found for a as recordings.*.tendon_tension.T1.offset too",
        ),
        ({}, {"held_out": {"day": "fri"}}, 'a.held_out.day = "fri": no row has it; there are mon, tue'),
        ({}, {"held_out": {"days": "mon"}}, "a.held_out.days: no such column"),
        ({}, {"held_out": {"day": ["mon", "tue"]}}, "leaves no row to be fitted"),
        ({}, {"held_out": {"day": []}}, "must be a number or word of that column"),
        ({}, {"held_out": {}}, "must name a column"),
        ({}, {"inputs": {"tendon_command.T1": {"column": "in", "least_noise": 1.0}}}, "is for outputs only"),
    ],
)
def test_shared_zeros_and_rows_that_are_not_there_are_refused_in_one_line(parameters, more, said):
    data = table(1, [2.0, 3.0]) | {"day": ["mon", "tue"] * 4}
    with pytest.raises(fp.InputError) as refused:
        found({"a": steady(**more)}, {"a": data}, parameters={COULOMB: (0.01, 1.0), **parameters})
    assert said in str(refused.value) and "\n" not in str(refused.value)


def test_the_least_noise_of_signals_weighs_them_and_widens_intervals_and_bands():
    """A line through the origin by two load cells of known noise: weighted least squares with known variances."""
    rng, cells, data = np.random.default_rng(30), {"fine": (0.05, 0.0), "coarse": (0.2, 0.01)}, {}
    for name, (_, bias) in cells.items():
        load = rng.uniform(3.0, 12.0, 200)
        data[name] = {"in": load, "out": load * (np.exp(-TRUE * TURN) + bias) + rng.normal(0.0, 0.02, load.size)}
    outputs = {name: {"tendon_tension.T1": {"column": "out", "least_noise": s}} for name, (s, _) in cells.items()}
    recordings = {name: steady(outputs=columns) for name, columns in outputs.items()}
    result = found(recordings, data)
    pairs = [(data[name]["in"] / s, data[name]["out"] / s) for name, (s, _) in cells.items()]
    information = sum(load @ load for load, _ in pairs)
    share = sum(load @ out for load, out in pairs) / information
    np.testing.assert_allclose(result.estimate, [-np.log(share) / TURN], rtol=1e-5)
    assert [float(result.noise.sel(signal=f"{name}.tendon_tension.T1")) for name in cells] == [0.05, 0.2]
    # mu = -log(share) / turn, and by 400 readings Student's t hardly differs from the normal distribution.
    deviation = 1.0 / np.sqrt(information) / share / TURN
    for ends in ((result.lower, result.upper), (result.linear_lower, result.linear_upper)):
        np.testing.assert_allclose(float(ends[1][0] - ends[0][0]) / (2 * 1.96 * deviation), 1.0, rtol=0.02)
    later = fp.predict(result, {"coarse": recordings["coarse"]}, data=data)
    np.testing.assert_allclose(later.predicted_band, 1.96 * 0.2, rtol=0.02)
    loose = found({name: steady() for name in cells}, data)
    # Noises that are estimated weigh the coarse cell more.
    assert abs(float(loose.estimate[0] - result.estimate[0])) > 1e-4


def test_a_least_noise_joins_the_estimated_one_smoothly():
    """By the normal density: minus twice its logarithm at the best deviation that is not below the least."""
    residuals = [np.array([0.1, -0.2, 0.2])]
    for least in (0.0, 0.1, np.sqrt(0.03), 0.3, 2.0):
        deviation = max(least, np.sqrt(0.09 / 3))
        density = norm.logpdf(residuals[0], scale=deviation).sum() + 1.5 * (1.0 + np.log(2.0 * np.pi))
        value = minus_twice_likelihood(residuals, np.ones(1), np.zeros(1, dtype=int), np.array([least]))
        assert value == pytest.approx(-2.0 * density, rel=1e-12)


@pytest.mark.slow
def test_tolerances_that_are_too_coarse_for_slopes_are_warned_of():
    for rtol, told in ((1e-3, True), (1e-4, False)):
        with warnings.catch_warnings(record=True) as seen:
            warnings.simplefilter("always")
            found({"first": motion()}, {"first": ramp(3)}, overrides={"simulation.rtol": rtol}, profiles=False)
        assert any("simulation.rtol = 0.001: slopes of such runs" in str(each.message) for each in seen) == told
