"""Signals over time against their definitions, written out, and against scipy's own polynomials."""

import math

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from finger_pin.core.addresses import time_functions as core
from finger_pin.description.signals import ForceSignal, JointReference
from finger_pin.exceptions import InputError
from finger_pin.references.signal import Signal

STEP = JointReference(kind="step", offset=0.1, time=0.5, height=0.4)
RAMP = JointReference(kind="ramp", time=1.0, duration=0.5, height=-0.6)
POINTS = JointReference(kind="points", times=(0.2, 0.7, 1.7), values=(0.1, 0.5, -0.3))
SAMPLES = JointReference(kind="samples", times=(0.0, 0.3, 0.4, 1.1), values=(0.2, 0.9, 0.9, 0.0))
SINE = JointReference(offset=0.3, amplitude=0.2, frequency=0.7, phase=0.4)
ALL = [STEP, RAMP, POINTS, SAMPLES, SINE]


def values(settings, times):
    return Signal.from_settings([settings]).at(np.asarray(times))[0][..., 0]


def test_a_step_is_there_from_its_time_on():
    np.testing.assert_allclose(values(STEP, [-9.0, 0.0, 0.4999, 0.5, 0.6, 99.0]), [0.1, 0.1, 0.1, 0.5, 0.5, 0.5])


def test_a_ramp_rises_evenly_over_its_duration_and_stays():
    np.testing.assert_allclose(
        values(RAMP, [0.0, 1.0, 1.25, 1.4, 1.5, 7.0]), [0, 0, -0.3, -0.48, -0.6, -0.6], atol=1e-15
    )


def test_points_are_joined_by_the_motion_of_least_jerk():
    """Flash and Hogan: x0 + (x1 - x0)(10 s^3 - 15 s^4 + 6 s^5), s the part of the time between two points."""

    def least_jerk(time):
        for t0, t1, x0, x1 in ((0.2, 0.7, 0.1, 0.5), (0.7, 1.7, 0.5, -0.3)):
            if t0 <= time <= t1:
                s = (time - t0) / (t1 - t0)
                return x0 + (x1 - x0) * (10 * s**3 - 15 * s**4 + 6 * s**5)
        return 0.1 if time < 0.2 else -0.3

    times = np.linspace(-0.5, 2.5, 301)
    np.testing.assert_allclose(values(POINTS, times), [least_jerk(t) for t in times], atol=1e-13)


def test_at_every_point_the_motion_rests():
    rate = Signal.from_settings([POINTS]).at(np.array(POINTS.times))[1]
    np.testing.assert_allclose(rate, 0.0, atol=1e-12)


def test_samples_are_joined_by_scipy_s_monotone_cubics_and_never_overshoot():
    times = np.linspace(0.0, 1.1, 200)
    found = values(SAMPLES, times)
    np.testing.assert_allclose(found, PchipInterpolator(SAMPLES.times, SAMPLES.values)(times), atol=1e-14)
    assert found.max() <= 0.9 + 1e-15 and found.min() >= -1e-15
    np.testing.assert_allclose(values(SAMPLES, [-1.0, 2.0]), [0.2, 0.0], atol=1e-14)


def test_signals_that_share_knots_are_each_what_they_are_alone():
    times = np.linspace(-0.5, 2.5, 500)
    together, rates = Signal.from_settings(ALL).at(times)
    for column, settings in enumerate(ALL):
        alone, rate = Signal.from_settings([settings]).at(times)
        np.testing.assert_allclose(together[:, column], alone[:, 0], atol=1e-12)
        np.testing.assert_allclose(rates[:, column], rate[:, 0], atol=1e-9)


def test_a_sinusoid_is_added_to_every_kind():
    both = STEP.updated(amplitude=0.2, frequency=0.7, phase=0.4)
    times = np.linspace(0.0, 2.0, 50)
    expected = values(STEP, times) + 0.2 * np.sin(2.0 * math.pi * 0.7 * times + 0.4)
    np.testing.assert_allclose(values(both, times), expected, atol=1e-14)


