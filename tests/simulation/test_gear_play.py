"""Gears with play: a spool between cords and flanks, against scipy, a closed form and conservation of energy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from servo_cases import INERTIA, LINK, LINK_INERTIA, RADIUS, SMOOTH, SPOOL, finger, scenario, stepped, together

import finger_pin as fp

K, D = 6000.0 / 0.3, 10.0


def loose(gap, **actuator):
    """A joint between two cords on one spool, of a motor whose gears have play."""
    motor = {**SMOOTH, "friction": {"coulomb": 0.0, "backlash": gap, "stiffness": 50.0}}
    return finger(motor, opposed=True, drive="position", pretension=3.0, **actuator)


@pytest.mark.slow
def test_a_spool_behind_play_moves_between_cords_and_flanks_as_scipy_has_it():
    """J_s s'' = T - r (f1 - f2), J_r m'' = tau - T; T from flanks of 10 sigma_0 that only push, J_s a 1e-4 of J."""
    gap, flank, rebound, spool = 0.05, 500.0, 1.0, 1e-4 * INERTIA

    def rate(_, x):
        q, s, m, dq, ds, dm = x
        pulls = [
            max(0.0, K * (3.0 / K + way * (SPOOL * s - RADIUS * q)) + D * way * (SPOOL * ds - RADIUS * dq))
            for way in (1.0, -1.0)
        ]
        depth, way = abs(s - m) - 0.5 * gap, np.sign(s - m)
        borne = -way * flank * max(depth, 0.0) * max(1.0 + rebound * way * (ds - dm), 0.0)
        net = pulls[0] - pulls[1]
        driven = -(0.4**2) / 3.0 * dm
        return [
            dq,
            ds,
            dm,
            RADIUS * net / LINK_INERTIA,
            (borne - SPOOL * net) / spool,
            (driven - borne) / (INERTIA - spool),
        ]

    times, start = np.linspace(0.0, 0.2, 21), [0.06, 0.0, 0.0, 0.0, 0.0, 0.0]
    expected = solve_ivp(rate, (0.0, 0.2), start, "LSODA", times, rtol=1e-9, atol=1e-11, max_step=1e-4).y
    found = stepped(loose(gap), [0.0, 0.0], times, angle=0.06, spool=0.0)
    np.testing.assert_allclose(found[:, [0, 2]].T, expected[[0, 2]], atol=1e-5)
    assert np.ptp(expected[1] - expected[2]) > gap and np.ptp(expected[0]) > 0.08


def test_play_adds_its_gap_to_the_swing_of_a_joint_and_closes_the_account():
    """Pushed or pulled at rest, the pulley swings by the gap times r / R more, whatever the cords and flanks give."""
    gap, ends, push = 0.0175, {}, 0.05
    for b in (0.0, gap):
        for way in (1.0, -1.0):
            made = loose(b, tendon_damping=50.0)
            result = fp.simulate(scenario(made, 1.0, environment={"fingertip_force": [0.0, way * push, 0.0]}))
            ends[b, way] = result.joint_position.values[-1, 0] - SPOOL / RADIUS * result.motor_position.values[-1, 0]
            supplied = sum(float(abs(result[name]).max()) for name in result if name.startswith("energy_exchanged"))
            assert float(abs(result.energy_residual).max()) < 1e-6 * supplied
            # Gears without friction carry what the motor holds, twice.
            torque = push * LINK["length"] * SPOOL / RADIUS
            assert float(result.gearbox_load[-1, 0]) == pytest.approx(2.0 * torque, rel=1e-3)
    more = [abs(ends[gap, way] - ends[0.0, way]) for way in (1.0, -1.0)]
    flanks = 2.0 * push * LINK["length"] * SPOOL / RADIUS / 500.0
    assert sum(more) == pytest.approx(SPOOL / RADIUS * (gap + flanks), rel=1e-3)


def test_gears_whose_cords_are_all_wound_in_show_no_play():
    """Cords keep the spool at one flank, so that the joint comes to rest where it does without play."""
    friction = [{"coulomb": 0.0, "backlash": gap} for gap in (0.0, 0.1)]
    made = [together({**SMOOTH, "friction": each}, [0.01], spool_radius=SPOOL) for each in friction]
    ended = [stepped(each, [8.0], [4.0])[0, 0] for each in made]
    assert ended[1] == pytest.approx(ended[0], abs=1e-5) and ended[0] > 0.3
