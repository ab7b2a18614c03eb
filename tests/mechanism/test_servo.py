"""Motors, gearboxes, spools and elastic tendons against their closed forms."""

import numpy as np
import pytest
from servo_cases import INERTIA, LINK, LINK_INERTIA, RADIUS, SMOOTH, SPOOL, finger, motor_of, stepped

import finger_pin as fp

STIFFNESS = 6000.0 / 0.3


def data_sheet(torque, current, speed):
    sheet = {"stall_torque": torque, "stall_current": current, "no_load_speed": speed}
    return {"voltage": 5.0, "maximum_current": current, "inertia": INERTIA, "data_sheet": sheet}


def test_a_data_sheet_gives_the_constants_of_the_xc330_by_hand():
    """R = 5 / 1.8, K_t = sqrt(0.93 R / 8.482), c0 = K_t 1.8 - 0.93."""
    expected = (np.sqrt(0.93 * 5.0 / 1.8 / 8.482), 5.0 / 1.8, np.sqrt(0.93 * 5.0 * 1.8 / 8.482) - 0.93)
    assert motor_of("XC330-M288").constants == pytest.approx(expected, rel=1e-12)
    assert expected == pytest.approx((0.552, 2.78, 0.0634), rel=1e-3)


def test_a_motor_of_a_data_sheet_has_both_its_ends():
    """Standing under full voltage gears hold what is missing to the stall torque; without load it reaches w_0."""
    motor = {**data_sheet(0.93, 1.80, 8.482), "encoder": {"range": [-100.0, 100.0]}}
    free = finger(motor, drive="position")
    constant, _, dry = free.description.actuators["servo"].motor.constants
    stalled = free.evaluate(free.rest_state(np.zeros(1)), np.array([5.0]))
    assert stalled["motor_torque"][0] - dry == pytest.approx(0.93, rel=1e-12) and stalled["motor_current"][
        0
    ] == pytest.approx(1.80)
    # Turned back, the spool lets its tendon hang.
    ended = stepped(free, [-5.0], [5.0])[0]
    assert ended[3] == pytest.approx(-8.482, rel=1e-6)
    assert constant * 1.80 == pytest.approx(0.93 + dry)


def test_a_free_motor_answers_a_step_of_voltage_as_a_first_order_lag():
    """At w = -K U / (K^2 + R b) (1 - exp(-t / T)), T = J R / (K^2 + R b), while its tendon hangs slack."""
    viscous, constant, resistance = 0.01, 0.4, 3.0
    free = finger({**SMOOTH, "friction": {"coulomb": 0.0, "viscous": viscous}}, drive="position")
    stiff = constant**2 + resistance * viscous
    times = np.linspace(0.0, 0.1, 6)
    expected = -constant * 2.0 / stiff * (1.0 - np.exp(-times * stiff / (INERTIA * resistance)))
    np.testing.assert_allclose(stepped(free, [-2.0], times)[:, 3], expected, atol=1e-7)


def test_a_rotor_swings_on_its_tendon_against_a_locked_finger_at_the_root_of_r2_k_over_j():
    """Its stretch does, with J / r^2 at one end and, at the other, a link of 100 kg m2 that hardly moves."""
    locked = {**LINK, "mass": 100.0, "centre_of_mass": 0.0, "transverse_inertia": 100.0}
    swinging = finger(SMOOTH, link=locked, tendon_damping=0.0)
    spool_mass, link_mass, tension, start = INERTIA / SPOOL**2, 100.0 / RADIUS**2, 4.0, 3e-4
    frequency = np.sqrt(STIFFNESS * (1.0 / spool_mass + 1.0 / link_mass))
    assert frequency == pytest.approx(np.sqrt(SPOOL**2 * STIFFNESS / INERTIA), rel=1e-4)
    rest = tension / spool_mass / frequency**2
    times = np.linspace(0.0, 2.0, 41)
    found = stepped(swinging, [tension], times, spool=start / SPOOL)
    stretch = SPOOL * found[:, 2] - RADIUS * found[:, 0]
    np.testing.assert_allclose(stretch - rest, (start - rest) * np.cos(frequency * times), atol=1e-9)