def test_rates_are_the_derivatives_of_values():
    times, step = np.linspace(-0.21, 2.13, 118), 1e-6
    signal = Signal.from_settings([RAMP, POINTS, SAMPLES, SINE])
    numeric = (signal.at(times + step)[0] - signal.at(times - step)[0]) / (2.0 * step)
    np.testing.assert_allclose(signal.at(times)[1], numeric, atol=1e-6)


def test_one_time_is_a_row_of_many():
    signal, times = Signal.from_settings(ALL), np.array([0.1, 0.5, 1.2, 5.0])
    value, rate = signal.at(times)
    assert value.shape == rate.shape == (4, 5)
    for row, time in enumerate(times):
        np.testing.assert_array_equal(signal.at(time)[0], value[row])
        np.testing.assert_array_equal(signal.at(time)[1], rate[row])


def test_a_later_start_shifts_the_clock():
    times = np.linspace(0.0, 2.0, 40)
    signal = Signal.from_settings(ALL)
    np.testing.assert_allclose(signal.starting_at(0.37).at(times)[0], signal.at(times + 0.37)[0], atol=1e-12)


def test_a_faster_signal_is_the_same_in_less_time():
    times = np.linspace(-0.5, 2.5, 90)
    for settings in ALL:
        np.testing.assert_allclose(values(settings.faster(4.0), times / 4.0), values(settings, times), atol=1e-12)


def test_only_sinusoids_are_harmonic():
    assert Signal.from_settings([SINE, JointReference()]).is_harmonic
    assert not Signal.from_settings([SINE, STEP]).is_harmonic


@pytest.mark.parametrize("settings", ALL[:4], ids=lambda each: each.kind)
def test_the_lowest_value_is_what_the_signal_comes_down_to(settings):
    assert values(settings, np.linspace(-1.0, 3.0, 4001)).min() == pytest.approx(settings.lowest, abs=1e-12)


def test_a_sinusoid_is_never_below_offset_less_amplitude():
    assert ForceSignal(offset=3.0, amplitude=-2.0).lowest == 1.0


def test_a_step_ends_where_a_signal_jumps_or_bends_and_so_many_times_however_many_samples_it_has():
    assert Signal.from_settings([STEP]).step_ends(1e-6).tolist() == [0.5]
    assert Signal.from_settings([RAMP]).step_ends(1e-6).tolist() == [1.0, 1.5]
    ends = []
    for count in (11, 2_001, 200_001):
        times = np.linspace(0.0, 4.0, count)
        # Half a millisecond of pulse in four seconds of rest.
        pulse = np.exp(-(((times - 2.0) / 1e-4) ** 2))
        ends.append(Signal.from_samples("x", (times, np.transpose([np.sin(times), 0.1 * pulse])), "ab").step_ends(1e-6))
    assert len(ends[0]) <= 11 < len(ends[1]) < len(ends[2]) < 500
    assert np.count_nonzero(np.abs(ends[2] - 2.0) < 3e-4) > 20


@pytest.mark.parametrize(("count", "digits"), [(2_001, 9), (20_001, 7), (200_001, 6)])
def test_rounding_within_the_tolerance_adds_no_ends_of_steps(count, digits):
    """Of sin t over two periods the integral of the root of |u''| is 4 sqrt(pi) Gamma(3/4) / Gamma(5/4)."""
    times, tolerance = np.linspace(0.0, 4.0 * np.pi, count), 1e-6
    samples = (times, np.round(np.sin(times), digits)[:, None])
    # Chords within d of a curve of curvature c are sqrt(8 d / c) long; here a quarter of that distance counts.
    closed = (
        4.0 * math.sqrt(math.pi) * math.gamma(0.75) / math.gamma(1.25) / math.sqrt(2.0 * 2.0 * math.sqrt(tolerance))
    )
    assert len(Signal.from_samples("x", samples, "a").step_ends(tolerance)) == pytest.approx(closed, rel=0.02)


