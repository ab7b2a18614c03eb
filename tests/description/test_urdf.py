"""The generated URDF against equation (1), closed forms, and an independent reader (yourdfpy)."""

from pathlib import Path

import generate_urdf
import numpy as np
import pinocchio as pin
import pytest
from urdf_cases import FINGERS, JOINTS, OTHER_LENGTHS, links_of
from validation.kinematics import equation_1, planar_tip, read_by_yourdfpy

from finger_pin.description.loading import load_finger
from finger_pin.description.tables import list_fingers
from finger_pin.exceptions import InputError
from finger_pin.mechanism.bodies import build_rigid_body
from finger_pin.mechanism.urdf import to_urdf

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(params=FINGERS.values(), ids=FINGERS.keys())
def finger(request):
    return load_finger(*request.param)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, overrides, closed_form",
    [
        ("ub_stand_in", {}, equation_1),
        ("ub_stand_in", OTHER_LENGTHS, equation_1),
        ("dexmart_index", {}, equation_1),
        ("planar", {}, planar_tip),
        ("planar", {"finger.joints.distal.link.length": 0.019}, planar_tip),
    ],
    ids=["ub_stand_in", "other lengths", "dexmart_index", "planar", "planar, other length"],
)
def test_pinocchio_and_yourdfpy_place_the_fingertip_where_equation_1_does(name, overrides, closed_form):
    finger = load_finger(name, overrides)
    lengths = [link.length for link in links_of(finger)]
    body, robot = build_rigid_body(finger), read_by_yourdfpy(to_urdf(finger))
    assert body.joints == tuple(finger.joints) == tuple(robot.actuated_joint_names)
    generator = np.random.default_rng(1)
    for theta in generator.uniform(-np.pi, np.pi, (1000, len(lengths))):
        expected = closed_form(lengths, theta)
        robot.update_cfg(theta)
        np.testing.assert_allclose(body.tip_position(theta), expected, rtol=0, atol=1e-12)
        pose = robot.get_transform("fingertip", "base")
        np.testing.assert_allclose(pose[:3, 3], expected, rtol=0, atol=1e-12)


def test_the_straight_finger_reaches_the_sum_of_table_1():
    tip = build_rigid_body(load_finger("ub_stand_in")).tip_position(np.zeros(4))
    np.testing.assert_allclose(tip, [0.0202 + 0.045 + 0.0299 + 0.0218, 0.0, 0.0], rtol=0, atol=1e-15)


