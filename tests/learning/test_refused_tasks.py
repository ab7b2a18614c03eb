"""Tasks that are no tasks: each is refused in one line that names the entry."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.learning import Choice, Environment, LogUniform, Normal, Sensor, Uniform

FIG6 = fp.load_scenario("reversals", {"simulation.rtol": 1e-3, "simulation.atol_scale": 1e-3})


def nothing(signals):
    return np.zeros(len(signals["action"]))


@pytest.mark.parametrize(
    ("task", "words"),
    [
        ({"randomise": {"finger.tendon_friction.coulom": Uniform(0, 1)}}, "coulom"),
        ({"randomise": {"finger.joints": Uniform(0, 1)}}, "finger.joints"),
        ({"randomise": {"finger.tendon_friction.coulomb": Normal(-1.0, 0.1)}}, "finger.tendon_friction.coulomb"),
        ({"randomise": {"observation.joint_angle.noise": Uniform(0, 1)}}, "observation.joint_position"),
        ({"randomise": {"observation.joint_position.noise": Uniform(-0.1, 1)}}, "noise = -0.1"),
        ({"randomise": {"finger.tendon_friction.coulomb": Uniform(-0.1, 1e9)}}, "coulomb = -0.1"),
        ({"randomise": {"finger.tendon_friction.coulomb": Choice([0.1, -0.2])}}, "coulomb = -0.2"),
        ({"randomise": {"controller.gain": Uniform(1, 2)}}, "does not act on an episode"),
        ({"randomise": ["finger.tendon_friction.coulomb"]}, "distributions by key"),
        ({"observation": []}, "at least one"),
        ({"observation": "joint_position"}, "list of names"),
        ({"draw": lambda random: {"goal": np.nan}}, "draw.goal"),
        ({"observation": ["joint_angle"]}, "joint_angle"),
        ({"action": "motor_position"}, "position drive"),
        ({"limits": (-1.0, 1.0)}, "negative"),
        ({"start": lambda random: [0.0]}, "4 finite angles"),
        ({"observation": {"joint_position": Sensor(delay=0.03)}}, "multiple of the control period"),
        ({"period": 0.0}, "period"),
        ({"action": "torque"}, "must be one of"),
        ({"action": "tendon_winding"}, "or winches at all tendons"),
        ({"reward": 1.0}, "reward = 1.0: must be a function"),
        ({"start": "anywhere"}, '"reference", "random" or a function'),
        ({"observation": {"joint_position": 3.0}}, "must be a Sensor or a function"),
        ({"limits": (1.0, 0.0)}, "the least below the largest"),
        ({"limits": "ab"}, "must be a pair of numbers, or of 4 each"),
        ({"randomise": {"finger.tendon_friction.coulomb": 0.1}}, "must be Uniform, LogUniform, Normal, Choice"),
        ({"randomise": {"action.noise": Uniform(0, 1)}}, "of the action only action.delay"),
        ({"randomise": "nowhere/identified.toml"}, "has no identification.nc beside it"),
        ({"randomize": {}}, "did you mean randomise?"),
        ({"observation": {"way": lambda seen: 0.0, "joint_position": Sensor()}}, "worlds in front"),
    ],
)
def test_a_wrong_task_is_refused_in_one_line(task, words):
    with pytest.raises(fp.InputError) as caught:
        Environment(FIG6, **{"reward": nothing, **task})
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_an_environment_without_a_reward_is_refused():
    with pytest.raises(fp.InputError, match="reward: is missing"):
        Environment(FIG6)


@pytest.mark.parametrize("wrong", ["a", None, [1.0], True, float("nan")])
def test_an_argument_that_is_no_number_is_refused_by_its_name(wrong):
    made = {
        **{f"Sensor.{name}": lambda name=name: Sensor(**{name: wrong}) for name in vars(Sensor())},
        **{name: lambda name=name: simple(**{name: wrong}) for name in ("delay", "period", "duration")},
        **{each.__name__: lambda each=each: each(wrong, 2.0) for each in (Uniform, LogUniform, Normal)},
        "action.delay": lambda: simple(randomise={"action.delay": Choice([wrong])}),
    }
    for name, make in made.items():
        with pytest.raises(fp.InputError) as caught:
            make()
        assert caught.value.entry == name


def simple(**task):
    return Environment(FIG6, reward=nothing, **task)
