"""Gaps against coal where it is exact, else against an optimiser; their slopes against differences."""

import coal
import numpy as np
import pytest
from gap_cases import EPSILON, PARTS, coal_distance, coal_shape, gaps, random_pairs, twists
from scipy.optimize import minimize_scalar

from finger_pin.mechanism.gaps import prism_parameters

pytestmark = pytest.mark.slow

SHAPES = ("half_space", "sphere", "box", "cylinder", "capsule")
#: coal's distances of these are iterated to about 1e-6 m.
ITERATED = ("box", "cylinder")
PAIRS = [(shape, part) for shape in SHAPES for part in PARTS if (shape, part) != ("half_space", "segment")]
PAIRS += [("ellipsoid", "ellipsoid")]


def fillet_of(shape, part):
    rounded = {"disc": 5e-4, "cylinder": 5e-4, "ellipsoid": 2e-3}
    return rounded.get(part, 0.0) if shape in ITERATED else 0.0


def random_placement(rng):
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return coal.Transform3s(rotation * np.sign(np.linalg.det(rotation)), 0.1 * rng.normal(size=3))


def lowest(y, p):
    """Return the largest error of a distance that is too low."""
    if y.shape[1] == 9:
        return np.zeros(len(y))
    return EPSILON * (p[:, 2] * np.linalg.norm(y[:, 3:] - y[:, :3], axis=1) + 2.0 * p[:, 1])


def half_rounding(p):
    """Return the depth down to which gaps are the distances of what is rounded."""
    # Ellipsoids have no rounding; two of them are as deep as planes across the normal say.
    return 0.5 * (p[:, 0] + p[:, 9]) if p.shape[1] > 4 else np.full(len(p), np.inf)


@pytest.mark.parametrize(("shape", "part"), PAIRS)
def test_distances_are_those_of_coal_on_ten_thousand_random_pairs(shape, part):
    """400 of most kinds; of what reaches into the other body's core but for points, coal alone knows how deep it is.

    Below half of both roundings a gap may be less deep, never deeper.
    """
    rng = np.random.default_rng(3)
    fillet = fillet_of(shape, part)
    y, p, sizes = random_pairs(rng, shape, part, 1500 if part == "ellipsoid" else 400, fillet)
    found = gaps(y, p)[0][:, 0]
    place = random_placement(rng)
    expected = np.array([coal_distance(shape, *pair, place, fillet) for pair in zip(sizes, y, p, strict=True)])
    if shape != "half_space" and (part != "point" or shape == "cylinder"):
        outside = expected + p[:, 0] + fillet > 1e-6
        if part == "ellipsoid":
            outside = expected > -np.minimum(half_rounding(p), 2e-3)
        y, p, found, expected = y[outside], p[outside], found[outside], expected[outside]
    iterated = shape in ITERATED or shape == part == "ellipsoid"
    tolerance = 1e-12 if part == "point" and shape != "cylinder" else 2e-6 if iterated else 2e-9
    assert np.all(found > expected - lowest(y, p) - tolerance)
    assert np.all(found < np.maximum(expected, -half_rounding(p)) + tolerance)
    assert np.count_nonzero(found < 0.0) > 7 and np.count_nonzero(found > 0.0) > 100


@pytest.mark.parametrize("shape", ITERATED)
def test_where_coal_iterates_a_capsule_is_as_far_as_the_nearest_of_its_spheres(shape):
    rng = np.random.default_rng(4)
    y, p, sizes = random_pairs(rng, shape, "segment", 150)
    found, here = gaps(y, p)[0], coal.Transform3s()
    request, ball = coal.DistanceRequest(), coal.Sphere(1e-3)
    for ends, numbers, size, distance, low in zip(y, p, sizes, found[:, 0], lowest(y, p), strict=True):
        solid = coal_shape(shape, size)

        def far(t, ends=ends, solid=solid):
            place = coal.Transform3s(np.eye(3), (1.0 - t) * ends[:3] + t * ends[3:])
            return coal.distance(ball, place, solid, here, request, coal.DistanceResult()) + 1e-3

        # The distance falls, then rises along the segment; a parabola through three points is exact enough at 1e-7.
        inner = minimize_scalar(far, bounds=(0.0, 1.0), method="bounded", options={"xatol": 1e-8}).fun
        least = min(inner, far(0.0), far(1.0))
        if least > 0.5 * numbers[0] + 1e-6:
            assert least - low - 1e-9 < distance + numbers[0] < least + 1e-9


