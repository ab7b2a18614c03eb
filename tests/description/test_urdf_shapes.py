"""The shapes of the generated URDF: every link has some, they stay at their link, and readers agree on them."""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from urdf_cases import FINGERS, links_of, read_by_pinocchio
from validation.kinematics import read_by_yourdfpy

from finger_pin.description.loading import load_finger
from finger_pin.description.tree_parts import MATERIALS
from finger_pin.mechanism.urdf import to_urdf

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(params=FINGERS.values(), ids=FINGERS.keys())
def finger(request):
    return load_finger(*request.param)


def test_the_urdf_refers_to_no_file(finger):
    root = ET.fromstring(to_urdf(finger))
    assert not list(root.iter("mesh"))
    assert not [element for element in root.iter() if "filename" in element.attrib]


def test_every_link_is_drawn_and_those_that_touch_in_a_run_touch_as_the_same_capsules(finger):
    """A capsule is as wide as its link and goes from joint to joint; the last one's round end is the pad."""
    robot = read_by_yourdfpy(to_urdf(finger))
    assert set(robot.link_map) == {"base", "fingertip", *(f"{name}_link" for name in finger.joints)}
    assert all(link.visuals for link in robot.link_map.values())
    assert not robot.link_map["base"].collisions and not robot.link_map["fingertip"].collisions
    *_, last = finger.joints
    for name, joint in finger.joints.items():
        barrel, *ends = robot.link_map[f"{name}_link"].collisions
        radius, length = 0.5 * joint.link.width, joint.link.length
        length = max(length - radius, 0.0) if name == last else length
        assert barrel.geometry.cylinder.radius == radius and barrel.geometry.cylinder.length == length
        assert [end.geometry.sphere.radius for end in ends] == [radius, radius]
        centres = [end.origin[:3, 3] for end in ends]
        np.testing.assert_allclose(centres, [[0.0] * 3, [length, 0.0, 0.0]], atol=1e-15)


def test_pinocchio_reads_every_shape_of_the_urdf(finger):
    urdf = to_urdf(finger)
    root = ET.fromstring(urdf)
    for kind, tag in ((pin.GeometryType.VISUAL, "visual"), (pin.GeometryType.COLLISION, "collision")):
        assert read_by_pinocchio(urdf, kind).ngeoms == len(list(root.iter(tag)))


def test_every_material_is_defined_once_and_every_visual_uses_one_of_them(finger):
    root = ET.fromstring(to_urdf(finger))
    assert [material.get("name") for material in root.findall("material")] == list(MATERIALS)
    used = [visual.find("material") for visual in root.iter("visual")]
    assert {material.get("name") for material in used} == set(MATERIALS)
    assert not [material for material in used if len(material)]


def bounds(geometry, placement):
    """Axis-aligned box around a shape, in the frame that it is placed in, by yourdfpy's numbers."""
    if geometry.box is not None:
        half = 0.5 * np.abs(placement[:3, :3]) @ geometry.box.size
    elif geometry.cylinder is not None:
        axis = placement[:3, 2]
        radius, length = geometry.cylinder.radius, geometry.cylinder.length
        half = 0.5 * length * np.abs(axis) + radius * np.sqrt(np.clip(1.0 - axis**2, 0.0, None))
    else:
        half = np.full(3, geometry.sphere.radius)
    return placement[:3, 3] - half, placement[:3, 3] + half


def test_shapes_stay_within_half_a_width_of_their_link(finger):
    robot = read_by_yourdfpy(to_urdf(finger))
    for name, joint in finger.joints.items():
        link = robot.link_map[f"{name}_link"]
        length, width = joint.link.length, joint.link.width
        for shape in link.visuals:
            low, high = bounds(shape.geometry, shape.origin)
            assert np.all(low >= [-0.5 * width - 1e-12, -0.51 * width, -0.56 * width])
            assert np.all(high <= [length + 1e-12, 0.51 * width, 0.56 * width])


def test_a_phalanx_lies_along_x_between_its_joints_and_covers_most_of_the_link(finger):
    robot = read_by_yourdfpy(to_urdf(finger))
    for name, joint in finger.joints.items():
        link = robot.link_map[f"{name}_link"]
        shell = link.visuals[0]
        low, high = bounds(shell.geometry, shell.origin)
        assert (shell.geometry.box is not None) == (joint.link.section == "square")
        assert 0.0 < low[0] < high[0] < joint.link.length
        assert high[0] - low[0] >= 0.19 * joint.link.length
        np.testing.assert_allclose(high[1:] - low[1:], joint.link.width, rtol=1e-12)


def test_the_pad_ends_at_the_fingertip(finger):
    link = read_by_yourdfpy(to_urdf(finger)).link_map["fingertip"]
    for shape in link.visuals:
        _, high = bounds(shape.geometry, shape.origin)
        assert shape.geometry.sphere is not None
        assert high[0] == 0.0


def test_the_palm_lies_behind_the_first_phalanx(finger):
    link = read_by_yourdfpy(to_urdf(finger)).link_map["base"]
    width = links_of(finger)[0].width
    for shape in link.visuals:
        low, high = bounds(shape.geometry, shape.origin)
        assert low[0] < 0.0
        assert high[0] < 0.5 * width


def pulley_radius(urdf, joint):
    """Largest radius of the cylinders drawn around a joint axis, m."""
    visuals = read_by_yourdfpy(urdf).link_map[f"{joint}_link"].visuals
    around_axis = [visual.geometry.cylinder for visual in visuals if visual.origin[0, 3] == 0.0]
    return max(cylinder.radius for cylinder in around_axis)


def test_a_pulley_has_the_largest_winding_radius_of_its_joint():
    urdf = to_urdf(load_finger("ub_stand_in"))
    largest = [pulley_radius(urdf, name) for name in ("abduction", "proximal", "medial", "distal")]
    assert largest == [0.008, 0.008, 0.0063, 0.0053]


def test_a_pulley_never_sticks_out_of_the_finger_nor_vanishes_in_it():
    for given, drawn in ((0.1, 0.5 * 0.014), (1e-5, 0.3 * 0.014)):
        radii = {f"finger.tendons.{tendon}.crossings.distal.radius": given for tendon in ("T4", "T5")}
        assert pulley_radius(to_urdf(load_finger("ub_stand_in", radii)), "distal") == pytest.approx(drawn)
