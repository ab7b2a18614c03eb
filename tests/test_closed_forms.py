"""Closed solutions of special fingers, through the compiled simulator where they move."""

import math

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

import finger_pin as fp
from finger_pin.core.finger import CompiledFinger

FRICTIONLESS = {
    "tendon_friction": {"coulomb": 0.0, "viscous": 0.0, "floor": 1e-12, "stiffness": 1e-6},
    "joint_friction": {"coulomb": 0.0, "stiction": 0.0, "viscous": 0.0, "floor": 1e-15, "stiffness": 1e-12},
}
RADIUS, LENGTH, MASS, WIDTH = 8e-3, 0.05, 0.02, 0.01


def link(length=LENGTH, mass=MASS):
    return {"length": length, "width": WIDTH, "mass": mass}


def make(joints, tendons, **sections):
    """Return a planar finger: every joint turns about z, y is up, wide ranges; tendons as {name: {joint: radius}}."""
    lengths = {name: length for name, length in joints.items()}
    described = {
        "name": "planar",
        "gravity": [0.0, -9.81, 0.0],
        "joints": {name: {"range": [-50.0, 50.0], "link": link(length)} for name, length in lengths.items()},
        "tendons": {
            name: {"curvature_offset": 1.3, "crossings": {joint: {"radius": radius} for joint, radius in each.items()}}
            for name, each in tendons.items()
        },
    }
    return fp.Finger(fp.FingerDescription.model_validate(described | sections))


def one_joint(**sections):
    return make({"j": LENGTH}, {"F": {"j": RADIUS}, "E": {"j": -RADIUS}}, **sections)


def slide(finger, velocity, command, travel, stiction=0.0):
    """Return friction force and tension of the first tendon after a slow travel at constant velocity, compiled."""
    core = CompiledFinger(finger)
    x = finger.rest_state(np.zeros(1))
    x[1] = velocity / RADIUS
    tension = np.array([command, command])
    steps = 1500
    h = travel / abs(velocity) / steps
    x[2] = stiction
    record = []
    for _ in range(steps):
        # Rates of the stiction alone, at constant velocity: the classic method of order 4.
        slopes = []
        for share in (0.0, 0.5, 0.5, 1.0):
            at = x.copy()
            at[2] += share * h * (slopes[-1] if slopes else 0.0)
            slopes.append(core.evaluate(at, tension).rate[2])
        x[2] += h / 6.0 * (slopes[0] + 2.0 * slopes[1] + 2.0 * slopes[2] + slopes[3])
        record.append(x[2])
    signals = core.evaluate(x, tension)
    return signals.tendons.strands[0], np.array(record)


SLIDING = {"coulomb": 0.3, "stiction_ratio": 1.0, "viscous": 0.0}


@pytest.mark.parametrize("exponent", [1, 2])
@pytest.mark.parametrize("micro", [0.0, 2.0])
@pytest.mark.parametrize(("velocity", "sign"), [(1e-3, -1.0), (-1e-3, 1.0)])
def test_pulling_and_releasing_lose_tension_by_the_capstan_law(velocity, sign, exponent, micro):
    law = SLIDING | {"stribeck_exponent": exponent, "micro_damping": micro}
    tension, _ = slide(one_joint(tendon_friction=law), velocity, 5.0, 2e-3)
    assert tension == pytest.approx(5.0 * math.exp(sign * 0.3 * 1.3), rel=1e-9)


def test_the_hysteresis_loop_of_a_tendon_is_twice_the_tension_times_sinh_wide():
    """Back and forth under constant actuator force: tensions f exp(-mu_e phi) and f exp(mu_e phi)."""
    finger = one_joint(tendon_friction=SLIDING)
    pulled, record = slide(finger, 1e-3, 5.0, 2e-3)
    released, _ = slide(finger, -1e-3, 5.0, 2e-3, stiction=record[-1])
    assert released - pulled == pytest.approx(2.0 * 5.0 * math.sinh(0.3 * 1.3), rel=1e-9)


@pytest.mark.parametrize("ratio", [1.0, 1.5, 2.0])
def test_a_tendon_breaks_away_at_rho_times_its_sliding_friction_for_its_normal_force(ratio):
    """Friction over normal force: rho mu^d far below the Stribeck velocity, mu^d far above it."""
    coefficients = []
    for velocity in (1e-9, 1.0):
        law = {"coulomb": 0.3, "stiction_ratio": ratio, "viscous": 0.0}
        finger = one_joint(tendon_friction=law)
        tension, _ = slide(finger, velocity, 5.0, 2e-3)
        coefficients.append((5.0 - tension) / (5.0 + tension))
    assert coefficients[1] == pytest.approx(math.tanh(0.5 * 0.3 * 1.3), rel=1e-9)
    assert coefficients[0] / coefficients[1] == pytest.approx(ratio, rel=1e-6)


