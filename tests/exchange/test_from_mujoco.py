"""Hands read from MuJoCo models: their geometry, their inertia and what acts on them, against MuJoCo."""

import copy

import mujoco
import numpy as np
import pytest
from mujoco_models import FIXED, LINK, MODELS, ROUTED, arms, model_of, posture

import finger_pin as fp
from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.description.demo_motion import demo_motion
from finger_pin.description.loading import read_scenario

# Flags and other kinds of actuators are left out here on purpose.
pytestmark = pytest.mark.filterwarnings("ignore:hand. not carried over")


@pytest.fixture(scope="module")
def hands():
    """Models and the hands that are read from them, by name."""
    models = {name: load() for name, load in MODELS.items()}
    return {name: (model, fp.Hand(fp.from_mujoco(model))) for name, model in models.items()}


SMOOTH = {
    f"finger.{table}.{entry}": 0.0
    for table, entries in (("tendon_friction", ("coulomb", "viscous")), ("joint_friction", ("coulomb", "stiction")))
    for entry in entries
}


def inputs(hand, model, control):
    """Return the inputs of a hand for MuJoCo's: tensions of the tendons that motors pull, then those of actuators."""
    given = {model.actuator(i).name.replace(":", "_"): control[i] for i in range(model.nu)}
    pulled = [np.clip(given[name], 0.0, 20.0) for name in hand.description.tendons]
    return [*pulled, *(given[name] for name in hand.description.tree.actuators)]


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_lengths_and_arms_are_mujoco_s(hands, name):
    model, hand = hands[name]
    data, random = mujoco.MjData(model), np.random.default_rng(0)
    for _ in range(1000 if name == "routed" else 50):
        data.qpos = posture(model, random)
        mujoco.mj_fwdPosition(model, data)
        np.testing.assert_allclose(hand.paths.length(data.qpos), data.ten_length, atol=1e-12)
        # MuJoCo's wrap inside ends its iteration early.
        np.testing.assert_allclose(hand.paths.arms(data.qpos), arms(model, data), atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_accelerations_are_mujoco_s_without_its_constraints(name):
    """Inertia, gravity, springs, dampers, tendons and actuators at random states, by both evaluators."""
    model, random = MODELS[name](), np.random.default_rng(1)
    model.tendon_limited[:], model.jnt_margin[:] = 0, 0.0
    described = fp.from_mujoco(model)
    described = described.updated(touches_itself=False, tree=described.tree.updated(objects={}))
    smooth = read_scenario(demo_motion(described), SMOOTH)
    data, hand = mujoco.MjData(model), fp.Hand(smooth.finger)
    compiled = CompiledFinger(hand)
    for _ in range(50 if name == "routed" else 10):
        data.qpos, data.qvel = posture(model, random), 0.3 * random.normal(size=model.nv)
        data.ctrl = random.uniform(-2.0, 2.0, model.nu)
        mujoco.mj_forward(model, data)
        x = hand.rest_state(data.qpos, data.qvel)
        for evaluator in (hand, compiled):
            found = evaluator.evaluate(x, inputs(hand, model, data.ctrl))
            # As close as MuJoCo's arms of wraps inside.
            np.testing.assert_allclose(found["joint_acceleration"], data.qacc_smooth, rtol=1e-7, atol=1e-7)


COUPLED = '<equality><joint joint1="j2" joint2="j1" polycoef="0.4 0.5 0 0 0"/></equality></mujoco>'


def flagged(model, *bits):
    """Return a copy of a model in which no flag but some is set."""
    found = copy.copy(model)
    found.opt.disableflags = sum(int(bit) for bit in bits if isinstance(bit, mujoco.mjtDisableBit))
    found.opt.enableflags = sum(int(bit) for bit in bits if isinstance(bit, mujoco.mjtEnableBit))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    "flag", ["spring", "damper", "gravity", "actuation", "clampctrl", "limit", "equality", "constraint"]
)
def test_a_part_that_a_flag_of_mujoco_disables_is_off_here(flag):
    """Accelerations at one state: a control beyond its range, a slider too where no limit is left to stop it."""
    coupled = flag in ("equality", "constraint")
    model = mujoco.MjModel.from_xml_string(ROUTED.replace("</mujoco>", COUPLED) if coupled else ROUTED)
    switched = flagged(model, getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag.upper()}"))
    switched.geom_contype[:] = switched.geom_conaffinity[:] = 0
    data = mujoco.MjData(switched)
    data.qpos = [0.2, 0.5, 0.036 if flag in ("limit", "constraint") else 0.012]
    data.qvel, data.ctrl = 0.3 * np.random.default_rng(5).normal(size=3), [0.7, 25.0, -1.5]
    mujoco.mj_forward(switched, data)

    def acceleration(read):
        hand = fp.Hand(read_scenario(demo_motion(fp.from_mujoco(read)), SMOOTH).finger)
        given = inputs(hand, model, data.ctrl) if hand.description.tree.actuators else []
        return hand.evaluate(hand.rest_state(data.qpos, data.qvel), given)["joint_acceleration"]

    np.testing.assert_allclose(acceleration(switched), data.qacc, rtol=1e-7, atol=1e-7)
    assert np.abs(acceleration(flagged(model)) - data.qacc).max() > 1e-2


