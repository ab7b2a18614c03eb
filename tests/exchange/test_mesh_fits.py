"""Primitives fitted to hulls of points: kinds, sizes and places, volumes and distances in closed form."""

import numpy as np
import pytest
from mesh_points import ball, box, ring, tapered
from scipy.spatial.transform import Rotation

from finger_pin.description.primitives import KINDS
from finger_pin.exchange.mesh_fits import FORMS, Fit, Hull, fit

EVEN = np.eye(3)


def cylinder(radius, length):
    return np.concatenate([radius * ring() + [0.0, 0.0, side * length] for side in (-0.5, 0.5)])


def capsule(radius, length):
    return tapered(radius, radius, length) - [0.0, 0.0, 0.5 * length]


#: Kind, sizes and corners; a cube and a cylinder with equal moments about all axes have no principal axes.
SOLIDS = {
    "sphere": ("sphere", (0.015,), 0.015 * ball()),
    "box": ("box", (0.02, 0.03, 0.05), box(0.02, 0.03, 0.05)),
    "cube": ("box", (0.02, 0.02, 0.02), box(0.02, 0.02, 0.02)),
    "plate": ("box", (0.02, 0.05, 0.05), box(0.02, 0.05, 0.05)),
    "capsule": ("capsule", (0.008, 0.03), capsule(0.008, 0.03)),
    "cylinder": ("cylinder", (0.01, 0.04), cylinder(0.01, 0.04)),
    "disc": ("cylinder", (0.03, 0.01), cylinder(0.03, 0.01)),
    "isotropic": ("cylinder", (0.01, 0.01 * np.sqrt(3.0)), cylinder(0.01, 0.01 * np.sqrt(3.0))),
    "ellipsoid": ("ellipsoid", (0.01, 0.015, 0.03), ball() * [0.01, 0.015, 0.03]),
    "spheroid": ("ellipsoid", (0.01, 0.01, 0.03), ball() * [0.01, 0.01, 0.03]),
}


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize("seed", range(3))
def test_a_primitive_in_any_place_is_fitted_by_its_own_kind_sizes_and_place(name, seed):
    """Corners lie on round surfaces, so that their hull is smaller by up to 1 - cos(pi / 48), 0.2 %."""
    kind, sizes, corners = SOLIDS[name]
    random = np.random.default_rng(seed)
    turn, place = Rotation.random(random_state=random), random.uniform(-0.1, 0.1, 3)
    hull = Hull.around(turn.apply(corners) + place)
    found = fit(hull)
    rough = 1e-9 if kind == "box" else 0.01
    assert found.kind == kind
    same = sorted if kind in ("box", "ellipsoid") else list
    np.testing.assert_allclose(same(found.sizes), same(sizes), rtol=rough)
    np.testing.assert_allclose(found.position, place, atol=1e-9)
    np.testing.assert_allclose(found.axes.T @ found.axes, EVEN, atol=1e-12)
    assert np.linalg.det(found.axes) > 0.0
    assert found.distance(hull) < rough * max(sizes)


@pytest.mark.parametrize("radius", [0.7, 1.0, 1.2])
def test_the_volume_between_a_cube_and_a_ball_at_its_centre_is_that_of_the_closed_form(radius):
    """Six caps of height r - 1 stick out of a cube of half side 1, apart from each other below sqrt(2)."""
    hull = Hull.around(box(2.0, 2.0, 2.0))
    height = max(radius - 1.0, 0.0)
    whole, caps = 4.0 / 3.0 * np.pi * radius**3, 6.0 * np.pi * height**2 * (3.0 * radius - height) / 3.0
    found = Fit("sphere", (radius,), np.zeros(3), EVEN).volume_between(hull)
    # Two standard deviations of twice the share of 6,000 points that are in both.
    assert abs(found - (8.0 + whole - 2.0 * (whole - caps))) < 0.025 * 8.0


VOLUMES = {
    "sphere": ((0.9,), 4.0 / 3.0 * np.pi * 0.9**3),
    "box": ((1.0, 1.2, 1.9), 1.0 * 1.2 * 1.9),
    "capsule": ((0.5, 0.9), np.pi * 0.5**2 * 0.9 + 4.0 / 3.0 * np.pi * 0.5**3),
    "cylinder": ((0.8, 1.5), np.pi * 0.8**2 * 1.5),
    "ellipsoid": ((0.5, 0.7, 0.9), 4.0 / 3.0 * np.pi * 0.5 * 0.7 * 0.9),
}


@pytest.mark.parametrize("kind", FORMS)
def test_sizes_follow_from_the_moments_of_inertia_of_a_primitive(kind):
    """The variance along x is half of I_y + I_z - I_x, of inertia per mass."""
    sizes, volume = VOLUMES[kind]
    moments = np.array(KINDS[kind].moments(sizes))
    deviations = np.sqrt(0.5 * moments.sum() - moments)
    np.testing.assert_allclose(FORMS[kind].by_moments(deviations, volume), sizes, rtol=1e-7)


@pytest.mark.parametrize("kind", FORMS)
def test_the_volume_between_a_cube_and_what_lies_in_it_is_what_the_cube_has_more(kind):
    sizes, volume = VOLUMES[kind]
    found = Fit(kind, sizes, np.zeros(3), EVEN).volume_between(Hull.around(box(2.0, 2.0, 2.0)))
    assert abs(found - (8.0 - volume)) < 0.025 * 8.0


@pytest.mark.parametrize("name", ["cube", "cylinder", "ellipsoid"])
def test_support_of_a_hull_is_the_largest_coordinate_of_its_corners_along_spread_directions_and_faces(name):
    corners = Rotation.from_rotvec([0.3, -0.5, 0.8]).apply(SOLIDS[name][2] + [0.02, -0.03, 0.05])
    hull = Hull.around(corners)
    assert len(hull.directions) == 3000 + len(hull.normals)
    np.testing.assert_allclose(hull.support, (hull.directions @ corners.T).max(axis=1), atol=1e-12)


def test_the_distance_of_a_ball_from_a_cube_is_that_of_its_corners():
    hull = Hull.around(box(2.0, 2.0, 2.0))
    assert abs(Fit("sphere", (1.0,), np.zeros(3), EVEN).distance(hull) - (np.sqrt(3.0) - 1.0)) < 2e-3
    # The nearer side is 0.5 away from the middle, the ball reaches 1.
    shifted = Fit("sphere", (2.0,), np.array([0.5, 0.0, 0.0]), EVEN)
    assert abs(shifted.distance(hull) - 1.5) < 2e-3


@pytest.mark.parametrize("name", ["sphere", "box", "capsule", "cylinder", "ellipsoid"])
def test_the_distance_of_a_primitive_from_its_own_hull_is_how_far_it_was_moved(name):
    """Of a convex body and its translation the Hausdorff distance is the length of the translation."""
    kind, sizes, corners = SOLIDS[name]
    turn, move = Rotation.from_rotvec([0.3, -0.5, 0.8]), np.array([0.003, -0.002, 0.006])
    found = Fit(kind, sizes, turn.apply([0.0, 0.0, 0.0]) + move, turn.as_matrix())
    assert abs(found.distance(Hull.around(turn.apply(corners))) - np.linalg.norm(move)) < 0.01 * max(sizes)


@pytest.mark.parametrize("name", SOLIDS)
def test_a_kind_that_is_asked_for_is_fitted_though_another_fits_better(name):
    """A capsule as well, to a ball or a disc, which leave no length to it."""
    hull = Hull.around(SOLIDS[name][2])
    for kind in FORMS:
        found = fit(hull, (kind,))
        assert found.kind == kind and min(found.sizes) > 0.0