def test_a_stiffer_tendon_comes_closer_to_a_spool_without_stretch():
    """Without stretch joint and rotor are one mass; the stretch that speeds up the link holds it back, as 1 / K."""
    tension, time = 1.0, 0.1
    spool_mass, link_mass = INERTIA / SPOOL**2, LINK_INERTIA / RADIUS**2
    rigid = 0.5 * tension / (spool_mass + link_mass) * time**2
    for rigidity in (1e4, 1e5, 1e6):
        stiffness = rigidity / 0.3
        moving = finger(SMOOTH, tendon_rigidity=rigidity, tendon_damping=2.0 * np.sqrt(stiffness * link_mass))
        moved = RADIUS * stepped(moving, [tension], [time], rtol=1e-10)[0, 0]
        stretch = tension * link_mass / (spool_mass + link_mass) / stiffness
        lag = stretch * spool_mass / (spool_mass + link_mass)
        assert rigid - moved == pytest.approx(lag, rel=1e-2)


def test_pretension_in_equals_tensions_out_at_rest():
    """A spool that winds two tendons: K e0 each at zero; when the joint turns, one gains what the other loses."""
    pulled = finger(SMOOTH, opposed=True, drive="position", pretension=[3.0, 3.0])
    entering = pulled.evaluate(pulled.rest_state(np.zeros(1)), np.zeros(2))
    np.testing.assert_allclose(entering["spool_tension"], [3.0, 3.0], rtol=1e-12)
    np.testing.assert_allclose(entering.rate, 0.0, atol=1e-9)
    x = pulled.rest_state(np.zeros(1))
    pulled.layout.unpack(x).position[:] = 0.01
    shifted = pulled.evaluate(x, np.zeros(2))["spool_tension"]
    np.testing.assert_allclose(shifted - 3.0, STIFFNESS * RADIUS * np.array([-0.01, 0.01]), rtol=1e-12)


def test_two_tendons_hold_a_joint_twice_as_stiff_as_one_until_one_goes_slack():
    """Rotor locked by its inertia: the joint swings at sqrt(2 K r^2 / I), and at sqrt(K r^2 / I) with one slack."""
    heavy = {**SMOOTH, "inertia": 1e3}
    pulled = finger(heavy, opposed=True, drive="position", pretension=[3.0, 3.0], tendon_damping=0.0)
    frequency, times = np.sqrt(2.0 * STIFFNESS * RADIUS**2 / LINK_INERTIA), np.linspace(0.0, 0.05, 11)
    found = stepped(pulled, [0.0, 0.0], times, angle=0.015, spool=0.0)[:, 0]
    np.testing.assert_allclose(found, 0.015 * np.cos(frequency * times), atol=1e-6)
    x = pulled.rest_state(np.zeros(1))
    slopes = []
    for angle in (0.01, 0.05):
        pulled.layout.unpack(x).position[:] = angle + np.array([1e-6])
        above = pulled.evaluate(x, np.zeros(2))["joint_acceleration"][0]
        pulled.layout.unpack(x).position[:] = angle
        slopes.append((above - pulled.evaluate(x, np.zeros(2))["joint_acceleration"][0]) / 1e-6)
    np.testing.assert_allclose(slopes, [-(frequency**2), -(frequency**2) / 2.0], rtol=1e-6)


@pytest.mark.parametrize("drive, command", [("tension", 1e4), ("position", 4.9)])
def test_the_current_limit_saturates_the_torque(drive, command):
    limited = finger({**SMOOTH, "maximum_current": 0.3}, drive=drive)
    at_rest = limited.evaluate(limited.rest_state(np.zeros(1)), np.array([command]))
    assert at_rest["motor_torque"][0] == pytest.approx(0.4 * 0.3) and at_rest["motor_current"][0] == pytest.approx(0.3)
    # The electronics apply R I, whatever was asked for.
    assert at_rest["motor_voltage"][0] == pytest.approx(3.0 * 0.3)


