"""Dense samples: fewer pieces that have the value and the slope of what was sampled, whatever its rounding."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.references.signal import Signal

TOLERANCE = 1e-6


def sine(times):
    return np.transpose([np.sin(times), 3.0 - 2.0 * np.cos(0.7 * times)])


def rate(times):
    return np.transpose([np.cos(times), 1.4 * np.sin(0.7 * times)])


@pytest.mark.slow
@pytest.mark.parametrize("digits", [7, 9, 15])
@pytest.mark.parametrize("uneven", [0.0, 0.4])
def test_slopes_of_rounded_samples_are_those_of_what_was_sampled(digits, uneven):
    """Of single intervals of 20 us they would be wrong by 1e-7 / 2e-5 s = 5e-3 per second, and more."""
    random = np.random.default_rng(1)
    times = np.linspace(0.0, 4.0, 200_001)
    times[1:-1] += uneven * (times[1] - times[0]) * random.uniform(-1.0, 1.0, len(times) - 2)
    samples = np.round(sine(times), digits)
    signal = Signal.from_samples("x", (times, samples), ["a", "b"], TOLERANCE)
    assert len(signal.knots) < 1_000
    inside = random.uniform(0.001, 3.99, 5_000)
    value, slope = signal.at(inside)
    assert np.max(np.abs(value - sine(inside))) < max(3.0 * 10.0**-digits, 3e-8)
    assert np.max(np.abs(slope - rate(inside))) < 1e-3
    assert np.max(np.abs(signal.at(times)[0] - samples) / np.ptp(samples, axis=0)) < TOLERANCE


def test_corners_jumps_pulses_and_what_is_rougher_than_the_tolerance_stay_as_they_are():
    times = np.linspace(0.0, 4.0, 20_001)
    shapes = {
        "corner": np.abs(times - 1.23456),
        "jump": np.where(times < 1.2, 0.0, 1.0),
        "pulse": np.exp(-(((times - 2.0) / 1e-3) ** 2)),
        "noise": np.sin(times) + 1e-4 * np.random.default_rng(1).normal(size=len(times)),
        "rest": np.full(len(times), 3.0),
    }
    for name, values in shapes.items():
        plain = Signal.from_samples("x", (times, values[:, None]), ["a"])
        thin = Signal.from_samples("x", (times, values[:, None]), ["a"], TOLERANCE)
        between = np.linspace(-0.1, 4.1, 77_777)
        # Monotone cubics themselves leave a pulse by as much as it bends between samples.
        off = np.max(np.abs(thin.at(between)[0] - plain.at(between)[0]))
        assert off < (1e-4 if name == "pulse" else 2.0 * TOLERANCE), name
        assert (len(thin.knots) == len(times)) == (name == "noise"), name
    assert np.array_equal(thin.at(between)[0], plain.at(between)[0])


def test_a_run_takes_no_more_steps_for_samples_that_are_rounded():
    times, steps = np.linspace(0.0, 0.2, 200_001), []
    wave = np.sin(np.outer(times, [4.0, 6.0, 7.0, 4.0]) + np.array([0.0, 0.3, 1.0, 2.0]))
    scenario = fp.load_scenario("reversals", {"simulation.duration": 0.2})
    for digits in (15, 7):
        pulled = np.round([2.0, 2.0, 5.0, 4.0] + 0.4 * wave, digits)
        steps.append(fp.simulate(scenario, controller=(times, pulled)).attrs["solver_steps"])
    assert steps[1] < 1.2 * steps[0]