def test_a_centre_in_a_cylinder_is_as_deep_as_its_nearest_face_unless_the_next_one_is_near():
    """The core shrinks by r / 2 + 2 depth: beside a face that is farther than this no edge has grown round."""
    rng = np.random.default_rng(7)
    y, p, sizes = random_pairs(rng, "cylinder", "point", 8000)
    faces = np.column_stack([sizes[:, 0] - np.hypot(y[:, 0], y[:, 1]), sizes[:, 1] / 2.0 - np.abs(y[:, 2])])
    depth, next_, shrunk = faces.min(axis=1), faces.max(axis=1), 0.5 * p[:, 0] + 2.0 * faces.min(axis=1)
    inside = (depth > 0.0) & (shrunk < np.minimum(sizes[:, 0], sizes[:, 1] / 2.0))
    flat, found = inside & (shrunk < next_), gaps(y, p)[0][:, 0] + p[:, 0]
    assert found[flat] == pytest.approx(-depth[flat], abs=1e-15)
    assert np.all(found[inside] > -depth[inside] - 1e-15) and np.all(found[inside] < 0.5 * p[inside, 0])
    assert flat.sum() > 50 and (inside & ~flat).sum() > 50


@pytest.mark.parametrize(("shape", "part"), PAIRS)
def test_the_normal_is_the_way_out_and_the_point_lies_midway_between_the_surfaces(shape, part):
    """A moved by the distance against the normal touches; a tiny sphere at the point is half the distance off."""
    rng = np.random.default_rng(5)
    y, p, _ = random_pairs(rng, shape, part, 1000, fillet_of(shape, part) if part == "ellipsoid" else 0.0)
    found = gaps(y, p)[0]
    outside = found[:, 0] > 1e-4 - half_rounding(p)
    y, p, found = y[outside], p[outside], found[outside]
    distance, normal, point = found[:, 0], found[:, 1:4], found[:, 4:7]
    assert np.linalg.norm(normal, axis=1) == pytest.approx(1.0, abs=1e-12)
    moved = gaps(y - np.tile(distance[:, None] * normal, y.shape[1] // 3), p)[0][:, 0]
    assert moved == pytest.approx(0.0, abs=1e-9)
    tiny, points = np.hstack([np.zeros((len(p), 4)), p[:, 4:]]), np.tile(point, 2)
    if p.shape[1] == 4:
        tiny = np.hstack([np.full((len(p), 1), 1e-12), p[:, 1:]])
        points = np.hstack([point, point + 1e-12 * np.eye(3)[0], point + 1e-12 * np.eye(3)[1]])
    half = gaps(points, tiny)[0][:, 0] - distance / 2.0
    outer = distance > 1e-6
    assert np.all(np.abs(half[outer]) < lowest(y, p)[outer] + 1e-9)
    frame = found[:, 1:13].reshape(-1, 4, 3)[:, [2, 3, 0]]
    # Tangents lose digits next to the one direction where they jump.
    assert np.abs(np.einsum("kri,ksi->krs", frame, frame) - np.eye(3)).max() < 1e-9
    assert np.linalg.det(frame) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(("shape", "part"), PAIRS)
def test_slopes_are_differences_wherever_these_agree_on_both_sides(shape, part):
    rng = np.random.default_rng(6)
    y, p, _ = random_pairs(rng, shape, part, 1000, fillet_of(shape, part) if part == "ellipsoid" else 0.0)
    found, slopes, by_distance = gaps(y, p)
    # Where a disc pierces what is left of a core, its point is known less well than differences need.
    known = np.linalg.norm(found[:, 1:4], axis=1) > 1e-3
    y, p, found, slopes, by_distance = (each[known] for each in (y, p, found, slopes, by_distance))
    slopes = np.concatenate([by_distance[:, None], slopes], axis=1)
    step, (rate, by, *_) = 1e-8, twists(rng, y)
    ahead, behind = gaps(y + step * rate, p)[0], gaps(y - step * rate, p)[0]
    right, left = (ahead - found) / step, (found - behind) / step
    scale = 1.0 + np.abs(right).max(axis=1) + np.abs(left).max(axis=1)
    smooth = np.abs(right - left).max(axis=1) < 1e-4 * scale
    expected = (ahead - behind)[smooth] / (2.0 * step)
    error = np.abs(np.einsum("kij,kj->ki", slopes, by)[smooth] - expected).max(axis=1) / scale[smooth]
    assert smooth.mean() > 0.9 and error.max() < 1e-5


def test_a_gap_changes_by_no_more_than_the_fastest_point_of_a_part_moves():
    """What bounds of motions rest on; also where a disc lies along a face, and where it reaches into the core."""
    rng = np.random.default_rng(8)
    for shape, part in PAIRS:
        y, p, _ = random_pairs(rng, shape, part, 300)
        rate, _, turn, _ = twists(rng, y)
        farthest = np.maximum(*np.linalg.norm(rate[:, :6].reshape(-1, 2, 3), axis=2).T)
        # Of a disc: its rim moves by its radius times the speed of the axis' direction, or of a turn about it.
        spread = np.linalg.norm(rate[:, 3:6] - rate[:, :3], axis=1)
        length = np.maximum(np.linalg.norm(y[:, 3:6] - y[:, :3], axis=1), 1e-12)
        farthest += 0.03 * np.linalg.norm(turn, axis=1) if part == "ellipsoid" else p[:, 1] * spread / length
        step = 1e-6
        moved = gaps(y + step * rate, p)[0][:, 0] - gaps(y, p)[0][:, 0]
        outside = gaps(y, p)[0][:, 0] > 0.0
        assert np.all(np.abs(moved)[outside] < step * farthest[outside] * (1.0 + 1e-3) + 1e-9)


@pytest.mark.parametrize(("shape", "part"), PAIRS)
def test_a_gap_closes_as_the_material_at_its_point_moves_along_the_normal_however_deep(shape, part):
    """So a force along the normal does the work that the gap stores, and nothing else."""
    rng = np.random.default_rng(9)
    y, p, _ = random_pairs(rng, shape, part, 1000, 0.0 if part in ("point", "segment") else 5e-4)
    found, _, by_distance = gaps(y, p)
    _, rate, turn, speed = twists(rng, y)
    at_point = speed + np.cross(turn, found[:, 4:7])
    if part in ("disc", "cylinder"):
        # A turn about the axis moves no end.
        axis = y[:, 3:] - y[:, :3]
        axis /= np.linalg.norm(axis, axis=1, keepdims=True)
        spin = np.sum(turn * axis, axis=1, keepdims=True) * axis
        at_point -= np.cross(spin, found[:, 4:7] - y[:, :3])
    closing = np.sum(found[:, 1:4] * at_point, axis=1)
    assert np.sum(by_distance * rate, axis=1) == pytest.approx(closing, abs=2e-4)
    assert np.linalg.norm(found[:, 1:4], axis=1).max() < 1.0 + 1e-12
    assert np.count_nonzero(found[:, 0] < -np.minimum(half_rounding(p), 0.02)) > (-1 if shape == "half_space" else 10)


@pytest.mark.parametrize("shape", ITERATED)
def test_the_normal_of_a_rim_turns_by_degrees_as_it_sinks_past_an_edge_of_a_core(shape):
    """5 mm deep; by micrometres on a rounding that is never sharper than three quarters of half of both."""
    size = (0.03, 0.04, 0.02) if shape == "box" else (0.02, 0.02)
    p = np.array([[9e-4, 8e-3, 0.0, 0.0, *prism_parameters(shape, size, 1e-3)]])
    share = np.linspace(0.0, 1.0, 10_001)[:, None]
    centre = (1.0 - share) * [0.026, 0.004, 0.016] + share * [0.009, 0.002, 0.009]
    y = np.hstack([centre, centre + np.array([0.012, 0.003, 0.009])])
    found = gaps(y, np.repeat(p, len(y), axis=0))[0]
    turned = np.linalg.norm(np.diff(found[:, 1:4], axis=0), axis=1)
    travelled = np.linalg.norm(np.diff(centre, axis=0), axis=1)
    assert found[:, 0].max() > 0.0 and found[:, 0].min() < -4.5e-3
    assert np.ptp(found[:, 1:4], axis=0).max() > 0.1 and turned.max() < 3.0 * travelled.max() / (0.75 * 9.5e-4)


def test_slopes_hold_at_the_poles_where_an_offset_has_zero_components():
    """Spheres over the middle of a sphere's, a capsule's and a cylinder's top, and beside a capsule's waist."""
    cases = [
        ((0.0, 0.0, 0.0, 0.0, 0.0, 0.01), (0.0, 0.0, 0.02)),
        ((0.0, 0.0, 0.0, -0.01, 0.01, 0.01), (0.0, 0.0, 0.03)),
        ((0.0, 0.0, 0.01, -0.01, 0.01, 0.0), (0.0, 0.0, 0.03)),
        ((0.0, 0.0, 0.0, -0.01, 0.01, 0.01), (0.02, 0.0, 0.0)),
    ]
    y = np.array([[*centre, *centre] for _, centre in cases])
    p = np.array([[0.005, 0.0, 0.0, 0.0, *numbers] for numbers, _ in cases])
    found, slopes, by_distance = gaps(y, p)
    for unit in np.tile(np.eye(3), 2):
        step = 1e-6 * unit
        expected = (gaps(y + step, p)[0] - gaps(y - step, p)[0]) / 2e-6
        assert slopes @ unit == pytest.approx(expected[:, 1:], abs=1e-6)
        assert by_distance @ unit == pytest.approx(expected[:, 0], abs=1e-6)
    assert found[:, 0] == pytest.approx([0.005, 0.005, 0.015, 0.005], abs=1e-15)


def test_what_lies_along_a_face_meets_it_at_its_middle_and_as_it_tilts_at_its_end():
    """A capsule, and a disc that covers a box: its point lies where the box begins that is nearest to its middle."""
    p = np.array([[0.005, 0.0, 1.0, 0.0, 0.05, 0.05, 0.0, -0.01, 0.01, 0.0]])
    found = gaps(np.array([[-0.02, 0.0, 0.016, 0.01, 0.0, 0.016]]), p)[0][0]
    assert found[:7] == pytest.approx([0.001, 0.0, 0.0, 1.0, -0.005, 0.0, 0.0105], abs=1e-7)
    p = np.array([[5e-4, 0.06, 0.0, 0.0, 0.0245, 0.0245, 0.0, -0.0195, 0.0195, 5e-4]])
    middle, axis = np.array([0.003, 0.01, 0.0205]), np.array([0.0, 0.0, 0.009])
    for tilt, expected in ((0.0, (0.003, 0.01)), (1e-4, (0.003, 0.0245)), (-1e-4, (0.003, -0.0245))):
        turned = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, tilt], [0.0, -tilt, 1.0]])
        found = gaps(np.concatenate([middle, middle + turned @ axis])[None], p)[0][0]
        assert found[4:6] == pytest.approx(expected, abs=1e-6)
