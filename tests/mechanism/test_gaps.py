"""Gaps against coal where it is exact, else against an optimiser; their slopes against differences."""

import coal
import numpy as np
import pytest
from gap_cases import coal_distance, coal_shape, gaps, random_pairs
from scipy.optimize import minimize_scalar

SHAPES = ("half_space", "sphere", "box", "cylinder", "capsule")
#: coal's distances of these are iterated to about 1e-6 m.
ITERATED = ("box", "cylinder")
PAIRS = [(shape, long) for shape in SHAPES for long in (0.0, 1.0) if (shape, long) != ("half_space", 1.0)]


def random_placement(rng):
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return coal.Transform3s(rotation * np.sign(np.linalg.det(rotation)), 0.1 * rng.normal(size=3))


def moves(long):
    """Return by what y may move: the ends of a capsule one by one, those of a sphere together."""
    return np.eye(6) if long else np.tile(np.eye(3), 2)


@pytest.mark.parametrize(("shape", "long"), PAIRS)
def test_distances_are_those_of_coal_on_ten_thousand_random_pairs(shape, long):
    """About 1100 of each kind; of a sphere whose centre is in a cylinder, and a segment in a box, coal has no truth."""
    rng = np.random.default_rng(3)
    y, p, sizes = random_pairs(rng, shape, 1120, long)
    found = gaps(y, p)[0]
    place = random_placement(rng)
    pairs = zip(sizes, y, p[:, 0], strict=True)
    expected = np.array([coal_distance(shape, size, ends, radius, place) for size, ends, radius in pairs])
    if (shape in ITERATED and long) or shape == "cylinder":
        outside = expected + p[:, 0] > 1e-6
        found, expected = found[outside], expected[outside]
    tolerance = 2e-6 if shape in ITERATED and long else 1e-12
    assert found[:, 0] == pytest.approx(expected, abs=tolerance)
    assert np.count_nonzero(found[:, 0] < 0.0) > 15 and np.count_nonzero(found[:, 0] > 0.0) > 400


@pytest.mark.parametrize("shape", ITERATED)
def test_where_coal_iterates_a_capsule_is_as_far_as_the_nearest_of_its_spheres(shape):
    rng = np.random.default_rng(4)
    y, p, sizes = random_pairs(rng, shape, 150, 1.0)
    found, here = gaps(y, p)[0], coal.Transform3s()
    request, ball = coal.DistanceRequest(), coal.Sphere(1e-3)
    for ends, numbers, size, distance in zip(y, p, sizes, found[:, 0], strict=True):
        solid = coal_shape(shape, size)

        def far(t, ends=ends, solid=solid):
            place = coal.Transform3s(np.eye(3), (1.0 - t) * ends[:3] + t * ends[3:])
            return coal.distance(ball, place, solid, here, request, coal.DistanceResult()) + 1e-3

        # The distance falls, then rises along the segment; a parabola through three points is exact enough at 1e-7.
        inner = minimize_scalar(far, bounds=(0.0, 1.0), method="bounded", options={"xatol": 1e-8}).fun
        least = min(inner, far(0.0), far(1.0))
        if least > 1e-6:
            assert distance + numbers[0] == pytest.approx(least, abs=1e-9)


def test_a_centre_in_a_cylinder_is_as_deep_as_its_nearest_face():
    rng = np.random.default_rng(7)
    y, p, sizes = random_pairs(rng, "cylinder", 4000, 0.0)
    depth = np.minimum(sizes[:, 0] - np.hypot(y[:, 0], y[:, 1]), sizes[:, 1] / 2.0 - np.abs(y[:, 2]))
    inside = depth > 0.0
    assert gaps(y, p)[0][inside, 0] == pytest.approx(-depth[inside] - p[inside, 0], abs=1e-15)
    assert inside.sum() > 50


