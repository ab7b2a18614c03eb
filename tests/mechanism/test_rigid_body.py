"""Rigid-body dynamics against identities, finite differences and textbook closed forms."""

import numpy as np
import pinocchio as pin
import pytest
from closed_kinematics import equation_1
from scipy.integrate import solve_ivp

from finger_pin.description.loading import load_finger, load_hand
from finger_pin.exceptions import InputError
from finger_pin.mechanism.bodies import build_rigid_body
from finger_pin.mechanism.rigid_body import RigidBody

SAMPLES = 30


@pytest.fixture(params=["ub_stand_in", "planar"])
def body(request):
    return build_rigid_body(load_finger(request.param))


def states(body, count=SAMPLES):
    """Random positions, rad, velocities, rad/s, and accelerations, rad/s2."""
    generator = np.random.default_rng(7)
    size = (count, len(body.joints))
    return zip(
        generator.uniform(-np.pi, np.pi, size),
        generator.normal(0.0, 5.0, size),
        generator.normal(0.0, 50.0, size),
        strict=True,
    )


def derivative(function, x, step=1e-5):
    """Central differences of fourth order, one more axis at the end."""
    columns = []
    for direction in np.eye(len(x)) * step:
        near = function(x + direction) - function(x - direction)
        far = function(x + 2 * direction) - function(x - 2 * direction)
        columns.append((8 * near - far) / (12 * step))
    return np.stack(columns, axis=-1)


def test_mass_matrix_is_symmetric_and_positive_definite(body):
    for q, _, _ in states(body):
        mass = body.mass_matrix(q)
        np.testing.assert_array_equal(mass, mass.T)
        assert np.linalg.eigvalsh(mass).min() > 0.0


def test_mass_matrix_changes_at_the_rate_c_plus_its_transpose(body):
    for q, v, _ in states(body):
        rate = derivative(body.mass_matrix, q) @ v
        coriolis = body.coriolis_matrix(q, v)
        np.testing.assert_allclose(rate, coriolis + coriolis.T, rtol=0, atol=1e-11)


def test_rate_of_mass_matrix_minus_twice_c_is_skew_symmetric(body):
    for q, v, _ in states(body):
        skew = derivative(body.mass_matrix, q) @ v - 2.0 * body.coriolis_matrix(q, v)
        np.testing.assert_allclose(skew, -skew.T, rtol=0, atol=1e-11)


def test_inverse_dynamics_is_mass_coriolis_and_gravity(body):
    for q, v, a in states(body):
        expected = body.mass_matrix(q) @ a + body.coriolis_matrix(q, v) @ v + body.gravity_torque(q)
        np.testing.assert_allclose(body.inverse_dynamics(q, v, a), expected, rtol=1e-12, atol=1e-15)


def test_forward_dynamics_inverts_inverse_dynamics(body):
    for q, v, a in states(body):
        np.testing.assert_allclose(body.forward_dynamics(q, v, body.inverse_dynamics(q, v, a)), a, rtol=1e-9)


def test_forward_dynamics_is_newton_s_law_solved_with_the_mass_matrix(body):
    for q, v, torque in states(body):
        load = 1e-3 * torque - body.coriolis_matrix(q, v) @ v - body.gravity_torque(q)
        expected = np.linalg.solve(body.mass_matrix(q), load)
        np.testing.assert_allclose(body.forward_dynamics(q, v, 1e-3 * torque), expected, rtol=1e-9, atol=1e-9)


def test_forward_dynamics_of_a_batch_is_that_of_each_row(body):
    q, v, torque = (np.array(rows) for rows in zip(*states(body, 5), strict=True))
    rows = [body.forward_dynamics(*row) for row in zip(q, v, torque, strict=True)]
    np.testing.assert_array_equal(body.forward_dynamics(q, v, torque), rows)


def test_jacobian_is_the_derivative_of_equation_1():
    body = build_rigid_body(load_finger("ub_stand_in"))
    for q, _, _ in states(body):
        np.testing.assert_allclose(body.jacobian(q), derivative(equation_1, q, 1e-3), rtol=0, atol=1e-12)


