"""The exported MJCF in MuJoCo, an independent simulator: the same forces at a state, the same motion over time."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from validation import mujoco_motion

import finger_pin as fp
from finger_pin.description.tables import list_fingers
from finger_pin.exceptions import InputError
from finger_pin.exchange.mjcf import to_mjcf
from finger_pin.mechanism.state import State
from finger_pin.mechanism.urdf import to_urdf

mujoco = pytest.importorskip("mujoco")

TWO_PASSIVE = {
    "finger": {
        "base": "ub_stand_in",
        "tendons": {
            "T6": {
                "kind": "passive",
                "mass_after": 0,
                "crossings": {"abduction": {"radius": 0.004}, "distal": {"radius": -0.006}},
            }
        },
    },
    "finger.passive_tendon.mass": [1e-5, 3e-4],
    "finger.passive_tendon.stiffness": [5e4, 2e4],
    "finger.passive_tendon.slack": [1e-3, -5e-4],
    "finger.tendon_friction.viscous": [1.0, 0.5, 0.25, 2.0, 0.7, 0.1],
    "finger.joint_friction.viscous": [1e-3, 2e-3, 0.0, 5e-4],
    "finger.gravity": [3.0, -4.0, 5.0],
    "finger.joints.abduction.link.twist": 1.1,
    "finger.joints.distal.link.twist": -0.4,
}
SOFT = {
    "finger.passive_tendon.stiffness": 2e3,
    "finger.passive_tendon.mass": 1e-4,
    "finger.gravity": [4.0, 2.0, 1.0],
    "finger.joint_friction.viscous": 2e-3,
}


def load(text):
    return mujoco.MjModel.from_xml_string(text)


def forward(model, position, velocity, command):
    """Return MuJoCo's data with everything computed at a state."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.ctrl[:] = position, velocity, command
    mujoco.mj_forward(model, data)
    return data


def random_states(finger, count, slack):
    """Yield joint positions and velocities, passive positions and velocities, and commands."""
    generator = np.random.default_rng(3)
    joints, passive, actuated = len(finger.routing.joints), finger.routing.passive, finger.routing.actuated
    for _ in range(count):
        position = generator.uniform(-2.0, 2.0, joints)
        velocity = generator.normal(0.0, 3.0, joints)
        passive_position = finger.tendons.rest_position(position) + generator.normal(0.0, slack, passive)
        passive_velocity = generator.normal(0.0, 0.1, passive)
        yield position, velocity, passive_position, passive_velocity, generator.uniform(20.0, 60.0, actuated)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, overrides",
    [("ub_stand_in", {}), ("dexmart_index", {}), ("planar", {}), ("ub_stand_in", TWO_PASSIVE)],
    ids=["ub_stand_in", "dexmart_index", "planar", "two passive tendons"],
)
def test_mujoco_finds_the_accelerations_of_our_equation_18_at_any_state(name, overrides):
    description = fp.load_finger(name, {**overrides, "finger.stroke_limiter.stiffness": 0.0})
    finger, model = fp.Finger(description), load(to_mjcf(description))
    assert (model.nq, model.nu) == (len(finger.routing.joints) + finger.routing.passive, finger.routing.actuated)
    seen = set()
    for position, velocity, passive, rate, command in random_states(finger, 200, slack=1e-3):
        state = State(position=position, passive_position=passive, velocity=velocity, passive_velocity=rate)
        ours = finger.evaluate(finger.layout.pack(state), command)
        data = forward(model, np.append(position, passive), np.append(velocity, rate), command)
        expected = np.append(ours["joint_acceleration"], ours.mechanism.acceleration[..., 4:])
        for found, wanted in zip(np.split(data.qacc, [4]), np.split(expected, [4]), strict=True):
            np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-9 * np.abs(wanted).max(initial=1e-9))
        seen |= {tuple(ours.strands[finger.routing.actuated :] > 0.0)}
    # Every combination of taut and slack halves came up.
    assert len(seen) == 4**finger.routing.passive