def test_a_twist_of_the_last_link_turns_the_fingertip_frame_and_does_not_move_it():
    finger = load_finger("planar", {"finger.joints.distal.link.twist": 0.5})
    robot = read_by_yourdfpy(to_urdf(finger))
    pose = robot.get_transform("fingertip", "base")
    np.testing.assert_allclose(pose[:3, 3], [0.077, 0.0, 0.0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(pose[1:3, 1], [np.cos(0.5), np.sin(0.5)], rtol=0, atol=1e-15)


def denavit_hartenberg(angle, link):
    """Rz(theta) Tz(d) Tx(a) Rx(alpha), written out."""
    c, s, ca, sa = np.cos(angle), np.sin(angle), np.cos(link.twist), np.sin(link.twist)
    return np.array(
        [
            [c, -s * ca, s * sa, link.length * c],
            [s, c * ca, -c * sa, link.length * s],
            [0.0, sa, ca, link.offset],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def test_joint_offsets_place_the_fingertip_where_the_denavit_hartenberg_table_does():
    offsets = {
        f"finger.joints.{name}.link.offset": d for name, d in zip(JOINTS, (4e-3, -7e-3, 2e-3, 9e-3), strict=True)
    }
    finger = load_finger("ub_stand_in", offsets | {"finger.joints.medial.link.twist": 0.6})
    body, robot = build_rigid_body(finger), read_by_yourdfpy(to_urdf(finger))
    for q in np.random.default_rng(6).uniform(-2.0, 2.0, (10, 4)):
        frame = np.eye(4)
        for angle, link in zip(q, links_of(finger), strict=True):
            frame = frame @ denavit_hartenberg(angle, link)
        np.testing.assert_allclose(body.tip_position(q), frame[:3, 3], atol=1e-15)
        robot.update_cfg(q)
        np.testing.assert_allclose(robot.get_transform("fingertip", "base"), frame, atol=1e-14)


def test_a_link_with_an_offset_has_its_mass_and_its_shape_there():
    finger = load_finger("ub_stand_in", {"finger.joints.medial.link.offset": 7e-3})
    urdf = to_urdf(finger)
    model, robot = build_rigid_body(finger).model, read_by_yourdfpy(urdf)
    np.testing.assert_allclose(model.inertias[3].lever, [0.5 * 0.0299, 0.0, 7e-3], rtol=1e-12)
    shell = next(each for each in robot.robot.links if each.name == "medial_link").visuals[0]
    assert shell.origin[2, 3] == 7e-3


def test_masses_centres_and_inertias_survive_the_round_trip_in_pinocchio(finger):
    model = build_rigid_body(finger).model
    for link, inertia in zip(links_of(finger), list(model.inertias)[1:], strict=True):
        axial, transverse = link.inertia
        tensor = np.diag([axial, transverse, transverse])
        assert inertia.mass == link.mass
        np.testing.assert_allclose(inertia.lever, [link.mass_centre, 0.0, 0.0], rtol=1e-15, atol=1e-17)
        np.testing.assert_allclose(inertia.inertia, tensor, rtol=1e-14, atol=1e-22)


def test_masses_centres_and_inertias_survive_the_round_trip_in_yourdfpy(finger):
    robot = read_by_yourdfpy(to_urdf(finger))
    for name, joint in finger.joints.items():
        inertial = robot.link_map[f"{name}_link"].inertial
        axial, transverse = joint.link.inertia
        assert inertial.mass == joint.link.mass
        np.testing.assert_array_equal(inertial.origin[:3, 3], [joint.link.mass_centre, 0.0, 0.0])
        np.testing.assert_array_equal(inertial.origin[:3, :3], np.eye(3))
        np.testing.assert_array_equal(inertial.inertia, np.diag([axial, transverse, transverse]))


def test_the_published_masses_and_inertias_are_those_of_the_shipped_finger():
    rows = [(0.0050, 2.8e-7, 2.0e-7), (0.0101, 1.9e-6, 3.6e-7), (0.0060, 5.4e-7, 1.9e-7), (0.0038, 2.0e-7, 9.3e-8)]
    for inertia, row in zip(list(build_rigid_body(load_finger("ub_stand_in")).model.inertias)[1:], rows, strict=True):
        tensor = inertia.inertia
        np.testing.assert_allclose((inertia.mass, tensor[1, 1], tensor[0, 0]), row, rtol=1e-14)


def test_the_dexmart_links_have_the_density_of_the_first_finger():
    scaled, original = (links_of(load_finger(name)) for name in ("dexmart_index", "ub_stand_in"))
    for one, other in zip(scaled, original, strict=True):
        assert one.width == other.width
        assert one.mass / one.length == pytest.approx(other.mass / other.length, rel=0.002)


def test_joint_limits_are_the_ranges_of_the_description(finger):
    model, robot = build_rigid_body(finger).model, read_by_yourdfpy(to_urdf(finger))
    ranges = np.array([joint.range for joint in finger.joints.values()])
    np.testing.assert_array_equal(model.lowerPositionLimit, ranges[:, 0])
    np.testing.assert_array_equal(model.upperPositionLimit, ranges[:, 1])
    limits = [robot.joint_map[name].limit for name in finger.joints]
    np.testing.assert_array_equal([(limit.lower, limit.upper) for limit in limits], ranges)


def test_the_paper_s_finger_abducts_by_ten_degrees_and_flexes_by_ninety():
    model = build_rigid_body(load_finger("ub_stand_in")).model
    np.testing.assert_allclose(np.degrees(model.lowerPositionLimit), [-10, 0, 0, 0], rtol=1e-14)
    np.testing.assert_allclose(np.degrees(model.upperPositionLimit), [10, 90, 90, 90], rtol=1e-14)


def test_effort_limits_are_the_torques_of_a_hundred_newtons_on_each_tendon_of_the_stronger_side():
    model = build_rigid_body(load_finger("ub_stand_in")).model
    by_hand = [100 * 0.008, 100 * (0.008 + 0.008), 100 * (0.0053 + 0.0035), 100 * 0.0053]
    np.testing.assert_allclose(model.upperEffortLimit, by_hand, rtol=1e-14)
    np.testing.assert_allclose(model.upperVelocityLimit, 20.0)


def test_every_joint_turns_about_its_z_axis(finger):
    robot = read_by_yourdfpy(to_urdf(finger))
    for name in finger.joints:
        joint = robot.joint_map[name]
        assert joint.type == "revolute"
        np.testing.assert_array_equal(joint.axis, [0.0, 0.0, 1.0])


def test_gravity_of_the_description_acts_in_the_model():
    finger = load_finger("planar")
    np.testing.assert_array_equal(build_rigid_body(finger).model.gravity.linear, [0.0, -9.81, 0.0])
    np.testing.assert_array_equal(build_rigid_body(finger).model.gravity.angular, np.zeros(3))


def test_the_files_in_urdf_are_current_and_the_script_that_writes_them_says_so(monkeypatch, tmp_path, capsys):
    files = {path.name: path.read_text(encoding="utf-8") for path in (ROOT / "urdf").glob("*.urdf")}
    assert files == {f"{name}.urdf": to_urdf(load_finger(name)) for name in list_fingers()}
    assert generate_urdf.main(["--check"]) == 0
    monkeypatch.setattr(generate_urdf, "FOLDER", tmp_path)
    assert generate_urdf.main(["--check"]) == 1 and "urdf/ub.urdf is not current" in capsys.readouterr().err


def test_a_file_from_urdf_is_read_by_pinocchio_as_the_description_is():
    for name in list_fingers():
        model = pin.buildModelFromUrdf(str(ROOT / "urdf" / f"{name}.urdf"))
        model.gravity.linear[:] = load_finger(name).gravity
        assert model == build_rigid_body(load_finger(name)).model


def test_a_joint_without_a_link_is_an_error_that_names_it():
    finger = load_finger("planar")
    joints = {**finger.joints, "distal": finger.joints["distal"].updated(link=None)}
    with pytest.raises(InputError) as caught:
        to_urdf(finger.updated(joints=joints))
    assert caught.value.entry == "finger.joints.distal.link"


@pytest.mark.parametrize("name", ["fingertip", "fingertip_fixed", "universe"])
def test_a_joint_with_a_name_that_the_urdf_needs_is_an_error_that_names_it(name):
    finger = load_finger("planar")
    joints = {"proximal": finger.joints["proximal"], name: finger.joints["distal"]}
    with pytest.raises(InputError) as caught:
        to_urdf(finger.updated(joints=joints))
    assert caught.value.entry == f"finger.joints.{name}"
