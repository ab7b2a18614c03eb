"""Tendons on a finger of the Allegro hand: `Finger.from_model` against the whole hand in Pinocchio."""

import example_robot_data
import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import finger_pin as fp
from finger_pin.exceptions import InputError, LeftOutWarning
from finger_pin.simulation.energy import energies, powers

# The hand's URDF says 10 N m of dry friction and less of ranges, of which the tests of the hand have no need.
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::finger_pin.exceptions.LeftOutWarning")]

JOINTS = {"spread": "joint_0.0", "proximal": "joint_1.0", "medial": "joint_2.0", "distal": "joint_3.0"}
INDICES = [0, 1, 2, 3]
TIP = "link_3.0_tip"
GAIN = np.array([2.0, 4.0, 3.0, 2.0])


@pytest.fixture(scope="module")
def hand():
    return example_robot_data.load("allegro_right_hand").model


@pytest.fixture(scope="module")
def description(hand):
    """The paper's five tendons, with radii that suit the larger finger and the hand's own ranges."""
    tendons = {
        "T1": {"spread": 10e-3, "proximal": 10e-3},
        "T2": {"spread": -10e-3, "proximal": 10e-3},
        "T3": {"medial": 9e-3},
        "T4": {"proximal": -8e-3, "medial": -7e-3, "distal": -6e-3},
        "T5": {"medial": -5e-3, "distal": 7e-3},
    }
    lower, upper = hand.lowerPositionLimit, hand.upperPositionLimit
    return fp.FingerDescription.model_validate(
        {
            "name": "allegro_index",
            "tendon_friction": {"stiffness": 5e4},
            "joint_friction": {"stiffness": 5.0},
            "joints": {name: {"range": [lower[i], upper[i]]} for name, i in zip(JOINTS, INDICES, strict=True)},
            "tendons": {
                name: {
                    "kind": "passive" if name == "T5" else "actuated",
                    "curvature_offset": 0.5,
                    "crossings": {joint: {"radius": radius} for joint, radius in crossings.items()},
                }
                for name, crossings in tendons.items()
            },
        }
    )


@pytest.fixture(scope="module")
def posture(hand):
    """The posture in which the other fingers are locked: inside their ranges, not at zero."""
    return 0.3 * hand.lowerPositionLimit + 0.7 * hand.upperPositionLimit


@pytest.fixture(scope="module")
def finger(description, hand, posture):
    return fp.Finger.from_model(description, hand, JOINTS, TIP, posture, base_axis=upwards(hand))


def upwards(hand):
    """The direction of the straight index finger: up, and 5 degrees outwards."""
    return np.array(hand.jointPlacements[hand.getJointId("joint_0.0")].rotation[:, 2])


def desired(time):
    """A smooth flexion in half a second; the distal joint follows the medial one."""
    rise = 0.5 - 0.5 * np.cos(np.pi * min(time / 0.4, 1.0))
    bend = 0.2 + 0.5 * rise
    return np.array([0.1 * rise, bend, bend, (5e-3 * bend - 2.0 / 5e4) / 7e-3])


def tensions(finger, time, x):
    """A controller of one's own: springs and dampers on the joints, least squares plus internal tension."""
    q, v = x[:4], x[5:9]
    torque = GAIN * (desired(time) - q) - 0.02 * v
    shortest = np.linalg.lstsq(finger.coupling.T, torque, rcond=None)[0]
    internal = finger.routing.force_closure().tension
    return (shortest + np.max((2.0 - shortest) / internal) * internal)[:4]


@pytest.fixture(scope="module")
def motion(finger):
    """States over 0.5 s, with the work of all powers as one more state."""

    def rates(time, y):
        signals = finger.evaluate(y[:-1], tensions(finger, time, y[:-1]))
        return np.append(signals.rate, powers(signals).net)

    start = np.append(finger.rest_state(desired(0.0)), 0.0)
    scales = 1e-5 * np.append(finger.layout.scales(), 1e-3)
    times = np.linspace(0.0, 0.5, 51)
    solution = solve_ivp(rates, (0.0, 0.5), start, method="BDF", rtol=1e-5, atol=scales, t_eval=times)
    assert solution.success
    return times, solution.y[:-1].T, solution.y[-1]


