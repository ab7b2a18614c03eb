"""A hand: every finger moves as it does alone, under names with a dot, and the whole closes its account."""

import tomllib

import numpy as np
import pytest
from core_cases import relative
from pydantic import ValidationError
from random_mechanisms import kinds_of

import finger_pin as fp
from finger_pin.core.signals.compiled_finger import CompiledMechanism
from finger_pin.exceptions import InputError

SHORT = {"simulation.duration": 0.05}


@pytest.fixture(scope="module")
def scenario():
    return fp.load_scenario("hand", SHORT)


@pytest.fixture(scope="module")
def result(scenario):
    return fp.simulate(scenario)


def test_every_finger_moves_bit_by_bit_as_alone_on_the_palm(scenario, result):
    for name, part in scenario.parts().items():
        alone = fp.simulate(part)
        assert all(str(joint).startswith(f"{name}.") for joint in alone.joint.values)
        for variable in ("joint_position", "joint_velocity", "joint_friction", "tracking_error"):
            np.testing.assert_array_equal(result[variable].sel(joint=alone.joint), alone[variable])
        for variable in ("tendon_tension", "tendon_command", "tendon_friction"):
            # What is planned is computed anew for all fingers at once: sums may be in another order.
            np.testing.assert_allclose(
                result[variable].sel(tendon=alone.tendon), alone[variable], rtol=1e-13, atol=1e-14
            )
        np.testing.assert_array_equal(result.fingertip_position.sel(finger=name), alone.fingertip_position)


def test_a_placed_finger_accelerates_as_the_same_finger_under_turned_gravity_and_force(scenario):
    """The thumb's own description, to scale, in its own base frame."""
    placed, own = scenario.hand.fingers["thumb"], fp.Finger(scenario.hand.built()["thumb"])
    whole = fp.Finger(scenario.parts()["thumb"].finger)
    rng = np.random.default_rng(7)
    for _ in range(20):
        x = own.rest_state(rng.uniform(0.0, 1.0, 4), rng.normal(size=4))
        x[10:] += rng.normal(size=9) * own.layout.scales()[10:] * 0.1
        force, pull = rng.normal(size=3), rng.uniform(0.0, 9.0, 4)
        alone = own.evaluate(x, pull, placed.rotation.T @ force)
        found = whole.evaluate(x, pull, force)
        np.testing.assert_allclose(found.rate, alone.rate, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found["joint_reaction"], alone["joint_reaction"], rtol=1e-12)
        tip = own.motion(x[:4], x[5:9]).tip @ placed.rotation.T + placed.position
        np.testing.assert_allclose(whole.motion(x[:4], x[5:9]).tip, tip, rtol=0.0, atol=1e-14)


def test_the_account_of_a_hand_is_the_sum_of_its_fingers(scenario, result):
    alone = [fp.simulate(part) for part in scenario.parts().values()]
    for name in ("energy_kinetic", "energy_gravity", "energy_exchanged_actuators", "energy_exchanged_tendon_coulomb"):
        total = sum(each[name].values for each in alone)
        np.testing.assert_allclose(result[name], total, rtol=1e-9, atol=1e-15)
    exchanged = float(abs(result.energy_exchanged_actuators).max())
    assert float(abs(result.energy_residual).max()) < 1e-5 * exchanged


@pytest.mark.slow
def test_the_textbook_evaluation_gives_the_rates_of_the_compiled_hand(scenario, result):
    """NumPy and Pinocchio, near the states of a run."""
    finger, rng = fp.Finger(scenario.finger), np.random.default_rng(1)
    x = np.array([finger.rest_state(each) for each in result.joint_position.values[::10]])
    x = x + 0.1 * rng.normal(size=x.shape) * finger.layout.scales()
    command = np.full(finger.mechanism.channels, 3.0)
    readable = finger.mechanism.evaluate(x, command).rate
    compiled = CompiledMechanism(finger.mechanism).evaluate(x, command).rate
    for kind in kinds_of(finger.mechanism):
        assert relative(compiled[:, kind], readable[:, kind]) < 1e-11


def test_a_hand_can_be_written_and_read_again(scenario, result, tmp_path):
    again = fp.Scenario.model_validate(tomllib.loads(fp.to_toml(scenario)))
    assert again == scenario and fp.to_toml(again) == result.attrs["scenario"]
    fp.save(result, tmp_path / "hand.nc")
    assert fp.load(tmp_path / "hand.nc").equals(result)


