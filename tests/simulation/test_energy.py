"""The energy account: it closes on correct runs and follows known works."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import finger_pin as fp
from finger_pin.description.simulation_settings import METHODS
from finger_pin.simulation.energy import energies, powers

LOSSES = ("tendon_coulomb", "tendon_viscous", "joint_coulomb", "joint_viscous", "limiter")
CONTACT = {
    "reference.joints.abduction.amplitude": 0.6,
    "reference.joints.abduction.frequency": 3.0,
    "controller.gain": 2.0,
    "simulation.duration": 0.12,
}


def turnover(result):
    """The energy that went through the account, J: everything supplied and lost, by magnitude."""
    works = [values for name, values in result.items() if name.startswith("energy_exchanged_")]
    return float(sum(abs(work).max() for work in works))


@pytest.fixture(scope="module")
def pushed():
    """The finger pushed at its tip while it follows reversals."""
    settings = {"environment.fingertip_force": [0.3, -0.2, 0.4], "simulation.duration": 0.1}
    return fp.simulate(fp.load_scenario("reversals", settings))


@pytest.fixture(scope="module")
def contact():
    """The abduction joint driven into its upper limit and back."""
    return fp.simulate(fp.load_scenario("reversals", CONTACT))


@pytest.mark.parametrize("method", METHODS)
def test_the_account_closes_at_default_tolerances(fig6_runs, method):
    result = fig6_runs[method]
    assert float(abs(result.energy_residual).max()) < 1e-5 * float(abs(result.energy_exchanged_actuators).max())


def test_the_account_of_the_main_job_closes(reversals):
    assert float(abs(reversals.energy_residual).max()) < 1e-5 * float(reversals.energy_exchanged_actuators.max())


@pytest.mark.parametrize("name", ["servo", "grasp"])
def test_what_energies_say_of_themselves_adds_up_to_the_residual(name):
    result = fp.simulate(fp.load_scenario(name, {"simulation.duration": 0.02}))
    signs = {"stored": 1.0, "supplied": -1.0, "lost": 1.0}
    booked = [
        each - each[0].values for each in result.values() if each.attrs["units"] == "J" and "account" in each.attrs
    ]
    left = sum(signs[each.attrs["account"]] * each for each in booked)
    most = max(float(abs(each).max()) for each in booked)
    np.testing.assert_allclose(left, result.energy_residual, rtol=0.0, atol=1e-12 * most)


def test_the_account_of_the_hard_case_closes():
    result = fp.simulate(fp.load_scenario("stick_slip"))
    assert float(abs(result.energy_residual).max()) < 1e-5 * float(result.energy_exchanged_actuators.max())


@pytest.mark.slow
@pytest.mark.parametrize("method", ["Rodas5P", "Rodas4", "BDF"])
def test_the_residual_shrinks_with_the_tolerance(method):
    residuals = []
    for rtol in (1e-4, 1e-6, 1e-8):
        settings = {"duration": 0.01, "method": method, "rtol": rtol, "atol_scale": rtol}
        result = fp.simulate(
            fp.load_scenario("reversals", {f"simulation.{key}": value for key, value in settings.items()})
        )
        residuals.append(float(abs(result.energy_residual).max()))
    assert residuals[0] > 5.0 * residuals[1] > 25.0 * residuals[2]


def test_the_account_closes_with_a_force_at_the_fingertip(pushed):
    assert float(abs(pushed.energy_residual).max()) < 1e-5 * turnover(pushed)


def test_a_constant_force_does_the_work_of_its_displacement(pushed):
    moved = pushed.fingertip_position - pushed.fingertip_position[0]
    expected = moved.values @ np.array([0.3, -0.2, 0.4])
    assert np.abs(expected).max() > 1e-4
    np.testing.assert_allclose(pushed.energy_exchanged_fingertip, expected, atol=1e-5 * np.abs(expected).max())


def test_the_account_closes_through_contact_with_a_stroke_limiter(contact):
    assert float(contact.energy_limiter.max()) > 1e-5
    assert float(contact.energy_exchanged_limiter[-1]) > 1e-6
    assert float(abs(contact.energy_residual).max()) < 1e-5 * turnover(contact)
    degrees = np.degrees(contact.joint_position.values)
    outside = np.maximum(degrees - [10.0, 90.0, 90.0, 90.0], 0.0) + np.maximum([-10.0, 0.0, 0.0, 0.0] - degrees, 0.0)
    expected = 25.0 * np.sum(np.radians(outside) ** 2, axis=1)
    np.testing.assert_allclose(contact.energy_limiter, expected, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("run", ["reversals", "pushed", "contact"])
def test_no_loss_is_ever_negative(run, request):
    result = request.getfixturevalue(run)
    for name in LOSSES:
        assert float(result[f"power_{name}"].min()) >= -1e-15, name
        assert float(result[f"energy_exchanged_{name}"].min()) >= -1e-12, name
    for name in LOSSES[:4]:
        assert float(result[f"energy_exchanged_{name}"][-1]) > 1e-7, name


@pytest.mark.parametrize("run", ["reversals", "pushed", "contact"])
def test_stored_energies_other_than_gravity_are_never_negative(run, request):
    result = request.getfixturevalue(run)
    stored = {"kinetic", "passive_tendon", "limiter", "joint_springs", "tendon_bristles", "joint_bristles"}
    for name in stored:
        assert float(result[f"energy_{name}"].min()) >= 0.0, name


def test_losses_are_friction_force_times_velocity_less_what_bristles_store(contact):
    """The work of f^f v, summed up over the samples, is the change of sum F^s^2 / 2 s0 and the losses."""
    for kind, velocity, stiffness in (("tendon", "tendon_velocity", 5e4), ("joint", "joint_velocity", 5.0)):
        power = (contact[f"{kind}_friction"] * contact[velocity]).sum(kind)
        supplied = np.cumsum(0.5 * (power.values[1:] + power.values[:-1])) * 1e-3
        stored = (contact[f"{kind}_stiction"] ** 2).sum(kind).values / (2.0 * stiffness)
        lost = contact[f"energy_exchanged_{kind}_coulomb"] + contact[f"energy_exchanged_{kind}_viscous"]
        # The trapezium of 1 ms samples is good to a few per cent of the total in a motion with 100 Hz in it.
        np.testing.assert_allclose(supplied, (stored - stored[0] + lost.values)[1:], atol=0.05 * float(lost[-1]))


def test_energies_at_a_state_are_those_written_out(finger):
    """Springs and bristles of a random state by hand; kinetic energy with the tendon's own mass."""
    draw = np.random.default_rng(15)
    theta, velocity = np.array([0.2, 0.5, 0.9, 0.4]), draw.normal(0.0, 2.0, 4)
    p5, p5_rate = 0.5 * (3.5e-3 * 0.9 + 5e-3 * 0.4) + 1e-5, 0.3
    tendon, joint = draw.normal(0.0, 0.5, 5), draw.normal(0.0, 1e-3, 4)
    x = np.concatenate([theta, [p5], velocity, [p5_rate], tendon, joint])
    signals = finger.evaluate(x, np.ones(4))
    stored = energies(finger, signals, finger.rigid_body.kinematics(theta, velocity))
    mass = finger.rigid_body.mass_matrix(theta)
    assert stored["kinetic"] == pytest.approx(0.5 * velocity @ mass @ velocity + 0.5 * 8.8e-6 * 0.09, rel=1e-12)
    halves = 5e4 * (max(0.0, 3.5e-3 * 0.9 - p5) ** 2 + max(0.0, p5 - 5e-3 * 0.4) ** 2)
    assert stored["passive_tendon"] == pytest.approx(halves, rel=1e-12)
    assert stored["limiter"] == pytest.approx(25.0 * (0.2 - math.pi / 18) ** 2, rel=1e-9)
    assert stored["tendon_bristles"] == pytest.approx(sum(tendon**2) / 1e5, rel=1e-12)
    assert stored["joint_bristles"] == pytest.approx(sum(joint**2) / 10.0, rel=1e-12)


