"""Tendon paths against the routing table as it is printed, and against kinematics worked out here by hand."""

import itertools

import numpy as np
import pytest
from closed_kinematics import LENGTHS, frames

import finger_pin as fp
from finger_pin.mechanism.geometry import TendonGeometry, tendon_paths

# (3) as the model document prints it: radius in mm by tendon and joint.
PAPER_RADII = {
    "T1": (8.0, 8.0, 0.0, 0.0),
    "T2": (-8.0, 8.0, 0.0, 0.0),
    "T3": (0.0, 0.0, 6.3, 0.0),
    "T4": (0.0, -5.3, -5.3, -5.3),
    "T5": (0.0, 0.0, -3.5, 5.0),
}
PLANAR_RADII = {"flexor_proximal": (6.0, 0.0), "flexor_distal": (2.0, 5.5), "extensor": (-8.0, -5.5)}
POSES = np.radians([[0.0, 0.0, 0.0, 0.0], [8.0, 35.0, 20.0, 50.0], [-9.0, 85.0, 60.0, 5.0], [3.0, 10.0, 88.0, 88.0]])


@pytest.fixture(scope="module")
def finger():
    return TendonGeometry(fp.load_finger("ub_stand_in"))


def lengths(geometry, q):
    return np.array([np.linalg.norm(np.diff(path.points, axis=-2), axis=-1).sum(axis=-1) for path in geometry.paths(q)])


def radial_distance(points, frame):
    """Distance of points from the axis of a joint."""
    rotation, origin = frame
    return np.linalg.norm(((points - origin) @ rotation)[:, :2], axis=1)


@pytest.mark.parametrize(("name", "radii"), [("ub_stand_in", PAPER_RADII), ("planar", PLANAR_RADII)])
@pytest.mark.parametrize("part", [0.1, 0.5, 0.9])
def test_turning_a_joint_shortens_every_path_by_its_winding_radius(name, radii, part):
    description = fp.load_finger(name)
    geometry, step = TendonGeometry(description, resolution=60), 1e-4
    q = np.array([low + part * (high - low) for low, high in (joint.range for joint in description.joints.values())])
    for joint, unit in enumerate(np.eye(len(q))):
        slope = (lengths(geometry, q + step * unit) - lengths(geometry, q - step * unit)) / (2 * step)
        expected = [-1e-3 * radii[tendon][joint] for tendon in description.tendons]
        assert slope == pytest.approx(expected, abs=2e-5)


@pytest.mark.parametrize("q", POSES)
def test_a_path_touches_each_of_its_pulleys_and_cuts_into_none(finger, q):
    for path in finger.paths(q):
        crossed = [j for j, r in enumerate(PAPER_RADII[path.name]) if r or (path.name in "T3 T4" and j < 2)]
        for joint in crossed:
            nearest = radial_distance(path.points, frames(q)[joint]).min()
            assert nearest == pytest.approx(1e-3 * abs(PAPER_RADII[path.name][joint]), abs=1e-9)


def test_positive_radii_lie_on_the_side_to_which_the_joint_turns():
    geometry = TendonGeometry(fp.load_finger("ub_stand_in"))
    paths = {path.name: path.points for path in geometry.paths(np.zeros(4))}
    medial = sum(LENGTHS[:2])
    at = {name: points[np.argmin(np.abs(points[:, 0] - medial))] for name, points in paths.items()}
    assert at["T3"][2] == pytest.approx(6.3e-3, abs=1e-4)
    assert at["T4"][2] == pytest.approx(-5.3e-3, abs=1e-4)
    start = {name: points[np.argmin(np.abs(points[:, 0]))] for name, points in paths.items()}
    assert start["T1"][1] == pytest.approx(8e-3, abs=1e-3)
    assert start["T2"][1] == pytest.approx(-8e-3, abs=1e-3)