def whole(posture, rows):
    """Configurations of the whole hand with the finger's joints in place."""
    q = np.tile(posture, (len(rows), 1))
    q[:, INDICES] = rows
    return q


def test_the_finger_has_the_chosen_joints_and_leaves_the_hand_alone(finger, hand):
    assert finger.rigid_body.joints == tuple(JOINTS.values())
    assert finger.layout.names_of("position") == tuple(JOINTS)
    assert hand.nv == 16 and finger.rigid_body.model.nv == 4
    assert finger.routing.force_closure().holds


def test_the_mass_matrix_is_the_block_of_the_whole_hand_s(finger, hand, posture):
    data = hand.createData()
    for rows in np.random.default_rng(17).uniform(-0.2, 1.2, (10, 4)):
        full = pin.crba(hand, data, whole(posture, [rows])[0])
        np.testing.assert_allclose(finger.rigid_body.mass_matrix(rows), full[:4, :4], rtol=1e-10, atol=1e-15)


def test_the_fingertip_is_where_the_whole_hand_has_it(finger, hand, posture):
    data = hand.createData()
    for rows in np.random.default_rng(18).uniform(-0.2, 1.2, (10, 4)):
        pin.framesForwardKinematics(hand, data, whole(posture, [rows])[0])
        expected = data.oMf[hand.getFrameId(TIP)].translation
        np.testing.assert_allclose(finger.rigid_body.tip_position(rows), expected, rtol=1e-12, atol=1e-15)


def test_along_the_motion_the_whole_hand_needs_just_the_torques_that_the_finger_reports(finger, hand, posture, motion):
    times, x, _ = motion
    data = hand.createData()
    for time, row in zip(times, x, strict=True):
        s = finger.evaluate(row, tensions(finger, time, row))
        q, v, a = whole(posture, [row[:4]])[0], np.zeros(16), np.zeros(16)
        v[:4], a[:4] = row[5:9], s["joint_acceleration"]
        net = s["joint_torque"] - s["joint_friction"] - s["limiter_torque"]
        np.testing.assert_allclose(pin.rnea(hand, data, q, v, a)[:4], net, rtol=1e-8, atol=1e-9)


def test_the_energy_account_of_the_motion_closes(finger, motion):
    times, x, net = motion
    commands = np.array([tensions(finger, time, row) for time, row in zip(times, x, strict=True)])
    signals = finger.evaluate(x, commands)
    stored = sum(energies(finger, signals, finger.rigid_body.kinematics(x[:, :4], x[:, 5:9])).values())
    assert np.ptp(stored) > 1e-3
    np.testing.assert_allclose(stored - stored[0], net, atol=1e-4 * np.ptp(stored))


def test_the_mechanical_energy_is_the_whole_hand_s(finger, hand, posture, motion):
    _, x, _ = motion
    data = hand.createData()
    found = finger.rigid_body.kinematics(x[:, :4], x[:, 5:9])
    velocity = np.zeros((len(x), 16))
    velocity[:, :4] = x[:, 5:9]
    q = whole(posture, x[:, :4])
    kinetic = [pin.computeKineticEnergy(hand, data, *row) for row in zip(q, velocity, strict=True)]
    potential = np.array([pin.computePotentialEnergy(hand, data, row) for row in q])
    np.testing.assert_allclose(found.kinetic_energy, kinetic, rtol=1e-9, atol=1e-15)
    change = found.potential_energy - found.potential_energy[0]
    np.testing.assert_allclose(change, potential - potential[0], atol=1e-13)


def test_the_finger_follows_its_reference_with_taut_tendons(finger, motion):
    """Errors stay near gravity and friction over the gain: 0.13 kg g 5 cm / 3 N m/rad is 20 mrad."""
    times, x, _ = motion
    error = np.array([desired(time) for time in times]) - x[:, :4]
    assert np.ptp(x[:, 1]) > 0.4
    assert np.abs(error[10:]).max() < 0.06
    commands = np.array([tensions(finger, time, row) for time, row in zip(times, x, strict=True)])
    assert finger.evaluate(x, commands).strands[10:].min() > 0.1


