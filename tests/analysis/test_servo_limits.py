"""The tensions left by motors and gears, against the balance of the gearbox solved for them."""

import numpy as np
import pytest
from scipy.optimize import brentq

import finger_pin as fp
from finger_pin.analysis import force_polytope, gear_shares, self_locking_margin, tension_limits

RADIUS = 0.005
GEARS = {"coulomb": 0.02, "stribeck": 0.01, "by_load": 0.1, "stribeck_by_load": 0.05}
OWN = {"voltage": 5.0, "torque_constant": 0.4, "resistance": 3.0, "maximum_current": 1.2, "inertia": 1e-3}
EVERY = "finger.actuators.*.motor"


def finger(weight, **motor):
    """The paper's finger, T3 and T4 pulled by motors of a gearbox in which the tendons' torque counts so much."""
    table = {**OWN, **motor, "friction": {**GEARS, "external_weight": weight}}
    actuators = {name: {"motor": table, "tendons": [name], "spool_radius": RADIUS} for name in ("T3", "T4")}
    return fp.load_finger("ub_stand_in", {"finger.actuators": actuators})


def balance(tension, torque, weight, dry, sign):
    """The torque left to a motor for pulling (1), or to gears and motor for holding (-1), N m."""
    carried = abs(weight * RADIUS * tension + torque)
    return sign * (torque - RADIUS * tension) - dry * (GEARS["coulomb"] + GEARS["stribeck"]) - 0.15 * carried


@pytest.mark.parametrize("weight", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("limit, current", [({"maximum_current": 1.2}, 1.2), ({"maximum_current": 9.0}, 5.0 / 3.0)])
def test_the_greatest_tension_is_where_gears_take_what_the_motor_has_over(weight, limit, current):
    built, torque = fp.Finger(finger(weight, **limit)), 0.4 * current
    pulled = brentq(lambda f: balance(f, torque, weight, 1.0, 1.0), 0.0, 1e3)
    held = brentq(lambda f: balance(f, torque, weight, 1.0, -1.0), torque / RADIUS, 1e4)
    np.testing.assert_allclose(tension_limits(built), [np.inf, np.inf, pulled, pulled], rtol=1e-9)
    np.testing.assert_allclose(tension_limits(built, holding=True), [np.inf, np.inf, held, held], rtol=1e-9)


@pytest.mark.parametrize("weight", [0.5, 1.0, 3.0])
def test_the_share_of_a_large_command_is_that_of_gears_without_dry_friction(weight):
    drawn = brentq(lambda f: balance(f, 1.0, weight, 0.0, 1.0), 0.0, 1.0 / RADIUS)
    let_out = brentq(lambda f: balance(f, 1.0, weight, 0.0, -1.0), 1.0 / RADIUS, 1e4)
    shares = gear_shares(finger(weight))
    np.testing.assert_allclose(shares[:, 2:], RADIUS * np.array([[drawn] * 2, [let_out] * 2]), rtol=1e-6)
    np.testing.assert_array_equal(shares[:, :2], 1.0)


@pytest.mark.slow
def test_gears_that_no_load_turns_hold_any_tension_and_lock_a_tension_drive():
    locked = finger(7.0)
    assert tension_limits(fp.Finger(locked), holding=True)[2:] == (np.inf, np.inf)
    scenario = fp.load_scenario("reversals", {"finger": locked.model_dump(exclude_none=True)})
    assert self_locking_margin(scenario, samples=50, servos=True).margin == 0.0
    assert self_locking_margin(scenario, samples=50).margin > 1.0


def test_gears_that_lose_nothing_by_load_move_no_margin_and_others_narrow_it():
    """Of strong motors without dry friction, where only shares count."""
    strong = {f"{EVERY}.friction.coulomb": 0.0, f"{EVERY}.voltage": 1e4, f"{EVERY}.maximum_current": 1e4}
    margins = [
        self_locking_margin(fp.load_scenario("servo", {**strong, **other}), samples=12, servos=True).margin
        for other in (
            {f"{EVERY}.friction.by_load": 0.0, f"{EVERY}.friction.stribeck_by_load": 0.0},
            {f"{EVERY}.friction.external_weight": 4.0},
        )
    ]
    alone = self_locking_margin(fp.load_scenario("servo"), samples=12).margin
    assert margins[0] == pytest.approx(alone, rel=1e-2) and margins[1] < 0.9 * alone


@pytest.mark.slow
def test_weaker_motors_have_a_narrower_margin():
    """Without limits it is that of the gears; at 0.15 A the dry friction of the gears takes a seventh of the torque."""
    scenarios = [fp.load_scenario("servo", {f"{EVERY}.maximum_current": current}) for current in (0.15, 0.3, 1.47)]
    margins = [self_locking_margin(each, samples=40, servos=True).margin for each in scenarios]
    assert 0.0 < margins[0] < margins[1] < margins[2] <= self_locking_margin(scenarios[2], samples=40).margin


def test_the_force_polytope_of_servos_is_that_of_their_limits_and_shrinks_with_the_current():
    posture = [0.0, 0.5, 0.5, 0.35]
    sizes = []
    for current in (0.4, 0.8):
        built = fp.Finger(fp.load_scenario("servo", {f"{EVERY}.maximum_current": current}).finger)
        limits = tension_limits(built)
        # XL330: r f + c0 + m (r f + K_t I) = K_t I with m = m0 + m1.
        assert limits[0] == pytest.approx((0.3862 * current * (1.0 - 0.1418) - 8.76e-3) / 1.1418 / RADIUS, rel=1e-9)
        sizes.append(force_polytope(built, posture, limits).support([0.0, 0.0, 1.0]))
    assert 0.0 < sizes[0] < sizes[1]
