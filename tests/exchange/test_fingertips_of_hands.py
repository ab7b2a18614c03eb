"""All fingertips of an imported hand against MuJoCo's sites, geoms and Jacobians: places, forces, targets."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import finger_pin as fp
from finger_pin.analysis import equilibrium, force_polytope, inverse_kinematics
from finger_pin.description.demo_motion import demo_motion
from finger_pin.description.loading import load_finger, read_scenario
from finger_pin.learning import Environment
from finger_pin.playground.session import Session

_HAND = """<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody>
  <body name="index" pos="0.03 0 0"><joint name="index" axis="0 1 0" range="-1 1"/>
    <geom type="capsule" size="0.005" fromto="0 0 0.003 0 0 0.04" mass="0.02"/>
    <body name="index_end" pos="0 0 0.05" euler="0.3 0 0.2"><joint name="index_end" axis="0 1 0" range="-1 1"/>
      <geom name="index_end" type="capsule" size="0.005" fromto="0 0 0.003 0 0 0.03" mass="0.01"/></body></body>
  <body name="middle" pos="0 0.03 0"><joint name="middle" axis="1 0 0" range="-1 1"/>
    <geom type="box" size="0.005 0.005 0.02" pos="0 0 0.02" mass="0.02"/>
    <site name="middle_tip" pos="0.001 0.002 0.041"/><site name="tip_again" pos="0 0 0.02"/></body>
  <body name="thumb" pos="0 -0.03 0"><joint name="thumb" axis="1 0 0" range="-1 1"/>
    <geom type="sphere" size="0.005" mass="0.02"/>
    <body name="nail" pos="0 0.01 0.02" euler="0.4 0 0">
      <geom name="nail" type="box" size="0.004 0.006 0.02"/></body></body>
  <body name="ball" pos="0 0 0.2"><freejoint/><geom type="sphere" size="0.01"/></body></worldbody>
  <actuator><position name="index" joint="index" kp="1"/><position name="index_end" joint="index_end" kp="1"/>
    <position name="middle" joint="middle" kp="1"/><position name="thumb" joint="thumb" kp="1"/></actuator></mujoco>"""
_POSTURE = {"index": 0.4, "index_end": -0.3, "middle": 0.5, "thumb": -0.2}
_FORCES = {"index_end": (0.1, 0.2, -0.3), "middle_tip": (-0.2, 0.1, 0.05), "thumb": (0.0, -0.3, 0.1)}


@pytest.fixture(scope="module")
def hand(tmp_path_factory):
    """Return the description of the hand, MuJoCo's model, and its data at the posture."""
    path = tmp_path_factory.mktemp("hand") / "hand.xml"
    path.write_text(_HAND)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    for name, angle in _POSTURE.items():
        data.joint(name).qpos[:] = angle
    mujoco.mj_forward(model, data)
    return fp.from_mujoco(str(path)), model, data


def _ends(data):
    """Return the fingertips by MuJoCo, by name, m: a site, the end of a capsule's axis, the face of a box."""
    tip, nail = data.body("index_end"), data.geom("nail")
    return {
        "index_end": tip.xpos + 0.03 * tip.xmat.reshape(3, 3)[:, 2],
        "middle_tip": data.site("middle_tip").xpos,
        "thumb": nail.xpos + 0.02 * nail.xmat.reshape(3, 3)[:, 2],
    }


def _alone(description):
    """Return the hand without the ball."""
    return description.updated(tree=description.tree.updated(objects={}))


def _scenario(description, **overrides):
    start = {f"simulation.initial.position.{name}": angle for name, angle in _POSTURE.items()}
    pushed = {f"environment.fingers.{name}.fingertip_force": force for name, force in _FORCES.items()}
    return read_scenario(demo_motion(description, 0.01), start | pushed | overrides)


def test_every_fingertip_is_where_mujoco_has_it_and_its_force_turns_the_same_joints(hand):
    description, model, data = hand
    result = fp.simulate(_scenario(description))
    torque = np.zeros(model.nv)
    for name, place in _ends(data).items():
        assert result.fingertip_position.sel(tip=name)[0].values == pytest.approx(place, abs=1e-12)
        body = model.body("middle" if name == "middle_tip" else name).id
        mujoco.mj_applyFT(model, data, np.array(_FORCES[name]), np.zeros(3), place, body, torque)
    assert result.fingertip_force[0].sel(tip="thumb").values == pytest.approx(_FORCES["thumb"])
    assert result.external_torque[0].values == pytest.approx(torque[: len(_POSTURE)], abs=1e-12)
    assert result.sizes["tip"] == len(_FORCES)


@pytest.mark.slow
def test_policies_players_and_linear_models_see_every_fingertip(hand):
    description, model, data = hand
    alone = _scenario(_alone(description), **{"finger.tree.actuators.thumb.delay": 0.02})
    environment = Environment(alone, reward=lambda signals: 0.0, observation=["fingertip_position"], period=0.01)
    observation, _ = environment.reset(seed=0)
    places = np.array([*_ends(data).values()])
    assert observation.reshape(3, 3) == pytest.approx(places, abs=1e-6)
    session = Session(alone)
    session.step()
    assert session.reading().force == pytest.approx(np.array([*_FORCES.values()]))
    linear = fp.linearise(_alone(description), [_POSTURE[name] for name in description.joints], {})
    jacobian = np.zeros((3, model.nv))
    for name, place in _ends(data).items():
        body = model.body("middle" if name == "middle_tip" else name).id
        mujoco.mj_jac(model, data, jacobian, None, place, body)
        rows = linear.C.sel(output=[f"fingertip_position.{name}.{axis}" for axis in "xyz"])
        columns = rows.sel(by_state=[f"joint_position[{joint}]" for joint in description.joints])
        assert columns.values == pytest.approx(jacobian[:, : len(_POSTURE)], abs=1e-8)
    assert fp.linearise(alone, [0.0] * 4, {}).input_delay.values.tolist() == [0.0, 0.0, 0.0, 0.02]


