"""Tensions and fingertip forces over time in the closed loop of NumPy, against (18) and held commands."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.exceptions import InputError

STILL = {f"reference.joints.{name}.amplitude": 0.0 for name in ("abduction", "proximal", "medial")}
SHORT = STILL | {"simulation.duration": 0.01, "simulation.method": "BDF"}
PULLS = {
    "T1": {"offset": 2.0},
    "T2": {"kind": "step", "offset": 2.0, "time": 0.005, "height": 1.0},
    "T3": {"kind": "ramp", "offset": 5.0, "time": 0.0, "duration": 0.01, "height": 1.0},
}


def pulled(**entries):
    return fp.load_scenario("reversals", SHORT | {"controller": {"kind": "tensions", "tensions": PULLS}} | entries)


@pytest.mark.slow
def test_commands_are_the_signals_and_a_tendon_without_one_is_held_at_its_minimum():
    result = fp.simulate(pulled(**{"controller.minimum_tension": 3.0}))
    time = result.time.values
    expected = [2.0 + 0 * time, 2.0 + (time >= 0.005), 5.0 + time / 0.01, 3.0 + 0 * time]
    np.testing.assert_allclose(result.tendon_command[:, :4], np.transpose(expected), atol=1e-12)
    np.testing.assert_allclose(result.joint_torque_command[0], [0.0, 0.032 - 0.0053 * 3, 0.0315 - 0.0159, -0.0159])
    assert float(abs(result.energy_residual).max()) < 1e-5 * float(abs(result.energy_exchanged_actuators).max())


@pytest.mark.slow
def test_signals_and_their_samples_make_the_same_motion():
    times = np.linspace(0.0, 0.01, 3)
    scenario = pulled(**{"controller.tensions.T2": {"offset": 3.0}})
    samples = np.transpose([2.0 + 0 * times, 3.0 + 0 * times, 5.0 + times / 0.01, 1.0 + 0 * times])
    given = fp.simulate(fp.load_scenario("reversals", SHORT), controller=(times, samples))
    np.testing.assert_allclose(given.joint_position, fp.simulate(scenario).joint_position, atol=1e-6)


@pytest.mark.slow
def test_a_short_pulse_is_not_stepped_over():
    """1 N for 1 ms on a finger at rest: the actuator's work shows it, and the sum rule of (18) at its peak."""
    pulse = {"kind": "samples", "times": [0.0055, 0.006, 0.0065], "values": [0.0, 1.0, 0.0]}
    quiet = {f"controller.tensions.{name}": {"offset": 1.0} for name in ("T2", "T3", "T4")}
    runs = [fp.simulate(pulled(**quiet, **{"controller.tensions.T1": {"offset": 1.0} | each})) for each in ({}, pulse)]
    moved = [float(run.joint_velocity.sel(time=0.007, method="nearest")[0]) for run in runs]
    assert moved[1] - moved[0] > 0.05


def test_a_motion_takes_the_steps_that_it_needs_however_many_samples_it_is_given_by():
    """And none so long that it misses 1 N for half a millisecond: the finger is moved as by a thousand times fewer."""
    found = []
    for count in (201, 200_001):
        times = np.linspace(0.0, 0.1, count)
        pulse = np.interp(times, [0.05, 0.0505, 0.051], [0.0, 1.0, 0.0])
        tension = np.column_stack([1.0 + pulse, 2.0 + np.sin(20.0 * times), 5.0 + 0 * times, 1.0 + 0 * times])
        found.append(
            fp.simulate(fp.load_scenario("reversals", {"simulation.duration": 0.1}), controller=(times, tension))
        )
    few, many = found
    assert many.attrs["solver_steps"] < 1.5 * few.attrs["solver_steps"]
    np.testing.assert_allclose(many.joint_position, few.joint_position, atol=2e-5)
    assert float(abs(many.joint_velocity).max()) > 0.05


def test_a_negative_sample_of_tension_is_refused():
    with pytest.raises(InputError, match="a tendon only pulls"):
        fp.simulate(fp.load_scenario("reversals"), controller=([0.0, 1.0], [[1.0, 1.0, 1.0, -1e-3]] * 2))


