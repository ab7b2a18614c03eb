"""Random models through the table of doors; `scripts/validate.py --random N` takes thousands of seeds."""

import pytest
from random_models import FEATURES, random_model
from random_table import DOORS

# Every door has a model of its own; one has bristles 1e-6 N m from a kink, across which derivatives were taken, and one
# a cord that gets taut within 1e-9 s, in which bristles turn over.
CASES = [(name, 100 * index) for index, name in enumerate(DOORS)]
CASES += [("linearise = differences", 43), ("linearise over a step = differences", 50026)]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::finger_pin.exceptions.ScenarioWarning")
@pytest.mark.parametrize(("name", "seed"), CASES)
def test_two_computations_of_one_thing_agree_on_a_random_model(name, seed):
    door = DOORS[name]
    door.check(door.model(seed))


def test_a_model_without_a_feature_keeps_all_its_other_numbers():
    model = random_model(5, kind="tree")
    assert len(model.features) > 3
    fewer = model.without("armatures", "motor")
    bodies, others = (each.table["finger"]["tree"]["bodies"] for each in (model, fewer))
    assert bodies == others and "motor" not in fewer.features


@pytest.mark.parametrize("kind", FEATURES)
def test_every_feature_is_drawn_and_every_drawn_model_is_read(kind):
    drawn = set()
    for seed in range(60):
        model = random_model(seed, kind=kind)
        drawn |= {*model.features}
        assert model.scenario.name == "random"
    assert drawn == {*FEATURES[kind]}