def test_gravity_is_the_description_s(description, hand):
    sideways = description.updated(gravity=(0.0, 3.0, 0.0))
    finger = fp.Finger.from_model(sideways, hand, JOINTS, TIP)
    np.testing.assert_array_equal(finger.rigid_body.model.gravity.linear, [0.0, 3.0, 0.0])
    np.testing.assert_array_equal(hand.gravity.linear, [0.0, 0.0, -9.81])


def test_tendons_at_the_base_run_along_the_axis_that_is_given(finger, description, hand):
    """Links and tendons run along the straight finger, so that a pull of 1 N there takes 1 N off every joint.

    The joints are crossed by T1 T2, by T1 T2 T4, by T3 T4 and by T4: 5, 10, 9 and 5 N.
    """
    axis = upwards(hand)
    np.testing.assert_allclose(axis, [0.0, np.sin(np.radians(5.0)), np.cos(np.radians(5.0))], atol=1e-4)
    np.testing.assert_allclose(finger.rigid_body.link_directions(np.zeros(4)), np.tile(axis, (4, 1)), atol=1e-9)
    x, load = finger.rest_state(np.zeros(4)), np.array([2.0, 3.0, 4.0, 5.0])
    np.testing.assert_allclose(finger.evaluate(x, load, axis)["joint_reaction"], [4.0, 9.0, 8.0, 4.0], rtol=1e-9)
    across = fp.Finger.from_model(description, hand, JOINTS, TIP, base_axis=(1.0, 0.0, 0.0))
    reaction = across.evaluate(x, load, axis)["joint_reaction"]
    np.testing.assert_allclose(reaction, [np.hypot(5.0, 1.0), 9.0, 8.0, 4.0], rtol=1e-9)


@pytest.mark.parametrize(
    ("change", "entry"),
    [
        ({"distal": None}, "joints.distal"),
        ({"distal": "joint_99.0"}, "joints.distal"),
        ({"little": "joint_8.0"}, "joints.little"),
        ({"medial": "joint_1.0"}, "joints"),
        ({"medial": "joint_3.0", "distal": "joint_2.0"}, "joints"),
    ],
    ids=["missing", "misspelt", "unknown", "twice", "out of order"],
)
def test_a_wrong_choice_of_joints_names_the_entry(description, hand, change, entry):
    joints = {name: joint for name, joint in (JOINTS | change).items() if joint is not None}
    with pytest.raises(InputError) as caught:
        fp.Finger.from_model(description, hand, joints, TIP)
    assert caught.value.entry == entry


def test_a_missing_fingertip_frame_is_named(description, hand):
    with pytest.raises(InputError) as caught:
        fp.Finger.from_model(description, hand, JOINTS, "link_3.0_tipp")
    assert caught.value.entry == "tip_frame" and caught.value.value == "link_3.0_tipp"


