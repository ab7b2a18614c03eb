"""Sampled execution against sequences worked out by hand: delay, encoders, tension sensors."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.control.interface import ControlSignals
from finger_pin.control.sampling import JointEncoder, JointSpeed, TensionSensor
from finger_pin.exceptions import InputError


class Listening:
    """Commands the number of the sample on T1, and keeps all that it is told."""

    def __init__(self):
        """Begin with nothing heard."""
        self.position, self.velocity, self.tension, self.elapsed, self.times = [], [], [], [], []

    def sense(self, readings, elapsed):
        self.tension.append(readings["tendon_tension"])
        self.elapsed.append(elapsed)

    def command(self, time, reference, position, velocity):
        self.times.append(time)
        self.position.append(position)
        self.velocity.append(velocity)
        return ControlSignals(np.zeros(4), np.array([len(self.times), 1.0, 4.0, 3.0, 3.0]))


def run(controller=None, duration=0.012, rate=4000.0, **sampling):
    overrides = {f"controller.sampling.{key}": value for key, value in sampling.items()}
    settings = {"simulation.duration": duration, "simulation.sample_rate": rate}
    return fp.simulate(fp.load_scenario("reversals", overrides | settings), controller=controller)


@pytest.mark.parametrize("delay", [0.0, 0.5e-3, 1e-3, 2.5e-3, 3e-3, 0.3e-3, 1.7e-3])
def test_tensions_act_after_the_delay_and_hold_until_the_next_act(delay):
    """Sample k, at k ms, acts from k ms + delay on; the first acts from the start. Read between all switches."""
    controller = Listening()
    result = run(controller, period=1e-3, delay=delay, rate=10000.0)
    np.testing.assert_allclose(controller.times, np.arange(12) * 1e-3, atol=1e-12)
    # In units of 0.1 ms, so that every comparison is exact; readings at switches belong to what begins there.
    late = round(delay * 1e4)
    expected = [max(0, (tick - late) // 10) + 1 for tick in range(120)]
    np.testing.assert_array_equal(result.tendon_command[:120, 0], expected)


def test_the_finger_feels_the_tensions_when_they_act():
    """The energy account closes only if what is recorded is what was integrated."""
    result = run(None, duration=0.1, period=2e-3, delay=3.1e-3, rate=1000.0)
    assert float(abs(result.energy_residual).max()) < 1e-4 * float(abs(result.energy_exchanged_actuators).max())


def test_encoders_read_the_nearest_step_and_velocities_are_differences_by_hand():
    sensors, found = (JointEncoder(0.1), JointSpeed(0.5, 0.1)), []
    for angles in ([0.0, 0.24], [0.26, 0.26], [0.24, -0.06], [0.24, -0.04]):
        now = SimpleNamespace(state=SimpleNamespace(position=np.array(angles), velocity=np.full(2, 7.0)))
        found.append([each.read(now) for each in sensors])
    position, velocity = np.swapaxes(found, 0, 1)
    np.testing.assert_allclose(position, [[0, 0.2], [0.3, 0.3], [0.2, -0.1], [0.2, 0]])
    np.testing.assert_allclose(velocity, [[0, 0], [0.6, 0.2], [-0.2, -0.8], [0.0, 0.2]], atol=1e-12)


def test_without_a_resolution_angles_and_velocities_are_exact():
    controller = Listening()
    result = run(controller, period=1e-3, rate=1000.0)
    np.testing.assert_allclose(controller.position, result.joint_position[:12], rtol=1e-12)
    np.testing.assert_allclose(controller.velocity, result.joint_velocity[:12], rtol=1e-9, atol=1e-12)


def test_a_controller_sees_the_finger_through_its_encoders():
    controller = Listening()
    result = run(controller, period=1e-3, rate=1000.0, encoder_resolution=1e-3)
    position = np.array(controller.position)
    np.testing.assert_allclose(position * 1e3, np.round(position * 1e3), atol=1e-9)
    assert np.max(np.abs(position - result.joint_position[:12].values)) <= 0.5e-3 + 1e-12
    np.testing.assert_allclose(controller.velocity[1:], np.diff(position, axis=0) / 1e-3, atol=1e-9)


def test_a_tension_sensor_reads_what_is_delivered_under_the_tensions_that_act():
    """At the first sample nothing acts yet; later readings are the recorded tensions just before the sample."""
    controller = Listening()
    result = run(controller, period=1e-3, rate=1e5)
    assert controller.elapsed == [0.0] + 11 * [1e-3]
    np.testing.assert_array_equal(controller.tension[0][:4], 0.0)
    before = result.tendon_tension[99:1199:100].values
    np.testing.assert_allclose(controller.tension[1:], before, atol=0.05 * before.max())
    assert np.max(np.abs(np.array(controller.tension[2:]) - before[1:])) < 0.02 * before.max()


def test_noise_is_reproducible_by_its_seed_and_has_the_standard_deviation_and_no_memory():
    """For n normal numbers the mean scatters by s / sqrt(n), s by s / sqrt(2 n), correlations by 1 / sqrt(n)."""
    count, deviation = 20000, 0.3
    now = SimpleNamespace(signals={"tendon_tension": np.arange(5.0)})

    def readings(seed):
        sensor = TensionSensor(deviation, seed)
        return np.array([sensor.read(now) for _ in range(count)])

    first = readings(3)
    np.testing.assert_array_equal(first, readings(3))
    assert not np.any(first == readings(4))
    noise = first - np.arange(5.0)
    assert np.max(np.abs(noise.mean(axis=0))) < 4.0 * deviation / math.sqrt(count)
    assert np.max(np.abs(noise.std(axis=0) - deviation)) < 4.0 * deviation / math.sqrt(2 * count)
    together = np.corrcoef(np.hstack([noise[:-1], noise[1:]]).T) - np.eye(10)
    assert np.max(np.abs(together)) < 5.0 / math.sqrt(count)


@pytest.mark.slow
def test_the_recorded_scenario_repeats_a_noisy_run_bit_by_bit(tmp_path):
    overrides = {
        "controller.damping": 1e-3,
        "controller.gravity_compensation": True,
        "controller.tendon_friction_feedforward.share": 0.9,
        "controller.joint_friction_compensation.coulomb": [1e-4, 2e-4, 3e-4, 4e-4],
        "controller.distribution.maximum_tension": 30.0,
        "controller.passive_tension": 4.0,
        "controller.passive_tension_loop.proportional": 0.1,
        "controller.sampling.delay": 4e-4,
        "controller.sampling.encoder_resolution": 1e-4,
        "controller.sampling.tension_noise": 0.2,
        "simulation.duration": 0.05,
    }
    runs = {}
    for seed in (1, 2):
        scenario = fp.load_scenario("reversals", overrides | {"controller.sampling.seed": seed})
        runs[seed] = fp.simulate(scenario)
        path = tmp_path / f"seed{seed}.toml"
        path.write_text(runs[seed].attrs["scenario"])
        assert fp.load_scenario(path) == scenario
        again = fp.simulate(fp.load_scenario(path))
        np.testing.assert_array_equal(again.tendon_command, runs[seed].tendon_command)
        np.testing.assert_array_equal(again.joint_position, runs[seed].joint_position)
    assert np.any(runs[1].tendon_command.values != runs[2].tendon_command.values)


def test_the_period_of_an_argument_wins_over_the_scenario_s_and_keeps_its_sensors():
    controller = Listening()
    scenario = fp.load_scenario(
        "reversals", {"controller.sampling.encoder_resolution": 1e-3, "simulation.duration": 0.01}
    )
    fp.simulate(scenario, controller=controller, control_period=2e-3)
    np.testing.assert_allclose(controller.times, np.arange(5) * 2e-3)
    position = np.array(controller.position) * 1e3
    np.testing.assert_allclose(position, np.round(position), atol=1e-9)


def test_the_paper_s_controller_sampled_by_the_scenario_is_what_the_argument_makes_of_it():
    by_scenario = run(None, duration=0.05, rate=1000.0, period=1e-3)
    scenario = fp.load_scenario("reversals", {"simulation.duration": 0.05})
    by_argument = fp.simulate(scenario, control_period=1e-3)
    np.testing.assert_array_equal(by_scenario.joint_position, by_argument.joint_position)


def test_sampling_needs_a_method_that_can():
    scenario = fp.load_scenario("reversals", {"controller.sampling.period": 1e-3, "simulation.method": "BDF"})
    with pytest.raises(InputError) as caught:
        fp.simulate(scenario)
    assert caught.value.entry == "simulation.method"
