"""Keys that hold numbers: lengths, radii, entries of lists, and what is not one."""

import numpy as np
import pytest

import finger_pin as fp
from finger_pin.studies.keys import BaseScenario, describe

RADIUS = "finger.tendons.T3.crossings.medial.radius"
LENGTH = "finger.joints.distal.link.length"


@pytest.fixture(scope="module")
def reversals():
    return BaseScenario.from_scenario("reversals")


def test_a_point_changes_its_keys_and_nothing_else(reversals):
    changed = reversals.at({"controller.gain": 2.0, RADIUS: 0.007})
    expected = fp.load_scenario("reversals", {"controller.gain": 2.0, RADIUS: 0.007})
    assert changed == expected
    assert changed.finger.tendons["T3"].crossings["medial"].radius == 0.007


def test_what_a_file_leaves_to_its_default_follows_a_length(reversals):
    link = reversals.at({LENGTH: 0.03}).finger.joints["distal"].link
    assert link.length == 0.03
    assert link.centre_of_mass == 0.015


def test_an_index_means_one_number_of_a_list(reversals):
    changed = reversals.at({"environment.fingertip_force[2]": -0.5, "environment.fingertip_force[0]": 0.1})
    assert changed.environment.fingertip_force == (0.1, 0.0, -0.5)
    listed = BaseScenario.from_scenario("reversals", {"controller.gain": [1.0, 2.0, 3.0, 4.0]})
    assert listed.at({"controller.gain[1]": 9.0}).controller.gain == (1.0, 9.0, 3.0, 4.0)
    assert listed.scenario.controller.gain == (1.0, 2.0, 3.0, 4.0)


def test_a_whole_number_stays_one(reversals):
    changed = BaseScenario.from_scenario("reversals", {"finger.tendons.T5.mass_after": 1}).at(
        {"finger.tendons.T5.mass_after": 2.0}
    )
    assert changed.finger.tendons["T5"].mass_after == 2


@pytest.mark.parametrize(
    ("key", "says"),
    [
        ("controler.gain", "did you mean controller.gain"),
        ("controller.gian", "did you mean controller.gain"),
        ("controller.gain.x", "no entries of its own"),
        ("controller", "must be a table"),
        ("controller.kind", "must be one of"),
        ("simulation.method", "must be one of"),
        ("finger.title", "no such number"),
        ("finger.tendons.T9.crossings.abduction.radius", "no such number"),
        ("finger.tendons.T3.crossings.distal.radius", "no such number"),
        ("reference.joints.medial", "must be a table"),
        ("finger.gravity", "did you mean finger.gravity["),
        ("finger.gravity[3]", "[0] to [2]"),
        ("controller.gain[0]", "one number for all"),
        ("finger.joints[0]", "no such list"),
        ("finger.gravity[-1]", "index"),
    ],
)
def test_a_key_that_holds_no_number_is_refused_in_one_line(reversals, key, says):
    with pytest.raises(fp.InputError) as caught:
        reversals.check(key, [0.5, 0.6])
    assert says in str(caught.value)
    assert str(caught.value).isprintable()


def test_a_key_is_right_if_any_of_its_values_is_or_may_be_with_other_keys(reversals):
    reversals.check("controller.gain", [-1.0, 1.0])
    with pytest.raises(fp.InputError, match=r"controller\.gain"):
        reversals.check("controller.gain", [-1.0, -2.0])
    # Neither has force closure, but other radii may give it.
    reversals.check(RADIUS, [-0.005, -0.006])
    with pytest.raises(fp.InputError, match=f"{RADIUS}: no value of it can be simulated: .*force closure"):
        reversals.check(RADIUS, [-0.005, -0.006], alone=True)


def test_a_key_may_hold_a_name_or_a_whole_table_that_a_name_stands_for(reversals):
    reversals.check("simulation.method", ["Rodas4", "Rodas5P"])
    assert reversals.at({"simulation.method": "Rodas4"}).simulation.method == "Rodas4"
    reversals.check("finger", ["ub_stand_in", "dexmart_index"])
    assert reversals.at({"finger": "dexmart_index"}).finger == fp.load_finger("dexmart_index")
    reversals.check("controller.gravity_compensation", [True, False])


@pytest.mark.parametrize(
    ("key", "values", "says"),
    [
        ("simulation.method", ["Rodas6"], "did you mean Rodas"),
        ("simulation.methd", ["Rodas4"], "did you mean simulation.method"),
        ("finger.tendons.T9.kind", ["passive"], "did you mean finger.tendons.T"),
        ("controller.gain", ["much", "little"], "number"),
        ("finger", ["bu"], "there are dexmart_index, planar, ub"),
    ],
)
def test_a_name_that_a_key_cannot_hold_is_refused_in_one_line(reversals, key, values, says):
    with pytest.raises(fp.InputError, match=says):
        reversals.check(key, values)


def test_a_reference_that_a_scenario_leaves_out_is_a_key():
    still = BaseScenario.from_scenario("reversals", {"reference.joints": {}})
    still.check("reference.joints.medial.offset", [0.1])
    assert still.at({"reference.joints.medial.offset": 0.1}).reference.joints["medial"].offset == 0.1


def test_a_misspelt_name_of_a_tendon_does_not_make_a_new_one(reversals):
    with pytest.raises(fp.InputError, match=r"did you mean finger\.tendons\.T\d\.crossings\.abduction\.radius"):
        reversals.check("finger.tendons.T9.crossings.abduction.radius", [0.001])


def test_what_a_key_holds_has_unit_and_name():
    assert describe(RADIUS)["units"] == "m"
    assert describe("finger.tendon_friction.viscous")["units"] == "N s/m"
    assert describe("finger.joints.distal.link.length")["units"] == "m"
    assert describe("reference.joints.medial.frequency") == {"units": "Hz", "long_name": "Frequency of the sinusoid"}
    assert describe("environment.fingertip_force[1]")["units"] == "N"
    assert np.char.startswith(describe("controller.gain")["long_name"], "K_P")


def test_a_star_stands_for_every_name_and_holds_what_the_first_one_holds():
    servo = BaseScenario.from_scenario("servo")
    motor, radius = "finger.actuators.*.motor", "finger.actuators.*.spool_radius"
    servo.check(motor, ["XC330-M288", "STS3215"])
    servo.check(radius, [0.004, 0.006])
    assert servo.number(radius) == 0.005
    changed = servo.at({motor: "STS3215", radius: 0.006}).finger.actuators.values()
    assert [(each.motor.voltage, each.spool_radius) for each in changed] == [(7.4, 0.006)] * 4
    with pytest.raises(fp.InputError, match=r"finger\.actuators\.\*\.spool_radius"):
        BaseScenario.from_scenario("reversals").check(radius, [0.004])