@pytest.mark.parametrize(("shape", "long"), PAIRS)
def test_the_normal_is_the_way_out_and_the_point_lies_midway_between_the_surfaces(shape, long):
    """A moved by the distance against the normal touches; a tiny sphere at the point is half the distance off."""
    rng = np.random.default_rng(5)
    y, p, _ = random_pairs(rng, shape, 2000, long)
    found = gaps(y, p)[0]
    outside = found[:, 0] + p[:, 0] > 1e-6
    y, p, found = y[outside], p[outside], found[outside]
    distance, normal, point = found[:, 0], found[:, 1:4], found[:, 4:7]
    assert np.linalg.norm(normal, axis=1) == pytest.approx(1.0, abs=1e-12)
    moved = gaps(y - np.tile(distance[:, None] * normal, 2), p)[0][:, 0]
    assert moved == pytest.approx(0.0, abs=1e-9)
    tiny = np.hstack([np.zeros((len(p), 1)), p[:, 1:]])
    outer = distance > 1e-6
    assert gaps(np.tile(point, 2), tiny)[0][outer, 0] == pytest.approx(distance[outer] / 2.0, abs=1e-9)
    frame = found[:, 1:13].reshape(-1, 4, 3)[:, [2, 3, 0]]
    # Tangents lose digits next to the one direction where they jump.
    assert np.abs(np.einsum("kri,ksi->krs", frame, frame) - np.eye(3)).max() < 1e-9
    assert np.linalg.det(frame) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(("shape", "long"), PAIRS)
def test_slopes_are_differences_wherever_these_agree_on_both_sides(shape, long):
    rng = np.random.default_rng(6)
    y, p, _ = random_pairs(rng, shape, 2000, long)
    found, slopes, by_distance = gaps(y, p)
    slopes = np.concatenate([by_distance[:, None], slopes], axis=1)
    step = 1e-7
    for unit in moves(long):
        ahead, behind = gaps(y + step * unit, p)[0], gaps(y - step * unit, p)[0]
        right, left = (ahead - found) / step, (found - behind) / step
        scale = 1.0 + np.abs(right).max(axis=1) + np.abs(left).max(axis=1)
        smooth = np.abs(right - left).max(axis=1) < 1e-4 * scale
        expected = (ahead - behind)[smooth] / (2.0 * step)
        error = np.abs((slopes @ unit)[smooth] - expected).max(axis=1) / scale[smooth]
        assert smooth.mean() > 0.9 and error.max() < 3e-5


def test_slopes_hold_at_the_poles_where_an_offset_has_zero_components():
    """Spheres over the middle of a sphere's, a capsule's and a cylinder's top, and beside a capsule's waist."""
    cases = [
        ((0.0, 0.0, 0.0, 0.0, 0.0, 0.01), (0.0, 0.0, 0.02)),
        ((0.0, 0.0, 0.0, -0.01, 0.01, 0.01), (0.0, 0.0, 0.03)),
        ((0.0, 0.0, 0.01, -0.01, 0.01, 0.0), (0.0, 0.0, 0.03)),
        ((0.0, 0.0, 0.0, -0.01, 0.01, 0.01), (0.02, 0.0, 0.0)),
    ]
    y = np.array([[*centre, *centre] for _, centre in cases])
    p = np.array([[0.005, *numbers] for numbers, _ in cases])
    found, slopes, by_distance = gaps(y, p)
    for unit in moves(0.0):
        step = 1e-6 * unit
        expected = (gaps(y + step, p)[0] - gaps(y - step, p)[0]) / 2e-6
        assert slopes @ unit == pytest.approx(expected[:, 1:], abs=1e-6)
        assert by_distance @ unit == pytest.approx(expected[:, 0], abs=1e-6)
    assert found[:, 0] == pytest.approx([0.005, 0.005, 0.015, 0.005], abs=1e-15)


def test_a_capsule_along_a_face_meets_it_at_its_middle():
    p = np.array([[0.005, 0.05, 0.05, 0.0, -0.01, 0.01, 0.0]])
    found = gaps(np.array([[-0.02, 0.0, 0.016, 0.01, 0.0, 0.016]]), p)[0][0]
    assert found[:7] == pytest.approx([0.001, 0.0, 0.0, 1.0, -0.005, 0.0, 0.0105], abs=1e-9)
