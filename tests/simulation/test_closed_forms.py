"""Closed solutions of special fingers, through the compiled simulator where they move."""

import math

import numpy as np
import pytest
from validation import closed_forms, symmetry
from validation.closed_forms import SLIDING, one_joint, slide


@pytest.mark.slow
@pytest.mark.parametrize(("velocity", "sign", "exponent", "micro"), [(1e-3, -1.0, 1, 0.0), (-1e-3, 1.0, 2, 2.0)])
def test_pulling_and_releasing_lose_tension_by_the_capstan_law(velocity, sign, exponent, micro):
    law = SLIDING | {"stribeck_exponent": exponent, "micro_damping": micro}
    tension = slide(one_joint(tendon_friction=law), velocity).tension
    assert tension == pytest.approx(5.0 * math.exp(sign * 0.3 * 1.3), rel=1e-9)
    assert closed_forms.capstan_tension(velocity) == pytest.approx(5.0 * math.exp(sign * 0.3 * 1.3), rel=1e-15)


@pytest.mark.slow
def test_the_hysteresis_loop_of_a_tendon_is_twice_the_tension_times_sinh_wide():
    """Back and forth under constant actuator force: tensions f exp(-mu_e phi) and f exp(mu_e phi)."""
    pulled, released = closed_forms.hysteresis()
    assert released.tension - pulled.tension == pytest.approx(2.0 * 5.0 * math.sinh(0.3 * 1.3), rel=1e-9)


@pytest.mark.slow
def test_a_tendon_breaks_away_at_rho_times_its_sliding_friction_for_its_normal_force():
    """Friction over normal force: rho mu^d far below the Stribeck velocity, mu^d far above it."""
    ratio = 2.0
    static, kinetic = (closed_forms.friction_coefficient(ratio, velocity) for velocity in (1e-9, 1.0))
    assert kinetic == pytest.approx(math.tanh(0.5 * 0.3 * 1.3), rel=1e-9)
    assert static / kinetic == pytest.approx(ratio, rel=1e-6)


def test_a_hanging_link_needs_no_torque_and_a_level_one_its_weight_times_half_its_length():
    finger = one_joint(**closed_forms.FRICTIONLESS)
    _, moment = closed_forms.pendulum()
    assert abs(finger.rigid_body.gravity_torque(np.zeros(1))[0]) == pytest.approx(moment, rel=1e-12)
    hanging = np.array([closed_forms.hanging_angle(finger)])
    assert finger.rigid_body.gravity_torque(hanging)[0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("amplitude", [0.1, 1.0, 2.5])
def test_a_finger_with_loose_tendons_swings_as_a_physical_pendulum(amplitude):
    """Exact at any amplitude: sin(psi / 2) = k cd(omega t, k), with k = sin(amplitude / 2)."""
    motion = closed_forms.swing(amplitude, np.array([0.1, 0.25, 0.4, 0.5, 1.0, 3.0, 10.0]))
    np.testing.assert_allclose(motion.measured, motion.expected, rtol=0.0, atol=2e-6 * amplitude)
    # After whole periods it is where it began.
    np.testing.assert_allclose(motion.measured[-3:], amplitude, rtol=1e-6)


def test_small_oscillations_of_a_hanging_chain_have_the_frequencies_of_its_mass_and_stiffness():
    """Three links under gravity, M and K written down independently, against the motion in every mode."""
    modes = closed_forms.chain_modes()
    assert len(modes) == 3
    for _, motion in modes:
        assert np.ptp(motion.expected) > 1e-4
        np.testing.assert_allclose(motion.measured, motion.expected, atol=1e-9)


def test_stiff_bristles_on_a_joint_oscillate_at_the_root_of_stiffness_over_inertia_and_micro_damping_damps_them():
    """Sticking, without gravity: I theta'' + sigma_1 theta' + sigma_0 theta = 0 exactly to first order in theta."""
    motion = closed_forms.bristle_oscillation()
    assert np.ptp(motion.expected) > 0.5
    np.testing.assert_allclose(motion.measured, motion.expected, atol=1e-6)


def test_a_mirrored_finger_moves_as_its_mirror_image():
    """The paper's finger is its own mirror image in y: T1 and T2 swap, joint 1 turns the other way."""
    twins = symmetry.mirrored()
    assert abs(twins.position.expected[-1, 0] - 0.1) > 1e-3
    assert twins.position.largest < 1e-6
    assert twins.tendon_stiction.largest < 1e-4
    assert twins.joint_stiction.largest < 1e-6


def test_a_motion_does_not_depend_on_the_units_of_length_mass_and_time():
    """The same two-joint finger in other units, every option of law (9) on: angles are equal, forces scale."""
    motion, scaled = symmetry.in_units(1.0, 1.0, 1.0), symmetry.in_units(1.5, 3.0, 0.5)
    assert np.ptp(motion.angles) > 0.3
    np.testing.assert_allclose(scaled.angles, motion.angles, atol=1e-6)
    np.testing.assert_allclose(scaled.forces, motion.forces, atol=1e-5)