def test_without_masses_a_passive_tendon_is_one_spring_k_t_that_only_pulls():
    description = fp.load_finger("ub_stand_in")
    finger, model = fp.Finger(description), load(to_mjcf(description, massless=True))
    assert (model.nq, model.ntendon) == (4, 5)
    for position, velocity, _, _, command in random_states(finger, 50, slack=0.0):
        data = forward(model, position, velocity, command)
        stretch = 0.0035 * position[2] - 0.005 * position[3]
        coupling, passive = finger.coupling, max(0.0, 5e4 * stretch)
        viscous = coupling[:4].T @ (coupling[:4] @ velocity) + 1e-3 * velocity
        torque = coupling.T @ np.append(command, passive) - viscous
        expected = finger.rigid_body.forward_dynamics(position, velocity, torque)
        np.testing.assert_allclose(data.qacc, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, overrides", [("reversals", {}), ("reversals", SOFT)], ids=["reversals", "soft passive tendon"]
)
def test_mujoco_converges_to_our_trajectory_at_the_first_order_of_its_time_step(name, overrides):
    found = mujoco_motion.converge(name, overrides)
    result, finger = found.ours, found.scenario.finger
    ours = result["joint_position"].values
    assert abs(ours[-1] - ours[0]).max() > 0.01
    # The cut of a tension at zero and MuJoCo's clamp do not act, and bristles carry nothing.
    assert float(result["tendon_command"].max()) < 100.0
    assert float(result["tendon_tension"].min()) > 0.1
    velocity = result["joint_velocity"].values @ fp.Finger(finger).coupling[:4].T
    drag = np.broadcast_to(finger.tendon_friction.viscous, 5)[:4] * velocity
    assert abs(result["tendon_friction"].values[:, :4] - drag).max() < 1e-9
    assert found.errors[-1] < 5e-5
    np.testing.assert_allclose(found.errors[:-1] / found.errors[1:], 2.0, rtol=0.05)


@pytest.mark.slow
def test_a_finger_that_meets_a_plate_bounces_and_pushes_as_in_mujoco():
    """Before it touches, and over four bounces and a push after it, MuJoCo's motion nears ours at its first order."""
    found = mujoco_motion.converge("press", mujoco_motion.PRESSING)
    pushed = found.ours["contact_normal_force"].sel(contact="distal-plate").values
    # It has left the plate four times, stays, and nothing else touches.
    assert np.count_nonzero(np.diff((pushed > 0.0).astype(int)) == -1) == 4
    assert pushed.max() > 10.0 and pushed[-1] > 1.0
    assert float(found.ours["contact_normal_force"].values.sum()) == pytest.approx(pushed.sum(), rel=1e-12)
    assert found.free[-1] < 5e-6 and found.errors[-1] < 5e-5
    for errors in (found.free, found.errors):
        np.testing.assert_allclose(errors[:-1] / errors[1:], 2.0, rtol=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("name", list_fingers())
def test_the_default_time_step_is_stable(name):
    description = fp.load_finger(name)
    for massless in (False, True):
        model = load(to_mjcf(description, massless=massless))
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        data.ctrl[:] = np.linspace(3.0, 9.0, model.nu)
        mujoco.mj_step(model, data, round(0.1 / model.opt.timestep))
        assert np.all(np.isfinite(data.qpos)) and np.abs(data.qvel).max() < 200.0
        assert not data.warning.number.any()


@pytest.mark.parametrize("name", list_fingers())
def test_masses_frames_ranges_and_the_fingertip_are_those_of_the_urdf(name):
    description = fp.load_finger(name, {"finger.joints.distal.link.twist": 0.3})
    finger, model = fp.Finger(description), load(to_mjcf(description))
    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, index) for index in range(len(description.joints))]
    assert names == list(description.joints)
    ranges = [joint.range for joint in description.joints.values()]
    np.testing.assert_array_equal(model.jnt_range[: len(names)], ranges)
    assert not model.jnt_limited.any()
    position = np.linspace(0.3, 0.9, len(names))
    data = forward(model, np.append(position, np.zeros(finger.routing.passive)), 0.0, 0.0)
    np.testing.assert_allclose(data.site("fingertip").xpos, finger.rigid_body.tip_position(position), atol=1e-15)
    for joint, placed in description.joints.items():
        assert model.body(f"{joint}_link").mass[0] == placed.link.mass