def test_a_tension_drive_runs_out_of_voltage_where_the_motor_is_fast():
    """At w the current is at most (V - K w) / R, of whatever tension was commanded."""
    fast = finger(SMOOTH)
    x = fast.rest_state(np.zeros(1))
    fast.layout.unpack(x).motor_velocity[:] = 10.0
    found = fast.evaluate(x, np.array([90.0]))
    assert found["motor_current"][0] == pytest.approx((5.0 - 0.4 * 10.0) / 3.0) and found["motor_voltage"][
        0
    ] == pytest.approx(5.0)
    assert 90.0 * SPOOL / 0.4 > found["motor_current"][0]


@pytest.mark.parametrize("weight, turns", [(1.0, True), (4.0, False)], ids=["backdrivable", "not backdrivable"])
def test_without_power_a_backdrivable_gear_lets_a_load_down_and_another_one_holds_it(weight, turns):
    """A link that hangs on its tendon: gears hold against the load alone from m0 x = 1 on, here at 0.3 x 4."""
    friction = {"coulomb": 1e-4, "by_load": 0.3, "external_weight": weight}
    hanging = finger({**SMOOTH, "friction": friction}, gravity=9.81)
    load = 0.02 * 9.81 * 0.03 / RADIUS
    spool = load / (STIFFNESS * SPOOL)
    # Gears that carry nearly all of the load from the start.
    moved = stepped(hanging, [0.0], [0.0, 0.5], spool=spool, stiction=-0.9 * SPOOL * load, rtol=1e-6)[:, 2]
    assert (moved[1] - moved[0] < -0.1) if turns else abs(moved[1] - moved[0]) < 1e-3


def test_a_motor_overcomes_a_gear_that_no_load_turns():
    """At m0 = 0.3, x = 4 it lifts from tau = 22 / 7 r f on: 0.3 (4 r f + tau) is below tau - r f at tau = 4 r f."""
    friction = {"coulomb": 1e-4, "by_load": 0.3, "external_weight": 4.0}
    lifting = finger({**SMOOTH, "friction": friction}, gravity=9.81)
    load = 0.02 * 9.81 * 0.03 / RADIUS
    # Gears that slide from the start: J w' = 4 r f - r f - 0.3 (4 + 4) r f.
    spool, level = load / (STIFFNESS * SPOOL), 0.3 * 8.0 * SPOOL * load
    moved = stepped(lifting, [4.0 * load], [0.0, 0.3], spool=spool, stiction=level, rtol=1e-6)[:, 2]
    assert moved[1] - moved[0] == pytest.approx(0.3 * SPOOL * load / INERTIA * 0.3**2, rel=0.1)


@pytest.mark.parametrize("exponent", [0.76, 1.0, 2.0])
def test_the_level_of_the_gears_is_the_published_one_but_for_a_thousandth_of_its_stribeck_part(exponent):
    c0, m0, c1, m1, w = 8.76e-3, 0.068, 2e-3, 0.0738, 2.558
    gears = {"coulomb": c0, "by_load": m0, "stribeck": c1, "stribeck_by_load": m1, "stribeck_velocity": w}
    geared = finger({**SMOOTH, "friction": {**gears, "stribeck_exponent": exponent}})
    x = geared.rest_state(np.zeros(1), tension=np.array([4.0]))
    for speed in (0.0, 1e-4, 1e-3, 0.1, 2.0, 10.0):
        geared.layout.unpack(x).motor_velocity[:] = -speed
        found = geared.evaluate(x, np.array([7.0]))
        load = 7.0 * SPOOL + SPOOL * found["spool_tension"][0]
        assert found["gearbox_load"][0] == pytest.approx(load, rel=1e-12)
        part = c1 + m1 * load
        level = c0 + m0 * load + part * np.exp(-((speed / w) ** exponent))
        assert abs(found.mechanism.rows["gearboxes"]["level"][0] - level) <= 1.1e-3 * part