def test_settings_of_one_finger_are_its_own_and_the_others_keep_theirs():
    changes = {
        "controller.fingers.thumb.gain": 2.0,
        "hand.fingers.thumb.finger.joints.distal.link.length": 0.03,
        "hand.fingers.ring.finger": "dexmart_index",
        "hand.fingers.little.scale": 0.5,
        "reference.joints.index.medial.amplitude": 0.2,
    }
    plain, changed = fp.load_scenario("hand"), fp.load_scenario("hand", changes)
    gains = {name: part.controller.gain for name, part in changed.parts().items()}
    assert gains == {"thumb": 2.0, "index": 1.0, "middle": 1.0, "ring": 1.0, "little": 1.0}
    joints = changed.finger.joints
    assert joints["thumb.distal"].link.length == pytest.approx(1.1 * 0.03)
    assert joints["index.distal"] == plain.finger.joints["index.distal"]
    assert changed.hand.fingers["ring"].finger == fp.load_finger("dexmart_index")
    assert joints["little.distal"].link.mass == pytest.approx(0.5**3 * 0.0038)
    assert joints["little.distal"].link.inertia[1] == pytest.approx(0.5**5 * 2.0e-7)
    assert changed.finger.tendons["little.T3"].crossings["little.medial"].radius == pytest.approx(0.5 * 0.0053)
    assert changed.reference.joints["index.medial"].amplitude == 0.2
    again = fp.Scenario.model_validate(tomllib.loads(fp.to_toml(changed)))
    assert again == changed


@pytest.mark.parametrize("where", ["tensions.index.T3", "fingers.index.tensions.T3", "fingers.index.tensions.index.T3"])
def test_given_tensions_are_those_of_a_finger_wherever_they_stand(where):
    # Without another one's, every other tendon is held at its minimum tension.
    plain = fp.load_scenario("hand")
    table = tomllib.loads(fp.to_toml(plain))
    table["controller"] = own = {"kind": "tensions"}
    for name in where.split("."):
        own[name] = own = {}
    own["offset"] = 4.0
    parts = fp.Scenario.model_validate(table).parts()
    given = {name: dict(part.controller.tensions or {}) for name, part in parts.items()}
    assert list(given.pop("index")) == ["index.T3"] and not any(given.values())
    own["offset"], table["controller"]["tensions"] = 5.0, {"nobody": {"T3": {"offset": 1.0}}}
    with pytest.raises(ValidationError, match="no such finger; the fingers are thumb"):
        fp.Scenario.model_validate(table)


def test_each_finger_has_a_lambda_of_its_own(scenario, result):
    """The least planned tension of every finger is at its minimum at all times, (22)."""
    for name in scenario.hand.fingers:
        own = [tendon for tendon in result.tendon.values if tendon.startswith(f"{name}.")]
        np.testing.assert_allclose(result.tendon_command.sel(tendon=own).min("tendon"), 1.0, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    "overrides",
    [
        {"controller.fingers.thumb.gravity_compensation": True, "controller.sampling.period": 1e-3},
        {"controller.kind": "tensions", "controller.tensions.index.T3.offset": 4.0},
        {"environment.fingers.index.fingertip_force": [0.0, 0.0, 0.2]},
    ],
    ids=["compensated", "open loop", "pushed"],
)
def test_other_controllers_and_forces_act_on_the_finger_that_they_are_for(overrides, result):
    if overrides.get("controller.kind"):
        base = fp.load_scenario("hand", SHORT)
        table = tomllib.loads(fp.to_toml(base))
        table["controller"] = {"kind": "tensions", "tensions": {"index": {"T3": {"offset": 4.0}}}}
        changed = fp.Scenario.model_validate(table)
    else:
        changed = fp.load_scenario("hand", SHORT | overrides)
    found = fp.simulate(changed)
    for part in changed.parts().values():
        alone = fp.simulate(part)
        moved = found.joint_position.sel(joint=alone.joint)
        np.testing.assert_allclose(moved, alone.joint_position, rtol=0.0, atol=1e-9)
    assert float(abs(found.energy_residual).max()) < 1e-6


def test_motors_of_a_finger_move_with_it_bit_by_bit_as_alone():
    """One in tension drive, one in position drive, on different fingers."""
    tension = {"m": {"motor": "XL330-M288", "tendons": ["T3"], "spool_radius": 0.005}}
    held = {"motor": "STS3215", "tendons": ["T4"], "spool_radius": 0.006, "drive": "position", "pretension": 2.0}
    for actuators in (tension, {"m": held}):
        changed = fp.load_scenario(
            "hand", {"simulation.duration": 0.02, "hand.fingers.ring.finger.actuators": actuators}
        )
        found, alone = fp.simulate(changed), fp.simulate(changed.parts()["ring"])
        assert list(found.motor.values) == ["ring.m"]
        np.testing.assert_array_equal(found.joint_position.sel(joint=alone.joint), alone.joint_position)
        np.testing.assert_array_equal(found.motor_position, alone.motor_position)
        assert float(abs(found.energy_residual).max()) < 1e-6