@pytest.mark.parametrize("name", list_fingers())
def test_shapes_are_those_of_the_urdf_and_do_not_collide_with_each_other(name):
    description = fp.load_finger(name)
    model, urdf = load(to_mjcf(description)), ET.fromstring(to_urdf(description))
    touching = model.geom_conaffinity == 1
    assert int((~touching).sum()) == len(list(urdf.iter("visual")))
    # A capsule is a cylinder and two spheres there.
    assert (model.geom_type[touching] == mujoco.mjtGeom.mjGEOM_CAPSULE).all()
    assert 3 * int(touching.sum()) == len(list(urdf.iter("collision")))
    assert not model.geom_contype.any()
    assert load(to_mjcf(description, shapes=False)).ngeom == 0


def test_a_ball_that_is_dropped_on_the_finger_touches_it():
    root = ET.fromstring(to_mjcf(fp.load_finger("ub_stand_in", {"finger.gravity": [0.0, 0.0, 0.0]})))
    ball = ET.SubElement(root.find("worldbody"), "body", pos="0.04 0 0.012")
    ET.SubElement(ball, "freejoint")
    ET.SubElement(ball, "geom", size="0.005", mass="0.01")
    model = load(ET.tostring(root, encoding="unicode").replace('qpos="0.0 0.0 0.0 0.0 0.0"', ""))
    data = forward(model, model.qpos0, 0.0, 0.0)
    assert data.ncon > 0


def test_the_keyframe_holds_the_posture_with_both_halves_stretched_alike():
    description = fp.load_finger("ub_stand_in")
    posture = [0.1, 0.5, 0.6, 0.3]
    model = load(to_mjcf(description, posture=posture))
    np.testing.assert_allclose(model.key_qpos[0], [*posture, 0.5 * (0.0035 * 0.6 + 0.005 * 0.3)], rtol=1e-15)


def test_gravity_does_not_act_on_the_lumped_mass():
    for gravity in ([0.0, 0.0, -9.81], [3.0, -4.0, 5.0], [0.0, 0.0, 0.0]):
        model = load(to_mjcf(fp.load_finger("ub_stand_in", {"finger.gravity": gravity})))
        data = forward(model, model.qpos0, 0.0, 0.0)
        assert abs(data.qfrc_bias[4]) < 1e-19


def test_the_file_lists_at_its_head_what_is_left_out():
    text = to_mjcf(fp.load_finger("ub_stand_in"))
    head = text[: text.index("-->")]
    for phrase in ("stiction and Coulomb", "stroke limiters", "at zero", "fingertip", "clamped", "lumped mass"):
        assert phrase in head
    assert max(map(len, head.splitlines())) <= 120
    assert "passive tendon" not in to_mjcf(fp.load_finger("planar"))


def test_numbers_in_the_file_are_read_back_as_the_same_floats():
    description = fp.load_finger("ub_stand_in", {"finger.passive_tendon.stiffness": 12345.678901234567})
    model = load(to_mjcf(description, timestep=1.2345678901234567e-6))
    assert model.opt.timestep == 1.2345678901234567e-6
    assert model.tendon_stiffness[model.tendon("T5_distal").id] == 2.0 * 12345.678901234567


@pytest.mark.parametrize(
    "options, entry",
    [({"timestep": 0.0}, "timestep"), ({"timestep": float("nan")}, "timestep"), ({"posture": [0.0]}, "posture")],
)
def test_wrong_options_are_errors_that_name_them(options, entry):
    with pytest.raises(InputError) as caught:
        to_mjcf(fp.load_finger("ub_stand_in"), **options)
    assert caught.value.entry == entry


