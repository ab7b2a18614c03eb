"""Laws of joint friction chosen by name: Dahl's, Coulomb's and a user's, against what they are by definition."""

import sys

import numpy as np
import pytest

import finger_pin as fp

SHORT = {"simulation.duration": 0.3}
LAW = "finger.joint_friction.law"

OWN = """
import numpy as np
import finger_pin as fp


def value(row, p):
    (kinetic,) = p
    level = kinetic * row.load
    loss = level * row.speed / np.sqrt(1.0 + row.speed * row.speed)
    return -loss, 0.0 * row.speed, loss, row.load, kinetic + 0.0 * row.load, level


def slopes(row, p, signals):
    share = 1.0 / np.sqrt(1.0 + row.speed * row.speed)
    return (0.0, -signals[3] * share**3, 0.0, 0.0, -p[0] * row.speed * share, 0.0, 0.0), (0.0,) * 6


def account(row, p, force, rate, signals):
    return 0.0 * force, -force * row.speed


SOFT = fp.Law("soft", ("kinetic",), value, slopes, account, ("friction", "normal_force", "coefficient", "level"),
              losses=("rubbing",))
NOTHING = fp.Law("lacks signals", ("kinetic",), value, slopes, account)
"""


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A module with laws, which can be imported."""
    (tmp_path / "laws_of_mine.py").write_text(OWN, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    yield
    sys.modules.pop("laws_of_mine", None)


def keys(numbers):
    return {f"finger.joint_friction.{name}": value for name, value in numbers.items()}


def scenario(law, **more):
    return fp.load_scenario(
        "fig6", {**SHORT, LAW: law} | {f"finger.joint_friction.{key}": v for key, v in more.items()}
    )


def test_dahl_is_the_paper_s_law_without_stribeck_s_curve():
    dahl, flat = fp.simulate(scenario("dahl")), fp.simulate(scenario("lugre", stiction=2.5e-4))
    np.testing.assert_array_equal(dahl.joint_position, flat.joint_position)
    np.testing.assert_array_equal(dahl.joint_stiction, flat.joint_stiction)


def test_coulomb_friction_is_a_function_of_speed_and_reaction_and_has_no_state():
    result = fp.simulate(scenario("coulomb", coulomb=4e-4, viscous=2e-3, reversal_speed=0.05))
    speed = result.joint_velocity.values
    expected = 4e-4 * result.joint_reaction.values * np.tanh(speed / 0.05) + 2e-3 * speed
    np.testing.assert_allclose(result.joint_friction, expected, rtol=1e-12, atol=1e-15)
    assert "joint_stiction" not in result and abs(speed).max() > 0.1
    dry = (expected - 2e-3 * speed) * speed
    np.testing.assert_allclose(result.power_joint_coulomb, dry.sum(axis=1), rtol=1e-9, atol=1e-15)


def test_below_its_level_coulomb_friction_creeps_where_bristles_hold():
    """With a torque of the share s of the level a joint goes at v_r artanh(s), where viscous friction is none."""
    share, speed, more = 0.6, 0.02, {"coulomb": 2e-3, "viscous": 0.0, "reversal_speed": 0.02}
    description = fp.load_finger(
        "planar", {f"finger.joint_friction.{key}": v for key, v in more.items()} | {LAW: "coulomb"}
    )
    finger = fp.Finger(description)
    x = finger.rest_state(np.array([0.3, 0.3]), np.full(2, speed * np.arctanh(share)))
    joints = finger.evaluate(x, np.full(finger.routing.actuated, 5.0)).joints
    np.testing.assert_allclose(joints.friction, share * 2e-3 * joints.reaction, rtol=1e-12)


def test_the_compiled_and_the_readable_path_agree_on_every_law(own):
    for law in ("dahl", "coulomb", "laws_of_mine:SOFT"):
        both = [fp.simulate(scenario(law).updated(simulation={"method": method})) for method in ("Rodas5P", "BDF")]
        np.testing.assert_allclose(*(each.joint_position.values for each in both), atol=2e-5)


def test_a_user_s_law_acts_and_has_its_own_entry_in_the_account(own):
    result = fp.simulate(scenario("laws_of_mine:SOFT", coulomb=3e-4))
    speed = result.joint_velocity.values
    loss = 3e-4 * result.joint_reaction.values * speed / np.sqrt(1.0 + speed**2)
    np.testing.assert_allclose(result.joint_friction, loss, rtol=1e-12, atol=1e-16)
    np.testing.assert_allclose(result.power_joint_rubbing, (loss * speed).sum(axis=1), rtol=1e-9, atol=1e-16)


def test_the_coefficient_of_dahl_and_coulomb_is_what_analyses_call_stiction(tmp_path):
    for law in ("dahl", "coulomb"):
        assert scenario(law, coulomb=3e-4).finger.joint_friction.break_away == 3e-4
        written = tmp_path / f"{law}.toml"
        written.write_text(fp.to_toml(scenario(law, coulomb=3e-4)), encoding="utf-8")
        assert fp.load_scenario(written).finger.joint_friction == scenario(law, coulomb=3e-4).finger.joint_friction
        run = fp.prepare(scenario(law), ["finger.joint_friction.coulomb"])
        both = run.simulate([3e-4]), fp.simulate(scenario(law, coulomb=3e-4))
        np.testing.assert_array_equal(*(each.joint_position.values for each in both))
        assert both[0].self_locking_margin == both[1].self_locking_margin


@pytest.mark.parametrize(
    ("law", "more", "says"),
    [
        ("dall", {}, "did you mean dahl"),
        ("dahl", {"stiction": 5e-4}, "has no effect"),
        ("dahl", {"micro_damping": 1e-3}, "has no effect"),
        ("coulomb", {"stiffness": 7.0}, "has no effect"),
        ("lugre", {"reversal_speed": 0.1}, "coulomb"),
        ("numpy:sin", {}, "must be a Law"),
        ("no_such_module:X", {}, "cannot be imported"),
        ("laws_of_mine:MISSING", {}, "cannot be imported"),
        ("laws_of_mine:NOTHING", {}, "signals"),
        ("finger_pin.laws.capstan:DRIVEN_TENDON", {}, "parameters"),
    ],
)
def test_a_law_that_there_is_not_and_keys_that_it_does_not_have_are_refused_in_one_line(own, law, more, says):
    with pytest.raises(fp.InputError, match=says) as caught:
        fp.simulate(scenario(law, **more))
    assert "\n" not in str(caught.value) and caught.value.entry.startswith("finger.joint_friction")


def test_the_fingers_of_a_hand_have_one_law():
    with pytest.raises(fp.InputError, match=r"one joint_friction\.law"):
        fp.load_scenario("hand", {"hand.fingers.thumb.finger.joint_friction.law": "dahl"})