def test_slack_is_booked_only_where_a_tension_is_cut(finger):
    """T1 is commanded 1 N and loses 3 N, so 2 N of friction have nowhere to go; T2 to T4 deliver."""
    velocity = np.array([0.5, 0.2, -0.3, 0.4])
    x = np.concatenate([[0.0, 0.4, 0.5, 0.3], [0.002], velocity, [0.0], [3.0, 0.1, -0.2, 0.3, 0.0], np.zeros(4)])
    booked = powers(finger.evaluate(x, np.ones(4)))
    sliding = 8e-3 * 0.5 + 8e-3 * 0.2
    assert booked["slack"] == pytest.approx((1.0 - 3.0 - sliding) * sliding, rel=1e-9)
    x[10] = 0.3
    assert powers(finger.evaluate(x, np.ones(4)))["slack"] == 0.0


def test_net_power_is_supply_less_losses_and_the_rate_of_stored_energy(finger):
    """By finite differences of the stored energy along the flow, at random states with slack and contact."""
    draw = np.random.default_rng(16)
    force = np.array([0.4, -0.3, 0.6])

    def total(x):
        signals = finger.evaluate(x, command, force)
        return sum(energies(finger, signals, finger.rigid_body.kinematics(x[:4], x[5:9])).values())

    for _ in range(30):
        theta = np.append(draw.uniform(-0.25, 0.25), draw.uniform(-0.1, 1.7, 3))
        p5 = 0.5 * (3.5e-3 * theta[2] + 5e-3 * theta[3]) + draw.normal(0.0, 1e-5)
        stiction = draw.normal(0.0, 0.8, 5), draw.normal(0.0, 2e-3, 4)
        x = np.concatenate([theta, [p5], draw.normal(0.0, 3.0, 4), [draw.normal(0.0, 0.02)], *stiction])
        command = draw.uniform(0.0, 3.0, 4)
        signals = finger.evaluate(x, command, force)
        exchanged = powers(signals)
        by_hand = exchanged["actuators"] + exchanged["fingertip"] - exchanged["slack"]
        by_hand -= sum(exchanged[name] for name in LOSSES)
        assert exchanged.net == pytest.approx(by_hand, rel=1e-12, abs=1e-15)
        step = 1e-9
        slope = (total(x + step * signals.rate) - total(x - step * signals.rate)) / (2.0 * step)
        size = np.sum(np.abs(exchanged.values))
        assert float(slope) == pytest.approx(float(by_hand), abs=1e-5 * float(size))


