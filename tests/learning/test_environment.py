"""Environments: what a policy does and sees, against the simulator and what was asked for."""

from itertools import pairwise

import gymnasium
import numpy as np
import pytest
import xarray as xr
from gymnasium.utils.env_checker import check_env

import finger_pin as fp
from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.learning import Choice, Environment, LogUniform, Sensor, Uniform, VectorEnvironment, per_world
from finger_pin.simulation.simulators import instant_variables

COARSE = {"simulation.rtol": 1e-3, "simulation.atol_scale": 1e-3}
FIG6 = fp.load_scenario("reversals", COARSE)
PULLS = [np.array([1.0, 1.0, 4.4, 3.1]) * scale for scale in (1.0, 1.5, 0.7, 2.0)]


def nothing(signals):
    return np.zeros(len(signals["action"]))


def tip_height(signals):
    return signals["fingertip_position"][..., 2]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*Box (action|observation) space")
@pytest.mark.parametrize("name", ["Reach", "Press", "Grasp"])
def test_gymnasium_accepts_what_ships(name):
    environment = gymnasium.make(f"finger_pin.learning:finger_pin/{name}-v0")
    check_env(environment.unwrapped, skip_render_check=True)


def test_a_step_moves_the_finger_as_the_simulator_does():
    environment = Environment(FIG6, reward=nothing)
    environment.reset(seed=0)
    sim = fp.Simulator(fp.Finger(FIG6.finger), rtol=1e-3, atol_scale=1e-3)
    sim.x = fp.prepare(FIG6).start
    for pull in PULLS:
        observation, *_ = environment.step(pull)
        state = sim.step(pull, 0.02)
    np.testing.assert_array_equal(observation, np.float32([*state.position, *state.velocity]))


def test_numbers_that_would_make_another_state_are_refused_when_an_environment_is_made():
    """A plate that rests has no state, and one that is led has."""
    with pytest.raises(fp.InputError, match="what the state consists of"):
        Environment("press", reward=nothing, randomise={"environment.objects.plate.path.z.phase": Uniform(0.0, 1.0)})


def test_an_action_arrives_after_its_delay():
    environment = Environment(FIG6, reward=nothing, delay=0.005)
    environment.reset(seed=0)
    sim = fp.Simulator(fp.Finger(FIG6.finger), rtol=1e-3, atol_scale=1e-3)
    sim.x = fp.prepare(FIG6).start
    observation, *_ = environment.step(PULLS[0])
    state = sim.step(PULLS[0], 0.02)  # the first acts at once
    for before, pull in pairwise(PULLS):
        observation, *_ = environment.step(pull)
        sim.step(before, 0.005)
        state = sim.step(pull, 0.015)
    np.testing.assert_allclose(observation[:4], state.position, atol=1e-6)


def test_seeds_alone_decide_what_happens(monkeypatch):
    drawn = {
        "finger.tendon_friction.coulomb": LogUniform(0.05, 0.3),
        "observation.joint_position.offset": Uniform(-0.1, 0.1),
    }
    task = dict(
        reward=tip_height,
        observation={"joint_position": Sensor(noise=0.01), "fingertip_position": Sensor()},
        start="random",
        randomise=drawn,
        duration=0.06,
    )
    found = []
    for threads in (1, 2):
        monkeypatch.setattr("finger_pin.threads.usable_cores", lambda count=threads: count)
        worlds = VectorEnvironment(3, FIG6, **task)
        seen = [worlds.reset(seed=7)[0]]
        seen += [worlds.step(np.tile(pull, (3, 1)))[0] for pull in [*PULLS, *PULLS]]
        worlds.close()
        found.append(np.array(seen))
    np.testing.assert_array_equal(*found)
    alone = Environment(FIG6, **task)
    seen = [alone.reset(seed=8)[0]]
    for pull in PULLS:
        # Three periods last an episode; the step after them begins the next.
        seen.append(alone.step(pull)[0] if len(seen) != 4 else alone.reset()[0])
    np.testing.assert_array_equal(np.array(seen), found[0][:5, 1])