def test_gravity_torque_is_the_gradient_of_potential_energy(body):
    still = np.zeros(len(body.joints))
    for q, _, _ in states(body):
        gradient = derivative(lambda x: body.kinematics(x, still).potential_energy, q, 1e-3)
        np.testing.assert_allclose(body.gravity_torque(q), gradient, rtol=0, atol=1e-13)


def test_gravity_holds_the_straight_finger_down():
    finger = load_finger("ub_stand_in")
    links = [joint.link for joint in finger.joints.values()]
    starts = np.concatenate([[0.0], np.cumsum([link.length for link in links])])[:-1]
    weights = 9.81 * np.array([link.mass for link in links])
    centres = starts + [link.mass_centre for link in links]
    moments = [weights[j:] @ (centres[j:] - starts[j]) for j in range(4)]
    torque = build_rigid_body(finger).gravity_torque(np.zeros(4))
    np.testing.assert_allclose(torque, [0.0, *moments[1:]], rtol=1e-12, atol=1e-17)


def test_kinetic_energy_is_half_v_m_v(body):
    for q, v, _ in states(body):
        expected = 0.5 * v @ body.mass_matrix(q) @ v
        assert body.kinematics(q, v).kinetic_energy == pytest.approx(expected, rel=1e-12)


def test_kinematics_agrees_with_the_single_queries(body):
    for q, v, _ in states(body):
        found = body.kinematics(q, v)
        np.testing.assert_allclose(found.tip, body.tip_position(q), rtol=0, atol=1e-16)
        np.testing.assert_array_equal(found.jacobian, body.jacobian(q))
        np.testing.assert_allclose(found.tip_velocity, body.jacobian(q) @ v, rtol=0, atol=1e-15)
        np.testing.assert_array_equal(found.directions, body.link_directions(q))


def test_all_tips_of_a_hand_are_those_of_its_fingers_in_their_places():
    hand, rng = load_hand("ub_hand"), np.random.default_rng(7)
    body, q = build_rigid_body(hand), rng.uniform(0.0, 1.0, (2, 3, 20))
    tips, jacobian = body.tip_position(q), body.jacobian(q[1, 2])
    assert tips.shape == (2, 3, 5, 3) and jacobian.shape == (5, 3, 20)
    for index, (name, finger) in enumerate(hand.hand.built().items()):
        placed, own = hand.hand.fingers[name], build_rigid_body(finger)
        joints = slice(4 * index, 4 * index + 4)
        expected = placed.rotation @ own.tip_position(q[1, 2, joints]) + placed.position
        np.testing.assert_allclose(tips[1, 2, index], expected, rtol=0, atol=1e-15)
        turned = np.zeros((3, 20))
        turned[:, joints] = placed.rotation @ own.jacobian(q[1, 2, joints])
        np.testing.assert_allclose(jacobian[index], turned, rtol=0, atol=1e-15)


def test_kinematics_keeps_leading_dimensions(body):
    n = len(body.joints)
    q, v, _ = (np.array(rows) for rows in zip(*states(body, 6), strict=True))
    found = body.kinematics(q.reshape(2, 3, n), v.reshape(2, 3, n))
    assert found.tip.shape == found.tip_velocity.shape == (2, 3, 3)
    assert found.jacobian.shape == (2, 3, 3, n)
    assert found.directions.shape == (2, 3, n, 3)
    assert found.kinetic_energy.shape == found.potential_energy.shape == (2, 3)
    np.testing.assert_array_equal(found.jacobian[1, 2], body.kinematics(q[5], v[5]).jacobian)


def test_results_do_not_change_when_the_model_is_used_again(body):
    (q, v, _), (other, _, _) = states(body, 2)
    found = body.kinematics(q, v)
    mass, jacobian, tip = body.mass_matrix(q), found.jacobian.copy(), found.tip.copy()
    kept = mass.copy()
    body.mass_matrix(other)
    body.kinematics(other, v)
    np.testing.assert_array_equal(mass, kept)
    np.testing.assert_array_equal(found.jacobian, jacobian)
    np.testing.assert_array_equal(found.tip, tip)