@pytest.mark.slow
def test_the_force_at_the_fingertip_is_the_constant_and_what_varies():
    signal = {"z": {"kind": "ramp", "time": 0.0, "duration": 0.01, "height": -0.2}, "x": {"offset": 0.1}}
    entries = {"environment.fingertip_force": [0.0, 0.2, 0.1], "environment.fingertip_force_signal": signal}
    scenario = fp.load_scenario("reversals", SHORT | entries)
    result = fp.simulate(scenario)
    time = result.time.values
    np.testing.assert_allclose(
        result.fingertip_force, np.transpose([0.1 + 0 * time, 0.2 + 0 * time, 0.1 - 20.0 * time])
    )
    body = fp.Finger(scenario.finger).rigid_body
    jacobians = np.array([body.jacobian(q) for q in result.joint_position.values])
    torque = np.einsum("mij,mi->mj", jacobians, result.fingertip_force.values)
    np.testing.assert_allclose(result.external_torque, torque, atol=1e-12)
    assert float(abs(result.energy_residual).max()) < 1e-5 * float(abs(result.energy_exchanged_actuators).max())


@pytest.mark.slow
def test_a_force_by_samples_replaces_that_of_the_scenario():
    forces = np.array([[0.0, 0.0, 0.1], [0.0, 0.0, 0.1]])
    given = fp.simulate(fp.load_scenario("reversals", SHORT), fingertip_force=([0.0, 1.0], forces))
    told = fp.simulate(fp.load_scenario("reversals", SHORT | {"environment.fingertip_force": [0.0, 0.0, 0.1]}))
    np.testing.assert_allclose(given.joint_position, told.joint_position, atol=1e-7)


@pytest.mark.slow
def test_a_reference_by_samples_is_followed_and_followers_are_filled_in():
    times = np.linspace(0.0, 0.01, 11)
    theta = np.column_stack([0.1 * times, 0.3 + times, 0.5 - times])
    result = fp.simulate(fp.load_scenario("reversals", SHORT), reference=(times, theta))
    np.testing.assert_allclose(result.joint_reference[:, :3], theta, atol=1e-12)
    np.testing.assert_allclose(result.joint_reference[:, 3], (3.5e-3 * theta[:, 2] - 1.0 / 5e4) / 5e-3, atol=1e-12)


def test_a_column_for_a_follower_is_refused_with_the_names_that_are_wanted():
    with pytest.raises(InputError, match="one column for each of abduction, proximal, medial"):
        fp.simulate(fp.load_scenario("reversals"), reference=([0.0, 1.0], np.zeros((2, 4))))


def test_the_clock_of_all_signals_starts_where_the_scenario_says():
    force = {"environment.fingertip_force_signal.z": {"kind": "step", "time": 1.0, "height": 0.5}}
    loop = ClosedLoop.from_scenario(pulled(**force, **{"simulation.start_time": 2.0}))
    early = ClosedLoop.from_scenario(pulled(**force))
    np.testing.assert_allclose(loop.force(0.0), early.force(2.0))
    np.testing.assert_allclose(loop.reference.at(0.3).position, early.reference.at(2.3).position, atol=1e-12)
    np.testing.assert_allclose(loop.controller.signal.at(0.3)[0], early.controller.signal.at(2.3)[0], atol=1e-12)


@pytest.mark.slow
def test_open_loop_tensions_need_no_force_closure():
    scenario = pulled(**{"finger.tendons.T4.crossings.proximal.radius": 0.0053})
    assert fp.simulate(scenario).sizes["time"] == 11


@pytest.mark.slow
def test_a_varying_force_beside_a_sampled_controller_varies_between_its_samples_too():
    force = {"offset": 0.1, "amplitude": 0.2, "frequency": 40.0}
    settings = {"environment.fingertip_force_signal.z": force, "controller.sampling.period": 5e-3}
    result = fp.simulate(fp.load_scenario("reversals", STILL | settings | {"simulation.duration": 1.0}))
    expected = 0.1 + 0.2 * np.sin(2.0 * np.pi * 40.0 * result.time)
    np.testing.assert_allclose(result.fingertip_force.sel(axis="z"), expected, atol=1e-12)
    turned_over = float(abs(result.energy_exchanged_actuators).max() + abs(result.energy_exchanged_fingertip).max())
    assert float(abs(result.energy_residual).max()) < 1e-5 * turned_over
