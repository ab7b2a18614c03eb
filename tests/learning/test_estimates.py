"""Estimates of observers among what a policy sees, against observers that are fed by hand with the same readings."""

import copy

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.exceptions import InputError
from finger_pin.learning import Environment, Sensor, Uniform, VectorEnvironment

WOUND = fp.load_scenario("wound", {"simulation.rtol": 1e-3, "simulation.atol_scale": 1e-3})
SEEN = [f"estimated.{name}" for name in ("joint_position", "joint_position_low", "spool_tension", "fingertip_force")]
TASK = {"reward": lambda signals: np.zeros(len(signals["action"])), "action": "spool_angle"}
# What the world has, and no observer knows.
TASK |= {"randomise": {"finger.tendon_friction.coulomb": Uniform(0.3, 0.4)}, "start": "random"}
ACTIONS = [[1.0], [2.0], [2.5], [1.5]]


def fed_by_hand(environment, random, step, noise):
    """Return the observation of the episode so far by what its result says of the motor, in steps and with noise."""
    result = environment.result()
    current = result.motor_current.values[:, 0]
    current[1:] += [random.normal(0.0, noise, 1)[0] if noise else 0.0 for _ in current[1:]]
    angle = result.motor_position.values[:, 0]
    angle = step * np.round(angle / step) if step else angle
    return fp.observe(WOUND, (result.time.values, {"motor_position.servo": angle, "motor_current.servo": current}))


@pytest.mark.parametrize(
    ("sensors", "step", "noise"),
    [({}, 2.0 * np.pi / 4096.0, 5e-3), ({"motor_position": Sensor(), "motor_current": Sensor()}, 0.0, 0.0)],
)
def test_estimates_are_those_of_an_observer_that_is_fed_by_hand(sensors, step, noise):
    task = TASK | {"observation": dict.fromkeys(SEEN, Sensor()) | sensors, "privileged": ["estimated.touched"]}
    environment = Environment(WOUND, delay=0.0035, **task)
    for seed in (1, 2):
        environment.reset(seed=seed)
        random = copy.deepcopy(environment.np_random)
        for action in ACTIONS:
            seen, *_, info = environment.step(action)
    expected = fed_by_hand(environment, random, step, noise).isel(time=-1)
    assert float(expected.spool_tension[0]) > 1.0
    told = np.concatenate([np.ravel(expected[name.removeprefix("estimated.")]) for name in SEEN])
    np.testing.assert_allclose(seen[: len(told)], told, rtol=1e-5, atol=1e-6)
    assert info["privileged"]["estimated.touched"] == float(expected.touched)


def test_worlds_and_copies_estimate_what_single_ones_do():
    task = TASK | {"observation": [*SEEN, "estimated.consistency"]}
    task["randomise"] = task["randomise"] | {"action.delay": Uniform(0.0, 0.01)}
    worlds, alone = VectorEnvironment(2, WOUND, **task), Environment(WOUND, **task)
    together = [worlds.reset(seed=5)[0]] + [worlds.step([action, action])[0] for action in ACTIONS[:2]]
    twin = copy.deepcopy(worlds)
    together.append(worlds.step([ACTIONS[2]] * 2)[0])
    np.testing.assert_array_equal(twin.step([ACTIONS[2]] * 2)[0], together[-1])
    for world in range(2):
        seen = [alone.reset(seed=5 + world)[0]] + [alone.step(action)[0] for action in ACTIONS[:3]]
        np.testing.assert_array_equal([each[world] for each in together], seen)


@pytest.mark.parametrize(
    ("scenario", "task", "message"),
    [
        ("reversals", {"observation": SEEN}, r"estimated.joint_position: needs a motor .* without are tensions.T1"),
        (WOUND, {"observation": ["estimated.joint_angle"]}, "estimated.joint_angle: no such estimate; there are"),
        (WOUND, {"observer": {"level": 0.9}}, "observer.level: has no effect"),
        (WOUND, {"observation": SEEN, "observer": {"levle": 0.9}}, r"observer.levle: must be one of .*level"),
    ],
)
def test_what_no_observer_can_tell_is_refused(scenario, task, message):
    action = "tension" if scenario == "reversals" else "spool_angle"
    with pytest.raises(InputError, match=message):
        Environment(scenario, reward=TASK["reward"], action=action, **task)
