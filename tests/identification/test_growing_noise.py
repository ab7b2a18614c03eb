"""Noise that grows with the reading: weighted least squares in closed form, and how often intervals hold the truth."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import norm

import finger_pin as fp
from finger_pin.identification.likelihood import minus_twice_likelihood
from finger_pin.identification.residuals.residuals import NoiseGrowth

COULOMB, TURN, TRUE = "finger.tendon_friction.coulomb", 2.5, 0.12
FLOOR, SHARE = 0.02, 0.06


def table(rng, scale=1.0):
    """Loads over two decades and what arrives through a canal, a line through the origin, with floor and share."""
    load = np.repeat(np.geomspace(0.3, 30.0, 10), 6)
    out = load * np.exp(-TRUE * TURN)
    return {"in": load, "out": out + scale * np.hypot(FLOOR, SHARE * out) * rng.normal(size=load.size)}


def fitted(data, refits=True, **output):
    recording = {
        "kind": "steady",
        "speed": 0.05,
        "inputs": {"tendon_command.T1": "in"},
        "outputs": {"tendon_tension.T1": {"column": "out", **output}},
    }
    overrides = {"finger.tendons.T1.curvature_offset": TURN, "finger.tendon_friction.drag": 0.0}
    given = {"recordings": {"pull": recording}, "data": {"pull": data}, "overrides": overrides}
    found = fp.identify("canal", parameters={COULOMB: (0.02, 0.5)}, starts=1, refits=refits, **given)
    return found, recording


GROWING = {"least_noise": FLOOR, "noise_share": SHARE}


def test_noise_that_grows_weighs_readings_as_weighted_least_squares_do():
    """Estimate, deviation, noise at zero and band, by the weights of what is computed; sigma 2.5 times what is said."""
    data = table(np.random.default_rng(5), scale=2.5)
    found, recording = fitted(data, **GROWING)

    def density(values):
        share, size = values
        sigma = size * np.hypot(FLOOR, SHARE * share * data["in"])
        return -norm.logpdf(data["out"], share * data["in"], sigma).sum()

    share, size = minimize(density, [np.exp(-TRUE * TURN), 2.5], method="Nelder-Mead", options={"xatol": 1e-9}).x
    assert float(found.estimate[0]) == pytest.approx(-np.log(share) / TURN, abs=2e-6)
    assert float(found.noise[0]) == pytest.approx(size * FLOOR, rel=1e-3)
    sigma = size * np.hypot(FLOOR, SHARE * share * data["in"])
    deviation = 1.0 / np.sqrt(np.sum((data["in"] / sigma) ** 2)) / share / TURN
    # The spread of noise tells a little of the line as well: 2 SHARE^2 of the information.
    width = float(found.linear_upper[0] - found.linear_lower[0])
    assert width / (4.0 * deviation) == pytest.approx(1.0, abs=0.04)
    plain, _ = fitted(data, refits=False)
    assert abs(float(plain.estimate[0] - found.estimate[0])) > 1e-3
    np.testing.assert_allclose(found.residual, data["out"] - share * data["in"], atol=1e-4)
    later = fp.predict(found, {"pull": recording}, data={"pull": data})
    np.testing.assert_allclose(later.predicted_band / (2.0 * sigma), 1.0, atol=0.06)
    assert 0.9 <= float(later.prediction_within[0]) <= 1.0


@pytest.mark.slow
def test_intervals_under_noise_that_grows_hold_the_truth():
    rng, held = np.random.default_rng(6), 0
    for _ in range(24):
        found, _ = fitted(table(rng), refits=False, **GROWING)
        held += bool(found.lower[0] <= TRUE <= found.upper[0])
    # Of 24, each with 95 %: fewer than 19 happen once in a thousand times.
    assert held >= 19


def test_slopes_of_weighed_residuals_are_those_of_differences_and_the_likelihood_is_that_of_normal_densities():
    rng = np.random.default_rng(7)
    measured, design = [rng.normal(3.0, 2.0, n) for n in (5, 4, 6)], [rng.normal(size=(n, 2)) for n in (5, 4, 6)]
    groups = np.array([0, 1, 0])
    noise = NoiseGrowth(measured, np.array([0.1, 0.2, 0.1]), np.array([0.05, 0.0, 0.05]), groups)

    def residuals(z):
        return noise.weigh([x - a @ z for x, a in zip(measured, design, strict=True)])

    z, step = np.array([0.4, -0.7]), 1e-6
    errors = [x - a @ z for x, a in zip(measured, design, strict=True)]
    slopes = noise.weigh_slopes(errors, [-a for a in design])
    for k in range(2):
        moved = [residuals(z + way * step * np.eye(2)[k]) for way in (1.0, -1.0)]
        for up, down, slope in zip(*moved, slopes, strict=True):
            np.testing.assert_allclose((up - down) / (2.0 * step), slope[:, k], atol=1e-7)

    def density(z):
        value = 0.0
        for group, floor, share in ((0, 0.1, 0.05), (1, 0.2, 0.0)):
            pairs = [(x, a @ z) for x, a, g in zip(measured, design, groups, strict=True) if g == group]
            x, c = (np.concatenate(each) for each in zip(*pairs, strict=True))
            size = np.hypot(1.0, share * c / floor)
            sigma = size * np.sqrt(np.mean(((x - c) / size) ** 2))
            value -= 2.0 * norm.logpdf(x, c, sigma).sum()
        return value

    places = [z, z + 0.3, -z]
    known = [minus_twice_likelihood(residuals(each), np.ones(3), groups, np.zeros(3)) for each in places]
    np.testing.assert_allclose(np.diff(known), np.diff([density(each) for each in places]), rtol=1e-10)


@pytest.mark.parametrize(
    ("output", "said"),
    [({"noise_share": 0.05}, "noise_share = 0.05: needs least_noise"), ({"noise_share": 2.0, "least_noise": 0.1}, "1")],
)
def test_a_share_without_a_floor_is_refused(output, said):
    with pytest.raises(fp.InputError) as refused:
        fitted(table(np.random.default_rng(1)), **output)
    assert said in str(refused.value) and "\n" not in str(refused.value)


def test_outputs_that_share_a_noise_are_weighed_alike():
    """Readings 3, 6, 9 N by a scale of mu: with one noise they are pooled, as by least squares over all of them."""
    rng, turn, load = np.random.default_rng(3), 1.57, np.repeat([3.0, 6.0, 9.0], 4)
    data = {
        name: {"in": load, "out": load * np.exp(-mu * turn) + rng.normal(0.0, spread, load.size)}
        for name, mu, spread in (("one", 0.10, 0.01), ("two", 0.12, 0.1))
    }

    def identify(**column):
        out = {"tendon_tension.T1": {"column": "out", **column}}
        recording = {"kind": "steady", "speed": 0.01, "inputs": {"tendon_command.T1": "in"}, "outputs": out}
        given = {"parameters": {"finger.tendon_friction.coulomb": (0.01, 1.0)}, "starts": 1}
        given |= {"profiles": False, "refits": False}
        return fp.identify("canal", recordings=dict.fromkeys(data, recording), data=data, **given)

    shared, own = identify(noise="cell"), identify()
    arrived = sum(load @ each["out"] for each in data.values()) / sum(load @ load for _ in data)
    assert float(shared.estimate[0]) == pytest.approx(-np.log(arrived) / turn, rel=1e-3)
    assert float(own.estimate[0]) < 0.104
    rms = np.sqrt(np.mean(shared.residual.values**2))
    np.testing.assert_allclose(shared.noise, [rms, rms], rtol=1e-9)


def test_outputs_with_another_least_noise_share_none():
    data = {name: {"in": np.ones(3), "out": np.ones(3)} for name in ("one", "two")}
    recordings = {
        name: {
            **{"kind": "steady", "speed": 0.01, "inputs": {"tendon_command.T1": "in"}},
            "outputs": {"tendon_tension.T1": {"column": "out", "noise": "cell", "least_noise": least}},
        }
        for name, least in (("one", 0.1), ("two", 0.2))
    }
    given = {"parameters": {"finger.tendon_friction.coulomb": (0.01, 1.0)}}
    with pytest.raises(fp.InputError, match=r'two.outputs.*T1.noise = "cell".*least_noise is 0.1, not 0.2'):
        fp.identify("canal", recordings=recordings, data=data, **given)