def test_a_scenario_is_exported_as_its_finger_or_hand_is():
    assert to_mjcf(fp.load_scenario("reversals")) == to_mjcf(fp.load_finger("ub_stand_in"))
    assert to_mjcf(fp.load_scenario("hand")) == to_mjcf(fp.load_hand("ub_hand"))
    assert to_urdf(fp.load_scenario("reversals")) == to_urdf(fp.load_finger("ub_stand_in"))


def test_a_joint_without_a_link_is_an_error_that_names_it():
    finger = fp.load_finger("planar")
    joints = {**finger.joints, "distal": finger.joints["distal"].updated(link=None)}
    with pytest.raises(InputError) as caught:
        to_mjcf(finger.updated(joints=joints))
    assert caught.value.entry == "finger.joints.distal.link"


@pytest.mark.parametrize("export", [to_mjcf, to_urdf])
def test_an_argument_that_is_no_finger_is_refused_by_name(export):
    with pytest.raises(InputError) as caught:
        export(5)
    assert (caught.value.entry, caught.value.value) == ("description", "int") and "\n" not in str(caught.value)


def test_a_joint_offset_puts_mujoco_s_fingertip_and_mass_where_the_urdf_has_them():
    offsets = {"finger.joints.proximal.link.offset": 6e-3, "finger.joints.distal.link.offset": -4e-3}
    finger = fp.Finger(fp.load_finger("ub_stand_in", offsets))
    model = load(to_mjcf(finger.description))
    q = np.array([0.1, 0.4, 0.7, 0.3])
    data = forward(model, np.append(q, 0.0), np.zeros(5), np.zeros(4))
    np.testing.assert_allclose(data.site("fingertip").xpos, finger.rigid_body.tip_position(q), atol=1e-12)
    np.testing.assert_allclose(data.qfrc_bias[:4], finger.rigid_body.gravity_torque(q), atol=1e-12)


def test_a_hand_has_the_inertia_the_tips_and_the_tendons_that_pinocchio_computes():
    hand = fp.Finger("ub_hand")
    model = mujoco.MjModel.from_xml_string(fp.to_mjcf(fp.load_hand("ub_hand")))
    data, rng = mujoco.MjData(model), np.random.default_rng(9)
    assert [model.joint(index).name for index in range(20)] == list(hand.routing.joints)
    q = rng.uniform(0.0, 1.0, 20)
    data.qpos[:20] = q
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    expected = hand.rigid_body.mass_matrix(q)
    np.testing.assert_allclose(mass[:20, :20], np.triu(expected) + np.triu(expected, 1).T, rtol=1e-9, atol=1e-14)
    gravity = hand.rigid_body.gravity_torque(q)
    np.testing.assert_allclose(data.qfrc_bias[:20], gravity, rtol=1e-9, atol=1e-13)
    tips = [data.site(f"{name}.fingertip").xpos for name in hand.description.hand.fingers]
    np.testing.assert_allclose(tips, hand.motion(q, np.zeros(20)).tip, atol=1e-14)
    lengths = [data.tendon(name).length[0] for name in hand.routing.tendons[:20]]
    np.testing.assert_allclose(lengths, hand.routing.actuated_coupling @ q, atol=1e-15)


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"law": "dahl"}, r'law = "dahl": must be "lugre", law \(9\)'),
        ({"law": "coulomb"}, r'law = "coulomb": must be "lugre", law \(9\)'),
        ({"drag": 1e-3, "drag_asymmetry": [0.0, 0.2]}, "drag_asymmetry = .*must be 0"),
    ],
)
def test_a_law_that_mujocos_step_does_not_have_is_not_written_as_another(keys, says):
    finger = fp.load_finger("planar", {f"finger.joint_friction.{key}": value for key, value in keys.items()})
    with pytest.raises(InputError, match=f"finger.joint_friction.{says}"):
        fp.to_mjcf(finger, friction=True)