def test_the_passive_tendon_crosses_between_its_pulleys_on_their_inner_tangent(finger):
    # Of two circles of 3.5 and 5.0 mm on opposite sides, 29.9 mm apart: sin(angle) = (3.5 + 5.0) / 29.9.
    points = {path.name: path.points for path in finger.paths(np.zeros(4))}["T5"]
    rotation, origin = frames(np.zeros(4))[2]
    local = (points - origin) @ rotation
    inside = local[(local[:, 0] > 0.004) & (local[:, 0] < 0.026)]
    slope = np.diff(inside[:, 1]) / np.diff(inside[:, 0])
    assert np.degrees(np.arctan(slope)) == pytest.approx(np.degrees(np.arcsin(8.5 / 29.9)), abs=1e-6)


@pytest.mark.parametrize(("tendon", "end", "link"), [("T1", -1, 1), ("T3", -1, 2), ("T4", -1, 3), ("T5", 0, 1)])
def test_tendons_end_on_the_last_link_they_cross_and_the_passive_one_begins_on_the_proximal_link(
    finger, tendon, end, link
):
    local = []
    for q in POSES:
        rotation, origin = frames(q)[link]
        point = {path.name: path.points for path in finger.paths(q)}[tendon][end]
        local.append((point - origin) @ rotation)
    assert np.ptp(local, axis=0) == pytest.approx(np.zeros(3), abs=1e-12)


def test_actuated_tendons_begin_at_rest_behind_the_base(finger):
    starts = np.array([[path.points[0] for path in finger.paths(q)[:4]] for q in POSES])
    assert np.ptp(starts, axis=0) == pytest.approx(np.zeros((4, 3)), abs=1e-12)
    assert (starts[..., 0] < -0.03).all()


@pytest.mark.parametrize("q", POSES)
def test_tendons_do_not_run_into_each_other(finger, q):
    for one, other in itertools.combinations(finger.paths(q), 2):
        gaps = np.linalg.norm(one.points[:, None] - other.points[None], axis=-1)
        assert gaps.min() > 0.9e-3, (one.name, other.name)


def test_half_of_the_passive_tendon_lies_beyond_its_mass_and_none_of_the_others(finger):
    flags = {path.name: path.distal for path in finger.paths(np.zeros(4))}
    assert not any(flags[name].any() for name in ("T1", "T2", "T3", "T4"))
    # It changes once, on the medial link, which lies between its two crossings.
    change = np.flatnonzero(np.diff(flags["T5"].astype(int)))
    points = {path.name: path.points for path in finger.paths(np.zeros(4))}["T5"]
    assert len(change) == 1
    assert sum(LENGTHS[:2]) < points[change[0], 0] < sum(LENGTHS[:3])


def test_a_slack_tendon_hangs_below_its_taut_path_and_keeps_its_ends():
    description = fp.load_finger("ub_stand_in")
    q = np.radians([0.0, 10.0, 10.0, 10.0])
    taut = tendon_paths(description, q)
    slack = tendon_paths(description, q, np.array([0.0, 0.0, 1.0, 0.0, 0.0]))
    for before, after in zip(taut, slack, strict=True):
        moved = after.points - before.points
        if before.name != "T3":
            assert not moved.any()
            continue
        assert moved[[0, -1]] == pytest.approx(np.zeros((2, 3)), abs=1e-12)
        assert moved[:, 2].min() < -4e-3


def test_paths_keep_the_leading_dimensions_of_the_joint_position(finger):
    many = finger.paths(np.stack([POSES, POSES[::-1]]))
    one = finger.paths(POSES[1])
    for path, single in zip(many, one, strict=True):
        assert path.points.shape[:2] == (2, 4)
        assert path.points[1, 2] == pytest.approx(single.points, abs=1e-15)


def test_a_joint_position_of_another_size_is_refused(finger):
    with pytest.raises(fp.InputError, match="4 joints"):
        finger.paths(np.zeros(3))
