"""Bands, refits without a recording and what intervals say, against made-up data whose truth is known."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import norm
from scipy.stats import t as student

import finger_pin as fp
from finger_pin.identification.cross_validation import parameter_variance
from finger_pin.identification.intervals import SmallSample
from finger_pin.views.report import summarize_identification

COULOMB, TURN = "finger.tendon_friction.coulomb", np.pi / 2.0
COLUMNS = {"inputs": {"tendon_command.T1": "in"}, "outputs": {"tendon_tension.T1": "out"}}
STEADY = {"kind": "steady", "speed": 0.05, **COLUMNS}
MOTION = {"time": "t", "settle": 0.3, **COLUMNS}


def identify(recordings, data, **more):
    given = {"parameters": {COULOMB: (0.01, 1.0)}, "starts": 1, **more}
    return fp.identify("canal", recordings=recordings, data=data, **given)


def readings(rng, coulomb, loads=(3.0, 6.0, 9.0), noise=0.05, repeats=4):
    """Readings by the capstan law, with noise."""
    load = np.repeat(loads, repeats)
    return {"in": load, "out": load * np.exp(-coulomb * TURN) + rng.normal(0.0, noise, load.size)}


def autoregressive(rng, rho, shape):
    """A stationary process of variance one in every row."""
    fresh = rng.normal(size=shape)
    fresh[:, 0] /= np.sqrt(1.0 - rho**2)
    return np.sqrt(1.0 - rho**2) * lfilter([1.0], [1.0, -rho], fresh, axis=1)


def linear_fit(slopes, samples):
    """One signal of a linear problem, its minimum by least squares and its covariance by the likelihood."""
    residual = samples - slopes @ np.linalg.lstsq(slopes, samples, rcond=None)[0]
    rho = np.clip(residual[1:] @ residual[:-1] / (residual @ residual), 0.0, 1.0 - 2.0 / len(samples))
    noise, weight = np.sqrt(np.mean(residual**2)), (1.0 - rho) / (1.0 + rho)
    likelihood = SimpleNamespace(noises=np.zeros(1, dtype=int), kinds=np.zeros(1, dtype=int))
    objective = SimpleNamespace(likelihood=likelihood, slopes=lambda z: [slopes])
    minimum = SimpleNamespace(
        z=np.zeros(slopes.shape[1]), noise=np.array([noise]), correlation=np.array([rho]), weights=np.array([weight])
    )
    return objective, minimum, np.linalg.inv(slopes.T @ slopes * weight / noise**2)


def test_bands_hold_95_percent_of_further_samples_that_follow_each_other():
    """Lines through noise of known correlation and a variance of one: the share inside is that of a normal variable."""
    rng, time = np.random.default_rng(1), np.linspace(-1.0, 1.0, 300)
    slopes = np.stack([np.ones_like(time), time], axis=1)
    half = []
    for samples in autoregressive(rng, 0.9, (400, time.size)):
        objective, minimum, covariance = linear_fit(slopes, samples)
        half.append(1.96 * minimum.noise[0] * SmallSample.from_fit(objective, minimum, covariance).noise[0])
    assert np.mean(2.0 * norm.cdf(half) - 1.0) == pytest.approx(0.95, abs=0.01)
    assert np.mean(half) / 1.96 == pytest.approx(1.0, abs=0.1)


def test_a_band_of_few_independent_samples_is_at_most_twice_as_wide():
    """Four degrees of freedom and half of the samples are left: t sqrt(2) / 1.96 = 2.776 * 1.414 / 1.96 = 2.003."""
    time = np.linspace(-1.0, 1.0, 500)
    slopes = np.stack([time**k for k in range(7)], axis=1)
    objective, minimum, covariance = linear_fit(slopes, np.cumsum(np.random.default_rng(2).normal(size=500)))
    minimum.correlation[:], minimum.weights[:] = 0.996, 0.004 / 1.996
    factor = SmallSample.from_fit(objective, minimum, covariance * 0.1).noise[0]
    assert 1.0 < factor <= 2.003


def test_variance_by_refits_is_that_of_the_jackknife():
    """Of a mean of r values it is their variance over r, whose t has r - 1 degrees of freedom (Tukey, 1958)."""
    values = np.random.default_rng(3).normal(size=12)
    refitted = np.array([[np.delete(values, k).mean()] for k in range(12)])
    expected = values.var(ddof=1) / 12 * (student.ppf(0.975, 11) / 1.96) ** 2
    variance = parameter_variance(np.zeros((1, 1)), np.zeros((1, 1)), refitted)
    assert variance[0] == pytest.approx(expected, rel=1e-12)


@pytest.mark.slow
def test_bands_hold_the_next_recording_where_friction_differs_from_day_to_day():
    """Canals whose coefficient is drawn anew in each of five recordings: the sixth is predicted, 10 times."""
    rng, within, squares = np.random.default_rng(4), [], []
    days = [f"day_{k}" for k in range(5)]
    for _ in range(10):
        data = {name: readings(rng, rng.normal(0.2, 0.03), noise=0.02) for name in (*days, "next")}
        recordings = {**dict.fromkeys(days, STEADY), "next": {**STEADY, "held_out": True}}
        result = identify(recordings, data, profiles=False)
        within.append(float(result.prediction_within[0]))
        error = result.predicted_measured.values - result.predicted_value.values
        squares.append([np.mean(result.predicted_band.values**2) / 1.96**2, np.mean(error**2)])
        ratio = np.sqrt(squares[-1][0] / squares[-1][1])
        assert float(result.prediction_band_ratio[0]) == pytest.approx(ratio, rel=1e-9)
    band, error = np.mean(squares, axis=0)
    # Of ten days whose coefficients miss together, the mean share varies by some 5 %.
    assert 0.85 < np.mean(within) <= 1.0
    assert 0.7 < np.sqrt(band / error) < 2.5
    assert re.search(r"% of 12 samples within the 95 % band, half of which is [\d.]+ times 1.96 rms", told(result))


def told(result):
    return summarize_identification(result)


def test_refits_without_a_load_stay_within_the_bounds():
    """Without 9 N the least squares line rises above 1, a coefficient below zero: the refit ends at the bound."""
    load = np.repeat([3.0, 6.0, 9.0], 4)
    out = np.where(load < 9.0, 1.05, 0.6) * load + np.random.default_rng(5).normal(0.0, 0.02, 12)
    result = identify({"pull": STEADY}, {"pull": {"in": load, "out": out}}, profiles=False)
    refits = dict(zip(result.left_out.values, result.left_out_estimate.values[:, 0], strict=True))
    assert list(refits) == ["pull at 3 N", "pull at 6 N", "pull at 9 N"]
    assert refits["pull at 9 N"] == pytest.approx(0.01, rel=1e-9)
    kept = load != 3.0
    share = load[kept] @ out[kept] / (load[kept] @ load[kept])
    assert refits["pull at 3 N"] == pytest.approx(-np.log(share) / TURN, rel=1e-4)


def test_refits_without_one_of_many_loads_are_regressions_to_first_order_and_run_nothing():
    """A line through the origin without each of its 60 readings; half the band by their jackknife (Tukey, 1958)."""
    data = readings(np.random.default_rng(8), 0.2, np.linspace(3.0, 12.0, 60), noise=0.02, repeats=1)
    result = identify({"pull": STEADY}, {"pull": data}, profiles=False)
    without = [np.delete([data["in"], data["out"]], k, axis=1) for k in range(60)]
    shares = np.array([load @ out / (load @ load) for load, out in without])
    np.testing.assert_allclose(result.left_out_estimate[:, 0], -np.log(shares) / TURN, rtol=1e-4)
    assert result.attrs["evaluations"] < 60
    later = fp.predict(result, {"next": STEADY}, data={"next": {"in": [100.0], "out": [70.0]}})
    size = data["in"] @ data["in"]
    off = data["out"] - data["in"] @ data["out"] / size * data["in"]
    noise = student.ppf(0.975, 59) * np.sqrt(off @ off / 59)
    unsure = max(noise / np.sqrt(size), student.ppf(0.975, 59) * np.sqrt(59 * np.var(shares)))
    expected = float(result.band_factor[0]) * np.hypot(noise, unsure * 100.0)
    assert float(later.predicted_band[0]) == pytest.approx(expected, rel=5e-3)


def test_a_fit_without_refits_keeps_estimate_and_intervals_and_has_the_band_of_a_regression():
    rng = np.random.default_rng(9)
    data = {name: readings(rng, coulomb) for name, coulomb in (("one", 0.2), ("next", 0.25))}
    recordings = {"one": STEADY, "next": {**STEADY, "held_out": True}}
    whole, quick = (identify(recordings, data, refits=refits) for refits in (True, False))
    for name in ("estimate", "lower", "upper", "noise", "predicted_value"):
        np.testing.assert_array_equal(quick[name], whole[name])
    assert "left_out" in whole.dims and "left_out" not in quick.dims
    load, out = data["one"].values()
    off = out - load @ out / (load @ load) * load
    noise = student.ppf(0.975, 11) * np.sqrt(off @ off / 11)
    band = np.hypot(noise, noise / np.sqrt(load @ load) * data["next"]["in"])
    np.testing.assert_allclose(quick.predicted_band, band, rtol=6e-3)
    assert "No recording was left out by a refit" in told(quick) and "No recording was left out" not in told(whole)


def with_noise(name, **more):
    return {**STEADY, "outputs": {"tendon_tension.T1": {"column": "out", "noise": name}}, **more}


def test_the_band_of_a_held_out_output_has_the_noise_that_it_names():
    """A quiet and a loud cell: the band of a regression of the quiet readings, which tell the line, through zero."""
    rng = np.random.default_rng(4)
    data = {name: readings(rng, 0.2, noise=0.02) for name in ("quiet", "next", "unnamed")}
    data["loud"] = readings(rng, 0.2, noise=1.0)
    recordings = {name: with_noise(name) for name in ("quiet", "loud")}
    recordings |= {"next": with_noise("quiet", held_out=True), "unnamed": {**STEADY, "held_out": True}}
    result = identify(recordings, data, refits=False, profiles=False)
    named, unnamed = (result.predicted_band.values[result.predicted_index == k] for k in range(2))
    load, out = data["quiet"].values()
    off = out - load @ out / (load @ load) * load
    noise = student.ppf(0.975, 11) * np.sqrt(off @ off / 11)
    np.testing.assert_allclose(named, np.hypot(noise, noise / np.sqrt(load @ load) * load), rtol=0.02)
    # Who names none has the mean square of both.
    assert unnamed.min() > 1.96 * 0.5


@pytest.mark.parametrize("refits", [True, False])
def test_open_combinations_are_said_to_be_tried_only_where_refits_are_asked_for(refits):
    """Of coefficient, turn and gain a line through the origin tells exp(-mu phi) over the gain alone."""
    turn, gain = "finger.tendons.T1.curvature_offset", "recordings.pull.tendon_tension.T1.scale"
    bounds = {COULOMB: (0.05, 0.5), turn: (0.5, 4.0), gain: (0.5, 2.0)}
    data = {"pull": readings(np.random.default_rng(2), 0.2)}
    result = identify({"pull": STEADY}, data, parameters=bounds, profiles=False, refits=refits)
    assert not result.determined.any() and len(result.attrs["undetermined"]) == 2
    for text in result.attrs["undetermined"]:
        assert ("the recordings are met as well" if refits else "is open, along which nothing was tried") in text


@pytest.mark.parametrize("rho", [0.0, 0.9])
def test_recordings_are_said_to_determine_every_parameter_only_where_residuals_are_white(rho):
    time = np.arange(0.0, 2.01, 0.02)
    pull = 3.0 + 4.0 * time
    noise = 0.02 * autoregressive(np.random.default_rng(7), rho, (1, time.size))[0]
    data = {"pull": {"t": time, "in": pull, "out": pull * np.exp(-0.15 * TURN) + noise}}
    text = told(identify({"pull": MOTION}, data, profiles=False))
    assert ("The recordings determine every parameter" in text) == (rho == 0.0)
    assert ("Residuals of pull.tendon_tension.T1" in text) == (rho > 0.0)
    assert ("do not heed what the model lacks" in text) == (rho > 0.0)


@pytest.mark.parametrize("other", [0.15, 0.154, 0.25])
def test_recordings_that_want_different_numbers_are_named(other):
    """By 400 readings each the coefficient is known to 0.0003: 0.154 is ten such deviations off, 0.25 makes a noise."""
    rng = np.random.default_rng(8)
    loads, truths = rng.uniform(3.0, 9.0, 400), {"one": 0.15, "two": 0.15, "odd": other}
    data = {name: readings(rng, truth, loads, repeats=1) for name, truth in truths.items()}
    text = told(identify(dict.fromkeys(data, STEADY), data))
    named = re.search(f"{re.escape(COULOMB)} is [^:]* without odd and [^:]* without (one|two): these want", text)
    assert (named is not None) == (other != 0.15)
    weighed = re.search(r"of odd is met to [\d.]+, that of (one|two) to 0.0[\d.]+: each recording is weighed", text)
    assert (weighed is not None) == (other == 0.25)
