"""A sensor that stands in this file alone, told to its controller and recorded."""

import numpy as np
import pytest

import finger_pin as fp

PERIOD = 1e-3


class Gauge(fp.control.SampledSensor):
    """The torque of the tendons at two joints, with noise."""

    name, units, dimension, labels = "link_torque", "N m", "gauge", ("proximal", "medial")

    def __init__(self):
        """Begin with nothing read."""
        self.noise, self.exact = np.random.default_rng(1).normal(0.0, 1e-3, (100, 2)), []

    def read(self, now):
        self.exact.append(now.signals["joint_torque"][1:3])
        return self.exact[-1] + self.noise[len(self.exact) - 1]


class Clock(fp.control.SampledSensor):
    """One number: the time."""

    name, units = "clock", "s"

    def read(self, now):
        return now.time


class Listening:
    """Pulls harder from sample to sample, and keeps what it is told."""

    def __init__(self, *sensors):
        """Take sensors."""
        self.sensors, self.told = sensors, []

    def sense(self, readings, elapsed):
        self.told.append({name: values.copy() for name, values in readings.items()})

    def command(self, time, reference, position, velocity):
        return np.array([1.0, 1.0, 4.0 + 0.1 * len(self.told), 3.0])


def run(controller, **sampling):
    overrides = {f"controller.sampling.{key}": value for key, value in sampling.items()}
    settings = {"simulation.duration": 0.012, "simulation.sample_rate": 4000.0}
    return fp.simulate(
        fp.load_scenario("reversals", overrides | settings), controller=controller, control_period=PERIOD
    )


@pytest.fixture(scope="module")
def heard():
    controller = Listening(Gauge(), Clock())
    return controller, run(controller, encoder_resolution=1e-3, tension_noise=0.2)


def test_the_result_holds_what_the_controller_was_told_until_the_next_sample(heard):
    controller, result = heard
    # Four saved times a period.
    last = np.minimum(np.arange(result.sizes["time"]) // 4, len(controller.told) - 1)
    for name in ("joint_position", "joint_velocity", "tendon_tension", "link_torque", "clock"):
        told = np.array([each[name] for each in controller.told])[last]
        np.testing.assert_array_equal(result[f"measured_{name}"], told)
    assert list(result.gauge.values) == ["proximal", "medial"] and result.measured_link_torque.units == "N m"
    np.testing.assert_array_equal(result.measured_clock, np.arange(12)[last] * PERIOD)


def test_a_sensor_reads_the_finger_at_the_sample_under_the_tensions_that_act_until_then(heard):
    """Just before a sample the recorded torque is what it reads, but for what 0.25 ms change; the noise is its own."""
    gauge, result = heard[0].sensors[0], heard[1]
    exact, before = np.array(gauge.exact[2:12]), result.joint_torque[7:47:4, 1:3].values
    assert np.max(np.abs(exact - before)) < 0.1 * np.ptp(before, axis=0).max()
    read = np.array([each["link_torque"] for each in heard[0].told])
    np.testing.assert_allclose(read - np.array(gauge.exact), gauge.noise[: len(read)], atol=1e-15)


def test_sensors_that_cannot_be_recorded_are_refused_before_anything_is_computed():
    class Three(Clock):
        """Three numbers in place of one."""

        def read(self, now):
            return np.zeros(3)

    with pytest.raises(fp.InputError, match=r"controller.sensors: clock must read values of shape \(\), not \(3,\)"):
        run(Listening(Three()))
    with pytest.raises(fp.InputError, match=r"controller.sensors = .clock.: there is another one of this name"):
        run(Listening(Clock(), Clock()))
    with pytest.raises(fp.InputError, match=r"control_period: is missing: a controller that reads sensors is sampled"):
        fp.simulate("reversals", controller=Listening(Clock()))