def test_the_compiled_search_finds_the_piece_of_any_time_on_uneven_knots():
    random = np.random.default_rng(1)
    for power in (1, 3, 9):
        knots = np.unique(random.uniform(-1.0, 1.0, 30) ** power)
        signal = core.SignalTable(np.zeros((0, 5)), knots, np.zeros((6, len(knots) - 1, 0)))
        for time in (*random.uniform(-1.2, 1.2, 50), *knots):
            piece, since = core._piece.py_func(signal, time)
            expected = np.clip(np.searchsorted(knots, time, side="right") - 1, 0, len(knots) - 2)
            assert piece == expected and since == np.clip(time, knots[0], knots[-1]) - knots[expected]


@pytest.mark.parametrize("delays", [(0.0, 0.1, 0.3, 0.0), (0.2, 0.0, 0.0, 0.7)])
def test_a_delayed_signal_is_the_same_later_and_zero_before(delays):
    signal = Signal.from_settings([
        ForceSignal(offset=2.0, amplitude=0.7, frequency=1.3, phase=0.4),
        ForceSignal(kind="samples", times=[0.1, 0.4, 0.9], values=[0.3, 1.0, -0.2], amplitude=0.2, frequency=3.0),
        ForceSignal(kind="ramp", time=-0.2, duration=0.5, height=3.0),
        ForceSignal(kind="step", time=0.5, height=1.0, offset=-0.4),
    ])  # fmt: skip
    delayed = signal.delayed(np.array(delays))
    for time in np.random.default_rng(2).uniform(0.0, 2.0, 200):
        before = [signal.at(time - delay) for delay in delays]
        begun = time >= np.array(delays) - np.where(np.array(delays) > 0.0, 0.0, 1.0)
        values, rates = (np.array([each[n][k] for k, each in enumerate(before)]) * begun for n in (0, 1))
        np.testing.assert_allclose(delayed.at(time), (values, rates), atol=1e-12)
        np.testing.assert_allclose(delayed.derivative(time, 1), rates, atol=1e-12)
    assert set(np.array(delays)[np.array(delays) > 0.0]) <= set(delayed.step_ends(1e-6))
    np.testing.assert_allclose(delayed.delayed(-np.array(delays)).at(1.1), signal.at(1.1), atol=1e-12)


WRONG = [
    (([0.0, 1.0], [[1.0], [2.0]]), "values must have 2 rows"),
    (([0.0], [[1.0, 2.0]]), "values must have 2 rows"),
    (([0.0, 1.0, 0.5], np.zeros((3, 2))), "times must increase"),
    (([0.0, 0.0], np.zeros((2, 2))), "times must increase"),
    (([0.0, 1.0], [[1.0, math.nan], [2.0, 1.0]]), "must be finite"),
    (([0.0, 1.0], [[1.0], [2.0, 3.0]]), "must be a pair of arrays"),
    ((1.0, 2.0, 3.0), "must be a pair of arrays"),
]


@pytest.mark.parametrize(("samples", "said"), WRONG)
def test_samples_of_a_wrong_shape_are_refused_in_one_line(samples, said):
    with pytest.raises(InputError, match=said) as caught:
        Signal.from_samples("reference", samples, ["a", "b"])
    assert caught.value.entry == "reference" and "\n" not in str(caught.value)


def test_a_held_value_stays_until_the_next_and_the_last_one_for_ever():
    settings = JointReference(kind="hold", times=(0.0, 0.3, 0.4), values=(0.2, 0.9, -0.1), offset=0.1)
    instants = [-1.0, 0.0, 0.29, 0.3, 0.39, 0.4, 9.0]
    np.testing.assert_allclose(values(settings, instants), [0.3, 0.3, 0.3, 1.0, 1.0, 0.0, 0.0], atol=1e-15)
    # Beside a signal with other knots as well.
    beside = Signal.from_settings([settings, SAMPLES]).at(np.array(instants))[0]
    np.testing.assert_allclose(beside[:, 0], [0.3, 0.3, 0.3, 1.0, 1.0, 0.0, 0.0], atol=1e-15)
