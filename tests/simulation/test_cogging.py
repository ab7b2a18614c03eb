"""Cogging of motors: a rotor in its magnets against the closed form of a pendulum, its account, and what refuses it."""

import numpy as np
import pytest
from scipy.special import ellipj, ellipk
from servo_cases import INERTIA, SMOOTH, SPOOL, finger, scenario, stepped

import finger_pin as fp
from finger_pin.laws.motor import OPEN_CIRCUIT

TORQUE, PER_TURN, PHASE = 0.01, 24.0, 0.7
COGGED = {**SMOOTH, "cogging": {"amplitude": TORQUE, "per_turn": PER_TURN, "phase": PHASE}}


def test_a_rotor_that_is_let_go_swings_in_its_magnets_as_a_pendulum_does():
    """With x = n theta + phi it is x'' = -(A n / J) sin x: sin(x / 2) = k sn(K + w t, k) k = sin(x_0 / 2)."""
    made, turns = finger(COGGED, drive="position"), -5.0 * 2.0 * np.pi
    rate, k, times = np.sqrt(TORQUE * PER_TURN / INERTIA), np.sin(1.25), np.linspace(0.0, 1.5, 31)
    start = (turns + 2.5 - PHASE) / PER_TURN
    expected = 2.0 * np.arcsin(k * ellipj(ellipk(k * k) + rate * times, k * k)[0]) + turns
    spool = stepped(made, [OPEN_CIRCUIT], times, spool=start)[:, 2]  # its cord is slack
    assert rate * times[-1] > 6.0 * ellipk(k * k)
    np.testing.assert_allclose(PER_TURN * spool + PHASE, expected, atol=1e-5)


def test_a_servo_stores_in_its_magnets_what_the_account_says_and_loads_its_gears_with_their_torque():
    swing = {"offset": 3.0, "amplitude": 2.9, "frequency": 4.0}
    made = finger({**COGGED, "friction": {"coulomb": 2e-3, "by_load": 0.1}}, gravity=9.81)
    run = scenario(made, 0.5, controller={"kind": "tensions", "tensions": {"flexor": swing}})
    result = fp.simulate(run)
    angle = PER_TURN * result.motor_position.values[:, 0] + PHASE
    assert np.ptp(angle) > 2.0 * np.pi
    np.testing.assert_allclose(result.energy_cogging, TORQUE / PER_TURN * (1.0 - np.cos(angle)), atol=1e-12)
    supplied = sum(float(abs(result[name]).max()) for name in result if name.startswith("energy_exchanged"))
    assert float(abs(result.energy_residual).max()) < 1e-6 * supplied
    carried = SPOOL * result.spool_tension[:, 0] + result.motor_torque[:, 0] - TORQUE * np.sin(angle)
    np.testing.assert_allclose(result.gearbox_load[:, 0], abs(carried), atol=1e-12)


def test_what_has_no_angle_of_the_motor_counts_the_whole_amplitude_or_refuses_cogging():
    smooth, cogged = finger(SMOOTH), finger(COGGED)
    for holding, more in ((True, TORQUE), (False, -TORQUE)):
        (less,), (limit,) = (fp.analysis.tension_limits(each, holding=holding) for each in (smooth, cogged))
        assert limit - less == pytest.approx(more / SPOOL)
    with pytest.raises(fp.InputError, match=r"motor\.cogging.*no current at rest"):
        fp.analysis.steady_state(cogged, np.ones((1, 1)), np.zeros(1), at_rest=True)
