"""Trees, lumps and free bodies under way, each against a solution that is not ours."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from finger_pin.core.stepping.integrator import integrate_compiled
from finger_pin.core.stepping.stepper import TABLEAUS, Stepper
from finger_pin.core.tables.inputs import held_control
from finger_pin.laws.limiter import STROKE_LIMITER
from finger_pin.laws.spring import TENDON_HALF
from finger_pin.mechanism.mechanism import Mechanism
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.mechanism.rows import Rows

TIGHT = 1e-10


def motion(mechanism, x, times, force=None, method="Rodas5P", tolerance=TIGHT):
    """Return states at times, shape (m, size), of a mechanism without inputs."""
    control = held_control(mechanism.channels, mechanism.coordinates)
    atol = np.full(mechanism.size, tolerance)
    stepper = Stepper(mechanism, control, x, TABLEAUS[method](), tolerance, atol, force)
    names = tuple(str(index) for index in range(mechanism.size))
    trajectory = integrate_compiled(stepper, float(times[-1]), names)
    assert not trajectory.failure
    return trajectory.interpolate(times)


def springs(arm, stiffness):
    """Rows that pull back to length zero: limiters whose range is a point, without damping."""
    arm, zero = np.atleast_2d(arm), np.zeros(len(np.atleast_2d(arm)))
    names = tuple(f"spring{k}" for k in range(len(arm)))
    parameters = np.array([zero, zero, zero + stiffness, zero, zero])
    return Rows(group="springs", law=STROKE_LIMITER, names=names, parameters=parameters, arm=arm)


def two_chains():
    """Chains of three and two joints on one base, each with a tip, under gravity."""
    rng, model = np.random.default_rng(31), pin.Model()
    model.gravity.linear[:] = [1.0, -2.0, -9.0]
    for name, kinds in (("long", "RZ RX PY"), ("short", "RY RZ")):
        parent = 0
        for index, kind in enumerate(kinds.split()):
            placement = pin.SE3(pin.exp3(rng.normal(size=3)), 0.1 * rng.normal(size=3))
            parent = model.addJoint(parent, getattr(pin, f"JointModel{kind}")(), placement, f"{name}{index}")
            inertia = pin.Inertia.FromEllipsoid(1.0, *rng.uniform(0.1, 0.3, 3))
            model.appendBodyToJoint(parent, inertia, pin.SE3(np.eye(3), 0.1 * rng.normal(size=3)))
        offset = pin.SE3(np.eye(3), np.array([0.1, 0.05, 0.0]))
        model.addFrame(pin.Frame(f"{name}_tip", parent, 0, offset, pin.FrameType.OP_FRAME))
    return model


@pytest.mark.parametrize("method", TABLEAUS)
def test_two_chains_on_one_base_with_forces_at_two_tips_move_as_pinocchio_has_them(method):
    """Pinocchio's articulated body algorithm under scipy's DOP853; a spring joins the two chains."""
    model = two_chains()
    tips, size = ("long_tip", "short_tip"), model.nv
    arm, stiffness = np.array([0.3, 0.0, -0.2, 0.4, 0.1]), 20.0
    forces = np.array([[0.5, 1.0, -0.3], [-0.8, 0.2, 0.4]])
    data = model.createData()

    def rhs(_, x):
        q, v = x[:size], x[size:]
        torque = -stiffness * (arm @ q) * arm
        for tip, force in zip(tips, forces, strict=True):
            frame = model.getFrameId(tip)
            torque = torque + pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)[:3].T @ force
        return np.concatenate([v, pin.aba(model, data, q, v, torque)])

    x, times = np.random.default_rng(32).normal(size=2 * size), np.linspace(0.0, 1.0, 11)
    expected = solve_ivp(rhs, (0.0, 1.0), x, method="DOP853", rtol=1e-11, atol=1e-12, t_eval=times).y.T
    found = motion(Mechanism(RigidBody(model, tips), [springs(arm, stiffness)]), x, times, forces, method)
    assert np.abs(np.ptp(expected, axis=0)).min() > 0.1
    np.testing.assert_allclose(found, expected, atol=2e-7)


def hinge(inertia):
    """One link on a hinge, without gravity."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "hinge")
    model.appendBodyToJoint(joint, pin.Inertia(0.3, np.zeros(3), np.diag([1.0, 1.0, inertia])), pin.SE3.Identity())
    model.addFrame(pin.Frame("tip", joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    model.gravity.linear[:] = 0.0
    return RigidBody(model, "tip")


def test_a_rotor_that_drives_a_link_through_a_spring_swings_with_it_as_the_closed_form_has_it():
    """L = N theta - theta_m: l'' = -k (N^2 / I + 1 / J) l, while I theta' + N J theta_m' is kept."""
    link, rotor, gear, k = 0.02, 3e-4, 7.0, 5.0
    mechanism = Mechanism(hinge(link), [springs([gear, -1.0], k)], ["rotor"], np.array([rotor]))
    times, start = np.linspace(0.0, 0.5, 41), np.array([0.1, 0.2, 0.3, -4.0])
    omega = np.sqrt(k * (gear**2 / link + 1.0 / rotor))
    stretch, rate = gear * start[0] - start[1], gear * start[2] - start[3]
    expected = stretch * np.cos(omega * times) + rate / omega * np.sin(omega * times)
    found = motion(mechanism, start, times)
    np.testing.assert_allclose(found[:, :2] @ [gear, -1.0], expected, atol=1e-7)
    kept = found[:, 2:] @ [link, gear * rotor]
    np.testing.assert_allclose(kept, kept[0], atol=1e-9)
    assert omega * times[-1] > 10.0


def test_a_lumped_mass_thrown_against_a_spring_that_only_pushes_comes_back_as_fast():
    """Half a swing in contact, pi sqrt(m / k), then free flight: closed form on both sides of the kink."""
    mass, k, speed = 0.02, 80.0, 0.5
    # It is stretched where its length x is negative.
    wall = Rows(group="wall", law=TENDON_HALF, names=("wall",), parameters=np.array([[k]]), arm=np.array([[0.0, 1.0]]))
    mechanism = Mechanism(hinge(1.0), [wall], ["mass"], np.array([mass]))
    omega, times = np.sqrt(k / mass), np.linspace(0.0, 0.2, 81)
    start = np.array([0.0, 0.01, 0.0, -speed])
    hit, left = 0.01 / speed, 0.01 / speed + np.pi / omega
    inside = -speed / omega * np.sin(omega * (times - hit))
    expected = np.select([times < hit, times < left], [0.01 - speed * times, inside], speed * (times - left))
    found = motion(mechanism, start, times, tolerance=1e-9)
    np.testing.assert_allclose(found[:, 1], expected, atol=1e-7)
    assert found[-1, 3] == pytest.approx(speed, rel=1e-6)


MASS, LEVER, MOMENTS = 0.4, np.array([0.02, -0.05, 0.03]), np.diag([1e-3, 2.5e-3, 3.1e-3])
GRAVITY = np.array([0.5, -1.0, -9.0])


@pytest.fixture(scope="module")
def thrown():
    """A free body whose mass centre is beside its origin, thrown and spinning near its unstable axis."""
    model = pin.Model()
    model.gravity.linear[:] = GRAVITY
    translation = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "object_position")
    placement = pin.SE3(pin.exp3(np.array([0.4, -0.2, 0.9])), np.zeros(3))
    joint = model.addJoint(translation, pin.JointModelSpherical(), placement, "object_orientation")
    model.appendBodyToJoint(joint, pin.Inertia(MASS, LEVER, MOMENTS), pin.SE3.Identity())
    model.addFrame(pin.Frame("tip", joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    mechanism = Mechanism(RigidBody(model, "tip"), [])
    quaternion = Rotation.from_rotvec([0.3, 1.0, -0.4]).as_quat()
    start = np.concatenate([[0.1, 0.2, 0.3], quaternion, [0.4, -0.2, 1.0], [0.3, 9.0, 0.2]])
    times = np.linspace(0.0, 3.0, 61)
    return placement.rotation, times, motion(mechanism, start, times)


def test_a_free_body_keeps_its_unit_quaternion(thrown):
    _, _, x = thrown
    np.testing.assert_allclose(np.linalg.norm(x[:, 3:7], axis=1), 1.0, atol=1e-14)


def attitudes(frame, x):
    return Rotation.from_matrix(frame) * Rotation.from_quat(x[:, 3:7])


def test_the_mass_centre_of_a_free_body_falls_on_a_parabola_whatever_its_spin(thrown):
    frame, times, x = thrown
    turned = attitudes(frame, x)
    centre = x[:, :3] + turned.apply(LEVER)
    velocity = x[0, 7:10] + turned[0].apply(np.cross(x[0, 10:13], LEVER))
    parabola = centre[0] + times[:, None] * velocity + 0.5 * times[:, None] ** 2 * GRAVITY
    np.testing.assert_allclose(centre, parabola, atol=1e-7)
    assert np.ptp(x[:, :3] - parabola, axis=0).min() > 0.05


def test_a_free_body_keeps_its_angular_momentum_and_its_energy(thrown):
    """About the mass centre, in the base frame; kinetic energy of the spin alone, and all of it with gravity."""
    frame, _, x = thrown
    turned, spin = attitudes(frame, x), x[:, 10:13]
    momentum = turned.apply(spin @ MOMENTS)
    np.testing.assert_allclose(momentum, np.tile(momentum[0], (len(x), 1)), atol=1e-8 * np.linalg.norm(momentum[0]))
    velocity = x[:, 7:10] + turned.apply(np.cross(spin, LEVER))
    energy = 0.5 * MASS * np.sum(velocity**2, axis=1) + 0.5 * np.sum(spin @ MOMENTS * spin, axis=1)
    energy -= MASS * (x[:, :3] + turned.apply(LEVER)) @ GRAVITY
    np.testing.assert_allclose(energy, energy[0], atol=1e-8 * np.ptp(0.5 * MASS * np.sum(velocity**2, axis=1)))


def test_the_attitude_of_a_free_body_is_that_of_euler_s_equations(thrown):
    """I w' = (I w) x w and the kinematics of the quaternion, by scipy; it tumbles over on the way."""
    _, times, x = thrown

    def rhs(_, y):
        quaternion, spin = y[:4], y[4:]
        vector, scalar = quaternion[:3], quaternion[3]
        rate = 0.5 * np.append(scalar * spin + np.cross(vector, spin), -vector @ spin)
        return np.concatenate([rate, np.linalg.solve(MOMENTS, np.cross(MOMENTS @ spin, spin))])

    begin = np.concatenate([x[0, 3:7], x[0, 10:13]])
    settings = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "t_eval": times}
    expected = solve_ivp(rhs, (0.0, times[-1]), begin, **settings).y.T
    between = Rotation.from_quat(expected[:, :4]).inv() * Rotation.from_quat(x[:, 3:7])
    assert between.magnitude().max() < 1e-6
    np.testing.assert_allclose(x[:, 10:13], expected[:, 4:], atol=1e-5)
    assert x[:, 11].min() < -5.0 and x[:, 11].max() > 5.0
