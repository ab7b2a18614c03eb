"""Entries of [controller]: what is wrong is named in one line, and what is left out changes nothing."""

import tomllib

import pytest

import finger_pin as fp
from finger_pin.description.controller import ControllerSettings
from finger_pin.exceptions import InputError

WRONG = [
    ("damping", -1.0, "damping", "at least 0"),
    ("damping", [1.0, 2.0], "damping", "a list of 4, one per joint"),
    ("gravity_compensation", 1, "gravity_compensation", "true or false"),
    ("gravity_compensaton", True, "gravity_compensaton", "did you mean controller.gravity_compensation"),
    ("tendon_friction_feedforward", True, "tendon_friction_feedforward", "must be a table"),
    ("tendon_friction_feedforward.share", 2.5, "tendon_friction_feedforward.share", "at most 2"),
    ("tendon_friction_feedforward.reversal_speed", 0.0, "tendon_friction_feedforward.reversal_speed", "above 0"),
    ("tendon_friction_feedforward.coulomb", [0.1, 0.1], "tendon_friction_feedforward.coulomb", "one per tendon"),
    (
        "tendon_friction_feedforward.reversal_sped",
        1.0,
        "tendon_friction_feedforward.reversal_sped",
        "did you mean controller.tendon_friction_feedforward.reversal_speed",
    ),
    ("joint_friction_compensation.stiction", [1e-4], "joint_friction_compensation.stiction", "one per joint"),
    ("joint_friction_compensation.viscous", float("nan"), "joint_friction_compensation.viscous", "finite"),
    ("passive_tension_loop.integral", -1.0, "passive_tension_loop.integral", "at least 0"),
    ("distribution", {}, "distribution.maximum_tension", "is missing"),
    ("distribution.maximum_tension", 0.5, "distribution.maximum_tension", "at least the minimum tension, 1 N for T1"),
    ("distribution.maximum_tension", [5.0, 5.0], "distribution.maximum_tension", "one per tendon"),
    ("sampling.period", 0.0, "sampling.period", "at least 1e-07"),
    ("sampling.delay", -1e-3, "sampling.delay", "at least 0"),
    ("sampling.seed", 1.5, "sampling.seed", "whole number"),
    ("sampling.seed", -1, "sampling.seed", "at least 0"),
    ("sampling.tension_noise", "loud", "sampling.tension_noise", "must be a number"),
]


@pytest.mark.parametrize(("key", "value", "entry", "said"), WRONG, ids=[f"{each[0]}={each[1]}" for each in WRONG])
def test_a_wrong_entry_is_named_in_one_line(key, value, entry, said):
    with pytest.raises(InputError) as caught:
        fp.load_scenario("reversals", {f"controller.{key}": value})
    assert caught.value.entry == f"controller.{entry}"
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_loop_around_a_passive_tendon_needs_one(tmp_path):
    path = tmp_path / "planar.toml"
    path.write_text('finger = "planar"\n[controller.passive_tension_loop]\n[controller.sampling]\n')
    with pytest.raises(InputError, match="without passive tendons"):
        fp.load_scenario(path)


def test_an_empty_table_asks_for_a_part_with_its_defaults():
    scenario = fp.load_scenario("reversals", {"controller.tendon_friction_feedforward": {}})
    controller = fp.control.build_controller(scenario)
    assert controller.tendons is not None and controller.tendons.share == 1.0 and controller.joints is None


def test_an_addition_that_is_not_asked_for_is_neither_in_the_controller_nor_in_the_written_scenario():
    scenario = fp.load_scenario("reversals")
    written = tomllib.loads(fp.to_toml(scenario))["controller"]
    assert not [key for key in written if isinstance(written[key], dict)]
    assert scenario.controller.is_paper and ControllerSettings().is_paper
    assert fp.simulate(fp.load_scenario("reversals", {"simulation.duration": 0.002})).attrs["method"] == "Rodas5P"


@pytest.mark.parametrize(
    "key", ["gravity_compensation", "tendon_friction_feedforward", "joint_friction_compensation", "distribution"]
)
def test_every_part_alone_makes_another_controller_than_the_paper_s(key):
    value = {"gravity_compensation": True, "distribution": {"maximum_tension": 9.0}}
    scenario = fp.load_scenario("reversals", {f"controller.{key}": value.get(key, {})})
    assert isinstance(fp.control.build_controller(scenario), fp.control.CompensatedController)