def test_a_finger_on_a_hand_is_named_in_place_of_a_table(tmp_path):
    text = '[hand]\n{}\n[hand.fingers]\nthumb = "planar"\n[controller]\ngain = 1.0\n'
    (tmp_path / "own.toml").write_text(text.format('name = "own"'))
    (tmp_path / "based.toml").write_text(text.format('base = "ub_hand"'))
    alone = fp.load_scenario(tmp_path / "own.toml").hand.fingers
    planar, usual = fp.load_finger("planar"), fp.load_hand("ub_hand").hand.fingers["thumb"]
    assert list(alone) == ["thumb"] and alone["thumb"].finger == planar and alone["thumb"].position == (0.0, 0.0, 0.0)
    overridden = fp.load_scenario("hand", {"hand.fingers.thumb": "planar", "reference.joints": {}})
    for scenario in (fp.load_scenario(tmp_path / "based.toml"), overridden):
        placed = scenario.hand.fingers["thumb"]
        assert placed.finger == planar and placed.position == usual.position and placed.scale == usual.scale


WRONG = {
    "hand.fingers.thumb": (3, "must be a table"),
    "hand.fingers.thumb.position": ([0.0, 0.0], "must be a list of 3 numbers"),
    "hand.fingers.index.position": ([0.0, 0.0, 50.0], "is it in millimetres?"),
    "hand.fingers.ring.orientation": ([0.0, 0.0, 90.0], "is it in degrees?"),
    "hand.fingers.thum.scale": (1.0, "did you mean thumb?"),
    "hand.fingers.thumb.finger": ("ubb", "did you mean ub?"),
    "hand": ("ub_hnd", "did you mean ub_hand?"),
    "controller.fingers.thum.gain": (1.0, "did you mean thumb?"),
    "controller.fingers.thumb.gian": (1.0, "did you mean controller.fingers.thumb.gain?"),
    "controller.fingers.thumb.sampling.period": (1e-3, "set controller.sampling"),
    "controller.gain": ([1.0, 2.0], "a list of 4"),
    "reference.joints.indx.medial.amplitude": (0.1, "did you mean index?"),
    "reference.joints.index.medal.amplitude": (0.1, "did you mean medial?"),
    "reference.joints.index.distal.offset": (0.1, "follows from the passive tendon"),
    "hand.fingers.index.finger.tendons.T4.crossings.distal.radius": (0.0, "index.T5 cannot be kept taut"),
}


@pytest.mark.parametrize("key", WRONG)
def test_a_wrong_entry_of_a_hand_is_named_in_one_line(key):
    value, said = WRONG[key]
    with pytest.raises(InputError) as caught:
        fp.load_scenario("hand", {key: value})
    assert said in str(caught.value) and "\n" not in str(caught.value)
    first = ".".join(key.split(".")[:2])
    assert caught.value.entry.startswith(first) or key == "hand"


def test_fingers_that_share_a_name_and_a_finger_that_is_missing_are_refused(tmp_path):
    hand = tmp_path / "mine.toml"
    missing = "hand.fingers.index.finger file nobody.toml: there is no such file"
    for text, said in (
        ("[fingers.index]\nfinger = 'ub'\n[fingers.index]\nfinger = 'ub'\n", "not valid TOML"),
        ("[fingers.index]\nfinger = 'ub'\n[fingers.Index]\nfinger = 'ub'\n", "another finger is called index"),
        ("[fingers.index]\nscale = 1.0\n", "hand.fingers.index.finger: is missing"),
        ("title = 'none'\n", "hand.fingers: is missing"),
        ("[fingers.index]\nfinger = 'nobody.toml'\n", missing),
    ):
        hand.write_text(text)
        with pytest.raises(InputError) as caught:
            fp.load_hand(hand)
        assert said in str(caught.value) and "\n" not in str(caught.value)


def test_a_hand_is_built_by_its_name_and_steps_all_its_fingers():
    hand = fp.Finger("ub_hand")
    assert hand.routing.joints == tuple(fp.load_hand("ub_hand").joints) and "20 joints" in repr(hand)
    simulator = fp.Simulator(hand)
    before = simulator.state.position
    assert np.all(simulator.step(np.full(20, 1.0), 1e-3).position != before)


def test_a_hand_may_replace_a_finger_and_a_finger_of_other_joints_no_hand():
    assert fp.load_scenario("reversals", {"hand": "ub_hand", "reference": {}}).hand.name == "ub_hand"
    with pytest.raises(InputError, match="no such joint"):
        fp.load_scenario("hand", {"finger": "ub_stand_in"})


def test_a_hand_needs_no_name_and_what_is_missing_is_said_in_words(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('[hand.fingers]\nthumb = "ub_stand_in"\n')
    scenario = fp.load_scenario(path)
    assert scenario.hand.name == scenario.finger.name == "hand"
    assert fp.load_scenario(scenario, {"controller.gain": 2.0}).hand == scenario.hand
    for text, said in [
        ('[hand]\nnmae = "mine"\n[hand.fingers]\nthumb = "ub_stand_in"\n', "did you mean hand.name?"),
        ('[hand]\nname = "mine"\n', "hand.fingers: is missing: Fingers by name."),
        ("[hand.fingers.thumb]\nscale = 1.0\n", "thumb.finger: is missing: Name of one that ships, path of a"),
    ]:
        path.write_text(text)
        with pytest.raises(fp.InputError) as refused:
            fp.load_scenario(path)
        assert said in str(refused.value) and "Of the hand" not in str(refused.value)