def test_a_free_swing_keeps_its_energy(body):
    n = len(body.joints)
    free = np.zeros(n)
    start = np.concatenate([np.full(n, 0.3), np.full(n, 2.0)])

    def rhs(_, x):
        return np.concatenate([x[n:], body.forward_dynamics(x[:n], x[n:], free)])

    solution = solve_ivp(rhs, (0.0, 0.5), start, method="DOP853", rtol=1e-12, atol=1e-12)
    assert solution.success
    found = body.kinematics(solution.y[:n].T, solution.y[n:].T)
    energy = found.kinetic_energy + found.potential_energy
    assert np.ptp(found.kinetic_energy) > 1e-4
    np.testing.assert_allclose(energy, energy[0], rtol=0, atol=1e-10 * np.ptp(found.kinetic_energy))


def test_link_directions_follow_the_links_of_the_paper_s_finger():
    body = build_rigid_body(load_finger("ub_stand_in"))
    for q, _, _ in states(body):
        (c1, s1), t2, t23 = (np.cos(q[0]), np.sin(q[0])), q[1], q[1] + q[2]
        expected = [
            (1.0, 0.0, 0.0),
            (c1, s1, 0.0),
            (c1 * np.cos(t2), s1 * np.cos(t2), np.sin(t2)),
            (c1 * np.cos(t23), s1 * np.cos(t23), np.sin(t23)),
        ]
        np.testing.assert_allclose(body.link_directions(q), expected, rtol=0, atol=1e-14)


def test_joints_whose_axes_meet_in_a_point_have_the_same_link_before_them():
    """A knuckle that abducts and flexes: turning it sideways does not turn the palm, along which the tendons come."""
    model = pin.Model()
    inertia = pin.Inertia(0.01, np.array([0.01, 0.0, 0.0]), 1e-6 * np.eye(3))
    along = pin.SE3(np.eye(3), np.array([0.03, 0.0, 0.0]))
    joints = [(pin.JointModelRZ(), pin.SE3.Identity()), (pin.JointModelRY(), pin.SE3.Identity())]
    joints += [(pin.JointModelRY(), along), (pin.JointModelRX(), pin.SE3.Identity())]
    for index, (kind, placement) in enumerate(joints):
        model.appendBodyToJoint(model.addJoint(index, kind, placement, f"j{index}"), inertia, pin.SE3.Identity())
    model.addFrame(pin.Frame("fingertip", 4, 0, along, pin.FrameType.OP_FRAME))
    aside, bent = 0.3, 0.5
    link = [np.cos(aside) * np.cos(bent), np.sin(aside) * np.cos(bent), -np.sin(bent)]
    found = RigidBody(model).link_directions(np.array([aside, bent, 0.7, 0.4]))
    np.testing.assert_allclose(found, [(1, 0, 0), (1, 0, 0), link, link], rtol=0, atol=1e-15)


def test_the_first_link_direction_is_the_base_axis_that_was_given():
    model = build_rigid_body(load_finger("planar")).model
    body = RigidBody(model, base_axis=(0.0, 0.0, 1.0))
    directions = body.link_directions(np.array([0.4, 0.2]))
    np.testing.assert_allclose(directions, [(0, 0, 1), (np.cos(0.4), np.sin(0.4), 0)], rtol=0, atol=1e-15)