@pytest.mark.parametrize("way", [1.0, -1.0], ids=["winding in", "paying out"])
@pytest.mark.parametrize("pull", [0.5, 6.0])
def test_a_drive_that_overcomes_all_of_its_friction_slides_its_gears_under_the_commanded_load(way, pull):
    """At the tension that it was told, bristles at the level of that load, it neither speeds up nor slows down."""
    c0, m0, b, x0, speed, torque = 0.01, 0.3, 4e-3, 1.5, way * 6.0, SPOOL * pull
    friction = {"coulomb": c0, "by_load": m0, "viscous": b, "external_weight": x0}
    # Of either sign of x T + tau with tau = T + way (c0 + m0 |x T + tau|), the one that comes out.
    levels = {side: (c0 + side * m0 * (1.0 + x0) * torque) / (1.0 - side * way * m0) for side in (1.0, -1.0)}
    (level,) = [each for side, each in levels.items() if side * ((1.0 + x0) * torque + way * each) > 0.0]
    driven = finger({**SMOOTH, "friction": friction}, friction_compensation=1.0, tendon_damping=0.0)
    x = driven.rest_state(np.zeros(1), tension=np.array([pull]))
    state = driven.layout.unpack(x)
    state.motor_velocity[:], state.gearbox_stiction[:] = speed, way * level
    found = driven.evaluate(x, np.array([pull]))
    assert found.mechanism.acceleration[-1] == pytest.approx(0.0, abs=1e-6)
    assert found["gearbox_load"][0] == pytest.approx(abs((1.0 + x0) * torque + way * level + b * speed), rel=1e-6)


def test_a_finger_with_ideal_and_servo_tendons_gives_each_strand_to_the_joints():
    """Whatever pulls it, a strand's delivered tension turns the joints by (11) and loads them by (17)."""
    actuators = {"M": {"motor": "XL330-M288", "tendons": ["T3"], "spool_radius": SPOOL}}
    mixed, ideal = fp.Finger(fp.load_finger("ub_stand_in", {"finger.actuators": actuators})), fp.Finger("ub_stand_in")
    tension = np.array([2.0, 1.5, 6.0, 4.0])
    position = np.array([0.1, 0.4, 0.5, 0.3])
    found = mixed.evaluate(mixed.rest_state(position, tension=tension), tension)
    alone = ideal.evaluate(ideal.rest_state(position), tension)
    np.testing.assert_allclose(found.strands, alone.strands, rtol=1e-9)
    np.testing.assert_allclose(found["joint_torque"], alone["joint_torque"], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found["joint_reaction"], alone["joint_reaction"], rtol=1e-9)
    np.testing.assert_allclose(found["joint_acceleration"], alone["joint_acceleration"], rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("by_load, viscous", [(0.3, 0.0), (0.0, 4e-3)])
def test_friction_compensation_leaves_the_rest_of_the_sliding_friction(share, by_load, viscous):
    """Without load gears carry what they take, N = c0 / (1 - m0), or c0 + b w; the tendon hangs."""
    friction = {"coulomb": 0.01, "by_load": by_load, "viscous": viscous}
    turning = finger({**SMOOTH, "friction": friction}, friction_compensation=share)
    taken, speed = 0.01 / (1.0 - by_load), -6.0
    x = turning.rest_state(np.zeros(1))
    state = turning.layout.unpack(x)
    state.motor_position[:], state.motor_velocity[:], state.gearbox_stiction[:] = -0.1, speed, -taken
    found = turning.evaluate(x, np.zeros(1))
    left = (1.0 - share) * (taken - viscous * speed)
    assert found.mechanism.acceleration[-1] == pytest.approx(left / INERTIA, abs=1e-6)
    # Sliding goes on as it is where all is compensated.
    if share == 1.0:
        assert found.rate[-1] == pytest.approx(0.0, abs=1e-6)
