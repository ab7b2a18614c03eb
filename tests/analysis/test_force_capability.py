"""Fingertip forces within tension limits: by hand, by vertex enumeration, by sampling, and by duality."""

from itertools import combinations, product

import numpy as np
import pytest
import scipy.spatial

import finger_pin as fp
from finger_pin.analysis import Friction, force_polytope, largest_force, tension_for_force

POSTURE = (0.1, 0.5, 0.6, 0.42)


@pytest.fixture(scope="module")
def weightless():
    return fp.Finger(fp.load_finger("ub_stand_in", {"finger.gravity": [0.0, 0.0, 0.0]}))


@pytest.fixture(scope="module")
def polytope(finger):
    return force_polytope(finger, POSTURE, 20.0, minimum_tension=1.0)


def test_planar_finger_exerts_the_hexagon_that_a_hand_calculation_gives():
    """J^-T maps the hexagon of torques {H^T f, 0 <= f <= 10 N}: the sum of three segments along the rows of H_c."""
    finger = fp.Finger(fp.load_finger("planar", {"finger.gravity": [0.0, 0.0, 0.0]}))
    q1, q2, l1, l2 = 0.4, 0.9, 0.045, 0.032
    jacobian = np.array(
        [
            [-l1 * np.sin(q1) - l2 * np.sin(q1 + q2), -l2 * np.sin(q1 + q2)],
            [l1 * np.cos(q1) + l2 * np.cos(q1 + q2), l2 * np.cos(q1 + q2)],
        ]
    )
    rows = np.array([[6.0, 0.0], [2.0, 5.5], [-8.0, -5.5]]) * 1e-3
    corners = np.array([np.array(f) @ rows for f in product((0.0, 10.0), repeat=3)])
    # The sum of all three rows is zero, so the corners of all tensions alike lie in the middle.
    expected = np.linalg.solve(jacobian.T, corners.T).T[[i for i in range(8) if i not in (0, 7)]]
    found = force_polytope(finger, [q1, q2], 10.0)
    assert found.vertices.shape == (6, 3)
    np.testing.assert_allclose(found.vertices[:, 2], 0.0, atol=1e-9)
    for corner in expected:
        assert np.linalg.norm(found.vertices[:, :2] - corner, axis=1).min() < 1e-6
    assert largest_force(finger, [q1, q2], [0, 0, 1.0], 10.0) == np.inf


def test_vertices_are_those_of_an_enumeration_of_active_bounds(finger, polytope):
    """A vertex has 4 of the 5 tensions at a bound (T5 has only one); the balance gives E and the fifth."""
    jacobian, weight = (
        finger.rigid_body.jacobian(np.array(POSTURE)),
        finger.rigid_body.gravity_torque(np.array(POSTURE)),
    )
    matrix = np.hstack([jacobian.T, -finger.coupling.T])
    low, high = np.array([1.0, 1.0, 1.0, 1.0, 0.0]), np.array([20.0, 20.0, 20.0, 20.0, np.inf])
    forces = []
    for held in combinations(range(5), 4):
        free = [*range(3), 3 + next(i for i in range(5) if i not in held)]
        for bounds in product(*[(low[i], high[i]) for i in held]):
            if np.isinf(bounds).any():
                continue
            right = -weight - matrix[:, [3 + i for i in held]] @ np.array(bounds)
            solved = np.linalg.solve(matrix[:, free], right)
            if low[free[-1] - 3] - 1e-9 <= solved[3] <= high[free[-1] - 3] + 1e-9:
                forces.append(solved[:3])
    draw = np.random.default_rng(3)
    for direction in draw.normal(size=(200, 3)):
        assert polytope.support(direction) == pytest.approx(np.max(np.array(forces) @ direction), rel=1e-6)
    for vertex in polytope.vertices:
        assert np.linalg.norm(np.array(forces) - vertex, axis=1).min() < 1e-5


def test_forces_of_random_feasible_tensions_lie_inside(finger, polytope):
    jacobian, weight = (
        finger.rigid_body.jacobian(np.array(POSTURE)),
        finger.rigid_body.gravity_torque(np.array(POSTURE)),
    )
    draw, inside = np.random.default_rng(5), 0
    matrix = np.hstack([jacobian.T, -finger.coupling.T[:, 4:]])
    for command in draw.uniform(1.0, 20.0, (300, 4)):
        *force, passive = np.linalg.solve(matrix, finger.coupling.T[:, :4] @ command - weight)
        if passive >= 0.0:
            assert polytope.contains(force)
            inside += 1
    assert inside > 100


@pytest.mark.slow
@pytest.mark.parametrize("friction", [Friction.NONE, Friction.HELPING])
def test_largest_force_lies_on_the_boundary(finger, friction):
    found = force_polytope(finger, POSTURE, 20.0, friction=friction)
    draw = np.random.default_rng(6)
    for direction in draw.normal(size=(20, 3)):
        direction /= np.linalg.norm(direction)
        reach = largest_force(finger, POSTURE, direction, 20.0, friction=friction)
        assert np.max(found.normals @ (reach * direction) - found.offsets) == pytest.approx(0.0, abs=1e-5)


def test_friction_helps_to_hold_and_hinders_to_push(weightless):
    draw = np.random.default_rng(7)
    for direction in draw.normal(size=(10, 3)):
        hold, ideal, push = (
            largest_force(weightless, POSTURE, direction, 20.0, friction=friction)
            for friction in (Friction.HELPING, Friction.NONE, Friction.HINDERING)
        )
        assert hold > 1.02 * ideal > 1.04 * push > 0.0


