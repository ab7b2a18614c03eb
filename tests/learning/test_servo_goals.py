"""Actions of a policy that are goals of motors in position drive."""

import sys
from pathlib import Path

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.description.coupling import PassiveCoupling
from finger_pin.learning import Environment, Uniform
from finger_pin.learning.action import Action

sys.path.append(str(Path(__file__).parents[1] / "mechanism"))
from servo_cases import SMOOTH, together

COARSE = {"simulation.rtol": 1e-3, "simulation.atol_scale": 1e-3}


def nothing(signals):
    return np.zeros(len(signals["action"]))


def test_goals_of_spools_are_lengths_over_radius():
    scenario = fp.load_scenario("servo_position", COARSE)
    by_angle = Environment(scenario, reward=nothing, action="motor_position", observation=["motor_position"])
    by_length = Environment(scenario, reward=nothing, action="tendon_length", observation=["motor_position"])
    goal, _ = by_angle.reset(seed=0)
    by_length.reset(seed=0)
    np.testing.assert_allclose(by_length.action_space.high, 0.005 * by_angle.action_space.high, rtol=1e-6)
    for _ in range(20):
        reached, *_ = by_angle.step(goal + 0.05)
        np.testing.assert_allclose(by_length.step(0.005 * (goal + 0.05))[0], reached, atol=2e-5)
    # All spools wind in against stretch: towards the goal, and with a proportional loop not all the way.
    assert np.all((reached > goal) & (reached < goal + 0.06))


def test_goals_of_joints_are_reached_whatever_slack_is_known():
    key = "finger.actuators.*.pretension"
    task = dict(reward=nothing, action="joint_position", observation=["joint_position"])
    goal, found = np.array([0.05, 0.6, 0.7]), {}
    for name, drawn in (("known", {}), ("slack", {key: Uniform(0.0, 0.0)})):
        drawn_in = {f"finger.actuators.M{k}.pretension": 40.0 for k in range(1, 5)}
        environment = Environment(fp.load_scenario("servo_position", COARSE | drawn_in), **task, randomise=drawn)
        environment.reset(seed=0)
        for _ in range(25):
            found[name], *_ = environment.step(goal)
    # What proportional loops and friction leave; and 40 N over 20 N/mm of slack, 2 mm of rope on radii of 5 to 8 mm.
    np.testing.assert_allclose(found["known"][:3], goal, atol=0.02)
    assert 0.05 < np.abs(found["slack"][:3] - goal).max() < 0.4


def test_an_episode_of_servos_goes_as_if_it_were_the_first():
    environment = Environment(fp.load_scenario("servo_position", COARSE), reward=nothing, action="joint_position")
    seen = []
    for _ in range(2):
        environment.reset(seed=0)
        seen.append([environment.step([0.1, 0.8, 0.9])[0] for _ in range(3)])
    np.testing.assert_array_equal(*seen)


@pytest.mark.parametrize(("period", "delay"), [(0.02, 0.0), (0.03, 0.0), (0.007, 0.004)])
def test_a_result_repeats_an_episode_of_new_goals_bit_for_bit(period, delay):
    """Goals arrive at samples of the loops, whose times differ from theirs by rounding, or between them."""
    task = dict(reward=nothing, action="spool_angle", period=period, delay=delay)
    seen = ["joint_position", "motor_position", "motor_voltage", "tendon_stiction"]
    environment = Environment(fp.load_scenario("servo_position", COARSE), privileged=seen, **task)
    environment.reset(seed=1)
    environment.action_space.seed(3)
    for _ in range(15):
        told = environment.step(environment.action_space.sample())[4]["privileged"]
    result = environment.result(sample_rate=1.0 / period)
    for name in ("joint_position", "motor_position", "tendon_stiction"):
        np.testing.assert_array_equal(result[name].values[-1], told[name], err_msg=name)
    np.testing.assert_allclose(result["motor_voltage"].values[-1], told["motor_voltage"], rtol=1e-12)
    exchanged = float(abs(result.energy_exchanged_electrical).max())
    assert float(abs(result.energy_residual).max()) < 1e-3 * exchanged


def test_a_motor_of_two_cords_can_be_told_to_wind_in_the_one_that_needs_more():
    """Pulleys of 10 and 4 mm turn by 6 rad on spools of 5 mm: 12 and 4.8 rad, and 20 N stretch a cord by 0.2 rad."""
    made = together(SMOOTH, [0.010, 0.004], spool_radius=0.005, winds=["in", "in"], drive="position")
    coupling = PassiveCoupling(np.eye(2), np.zeros(2), ())
    told = Action("motor_position", made, made, coupling)
    np.testing.assert_allclose([told.low, told.high], [[-12.0], [12.2]], rtol=1e-12)