def pendulum():
    """Return moment of inertia about the joint and m g c, of the link as a solid cylinder."""
    inertia = MASS * (WIDTH**2 / 16.0 + LENGTH**2 / 12.0) + MASS * (LENGTH / 2.0) ** 2
    return inertia, MASS * 9.81 * LENGTH / 2.0


@pytest.mark.parametrize("amplitude", [0.1, 1.0, 2.5])
def test_a_finger_with_loose_tendons_swings_as_a_physical_pendulum(amplitude):
    """Exact at any amplitude: sin(psi / 2) = k cd(omega t, k), with k = sin(amplitude / 2)."""
    finger = one_joint(**FRICTIONLESS)
    inertia, moment = pendulum()
    axis = finger.rigid_body.gravity_torque(np.array([0.0]))[0]
    assert abs(axis) == pytest.approx(moment, rel=1e-12)
    # Where the link hangs: the stable zero of the gravity torque.
    hanging = -math.copysign(math.pi / 2.0, axis)
    assert finger.rigid_body.gravity_torque(np.array([hanging]))[0] == pytest.approx(0.0, abs=1e-12)
    sim = fp.Simulator(finger, [hanging + amplitude], rtol=1e-9, atol_scale=1e-9, method="Rodas5P")
    omega, k = math.sqrt(moment / inertia), math.sin(amplitude / 2.0)
    period = 4.0 * ellipk(k * k) / omega
    for share in (0.1, 0.25, 0.4, 0.5, 1.0, 3.0, 10.0):
        state = sim.step(np.zeros(2), share * period - sim.time)
        sn, cn, dn, _ = ellipj(omega * sim.time, k * k)
        assert state.position[0] - hanging == pytest.approx(2.0 * math.asin(k * cn / dn), abs=2e-6 * amplitude)
    assert state.position[0] - hanging == pytest.approx(amplitude, rel=1e-6)
    assert sn == pytest.approx(0.0, abs=1e-9)


def test_small_oscillations_of_a_hanging_chain_have_the_frequencies_of_its_mass_and_stiffness():
    """Three links under gravity, M and K written down independently, against the motion in every mode.

    Absolute angles psi_i of the links: M_ij from the velocities of the mass centres, K = diag(moments of the weights);
    the joints turn by differences of them.
    """
    lengths = [0.05, 0.04, 0.03]
    names = ["a", "b", "c"]
    finger = make(
        dict(zip(names, lengths, strict=True)),
        {"F": {n: RADIUS for n in names}, "E": {n: -RADIUS for n in names}},
        **FRICTIONLESS,
    )
    mass, stiffness = np.zeros((3, 3)), np.zeros((3, 3))
    for i, length in enumerate(lengths):
        arm = np.array([*lengths[:i], length / 2.0, *np.zeros(2 - i)])
        mass += MASS * np.outer(arm, arm)
        mass[i, i] += MASS * (WIDTH**2 / 16.0 + length**2 / 12.0)
        stiffness += MASS * 9.81 * np.diag(arm)
    squares, modes = np.linalg.eig(np.linalg.solve(mass, stiffness))
    relative = np.array([[1.0, 0, 0], [-1.0, 1.0, 0], [0, -1.0, 1.0]])
    first = finger.rigid_body.gravity_torque(np.zeros(3))[0]
    hanging = np.array([-math.copysign(math.pi / 2.0, first), 0.0, 0.0])
    for square, mode in zip(squares, modes.T, strict=True):
        shape = relative @ mode
        start = 1e-4 * shape / np.max(np.abs(shape))
        sim = fp.Simulator(finger, hanging + start, rtol=1e-8, atol_scale=1e-11, method="Rodas5P")
        omega = math.sqrt(square)
        for turn in (0.3, 0.5, 1.0, 2.0):
            state = sim.step(np.zeros(2), 2.0 * math.pi * turn / omega - sim.time)
            expected = start * math.cos(omega * sim.time)
            np.testing.assert_allclose(state.position - hanging, expected, atol=1e-9)


