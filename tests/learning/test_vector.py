"""Many worlds: time limits, failures, masks, copies, and what Gymnasium and stable-baselines3 ask of them."""

import copy
import pickle

import gymnasium
import numpy as np
import pytest

import finger_pin as fp
from finger_pin.learning import Environment, LogUniform, Sensor, VectorEnvironment

COARSE = {"simulation.method": "Rodas4", "simulation.rtol": 1e-3, "simulation.atol_scale": 1e-3}
FIG6 = fp.load_scenario("reversals", COARSE)
PULL = np.array([1.0, 1.0, 4.4, 3.1])
DRAWN = {"finger.tendon_friction.coulomb": LogUniform(0.05, 0.3)}


def nothing(signals):
    return np.zeros(len(signals["action"]))


def bent(signals):
    return signals["joint_position"][:, 2]


def worlds(count=3, **task):
    made = VectorEnvironment(count, FIG6, **{"reward": bent, "start": "random", **task})
    made.reset(seed=5)
    return made


@pytest.mark.parametrize(("duration", "steps"), [(0.06, 3), (0.07, 4), (0.001, 1)])
def test_an_episode_is_truncated_after_its_duration_in_whole_periods_and_not_terminated(duration, steps):
    """Of 20 ms each; at least one."""
    environment = Environment(FIG6, reward=nothing, duration=duration)
    environment.reset(seed=0)
    ends = [environment.step(PULL)[2:4] for _ in range(steps)]
    assert ends == [(False, False)] * (steps - 1) + [(False, True)]


def test_an_end_that_is_reached_terminates_at_the_limit_too():
    environment = Environment(FIG6, reward=nothing, done=lambda signals: np.ones(1, dtype=bool), duration=0.02)
    environment.reset(seed=0)
    assert environment.step(PULL)[2:4] == (True, True)


def test_a_world_restarts_at_the_step_after_its_end_with_no_reward_and_its_first_observation():
    """Gymnasium's next-step mode."""
    made = worlds(duration=0.04)
    for _ in range(2):
        *_, truncated, _ = made.step(np.tile(PULL, (3, 1)))
    assert truncated.all()
    observations, rewards, terminated, truncated, info = made.step(np.tile(PULL, (3, 1)))
    assert not rewards.any() and not terminated.any() and not truncated.any() and info["_drawn"].all()
    # At rest, as every episode starts.
    np.testing.assert_array_equal(observations[:, 4:], 0.0)


def test_worlds_outside_of_a_mask_are_not_reset():
    made, other = worlds(), worlds()
    for each in (made, other):
        each.step(np.tile(PULL, (3, 1)))
    made.reset(options={"reset_mask": np.array([False, True, False])})
    after, expected = (each.step(np.tile(PULL, (3, 1)))[0] for each in (made, other))
    np.testing.assert_array_equal(after[[0, 2]], expected[[0, 2]])
    assert np.all(after[1] != expected[1])


def test_a_motion_that_fails_in_one_world_leaves_the_others_their_bits():
    made, other = (worlds(limits=(0.0, 1e9), start="reference", randomise=DRAWN) for _ in range(2))
    pulls = np.tile(PULL, (3, 1))
    torn = pulls.copy()
    torn[1] = [1e9, 0.0, 1e9, 0.0]
    for _ in range(5):
        observations, rewards, terminated, truncated, info = made.step(torn)
        expected = other.step(pulls)[0]
        np.testing.assert_array_equal(observations[[0, 2]], expected[[0, 2]])
        if truncated[1]:
            break
    assert truncated.tolist() == [False, True, False] and not terminated.any() and np.isfinite(rewards).all()
    assert "range" in info["reason"][1] and not info["reason"][0]
    observations, *_, truncated, _ = made.step(pulls)
    assert not truncated.any() and np.isfinite(observations).all()


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda it: pickle.loads(pickle.dumps(it))])
@pytest.mark.parametrize("task", [{"randomise": DRAWN, "observation": {"joint_position": Sensor(noise=0.1)}}, {}])
def test_a_copy_in_mid_episode_goes_on_with_the_bits_of_the_original_and_leaves_it_alone(copied, task):
    made = worlds(2, **task)
    made.step(np.tile(PULL, (2, 1)))
    twin = copied(made)
    ahead, behind = ([each.step(np.tile(1.3 * PULL, (2, 1)))[:2] for _ in range(3)] for each in (twin, made))
    for one, other in zip(ahead, behind, strict=True):
        np.testing.assert_array_equal(one[0], other[0])
        np.testing.assert_array_equal(one[1], other[1])


def test_other_seeds_begin_other_episodes():
    first = worlds(3, randomise=DRAWN)
    starts = [first.reset(seed=seed)[0][:, :4] for seed in (1, 2, 1)]
    np.testing.assert_array_equal(starts[0], starts[2])
    # World i of seed s is world i - 1 of seed s + 1.
    np.testing.assert_array_equal(starts[0][1:], starts[1][:-1])
    assert len(np.unique(np.concatenate([*starts[0], starts[1][-1]]))) == 4 * 4


def test_a_vector_of_gymnasium_s_own_has_the_observations_of_ours():
    """Its worlds stand one after the other, each an environment; both restart at the next step."""

    def make():
        return Environment(FIG6, reward=bent, start="random", duration=0.06)

    theirs = gymnasium.vector.SyncVectorEnv([make] * 2)
    ours = worlds(2, duration=0.06)
    np.testing.assert_array_equal(theirs.reset(seed=5)[0], ours.reset(seed=5)[0])
    for scale in np.linspace(0.5, 1.5, 8):
        for one, other in zip(
            theirs.step(np.tile(scale * PULL, (2, 1)))[:4], ours.step(np.tile(scale * PULL, (2, 1)))[:4], strict=True
        ):
            np.testing.assert_array_equal(one, other)


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_stable_baselines_accepts_an_environment_and_steps_worlds_as_ours():
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    from finger_pin.learning.stable_baselines import StableBaselinesEnvironment

    checker.check_env(Environment(FIG6, reward=bent, duration=0.04), warn=False)
    wrapped, ours = (
        StableBaselinesEnvironment(worlds(2, duration=0.04, limits=(0.0, 8.0))),
        worlds(2, duration=0.04, limits=(0.0, 8.0)),
    )
    wrapped.seed(5)
    np.testing.assert_array_equal(wrapped.reset(), ours.reset(seed=5)[0])
    for step in range(2):
        observations, rewards, dones, infos = wrapped.step(np.zeros((2, 4)))
        expected, reward, *_ = ours.step(np.full((2, 4), 4.0))
        np.testing.assert_allclose(rewards, reward, rtol=1e-6)
        assert dones.tolist() == [step == 1] * 2
    assert all(info["TimeLimit.truncated"] for info in infos)
    np.testing.assert_array_equal([info["terminal_observation"] for info in infos], expected)
    np.testing.assert_array_equal(observations[:, 4:], 0.0)