def test_the_two_link_finger_has_the_textbook_equations_of_motion():
    # Spong, Hutchinson and Vidyasagar, Robot Modeling and Control, Sec. 7.4: planar elbow manipulator.
    finger = load_finger("planar")
    body = build_rigid_body(finger)
    first, second = (joint.link for joint in finger.joints.values())
    (m1, l1, lc1, i1), (m2, lc2, i2) = (
        (first.mass, first.length, first.mass_centre, first.inertia[1]),
        (second.mass, second.mass_centre, second.inertia[1]),
    )
    for q, v, _ in states(body):
        c2, h = np.cos(q[1]), -m2 * l1 * lc2 * np.sin(q[1])
        m12 = m2 * (lc2**2 + l1 * lc2 * c2) + i2
        m11 = m1 * lc1**2 + m2 * (l1**2 + lc2**2 + 2 * l1 * lc2 * c2) + i1 + i2
        mass = [[m11, m12], [m12, m2 * lc2**2 + i2]]
        coriolis = [[h * v[1], h * (v[0] + v[1])], [-h * v[0], 0.0]]
        g2 = 9.81 * m2 * lc2 * np.cos(q.sum())
        gravity = [9.81 * (m1 * lc1 + m2 * l1) * np.cos(q[0]) + g2, g2]
        np.testing.assert_allclose(body.mass_matrix(q), mass, rtol=1e-12)
        np.testing.assert_allclose(body.coriolis_matrix(q, v), coriolis, rtol=0, atol=1e-17)
        np.testing.assert_allclose(body.gravity_torque(q), gravity, rtol=0, atol=1e-16)


@pytest.mark.parametrize(
    "joint",
    [pin.JointModelFreeFlyer(), pin.JointModelPlanar(), pin.JointModelRUBX()],
    ids=["free-flyer", "planar", "unbounded revolute"],
)
def test_a_joint_that_the_core_does_not_know_is_an_error_that_names_it(joint):
    model = pin.Model()
    model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "hinge")
    model.addJoint(1, joint, pin.SE3.Identity(), "odd_one")
    with pytest.raises(InputError, match="only revolute, prismatic, translation and spherical joints") as caught:
        RigidBody(model, "odd_one")
    assert caught.value.entry == "joint odd_one"


def test_an_unknown_tip_frame_is_an_error_that_names_it():
    model = build_rigid_body(load_finger("planar")).model
    with pytest.raises(InputError) as caught:
        RigidBody(model, "thumb")
    assert (caught.value.entry, caught.value.value) == ("tip_frame", "thumb")


def test_a_prismatic_joint_is_accepted():
    model = pin.Model()
    index = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    tool = pin.SE3(np.eye(3), np.array([0.1, 0.0, 0.0]))
    model.appendBodyToJoint(index, pin.Inertia(2.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    model.addFrame(pin.Frame("tool", index, tool, pin.FrameType.OP_FRAME))
    body = RigidBody(model, "tool")
    np.testing.assert_allclose(body.tip_position(np.array([0.5])), [0.6, 0.0, 0.0])
    np.testing.assert_allclose(body.mass_matrix(np.array([0.5])), [[2.0]])


def test_link_directions_off_the_fingertip_s_branch_do_not_depend_on_what_was_evaluated_before():
    model = pin.Model()
    inertia = pin.Inertia(0.01, np.array([0.01, 0.0, 0.0]), 1e-6 * np.eye(3))
    along = pin.SE3(np.eye(3), np.array([0.03, 0.0, 0.0]))
    root = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "root")
    tip = model.addJoint(root, pin.JointModelRZ(), along, "tip")
    side = model.addJoint(root, pin.JointModelRZ(), along, "side")
    last = model.addJoint(side, pin.JointModelRZ(), along, "last")
    for joint in (root, tip, side, last):
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    model.addFrame(pin.Frame("fingertip", tip, 0, along, pin.FrameType.OP_FRAME))
    body = RigidBody(model)
    q, still = np.array([0.3, -0.4, 0.5, 0.2]), np.zeros(4)
    index = body.joints.index("last")
    for before in (np.zeros(4), np.ones(4)):
        body.kinematics(before, still)
        # The link before the last joint is turned by the root and the side joint, about z.
        angle = q[body.joints.index("root")] + q[body.joints.index("side")]
        expected = [np.cos(angle), np.sin(angle), 0.0]
        np.testing.assert_allclose(body.kinematics(q, still).directions[index], expected, atol=1e-14)
