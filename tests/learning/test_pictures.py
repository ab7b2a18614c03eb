"""Pictures of environments: which world, goal and title they show."""

import numpy as np

import finger_pin as fp
from finger_pin.learning import Environment, VectorEnvironment
from finger_pin.learning.tasks import TASKS

FIG6 = fp.load_scenario("reversals", {"simulation.rtol": 1e-3, "simulation.atol_scale": 1e-3})


def nothing(signals):
    return np.zeros(len(signals["action"]))


def test_pictures_of_worlds_are_those_of_each():
    task = dict(reward=nothing, start="random", render_mode="rgb_array")
    worlds, alone = VectorEnvironment(2, FIG6, **task), Environment(FIG6, **task)
    worlds.reset(seed=4)
    first, second = worlds.render()
    alone.reset(seed=5)
    np.testing.assert_array_equal(second, alone.render())
    assert (first != second).any()


def test_pictures_of_tasks_show_the_goal_that_is_drawn_and_no_title_of_a_scenario():
    def picture(**drawn):
        environment = Environment(FIG6, reward=nothing, draw=lambda random: drawn, render_mode="rgb_array")
        environment.reset(seed=0)
        return environment.render().astype(float)

    point = [0.02, 0.0, 0.06]
    difference = np.abs(picture(goal=point) - picture(aim=point)).max(axis=-1)
    assert 50 < (difference > 30.0).sum() < 2000
    titles = {task()["scenario"].title for task in TASKS.values()}
    assert len(titles) == len(TASKS) and not titles & set(fp.list_scenarios().values())