def test_postures_are_found_by_the_tip_that_is_named(hand):
    description, model, data = hand
    for name, place in _ends(data).items():
        found = inverse_kinematics(description, place, tip=name)
        assert found.reached
        other = mujoco.MjData(model)
        for joint, angle in zip(description.joints, found.position, strict=True):
            other.joint(joint).qpos[:] = angle
        mujoco.mj_kinematics(model, other)
        assert _ends(other)[name] == pytest.approx(place, abs=2e-6)


@pytest.mark.slow
def test_forces_at_tips_are_held_up_by_the_servos(hand):
    description, model, _ = hand
    data, forces = mujoco.MjData(model), 0.1 * np.array([*_FORCES.values()])
    rest = equilibrium(_alone(description), {}, fingertip_force=forces)
    for joint, angle in zip(description.joints, rest.position, strict=True):
        data.joint(joint).qpos[:] = angle
    mujoco.mj_forward(model, data)
    torque = np.zeros(model.nv)
    for (name, place), force in zip(_ends(data).items(), forces, strict=True):
        body = model.body("middle" if name == "middle_tip" else name).id
        mujoco.mj_applyFT(model, data, force, np.zeros(3), place, body, torque)
    assert rest.position == pytest.approx(torque[: len(_POSTURE)], abs=1e-6)  # kp is 1 N m/rad


def test_fingertips_of_a_file_are_its_ends_or_those_that_it_names(hand, tmp_path):
    description, _, data = hand
    again = tmp_path / "again.toml"
    again.write_text(fp.to_toml(description))
    assert load_finger(again).tree.tips == description.tree.tips
    moved = _scenario(description, **{"finger.tree.tips.thumb.body": "middle"})
    assert fp.simulate(moved).fingertip_position.sel(tip="thumb")[0, 0] == pytest.approx(data.body("middle").xpos[0])


def test_every_fingertip_is_written_for_other_programs(hand):
    description, _, data = hand
    written = mujoco.MjModel.from_xml_string(fp.to_mjcf(description))
    urdf = pin.buildModelFromXML(fp.to_urdf(description))
    other, places = mujoco.MjData(written), urdf.createData()
    for name, angle in _POSTURE.items():
        other.joint(name).qpos[:] = angle
    mujoco.mj_kinematics(written, other)
    pin.framesForwardKinematics(urdf, places, np.array([_POSTURE[name] for name in urdf.names[1:]]))
    for name, place in _ends(data).items():
        site = name if "tip" in name else f"{name}_fingertip"
        assert other.site(site).xpos == pytest.approx(place, abs=1e-9)
        assert places.oMf[urdf.getFrameId(f"{name}_fingertip")].translation == pytest.approx(place, abs=1e-9)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda hand: inverse_kinematics(hand, (0.0, 0.0, 0.0)), "tip: must be one of"),
        (lambda hand: inverse_kinematics(hand, (0.0, 0.0, 0.0), tip="nail"), "middle_tip"),
        (lambda hand: inverse_kinematics("ub", (0.0, 0.0, 0.0), tip="nail"), "leave it out"),
        (lambda hand: force_polytope(hand, [0.0] * 4, 5.0), "tip: must be one of"),
        (lambda hand: equilibrium(_alone(hand), {}, fingertip_force=(0.0, 0.0, 1.0)), "a row each for"),
        (lambda hand: _scenario(hand, **{"environment.fingers.nail.fingertip_force": [0, 0, 1]}), "nail"),
        (lambda hand: _scenario(hand, **{"controller.fingers.thumb.gain": 1.0}), "a tip has fingertip_force"),
        (lambda hand: _scenario(hand, **{"finger.tree.tip.body": "nail"}), "leave it out beside tips"),
    ],
)
def test_a_call_for_no_fingertip_is_refused_by_name(hand, call, words):
    with pytest.raises(fp.InputError, match=words):
        call(hand[0])


@pytest.mark.slow
def test_a_controller_exerts_a_force_at_the_tip_that_is_named():
    arm = {"mass": 0.02, "inertia": [1e-6, 1e-5, 1e-5, 0.0, 0.0, 0.0]}
    arm |= {"solids": {"bar": {"kind": "box", "sides": [0.08, 0.01, 0.01]}}}
    cords = {f"{joint}{k}": {"joints": {joint: 0.01 * (-1) ** k}} for joint in ("left", "right") for k in (1, 2)}
    tree = {"bodies": {"left": arm, "right": {**arm, "position": [0.0, 0.05, 0.0]}}, "tendons": cords}
    tree |= {"joints": {joint: {"body": joint, "axis": [0.0, 1.0, 0.0]} for joint in ("left", "right")}}
    finger = {
        "name": "two",
        "gravity": [0.0] * 3,
        "joints": {joint: {"range": [-1.0, 1.0]} for joint in tree["joints"]},
    }
    finger |= {"tree": tree, "tendons": {name: {"along": name} for name in cords}}
    pushing = {"gain": 0.5, "fingers": {"right": {"fingertip_force": {"z": {"offset": 0.2}}}}}
    table = {"name": "two", "finger": finger, "controller": pushing, "simulation": {"duration": 0.01}}
    result = fp.simulate(read_scenario(table))
    # The end is half a bar from the hinge about y: 0.04 m along x, so that J^T F = -0.04 * 0.2 N m.
    assert result.joint_torque_command[0].values == pytest.approx([0.0, -0.008])
