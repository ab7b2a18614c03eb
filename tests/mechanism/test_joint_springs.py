"""Springs at the joints: their law, their place in (18), their energy, and a pendulum by hand."""

import math

import numpy as np
import pytest
import scipy.integrate

import finger_pin as fp
from finger_pin.analysis import tension_for_force
from finger_pin.laws.spring import spring_torque

K, REST, C = 0.02, -1.0, 3e-4
SPRINGS = {
    "finger.joints.proximal.spring": {"stiffness": K, "rest": REST, "damping": C},
    "finger.joints.distal.spring": {"stiffness": 0.01, "rest": 0.4},
}


@pytest.fixture(scope="module")
def sprung():
    return fp.Finger(fp.load_finger("planar", SPRINGS))


def test_the_torque_drives_the_joint_to_where_the_spring_is_relaxed():
    assert spring_torque(0.5, 0.0, K, REST, C) == pytest.approx(0.03, rel=1e-14)
    assert spring_torque(REST, 2.0, K, REST, C) == pytest.approx(6e-4, rel=1e-14)


def test_springs_enter_the_equation_of_motion_as_a_torque_against_the_joint(sprung):
    bare = fp.Finger(fp.load_finger("planar"))
    draw = np.random.default_rng(5)
    for _ in range(10):
        x = sprung.rest_state(draw.uniform(0.1, 1.4, 2), draw.normal(size=2))
        theta, rate = x[:2], x[2:4]
        torque = np.array([K * (theta[0] - REST) + C * rate[0], 0.01 * (theta[1] - 0.4)])
        command = draw.uniform(0.0, 5.0, 3)
        difference = bare.evaluate(x, command)["joint_acceleration"] - sprung.evaluate(x, command)["joint_acceleration"]
        np.testing.assert_allclose(sprung.rigid_body.mass_matrix(theta) @ difference, torque, rtol=1e-9)
        np.testing.assert_allclose(sprung.evaluate(x, command)["spring_torque"], torque, rtol=1e-13)


@pytest.mark.slow
def test_a_link_on_a_spring_swings_with_the_period_of_a_torsion_pendulum(network):
    """Free of gravity, tension and friction but for the floors of law (9): omega^2 = k / (I + m c^2)."""
    length, mass, inertia = 0.05, 0.012, 3e-6
    link = {"length": length, "width": 0.01, "mass": mass, "transverse_inertia": inertia, "axial_inertia": 1e-6}
    joints = {"a": {"range": [-3.0, 3.0], "spring": {"stiffness": K, "rest": 0.2}, "link": link}}
    quiet = {"viscous": 0.0, "floor": 1e-10}
    free = {"joints": joints, "gravity": [0, 0, 0], "joint_friction": quiet, "tendon_friction": quiet}
    finger = fp.Finger(fp.FingerDescription.model_validate(network("a", {"F": {"a": 5}}).model_dump() | free))
    period = 2.0 * math.pi * math.sqrt((inertia + mass * (length / 2) ** 2) / K)
    start = finger.rest_state(np.array([0.5]))
    found = scipy.integrate.solve_ivp(
        finger.rhs, (0.0, period), start, "Radau", t_eval=[0.25 * period, 0.5 * period, period], rtol=1e-6, atol=1e-8,
        args=(np.zeros(1),),
    )  # fmt: skip
    np.testing.assert_allclose(found.y[0], [0.2, -0.1, 0.5], atol=1e-5)


def test_the_account_of_a_sprung_finger_closes_and_books_its_springs(tmp_path):
    path = tmp_path / "sprung.toml"
    path.write_text(
        '[finger]\nbase = "planar"\n'
        "[finger.joints.proximal]\nspring = { stiffness = 0.02, rest = -1.0, damping = 3e-4 }\n"
        "[reference.joints.proximal]\noffset = 0.5\n[simulation]\nduration = 0.05\n"
    )
    result = fp.simulate(fp.load_scenario(path))
    moved = result.joint_position.values[:, 0]
    np.testing.assert_allclose(result.energy_joint_springs, 0.5 * K * (moved - REST) ** 2, rtol=1e-12)
    lost = np.trapezoid(C * result.joint_velocity.values[:, 0] ** 2, result.time)
    assert float(result.energy_exchanged_joint_springs[-1]) == pytest.approx(lost, rel=1e-2)
    change = float(abs(result.energy_joint_springs - result.energy_joint_springs[0]).max())
    assert float(abs(result.energy_residual).max()) < 1e-4 * change


def test_the_torque_that_holds_a_finger_at_rest_is_that_of_gravity_and_springs(sprung):
    theta = np.array([0.7, 0.9])
    at_rest = sprung.evaluate(sprung.rest_state(theta), np.zeros(3))
    held = sprung.rigid_body.inverse_dynamics(theta, np.zeros(2), at_rest["joint_acceleration"])
    np.testing.assert_allclose(held, -at_rest["spring_torque"], rtol=1e-9)
    gravity = sprung.rigid_body.gravity_torque(theta)
    np.testing.assert_allclose(sprung.static_torque(theta), gravity + at_rest["spring_torque"], rtol=1e-12)


def test_mujoco_has_the_same_springs(sprung):
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(fp.to_mjcf(sprung.description))
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = [0.3, 1.2], [2.0, -1.0]
    mujoco.mj_forward(model, data)
    viscous = sprung.joint_friction.viscous * data.qvel
    drag = sprung.coupling.T @ (sprung.tendons.viscous * (sprung.coupling @ data.qvel))
    expected = sprung.springs.torque(data.qpos, data.qvel) + viscous + drag
    np.testing.assert_allclose(data.qfrc_passive, -expected, rtol=1e-10)


def test_the_tensions_that_a_fingertip_force_needs_hold_the_springs_too(sprung):
    """H_c^T f = J^T E + G + k (theta - theta_0), free of friction."""
    theta, force = np.array([0.5, 0.8]), np.array([0.1, -0.2, 0.0])
    found = tension_for_force(sprung, theta, force, minimum_tension=0.5)
    body = sprung.rigid_body
    springs = [K * (theta[0] - REST), 0.01 * (theta[1] - 0.4)]
    needed = body.jacobian(theta).T @ force + body.gravity_torque(theta) + springs
    np.testing.assert_allclose(sprung.coupling.T @ found.command, needed, atol=1e-9)