def test_a_joint_of_several_coordinates_is_refused_by_name():
    model = pin.Model()
    ball = model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(ball, pin.Inertia.Random(), pin.SE3.Identity())
    model.addFrame(pin.Frame("tip", ball, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    description = fp.FingerDescription.model_validate(
        {
            "name": "ball",
            "joints": {"only": {"range": [-1.0, 1.0]}},
            "tendons": {"A": {"crossings": {"only": {"radius": 5e-3}}}},
        }
    )
    with pytest.raises(InputError) as caught:
        fp.Finger.from_model(description, model, {"only": "ball"}, "tip")
    assert caught.value.entry == "joint ball"


def test_a_configuration_of_the_wrong_size_is_named(description, hand):
    with pytest.raises(InputError) as caught:
        fp.Finger.from_model(description, hand, JOINTS, TIP, np.zeros(5))
    assert caught.value.entry == "configuration"


LINKS = """<robot name="f"><link name="palm"/>
<link name="p1"><inertial><origin xyz="0.03 0 0"/><mass value="0.03"/>
<inertia ixx="1e-6" iyy="1e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="p2"><inertial><origin xyz="0.02 0 0"/><mass value="0.02"/>
<inertia ixx="1e-6" iyy="4e-6" izz="4e-6" ixy="0" ixz="0" iyz="0"/></inertial></link><link name="tip"/>
<joint name="j1" type="continuous"><parent link="palm"/><child link="p1"/><axis xyz="0 0.6 0.8"/>
<dynamics damping="0.01" friction="0.001"/></joint>
<joint name="j2" type="revolute"><origin xyz="0.06 0 0"/><parent link="p1"/><child link="p2"/><axis xyz="0 1 0"/>MIMIC
<limit lower="-0.1" upper="0.5" effort="1" velocity="1"/></joint>
<joint name="jt" type="fixed"><origin xyz="0.04 0 0"/><parent link="p2"/><child link="tip"/></joint></robot>"""


def two_joints(friction, *ranges):
    """Return a finger of two joints that two tendons pull."""
    joints = {name: {"range": limits} for name, limits in zip("ab", ranges, strict=True)}
    crossings = {name: {"radius": 0.008} for name in "ab"}
    table = {"name": "f", "joints": joints, "tendons": {"T": {"crossings": crossings}}, "joint_friction": friction}
    return fp.FingerDescription.model_validate(table)


def test_damping_friction_and_ranges_that_the_description_has_less_of_are_told():
    model = pin.buildModelFromXML(LINKS.replace("MIMIC", ""))
    with pytest.warns(LeftOutWarning) as caught:
        fp.Finger.from_model(two_joints({}, [-1.0, 1.0], [-1.0, 0.4]), model, {"a": "j1", "b": "j2"}, "tip")
    (message,) = [str(each.message) for each in caught]
    assert "damping of joint j1, 0.01 N m s/rad: finger.joints.a.spring.damping can say it" in message
    assert "dry friction of joint j1, 0.001 N m: finger.joint_friction.floor can say it" in message
    assert "range of joint j2, -0.1 to 0.5: finger.joints.b.range acts, -1 to 0.4" in message
    assert message.count(";") == 2


@pytest.mark.filterwarnings("error")
def test_a_continuous_joint_moves_as_pinocchio_moves_its_cosine_and_sine():
    model = pin.buildModelFromXML(LINKS.replace("MIMIC", ""))
    description = two_joints({"viscous": 0.01, "floor": 0.001}, [-1.0, 1.0], [0.0, 0.4])
    body = fp.Finger.from_model(description, model, {"a": "j1", "b": "j2"}, "tip").rigid_body
    model.gravity.linear[:] = description.gravity
    data = model.createData()
    for q in np.random.default_rng(3).uniform(-2.0, 2.0, (5, 2)):
        whole = np.array([np.cos(q[0]), np.sin(q[0]), q[1]])
        mass = np.triu(pin.crba(model, data, whole))
        np.testing.assert_allclose(body.mass_matrix(q), mass + np.triu(mass, 1).T, rtol=1e-12)
        gravity = pin.computeGeneralizedGravity(model, data, whole)
        np.testing.assert_allclose(body.gravity_torque(q), gravity, rtol=1e-12, atol=1e-15)
        pin.framesForwardKinematics(model, data, whole)
        np.testing.assert_allclose(body.tip_position(q), data.oMf[model.getFrameId("tip")].translation, atol=1e-15)


def test_a_joint_that_mimics_another_is_refused_by_its_name():
    text = LINKS.replace("MIMIC", '<mimic joint="j1" multiplier="0.5" offset="0"/>').replace("continuous", "prismatic")
    text = text.replace("<dynamics", '<limit lower="0" upper="1" effort="1" velocity="1"/><dynamics')
    model = pin.buildModelFromXML(text, mimic=True)
    with pytest.raises(InputError, match=r"joint j2: follows another one; read the model without mimics"):
        fp.Finger.from_model(two_joints({}, [-1.0, 1.0], [0.0, 0.4]), model, {"a": "j1", "b": "j2"}, "tip")