def test_steps_have_the_bits_of_each_world_alone_whichever_thread_takes_them():
    pulls = np.random.default_rng(3).uniform(0.5, 5.0, (60, 5, 4))
    worlds, alone = VectorEnvironment(5, FIG6, reward=nothing), Environment(FIG6, reward=nothing)
    worlds.reset(seed=1)
    seen = [worlds.step(pull)[0] for pull in pulls]
    for index in range(5):
        alone.reset(seed=1 + index)
        own = [alone.step(pull[index])[0] for pull in pulls]
        np.testing.assert_array_equal(np.array(seen)[:, index], own)


SHAKEN = {
    "hand.palm.path.y.amplitude": Uniform(0.002, 0.012),
    "environment.objects.ball.mass": Uniform(0.02, 0.04),
    "hand.fingers.left.finger.tendons.T3.crossings.medial.radius": Uniform(0.006, 0.007),
}
SERVOS = {
    "finger.actuators.*.spool_radius": Uniform(0.004, 0.006),
    "finger.actuators.*.pretension": Uniform(0.0, 2.0),
    "finger.joints.medial.link.length": Uniform(0.028, 0.032),
    "environment.fingertip_force": Choice([[0.0, 0.0, 0.1], [0.05, 0.0, 0.0]]),
}


@pytest.mark.parametrize(
    ("name", "action", "drawn"),
    [("pinch", "tension", SHAKEN), ("servo_position", "motor_position", SERVOS), ("servo_position", "tension", {})],
)
def test_all_that_worlds_tell_is_what_one_tells_and_its_result(name, action, drawn):
    scenario = fp.load_scenario(name if action != "tension" or drawn else "reversals", COARSE)
    known = [each for each in instant_variables(ClosedLoop.from_scenario(scenario)) if each != "contact_gap"]
    task = dict(reward=nothing, privileged=known, action=action, randomise=drawn)
    worlds = VectorEnvironment(3, scenario, **task)
    worlds.reset(seed=5)
    pull = worlds.single_action_space.low + 0.3 * (worlds.single_action_space.high - worlds.single_action_space.low)
    for _ in range(2):
        told = worlds.step(np.tile(pull, (3, 1)))[4]["privileged"]
    alone = Environment(scenario, **task)
    alone.reset(seed=6)
    for _ in range(2):
        own = alone.step(pull)[4]["privileged"]
    scene = ClosedLoop.from_scenario(scenario).finger.scene  # Contacts that the result leaves out exert nothing.
    last = alone.result().isel(time=-1).reindex({"contact": scene.contacts.names} if scene else {}, fill_value=0.0)
    for each in known:
        np.testing.assert_array_equal(told[each][1], own[each], err_msg=each)
        scale = np.max(np.abs(last[each].values), initial=1e-6)
        np.testing.assert_allclose(own[each], last[each].values, atol=1e-9 * scale, err_msg=each)


def test_a_randomised_number_acts_like_an_override():
    key = "finger.tendon_friction.coulomb"
    drawn = Environment(FIG6, reward=nothing, randomise={key: Uniform(0.3, 0.3)})
    given = Environment(fp.load_scenario("reversals", {**COARSE, key: 0.3}), reward=nothing)
    assert drawn.reset(seed=1)[1]["drawn"][key] == pytest.approx(0.3)
    given.reset(seed=1)
    for pull in PULLS:
        np.testing.assert_array_equal(drawn.step(pull)[0], given.step(pull)[0])


def test_sensors_round_shift_and_delay():
    sensors = {"joint_position": Sensor(quantisation=0.01, offset=0.5, delay=0.04)}
    environment = Environment(FIG6, reward=nothing, observation=sensors, privileged=["joint_position"])
    seen = [environment.reset(seed=0)[0]]
    truth = [fp.prepare(FIG6).start[:4]]
    for pull in PULLS:
        observation, _, _, _, info = environment.step(pull)
        seen.append(observation)
        truth.append(info["privileged"]["joint_position"])
    expected = np.round((np.array([*truth[:1] * 2, *truth[:-2]]) + 0.5) / 0.01) * 0.01
    np.testing.assert_allclose(np.array(seen), expected, atol=1e-7)