@pytest.mark.slow
def test_no_flag_is_passed_over():
    """Each changes what is read, or is listed by name; a loss that is disabled is none."""
    lossy = ROUTED.replace('name="j1"', 'name="j1" frictionloss="0.3"').replace(
        'name="top"', 'name="top" frictionloss="1"'
    )
    lossy = lossy.replace("<option ", '<option o_friction="0.3 0.3 1 1 1" ').replace("</mujoco>", COUPLED)
    lossy = lossy.replace('euler="0.3 0 0"/>', 'euler="0.3 0 0"/><geom type="sphere" size="0.2" contype="3"/>')
    model = mujoco.MjModel.from_xml_string(lossy)
    plain = fp.from_mujoco(flagged(model))
    for bits in (mujoco.mjtDisableBit, mujoco.mjtEnableBit):
        for name, bit in bits.__members__.items():
            if not name.startswith("mjN"):
                assert fp.from_mujoco(flagged(model, bit)) != plain, name
    without = fp.from_mujoco(flagged(model, mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS))
    lossless = fp.from_mujoco(flagged(mujoco.MjModel.from_xml_string(lossy.replace("frictionloss", "margin"))))
    assert without == lossless


def test_actuators_that_are_disabled_or_of_other_kinds_are_listed_and_the_others_keep_their_controls():
    text = ROUTED.replace("<option ", '<option actuatorgroupdisable="3" ')
    text = text.replace('name="servo"', 'name="servo" group="3"')
    listed = fp.from_mujoco(mujoco.MjModel.from_xml_string(text)).tree.left_out
    assert "actuator servo: its group 3 is disabled in the model" in listed


OTHER_ACTUATORS = """<actuator><dcmotor name="dc" joint="j" gear="3" resistance="2" motorconst="0.1"/>
<pid name="pd" joint="k" kp="0.3" kv="0.01" ctrlrange="-0.5 0.5"/>
<dcmotor name="wound" joint="j" resistance="2" motorconst="0.1" inductance="0.1"/>
<pid name="pid" joint="k" kp="3" ki="1" slewmax="2"/>
<plugin name="foreign" joint="j" plugin="mujoco.pid" actdim="0"/></actuator>"""


def test_direct_current_motors_and_pid_without_states_push_as_in_mujoco_and_those_with_states_are_named():
    chain = LINK.replace("</body>", LINK.replace('"j"', '"k"').replace('"s"', '"z"') + "</body>")
    plugin = '<extension><plugin plugin="mujoco.pid"/></extension>'
    description = fp.from_mujoco(model_of(chain, FIXED + plugin + OTHER_ACTUATORS))
    assert list(description.tree.actuators) == ["dc", "pd"]
    assert [line for line in description.tree.left_out if line.startswith("actuator")] == [
        "actuator wound: it has dynamics of its own, of kind dcmotor",
        "actuator pid: its PID limits the rate of its input, and has an integral part",
        "actuator foreign: a plugin computes it",
    ]
    kept = FIXED + "".join(OTHER_ACTUATORS.splitlines(keepends=True)[:2]) + "</actuator>"
    model = model_of(chain, kept)
    hand = fp.Hand(read_scenario(demo_motion(description), SMOOTH).finger)
    data = mujoco.MjData(model)
    # The last control is the speed that the servo should have.
    data.qpos, data.qvel, data.ctrl = [0.2, 0.3], [1.0, -2.0], [4.0, 0.9, 0.0]
    mujoco.mj_forward(model, data)
    found = hand.evaluate(hand.rest_state(data.qpos, data.qvel), data.ctrl[:2])
    np.testing.assert_allclose(found["joint_acceleration"], data.qacc_smooth, rtol=1e-9)