def test_stiff_bristles_on_a_joint_oscillate_at_the_root_of_stiffness_over_inertia_and_micro_damping_damps_them():
    """Sticking, without gravity: I theta'' + sigma_1 theta' + sigma_0 theta = 0 exactly to first order in theta."""
    micro = 2e-5
    joint = {"coulomb": 0.05, "stiction": 0.05, "viscous": 0.0, "stiffness": 0.5, "micro_damping": micro, "floor": 1e3}
    quiet = FRICTIONLESS | {"joint_friction": joint, "gravity": [0.0, 0.0, 0.0]}
    finger = one_joint(**quiet)
    inertia, _ = pendulum()
    sim = fp.Simulator(finger, [0.0], rtol=1e-9, atol_scale=1e-12, method="Rodas5P")
    x = sim.x
    speed = 1e-3
    x[1] = speed
    sim.x = x
    decay = micro / (2.0 * inertia)
    omega = math.sqrt(0.5 / inertia - decay**2)
    for turn in (0.2, 0.5, 0.9, 3.1):
        state = sim.step(np.zeros(2), 2.0 * math.pi * turn / omega - sim.time)
        expected = speed / omega * math.exp(-decay * sim.time) * math.sin(omega * sim.time)
        assert state.position[0] == pytest.approx(expected, abs=1e-6 * speed / omega)


def test_a_mirrored_finger_moves_as_its_mirror_image():
    """The paper's finger is its own mirror image in y: T1 and T2 swap, joint 1 turns the other way."""
    description = fp.load_finger("ub")
    finger = fp.Finger(description)
    left = fp.Simulator(finger, [0.1, 0.4, 0.5, 0.3], rtol=1e-8, atol_scale=1e-8)
    right = fp.Simulator(finger, [-0.1, 0.4, 0.5, 0.3], rtol=1e-8, atol_scale=1e-8)
    for tension in ([1.5, 1.0, 5.0, 3.5], [1.0, 2.0, 4.0, 3.0], [3.0, 1.0, 6.0, 4.5]):
        one = left.step(tension, 0.02, [0.1, 0.2, -0.1])
        other = right.step([tension[1], tension[0], *tension[2:]], 0.02, [0.1, -0.2, -0.1])
        np.testing.assert_allclose(other.position * [-1, 1, 1, 1], one.position, atol=1e-6)
        np.testing.assert_allclose(other.tendon_stiction[[1, 0, 2, 3, 4]], one.tendon_stiction, atol=1e-4)
        np.testing.assert_allclose(other.joint_stiction * [-1, 1, 1, 1], one.joint_stiction, atol=1e-6)


def test_a_motion_does_not_depend_on_the_units_of_length_mass_and_time():
    """The same two-joint finger in other units, every option of law (9) on: angles are equal, forces scale."""

    def run(length, mass, time):
        force = mass * length / time**2
        tendon, torque = force / length, force * length
        described = {
            "name": "scaled",
            "gravity": [0.0, -9.81 * length / time**2, 0.0],
            "joints": {
                name: {
                    "range": [-0.5, 0.5],
                    "link": {"length": size * length, "width": WIDTH * length, "mass": MASS * mass},
                }
                for name, size in (("a", 0.05), ("b", 0.04))
            },
            "tendons": {
                name: {
                    "curvature_offset": 1.3,
                    "crossings": {joint: {"radius": radius * length} for joint, radius in each.items()},
                }
                for name, each in {
                    "F": {"a": 8e-3, "b": 6e-3},
                    "E": {"a": -8e-3, "b": -6e-3},
                    "S": {"a": 5e-3, "b": -6e-3},
                }.items()
            },
            "tendon_friction": {
                "stiffness": 5e4 * tendon,
                "viscous": tendon * time,
                "stribeck_velocity": 0.01 * length / time,
                "floor": 1e-4 * force,
                "stribeck_exponent": 2,
                "micro_damping": 2.0 * tendon * time,
            },
            "joint_friction": {
                "coulomb": 2.5e-4 * length,
                "stiction": 3.5e-4 * length,
                "stiffness": 5.0 * torque,
                "viscous": 1e-3 * torque * time,
                "stribeck_velocity": 0.1 / time,
                "floor": 1e-7 * torque,
                "stribeck_exponent": 2,
                "micro_damping": 1e-3 * torque * time,
            },
            "stroke_limiter": {"stiffness": 50.0 * torque, "damping": 0.5 * time},
        }
        finger = fp.Finger(fp.FingerDescription.model_validate(described))
        sim = fp.Simulator(finger, [0.1, 0.2], rtol=1e-9, atol_scale=1e-9, method="Rodas5P")
        angles, forces = [], []
        for tension in ([3.0, 1.0, 2.0], [1.0, 4.0, 1.0], [5.0, 1.0, 0.5]):
            state = sim.step(np.array(tension) * force, 0.05 * time)
            angles.append(state.position)
            forces.append(state.tendon_stiction / force)
        return np.array(angles), np.array(forces)

    angles, forces = run(1.0, 1.0, 1.0)
    scaled_angles, scaled_forces = run(1.5, 3.0, 0.5)
    assert np.ptp(angles) > 0.3
    np.testing.assert_allclose(scaled_angles, angles, atol=1e-6)
    np.testing.assert_allclose(scaled_forces, forces, atol=1e-5)
