"""Fig. 2: the workspace against equation (1), written out."""

import itertools

import numpy as np
import pytest
from closed_kinematics import A1, A2, A3, A4, equation_1
from paper.plot_workspace import plot_workspace
from paper.workspace_surfaces import fingertip_surface, flexion_section

from finger_pin.description.loading import load_finger
from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.views import plots


@pytest.fixture(scope="module")
def paper_surface():
    return fingertip_surface(Finger(load_finger("ub_stand_in")), samples=31)


def test_workspace_extremes_are_those_of_equation_1(paper_surface):
    length = A1 + A2 + A3 + A4
    # The least x lies on the edge theta2 = 90 deg, where theta4 = 0.7 theta3 by (4).
    t3 = np.linspace(0.0, np.pi / 2, 100_001)
    least = (A1 - A3 * np.sin(t3) - A4 * np.sin(1.7 * t3)).min()
    expected = {
        0: (least, length),
        1: (-length * np.sin(np.deg2rad(10.0)), length * np.sin(np.deg2rad(10.0))),
        2: (0.0, A2 + A3 + A4),
    }
    for axis, (low, high) in expected.items():
        assert paper_surface[..., axis].min() == pytest.approx(low, abs=5e-5)
        assert paper_surface[..., axis].max() == pytest.approx(high, abs=1e-9)


def test_workspace_surface_bounds_all_that_the_finger_reaches(paper_surface):
    section = flexion_section(Finger(load_finger("ub_stand_in"))).patches.reshape(-1, 3)
    radius = np.hypot(paper_surface[..., 0], paper_surface[..., 1]).ravel()
    height = paper_surface[..., 2].ravel()
    random = np.random.default_rng(5)
    for _ in range(100):
        t1, t2, t3 = random.uniform([-np.pi / 18, 0.0, 0.0], [np.pi / 18, np.pi / 2, np.pi / 2])
        tip = equation_1([t1, t2, t3, 0.7 * t3])
        assert np.linalg.norm(section - equation_1([0.0, t2, t3, 0.7 * t3]), axis=1).min() < 1.5e-3
        assert abs(np.arctan(tip[1] / tip[0])) <= np.deg2rad(10.0) + 1e-12
        assert np.hypot(tip[0], tip[1]) <= radius.max() and tip[2] <= height.max()


def test_the_section_lies_in_the_flexion_plane_and_obeys_equation_4():
    section = flexion_section(Finger(load_finger("ub_stand_in")), samples=11)
    assert section.plane == (0, 2)
    assert section.patches.shape == (1, 11, 11, 3)
    angles = np.linspace(0.0, np.pi / 2, 11)
    for (i, t2), (j, t3) in itertools.product(enumerate(angles), enumerate(angles)):
        np.testing.assert_allclose(section.patches[0, i, j], equation_1([0.0, t2, t3, 0.7 * t3]), atol=1e-12)
    joints = [[0.0, 0.0, 0.0], [A1, 0.0, 0.0], [A1 + A2, 0.0, 0.0], [A1 + A2 + A3, 0.0, 0.0], equation_1(np.zeros(4))]
    np.testing.assert_allclose(section.poses[0], joints, atol=1e-12)


def test_a_driven_joint_that_would_leave_its_range_bounds_the_workspace():
    finger = Finger(load_finger("ub_stand_in", {"finger.joints.distal.range": [0.0, 0.35]}))
    section = flexion_section(finger, samples=61)
    flexed = np.linspace(0.0, np.pi / 2, 61)
    outside = np.isnan(section.patches[0, ..., 0]).all(axis=0)
    np.testing.assert_array_equal(outside, 0.7 * flexed > 0.35 + 1e-9)


def test_the_workspace_of_a_planar_finger_lies_in_its_plane():
    finger = Finger(load_finger("planar"))
    section = flexion_section(finger, samples=21)
    assert section.plane == (0, 1)
    l1, l2 = (joint.link.length for joint in finger.description.joints.values())
    tips = section.patches.reshape(-1, 3)
    np.testing.assert_allclose(tips.max(axis=0), [l1 + l2, l1 + l2, 0.0], atol=1e-12)
    np.testing.assert_allclose(tips.min(axis=0), [-l2, 0.0, 0.0], atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ub_stand_in", "planar"])
def test_fig2_prints_ranges_in_centimetres_and_accepts_finger_and_description(name, tmp_path):
    description = load_finger(name)
    for finger in (Finger(description), description):
        figure = plot_workspace(finger)
        space, plane = figure.axes
        labels = [space.get_xlabel(), space.get_ylabel(), space.get_zlabel(), plane.get_xlabel(), plane.get_ylabel()]
        assert all(label.endswith("(cm)") for label in labels)
        texts = [" ".join(axes.get_title(loc="left").split()) for axes in (space, plane)]
        assert all("cm" in text for text in texts)
        assert ("(4) imposed" in texts[0]) == ("driven joints at 0" in texts[1]) == (name == "ub_stand_in")
    if name == "ub_stand_in":
        assert "x: \N{MINUS SIGN}2.7 to 11.7 cm, y: \N{MINUS SIGN}2.0 to 2.0 cm, z: 0.0 to 9.7 cm" in texts[0]
        # theta4 = 0: the least x is that of the flexed finger, a1 - a3 - a4.
        assert f"x: \N{MINUS SIGN}{1e2 * (A3 + A4 - A1):.1f} to 11.7 cm" in texts[1]
    plots.save_figure(figure, tmp_path / "fig2.png")


def test_fig2_needs_links(network):
    with pytest.raises(InputError):
        plot_workspace(network(("one",), {"T1": {"one": 5.0}, "T2": {"one": -5.0}}))