def test_without_friction_the_motion_converges_to_mujoco_s_with_order_one():
    model = MODELS["routed"]()
    model.jnt_limited[:] = 0
    settings = {"simulation.duration": 0.2, "simulation.rtol": 1e-9, "simulation.atol_scale": 1e-9}
    scenario = read_scenario(demo_motion(fp.from_mujoco(model)), SMOOTH | settings)
    result = fp.simulate(scenario)
    given = {**scenario.controller.inputs, **scenario.controller.tensions}
    signals = [given[model.actuator(i).name] for i in range(model.nu)]
    errors = []
    for step in (2.5e-4, 1.25e-4):
        data, model.opt.timestep = mujoco.MjData(model), step
        error, every = 0.0, round(0.01 / step)
        for count in range(1, 20 * every + 1):
            swing = [2.0 * np.pi * each.frequency * data.time + each.phase for each in signals]
            data.ctrl = [s.offset + s.amplitude * np.sin(angle) for s, angle in zip(signals, swing, strict=True)]
            mujoco.mj_step(model, data)
            if count % every == 0:
                there = result.joint_position.values[10 * count // every]
                error = max(error, np.abs(data.qpos - there).max())
        errors.append(error)
    assert errors[0] < 0.02
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.1)
    assert np.abs(result.energy_residual).max() < 1e-6


def test_a_tendon_that_a_motor_pulls_loses_tension_by_the_turn_of_its_path():
    """The capstan law with mu_e phi, phi from the path's directions at one posture: pulled in, then let out.

    Behind the pulley each branch has its part of what the tendon's canal has left, and loses by its own turn.
    """
    model = MODELS["routed"]()
    settings = {"finger.tendon_friction.viscous": 0.0, "finger.tendon_friction.floor": 1e-6}
    described = read_scenario(demo_motion(fp.from_mujoco(model)), settings).finger
    hand, data = fp.Hand(described), mujoco.MjData(model)
    data.qpos = [0.2, 0.4, 0.01]
    mujoco.mj_forward(model, data)
    first, count = data.ten_wrapadr[1], data.ten_wrapnum[1]
    points, passed = data.wrap_xpos.reshape(-1, 3)[first : first + count], data.wrap_obj.ravel()[first : first + count]
    turns = []
    for branch in np.split(points, np.flatnonzero(passed == -2)):
        pieces = np.diff(branch[np.any(branch, axis=1)], axis=0)
        pieces = pieces[np.linalg.norm(pieces, axis=1) > 0.0]
        unit = pieces / np.linalg.norm(pieces, axis=1)[:, None]
        turns.append(np.sum(np.arccos(np.clip(np.sum(unit[:-1] * unit[1:], axis=1), -1.0, 1.0))))
    trunk, branch, straight = turns
    assert branch > 0.4 and straight == 0.0
    assert hand.paths.turn(data.qpos)[1] == pytest.approx(trunk, abs=1e-6)
    for speed in (1.0, -1.0):
        x = hand.rest_state(data.qpos, [0.0, -speed / hand.paths.arms(data.qpos)[1, 1], 0.0])
        for _ in range(50):
            found = hand.evaluate(x, [5.0, 0.0, 0.0])
            behind = found.mechanism.rows["tendon_branches"]
            # Steady sliding: bristles bear what they can, which depends on what they bear.
            found.state.tendon_stiction[:] = np.sign(found["tendon_velocity"]) * found.at_all_places("level")
            found.state.canal_stiction[-2:] = np.sign(behind.row.speed) * behind["level"]
            x = hand.layout.pack(found.state)
        assert found["tendon_velocity"][0] == pytest.approx(speed)
        left = 5.0 * np.exp(-speed * 0.11 * trunk)
        assert found.strands[0] == pytest.approx(left, rel=1e-6)
        way = np.sign(behind.row.speed[0])
        assert behind.row.command[0] + behind.force[0] == pytest.approx(left / 2.0 * np.exp(-way * 0.11 * branch))
        assert behind.row.command[1] + behind.force[1] == pytest.approx(left / 3.0, rel=1e-4)


@pytest.mark.parametrize("name", MODELS)
def test_a_hand_is_the_same_when_written_and_read_again(hands, name, tmp_path):
    description = hands[name][1].description
    (tmp_path / "hand.toml").write_text(fp.to_toml(description))
    assert fp.load_finger(str(tmp_path / "hand.toml")) == description