def test_functions_of_one_world_and_of_what_sensors_show():
    def slack(signals):
        return signals["joint_position"][1] - signals["wanted"][0]

    task = dict(
        observation={
            "joint_position": Sensor(offset=0.5),
            "error": lambda seen: seen["joint_position"][:, :2] - seen["wanted"],
        },
        draw=lambda random: {"wanted": random.uniform(0.0, 1.0, 1)},
    )
    worlds = VectorEnvironment(3, FIG6, reward=per_world(slack), **task)
    seen, info = worlds.reset(seed=4)
    wanted = info["drawn"]["wanted"]
    # The truth, as noiseless sensors show it without their offset.
    np.testing.assert_allclose(seen[:, 4:6], seen[:, :2] - wanted, atol=1e-6)
    seen, reward, *_ = worlds.step(np.tile(PULLS[0], (3, 1)))
    np.testing.assert_allclose(reward, seen[:, 1] - 0.5 - wanted[:, 0], atol=1e-6)
    np.testing.assert_allclose(seen[:, 6:], wanted, atol=1e-6)


def test_noise_has_the_deviation_that_was_asked_for():
    environment = Environment(FIG6, reward=nothing, observation={"joint_position": Sensor(noise=0.2)}, duration=1e9)
    environment.reset(seed=3)
    truth = fp.prepare(FIG6).start[:4]
    worlds = environment._worlds
    noise = np.array([worlds.observe(np.zeros(1, dtype=int))[0][0] for _ in range(2000)]) - truth
    # Of 8,000 samples: four standard errors.
    assert abs(noise.std() / 0.2 - 1.0) < 4.0 / np.sqrt(2.0 * noise.size)


def test_an_episode_is_a_result():
    environment = Environment(FIG6, reward=nothing)
    environment.reset(seed=0)
    for pull in PULLS:
        observation, *_ = environment.step(pull)
    result = environment.result()
    np.testing.assert_array_equal(np.float32(result.joint_position[-1]), observation[:4])
    np.testing.assert_allclose(result.tendon_command.sel(tendon="T3")[:-1:20], [pull[2] for pull in PULLS], rtol=1e-7)
    assert abs(result.energy_residual).max() < 1e-5


def test_a_motion_that_cannot_go_on_truncates_with_a_reason():
    environment = Environment(FIG6, reward=nothing, limits=(0.0, 1e9))
    environment.reset(seed=0)
    for _ in range(5):
        observation, reward, terminated, truncated, info = environment.step([1e9, 0.0, 1e9, 0.0])
        if truncated:
            break
    assert truncated and not terminated and "range" in info["reason"]
    assert environment.observation_space.contains(observation) and np.isfinite(reward)
    environment.reset(seed=0)
    assert not environment.step(PULLS[0])[3]


def test_intervals_of_an_identification_are_distributions(tmp_path):
    found = xr.Dataset(
        {"lower": ("parameter", [0.08]), "upper": ("parameter", [0.12])},
        {"parameter": ["finger.tendon_friction.coulomb"]},
    )
    found.to_netcdf(tmp_path / "identification.nc")
    environment = Environment(FIG6, reward=nothing, randomise=str(tmp_path / "identified.toml"))
    values = [environment.reset(seed=seed)[1]["drawn"]["finger.tendon_friction.coulomb"] for seed in range(20)]
    assert 0.08 <= min(values) < 0.09 and 0.11 < max(values) <= 0.12


def test_wrong_actions_and_rewards_are_refused():
    environment = Environment(FIG6, reward=lambda signals: np.full(1, np.nan))
    environment.reset(seed=0)
    for action, words in (([1.0, 1.0], "shape"), ([np.nan] * 4, "finite"), ("pull", "numbers"), (PULLS[0], "reward")):
        with pytest.raises(fp.InputError, match=words):
            environment.step(action)
    environment = Environment(FIG6, reward=tip_height)
    with pytest.raises(gymnasium.error.ResetNeeded):
        environment.step(PULLS[0])
    environment.reset(seed=0)
    with pytest.raises(fp.InputError, match="there are joint_position, joint_velocity, action"):
        environment.step(PULLS[0])