@pytest.mark.parametrize("friction", list(Friction))
def test_needed_tension_and_largest_force_are_inverse_to_each_other(finger, friction):
    for direction in np.random.default_rng(8).normal(size=(10, 3)):
        direction /= np.linalg.norm(direction)
        reach = largest_force(finger, POSTURE, direction, 20.0, minimum_tension=0.5, friction=friction)
        needed = tension_for_force(finger, POSTURE, reach * direction, minimum_tension=0.5, friction=friction)
        assert needed.largest == pytest.approx(20.0, rel=1e-6)
        assert needed.command.min() >= 0.5 - 1e-9


@pytest.mark.parametrize("friction", list(Friction))
def test_required_tensions_balance_the_finger_as_the_model_has_it(finger, friction):
    force = np.array([0.3, 0.2, 0.8])
    needed = tension_for_force(finger, POSTURE, force, friction=friction)
    theta = np.array(POSTURE)
    demand = finger.rigid_body.jacobian(theta).T @ force + finger.rigid_body.gravity_torque(theta)
    gap = finger.routing.strand_coupling.T @ needed.strands - demand
    reaction = finger.joint_friction.kinetic * (finger.routing.loads @ needed.strands + np.linalg.norm(force))
    assert np.all(np.abs(gap) <= (0.0 if friction is Friction.NONE else 1.0) * reaction + 1e-9)
    if friction is Friction.HINDERING:
        np.testing.assert_allclose(gap, np.sign(demand) * reaction, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("friction", list(Friction))
def test_sensitivity_to_radii_is_that_of_differences(ub, finger, friction):
    force, step = [0.3, 0.2, 0.8], 1e-7
    exact = tension_for_force(finger, POSTURE, force, friction=friction).by_radius
    for row, (name, tendon) in enumerate(ub.tendons.items()):
        for joint, crossing in tendon.crossings.items():
            ends = []
            for sign in (1.0, -1.0):
                key = f"finger.tendons.{name}.crossings.{joint}.radius"
                other = fp.Finger(fp.load_finger("ub_stand_in", {key: crossing.radius + sign * step}))
                ends.append(tension_for_force(other, POSTURE, force, friction=friction).largest)
            slope = (ends[0] - ends[1]) / (2.0 * step)
            assert exact[row, list(ub.joints).index(joint)] == (
                pytest.approx(slope, rel=1e-3, abs=1e-3 * np.abs(exact).max())
            )


def test_straight_finger_has_no_force_along_itself_in_its_set(finger):
    found = force_polytope(finger, [0.0] * 4, 20.0)
    assert found.basis.shape == (3, 2)
    np.testing.assert_allclose(found.basis[0], 0.0, atol=1e-9)
    assert largest_force(finger, [0.0] * 4, [1.0, 0, 0], 20.0) == np.inf


def test_triangles_of_the_surface_enclose_the_volume_of_the_hull_and_its_ridges_are_those_of_a_polyhedron(polytope):
    """Divergence theorem: the sum of signed volumes over outward triangles; and Euler's V - E + F = 2."""
    corners = polytope.vertices[polytope.triangles()]
    volume = np.sum(np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))) / 6.0
    assert volume == pytest.approx(scipy.spatial.ConvexHull(polytope.vertices).volume, rel=1e-9)
    planes = np.unique(np.column_stack([polytope.normals, polytope.offsets]).round(5), axis=0)
    assert len(polytope.vertices) - len(polytope.ridges()) + len(planes) == 2


def test_a_flat_set_is_covered_once_and_outlined():
    """The planar finger's hexagon: four triangles, six sides; its area by the shoelace formula."""
    found = force_polytope(fp.Finger(fp.load_finger("planar")), [0.4, 0.9], 10.0)
    corners = found.vertices[found.triangles()]
    areas = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    assert len(areas) == 4 and len(found.ridges()) == 6
    assert abs(areas.sum()) == pytest.approx(np.abs(areas).sum())
    assert abs(areas.sum()) == pytest.approx(scipy.spatial.ConvexHull(found.vertices[:, :2]).volume, rel=1e-9)


@pytest.mark.parametrize("joint", [1, 2, 3])
def test_a_push_at_a_joint_s_axis_is_no_stronger_than_those_that_pass_it_on_either_side(finger, joint):
    """There the joint may slip either way, so that the push must do with the worse one."""
    theta = np.array([0.0, 0.5, 0.6, 0.42])
    lever = finger.rigid_body.jacobian(theta)[:, joint]
    for side in (1.0, -1.0):
        towards = side * np.array([-lever[2], 0.0, lever[0]]) / np.linalg.norm(lever)
        at, *beside = (
            largest_force(finger, theta, towards + 0.01 * shift * lever / np.linalg.norm(lever), 20.0,
                          friction=Friction.HINDERING)
            for shift in (0.0, 1.0, -1.0)
        )  # fmt: skip
        assert at == pytest.approx(min(beside), rel=0.05)


def test_wrong_arguments_are_named(finger):
    with pytest.raises(fp.InputError, match="maximum_tension"):
        force_polytope(finger, POSTURE, 1.0, minimum_tension=2.0)
    with pytest.raises(fp.InputError, match="friction"):
        force_polytope(finger, POSTURE, 10.0, friction=Friction.HINDERING)
    with pytest.raises(fp.InputError, match="position"):
        tension_for_force(finger, [0.0], [0, 0, 1])
    with pytest.raises(fp.InputError, match="direction"):
        largest_force(finger, POSTURE, [0, 0, 0], 10.0)