def test_entries_of_a_tree_are_changed_by_keys(hands, tmp_path):
    table = demo_motion(hands["routed"][1].description)
    key = "finger.tree.tendons.top.path.a1.position"
    changed = read_scenario(table, {key: [0.05, 0.0, 0.02], "controller.tensions.pull.offset": 3.0})
    moved = fp.Hand(changed.finger).paths.length(np.zeros(3)) - hands["routed"][1].paths.length(np.zeros(3))
    assert np.flatnonzero(moved).tolist() == [0]
    for wrong, text in (("tendons.up.stiffness", "there are top, branched"), ("tip.bodi", "did you mean")):
        with pytest.raises(fp.InputError, match=text):
            read_scenario(table, {f"finger.tree.{wrong}": 1.0})


def test_a_hand_is_stepped_as_a_finger_is(hands):
    hand = hands["routed"][1]
    sim = fp.Simulator(hand, position=[0.0, 0.3, 0.01])
    for step in range(20):
        state = sim.step([2.0, 0.01 * step, 0.5], 1e-3)
    result = sim.result()
    np.testing.assert_array_equal(result.joint_position[-1], state.position)
    np.testing.assert_allclose(result.actuator_input[-1], [0.19, 0.5])
    assert np.abs(result.energy_residual).max() < 1e-5
    with pytest.raises(fp.InputError, match="must be 3 numbers"):
        sim.step([2.0], 1e-3)
    assert repr(hand) == "<Finger hand: a tree of 3 joints, 4 tendons (1 pulled), 2 actuators>"


def test_a_coupled_joint_follows_as_mujoco_s_equality_says():
    chain = LINK.replace("</body>", LINK.replace('"j"', '"k"').replace('"s"', '"z"') + "</body>")
    equality = '<equality><joint joint1="k" joint2="j" polycoef="0.1 0.5 0 0 0"/></equality>'
    motor = '<actuator><position joint="j" kp="50" ctrlrange="-1 1"/></actuator>'
    description = fp.from_mujoco(model_of(chain, FIXED + equality + motor))
    start = {"simulation.initial.position.k": 0.1, "simulation.duration": 1.0}
    result = fp.simulate(read_scenario(demo_motion(description), start))
    lead, follower = result.joint_position.values.T
    assert np.ptp(lead) > 0.2
    np.testing.assert_allclose(follower, 0.1 + 0.5 * lead, atol=5e-3)


def test_coupled_fixed_tendons_follow_as_mujoco_s_equality_says():
    """0.01 k = 0.001 + 0.5 * 0.02 j."""
    chain = LINK.replace("</body>", LINK.replace('"j"', '"k"').replace('"s"', '"z"') + "</body>")
    rest = """<tendon><fixed name="a"><joint joint="j" coef="0.02"/></fixed>
    <fixed name="b"><joint joint="k" coef="0.01"/></fixed></tendon>
    <equality><tendon name="a" tendon1="b" tendon2="a" polycoef="0.001 0.5 0 0 0"/></equality>
    <actuator><position joint="j" kp="50" ctrlrange="-1 1"/></actuator>"""
    description = fp.from_mujoco(model_of(chain, rest))
    assert list(description.tree.tendons) == ["a", "b"]
    assert description.tree.couplings["a"].tendon == "b"
    start = {"simulation.initial.position.k": 0.1, "simulation.duration": 1.0}
    lead, follower = fp.simulate(read_scenario(demo_motion(description), start)).joint_position.values.T
    assert np.ptp(lead) > 0.2
    np.testing.assert_allclose(follower, 0.1 + lead, atol=1e-2)


SPRING = """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="slide" type="slide" axis="1 0 0"
stiffness="100"/><geom size="0.01" mass="0.1"/></body></worldbody></mujoco>"""


def test_a_slide_that_moves_by_a_millimetre_is_followed_as_well_as_its_tolerance_says():
    table = demo_motion(fp.from_mujoco(mujoco.MjModel.from_xml_string(SPRING)), 1.0)
    table["simulation"]["initial"]["position"] = {"slide": 1e-3}
    smooth = {f"finger.joint_friction.{name}": 0.0 for name in ("coulomb", "stiction", "viscous")}
    result = fp.simulate(read_scenario(table, smooth))
    expected = 1e-3 * np.cos(np.sqrt(100.0 / 0.1) * result.time.values)
    # A radian's absolute tolerance, 1e-6, would be off by 6e-4 of the amplitude.
    np.testing.assert_allclose(result.joint_position.values[:, 0], expected, atol=1e-4 * 1e-3)
