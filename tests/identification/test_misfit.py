"""Misfit: what correlated residuals and repeated readings do to intervals, against statistics in closed form."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
from intervals import COULOMB, MOTION, TURN, motion
from scipy.signal import lfilter

import finger_pin as fp
from finger_pin.identification.misfit import repeats, sandwich_covariance
from finger_pin.views.report import summarize_identification


def stub(residual, slopes, *, ordered=True, replicate=None, weight=1.0):
    """One signal of a linear problem, and its minimum."""
    count = len(residual)
    replicate = np.arange(count) if replicate is None else replicate
    settings = SimpleNamespace(values={}, start="rest")
    recording = SimpleNamespace(name="one", settings=settings, inputs={}, time=np.arange(count))
    signal = SimpleNamespace(
        **{"recording": "one", "name": "out", "instant": np.arange(count), "replicate": replicate, "ordered": ordered},
        **{"measured": residual, "least_noise": 0.0},
    )
    width = np.full(slopes.shape[1], 2e6)
    models, parameters = [SimpleNamespace(recording=recording)], SimpleNamespace(keys=("a",) * len(width))
    function = SimpleNamespace(signals=[signal], models=models, parameters=parameters)
    likelihood = SimpleNamespace(outputs=np.zeros(1, dtype=int))
    objective = SimpleNamespace(function=function, likelihood=likelihood, slopes=lambda z: [slopes], width=width)
    noise = np.full(1, np.sqrt(np.mean(residual**2)))
    found = SimpleNamespace(z=np.zeros(slopes.shape[1]), residuals=[residual], noise=noise, weights=np.full(1, weight))
    return objective, found, np.linalg.inv(slopes.T @ slopes * weight / noise[0] ** 2)


@pytest.mark.parametrize("rho", [0.6, 0.95])
@pytest.mark.parametrize("frequency", [0.01, 0.3, 1.5])
def test_a_slope_that_swings_has_the_variance_of_the_noise_at_its_frequency(rho, frequency):
    """Its spectral density at the slope cos(w t): sigma^2 (1 - rho^2) / (1 - 2 rho cos w + rho^2)."""
    count = 40_000
    fresh = np.random.default_rng(1).normal(size=count)
    residual = lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], fresh)
    slopes = np.cos(frequency * np.arange(count))[:, None]
    weight = (1.0 - rho) / (1.0 + rho)
    objective, found, naive = stub(residual, slopes, weight=weight)
    density = (1.0 - rho**2) / (1.0 - 2.0 * rho * np.cos(frequency) + rho**2)
    assert sandwich_covariance(objective, found, naive)[0, 0] == pytest.approx(weight * density * naive[0, 0], rel=0.05)


def test_readings_whose_law_misses_something_count_as_one_for_each_setting():
    """Fifty settings of eight readings share a miss of 0.3 each beside a scatter of 0.1: variance of their mean."""
    rng, replicate = np.random.default_rng(2), np.repeat(np.arange(50), 8)
    residual = 0.3 * rng.normal(size=50)[replicate] + 0.1 * rng.normal(size=400)
    residual -= residual.mean()
    objective, found, naive = stub(residual, np.ones((400, 1)), ordered=False, replicate=replicate)
    variance = sandwich_covariance(objective, found, naive)[0, 0]
    means = residual.reshape(50, 8).mean(axis=1)
    assert variance == pytest.approx(means.var(ddof=1) / 50, rel=0.02)
    assert repeats(objective.function, found.residuals)[0].p_value < 1e-6


def test_readings_whose_law_holds_are_said_to_miss_something_as_rarely_as_chance_has_it():
    rng, replicate = np.random.default_rng(3), np.repeat(np.arange(8), 5)
    chances = []
    for _ in range(400):
        objective, found, _ = stub(rng.normal(size=40), np.zeros((40, 0)), ordered=False, replicate=replicate)
        chances.append(repeats(objective.function, found.residuals)[0].p_value)
    # Uniform: the share below 0.2 is 0.2, with a standard deviation of 0.02.
    assert np.mean(np.array(chances) < 0.2) == pytest.approx(0.2, abs=0.06)


@pytest.mark.slow
def test_repeated_runs_tell_a_law_that_lacks_a_term_from_one_that_does_not():
    """Two runs of one canal with drag: fitted with it nothing is said; without it the missing term is, and widens."""
    rng = np.random.default_rng(4)
    runs = {name: motion(rng, 0.15, 0.6, 0.0) for name in ("first", "second")}
    recordings = {name: {**MOTION, "settle": 0.1} for name in runs}

    def found(parameters):
        overrides = {"finger.tendons.T1.curvature_offset": TURN}
        return fp.identify(
            "canal", parameters=parameters, recordings=recordings, data=runs, overrides=overrides, starts=1
        )

    whole = found({COULOMB: (0.005, 1.0), "finger.tendon_friction.drag": (0.0, 3.0)})
    lacking = found({COULOMB: (0.005, 1.0)})
    force = "first.tendon_tension.T1"
    assert float(whole.lack_of_fit.sel(signal=force)) > 0.01
    assert float(whole.replicate_noise.sel(signal=force)) == pytest.approx(0.05, rel=0.15)
    assert float(lacking.lack_of_fit.sel(signal=force)) < 1e-6
    assert "The model misses something of first.tendon_tension.T1" in summarize_identification(lacking)
    assert "misses" not in summarize_identification(whole)
    # No probability is below a significance of zero, which the report reads from the result.
    lacking.lack_of_fit.attrs["significance"] = 0.0
    assert "misses" not in summarize_identification(lacking)
    width = [float(each.upper[0] - each.lower[0]) for each in (whole, lacking)]
    assert width[1] > 2.0 * width[0]


@pytest.mark.slow
def test_bands_hold_beyond_the_loads_of_readings_whose_law_misses_something():
    """Of six loads of real readings choices of three are predicted from the others, most of them beyond these."""
    loads, inside = [3.0, 6.0, 9.0, 12.0, 15.0, 18.0], []
    # Every third one of all choices.
    for kept in [*itertools.combinations(loads, 3)][::3]:
        held = [load for load in loads if load not in kept]
        recordings = {"pull": {"held_out": {"force_in_N": held}}}
        inside.append(fp.identify("transmission", recordings=recordings, compare={}, starts=1, profiles=False))
    within = np.mean([float(each.prediction_within[0]) for each in inside])
    assert 0.9 < within < 0.98