OFF = {
    "finger.gravity": [0.0, 9.81, 0.0],
    "finger.tendon_friction.coulomb": 0.0,
    "finger.tendon_friction.viscous": 0.0,
    "finger.tendon_friction.stiffness": 1e-18,
    "finger.joint_friction.coulomb": 0.0,
    "finger.joint_friction.stiction": 0.0,
    "finger.joint_friction.viscous": 0.0,
    "finger.joint_friction.stiffness": 1e-18,
    "finger.joints.proximal.range": [-10.0, 10.0],
    "finger.joints.distal.range": [-10.0, 10.0],
}


def double_pendulum(_, y):
    """The textbook double pendulum of two rods about their hinges, angles from x, gravity along +y."""
    (l1, l2), (m1, m2), (d1, d2) = (0.045, 0.032), (0.0101, 0.0056), (0.017, 0.015)
    i1, i2 = (m * (d**2 / 16.0 + length**2 / 12.0) for m, d, length in ((m1, d1, l1), (m2, d2, l2)))
    a1, bend, w1, rate2 = y
    a2, w2 = a1 + bend, w1 + rate2
    m11 = i1 + m1 * l1**2 / 4.0 + m2 * l1**2
    m12 = m2 * l1 * l2 / 2.0 * math.cos(a1 - a2)
    m22 = i2 + m2 * l2**2 / 4.0
    h = m2 * l1 * l2 / 2.0 * math.sin(a1 - a2)
    f1 = -h * w2**2 + 9.81 * (m1 * l1 / 2.0 + m2 * l1) * math.cos(a1)
    f2 = h * w1**2 + 9.81 * m2 * l2 / 2.0 * math.cos(a2)
    e1, e2 = np.linalg.solve([[m11, m12], [m12, m22]], [f1, f2])
    return [w1, rate2, e1, e2 - e1]


@pytest.mark.slow
def test_with_everything_off_the_planar_finger_is_a_double_pendulum_that_keeps_its_energy():
    finger = fp.Finger(fp.load_finger("planar", OFF))
    start = finger.rest_state(np.array([0.3, 0.5]))
    times = np.linspace(0.0, 0.5, 50)
    settings = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-12, "t_eval": times}
    x = solve_ivp(lambda t, x: finger.rhs(t, x, np.zeros(3)), (0.0, 0.5), start, **settings).y.T
    expected = solve_ivp(double_pendulum, (0.0, 0.5), [0.3, 0.5, 0.0, 0.0], **settings).y.T
    assert np.ptp(expected[:, 0]) > 1.0
    np.testing.assert_allclose(x[:, :4], expected, atol=1e-7)
    signals = finger.evaluate(x, np.zeros((50, 3)))
    stored = energies(finger, signals, finger.rigid_body.kinematics(x[:, :2], x[:, 2:4]))
    assert np.ptp(stored["kinetic"]) > 1e-3
    total = sum(stored.values())
    np.testing.assert_allclose(total, total[0], atol=1e-8 * np.ptp(stored["kinetic"]))
