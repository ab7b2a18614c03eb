"""Small systems with a contact, integrated here, against their closed forms."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from finger_pin.laws.contact_law import CONTACT
from finger_pin.laws.law import Touch

G = 9.81
SOFT = dict(
    stiffness=1e4,
    damping=0.0,
    exponent=1.0,
    static=0.7,
    kinetic=0.5,
    tangential_stiffness=2e4,
    lag=2e-3,
    stribeck_velocity=5e-3,
    floor=1e-4,
    torsion_radius=0.0,
)


def contact(**changes):
    """Return value(touch) of a contact, and its numbers."""
    numbers = {**SOFT, **changes}
    p = tuple(numbers[name] for name in CONTACT.parameters)
    return (lambda touch: CONTACT.value(touch, p)), numbers


def pressed(value, normal, v, z, numbers):
    """The answer of a contact that is pressed with a force, whatever its gap."""
    return value(Touch(-normal / numbers["stiffness"], 0.0, v[0], v[1], 0.0, z[0], z[1], 0.0))


def integrate(rhs, end, start, **further):
    options = {"method": "Radau", "rtol": 1e-8, "atol": 1e-12, **further}
    return solve_ivp(rhs, (0.0, end), start, **options)


def block(slope, end, mass=0.2, start=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)):
    """Position, velocity and bristles of a block on an incline whose downhill direction is along (0.6, 0.8)."""
    value, numbers = contact()
    normal, pull = mass * G * np.cos(slope), mass * G * np.sin(slope) * np.array([0.6, 0.8])

    def rhs(_, y):
        _, f_1, f_2, _, rate_1, rate_2, *_ = pressed(value, normal, y[2:4], y[4:], numbers)
        return [y[2], y[3], (pull[0] + f_1) / mass, (pull[1] + f_2) / mass, rate_1, rate_2]

    return integrate(rhs, end, start).y, normal, pull, numbers


def test_a_block_on_an_incline_stays_for_good_up_to_the_angle_of_static_friction():
    slope, start = np.arctan(0.999 * SOFT["static"]), np.zeros(6)
    # Set down gently: a load that comes at once overshoots, and the block slides a little before it holds.
    start[:2] = start[4:] = 0.999 * 0.2 * G * np.sin(slope) / SOFT["tangential_stiffness"] * np.array([0.6, 0.8])
    y, _, pull, numbers = block(slope, 60.0, start=start)
    assert y[:2, -1] == pytest.approx(pull / numbers["tangential_stiffness"], rel=1e-6)
    assert np.abs(y[2:4, -1]).max() < 1e-11


def test_beyond_that_angle_it_slides_downhill_with_the_acceleration_of_kinetic_friction():
    slope = np.arctan(1.001 * SOFT["static"])
    y, *_ = block(slope, 3.0)
    expected = G * (np.sin(slope) - SOFT["kinetic"] * np.cos(slope))
    later = y[2:4, -1] - block(slope, 2.0)[0][2:4, -1]
    assert np.hypot(*later) == pytest.approx(expected, rel=1e-6)
    assert later / np.hypot(*later) == pytest.approx([0.6, 0.8], abs=1e-9)


@pytest.mark.slow
def test_a_block_that_is_thrown_across_the_incline_stops_and_stays():
    slope = np.arctan(0.5 * SOFT["kinetic"])
    y, _, pull, numbers = block(slope, 5.0, start=(0.0, 0.0, -0.8, 0.6, 0.0, 0.0))
    assert np.hypot(*y[2:4, -1]) < 1e-9 < np.hypot(*y[:2, -1])
    assert numbers["tangential_stiffness"] * y[4:, -1] == pytest.approx(pull, rel=1e-6)
    # The same without bristles, up to the stop: kinetic friction against the velocity.
    downhill = G * np.sin(slope) * np.array([0.6, 0.8])

    def coulomb(_, y):
        return [*y[2:], *(downhill - SOFT["kinetic"] * G * np.cos(slope) * y[2:] / np.hypot(*y[2:]))]

    stopped = lambda _, y: np.hypot(*y[2:]) - 1e-4  # noqa: E731
    stopped.terminal = True
    expected = solve_ivp(coulomb, (0.0, 5.0), [0.0, 0.0, -0.8, 0.6], events=stopped, rtol=1e-9).y[:2, -1]
    assert y[:2, -1] == pytest.approx(expected, abs=5e-3 * np.hypot(*expected))


def test_steady_sliding_settles_against_the_velocity_at_the_friction_that_the_law_gives():
    value, numbers = contact()
    normal, damping = 3.0, numbers["tangential_stiffness"] * numbers["lag"]
    for sliding in (2e-4, 2e-3, 5e-3, 0.1):
        friction = 0.5 + 0.2 * np.exp(-((sliding / 5e-3) ** 2))
        speed = sliding + (0.7 - friction) * normal / damping
        v = speed * np.array([0.28, -0.96])
        z = integrate(lambda _, z, v=v: pressed(value, normal, v, z, numbers)[4:6], 12.0, [1e-4, 1e-4]).y[:, -1]
        _, f_1, f_2, *_ = pressed(value, normal, v, z, numbers)
        assert np.array([f_1, f_2]) == pytest.approx(-friction * normal * v / speed, rel=1e-5)


def test_a_sphere_set_down_sliding_rolls_after_two_sevenths_of_v_over_mu_g_at_five_sevenths_of_v():
    value, numbers = contact(static=0.5, tangential_stiffness=1e6, lag=1e-4)
    mass, radius, v0 = 0.1, 0.02, 1.0

    def rhs(_, y):
        _, force, _, _, rate, *_ = pressed(value, mass * G, (y[0] - radius * y[1], 0.0), (y[2], 0.0), numbers)
        return [force / mass, -radius * force / (0.4 * mass * radius**2), rate]

    rolls = 2.0 * v0 / (7.0 * 0.5 * G)
    found = integrate(rhs, 3.0 * rolls, [v0, 0.0, 0.0], dense_output=True)
    assert found.y[0, -1] == pytest.approx(5.0 / 7.0 * v0, rel=1e-6)
    assert radius * found.y[1, -1] == pytest.approx(found.y[0, -1], rel=1e-6)
    times = np.linspace(0.1, 0.98, 20) * rolls
    assert found.sol(times)[0] == pytest.approx(v0 - 0.5 * G * times, abs=2e-4 * v0)
    assert found.sol(1.02 * rolls)[0] == pytest.approx(5.0 / 7.0 * v0, rel=1e-3)


@pytest.mark.parametrize("exponent", [1.0, 1.5])
def test_a_bouncing_ball_comes_back_with_one_less_two_thirds_of_damping_times_speed(exponent):
    """Hunt and Crossley 1975, to first order in c v; the next order is about (c v)^2 / 2."""
    mass = 0.05
    for speed, damping in ((1.0, 0.02), (0.5, 0.02), (1.0, 0.0)):
        value, _ = contact(damping=damping, exponent=exponent)
        opened = lambda _, y: y[0]  # noqa: E731
        opened.terminal, opened.direction = True, 1.0

        def rhs(_, y, value=value):
            return [y[1], value(Touch(y[0], y[1], *np.zeros(6)))[0] / mass]

        found = integrate(rhs, 1.0, [-1e-15, -speed], events=opened, atol=1e-14)
        product = damping * speed
        assert found.y[1, -1] / speed == pytest.approx(1.0 - 2.0 / 3.0 * product, abs=0.5 * product**2 + 1e-6)


def test_a_mass_on_the_contact_oscillates_at_the_square_root_of_stiffness_over_mass():
    value, numbers = contact()
    mass, amplitude = 0.05, 1e-5
    rest = -mass * G / numbers["stiffness"]

    def rhs(_, y):
        return [y[1], value(Touch(y[0], y[1], *np.zeros(6)))[0] / mass - G]

    pulse = np.sqrt(numbers["stiffness"] / mass)
    found = integrate(rhs, 20.0 * 2.0 * np.pi / pulse, [rest + amplitude, 0.0], method="DOP853", atol=1e-14)
    assert found.y[:, -1] == pytest.approx([rest + amplitude, 0.0], abs=1e-4 * amplitude * pulse)


@pytest.mark.slow
@pytest.mark.parametrize("normal", [12.0, 60.0])
def test_a_pinched_capsule_neither_creeps_nor_falls_until_its_load_is_twice_mu_times_the_pinch(normal):
    """45 g, mu 0.7; engines with regularised friction creep here at 50 to 155 um/s."""
    value, numbers = contact(kinetic=0.7)
    mass = 0.045

    def fall(load):
        def rhs(_, y):
            _, force, _, _, rate, *_ = pressed(value, normal, (y[1], 0.0), (y[2], 0.0), numbers)
            return [y[1], (load + 2.0 * force) / mass, rate]

        y = integrate(rhs, 60.0, [0.0, 0.0, 0.0], dense_output=True).sol([10.0, 60.0])[0]
        return (y[1] - y[0]) / 50.0

    assert abs(fall(mass * G)) < 1e-13
    assert abs(fall(0.999 * 2.0 * 0.7 * normal)) < 1e-12
    assert fall(1.001 * 2.0 * 0.7 * normal) > 1.0


def test_vibration_of_load_and_normal_force_below_break_away_moves_nothing_on():
    """Out of phase, which makes friction walk whose bristles are scaled by the normal force."""
    value, numbers = contact()
    mass, period = 0.02, 0.02

    def rhs(t, y):
        phase = 2.0 * np.pi * t / period
        normal, pull = 2.0 + 0.5 * np.cos(phase), 0.6 + 0.4 * np.sin(phase)
        _, force, _, _, rate, *_ = pressed(value, normal, (y[1], 0.0), (y[2], 0.0), numbers)
        return [y[1], (pull + force) / mass, rate]

    found = integrate(
        rhs, 20.0 * period, [0.6 / 2e4, 0.0, 0.6 / 2e4], method="DOP853", t_eval=np.arange(10, 21) * period
    )
    assert np.ptp(found.y[0]) < 1e-11


@pytest.mark.slow
def test_no_closed_cycle_yields_energy_and_sliding_cycles_cost_some():
    rng = np.random.default_rng(8)
    for _ in range(4):
        value, _ = contact(damping=rng.uniform(0.0, 5.0), exponent=rng.choice([1.0, 1.5]))
        sines = 1e-4 * rng.normal(size=(3, 3))
        turns = np.arange(1, 4)

        def rhs(t, y, value=value, sines=sines, turns=turns):
            place, rate = np.sin(turns * t), turns * np.cos(turns * t)
            (gap, _, _), (speed, slip_1, slip_2) = sines @ place - [2e-5, 0.0, 0.0], sines @ rate
            f_n, f_1, f_2, _, rate_1, rate_2, *_ = value(Touch(gap, speed, slip_1, slip_2, 0.0, y[0], y[1], 0.0))
            return [rate_1, rate_2, f_n * speed + f_1 * slip_1 + f_2 * slip_2]

        work = integrate(rhs, 2.0 * np.pi, np.zeros(3), rtol=1e-6, atol=1e-11).y[2, -1]
        assert work < -1e-8


def test_a_contact_that_opens_forgets_with_its_time_constant_and_exerts_nothing():
    value, numbers = contact()

    def rhs(_, z):
        return value(Touch(1e-4, 0.1, 0.3, -0.2, 0.0, *z, 0.0))[4:6]

    z = integrate(rhs, 5.0 * numbers["lag"], [1e-5, -2e-5]).y[:, -1]
    assert z == pytest.approx(np.exp(-5.0) * np.array([1e-5, -2e-5]), rel=1e-5)
    assert np.array(value(Touch(1e-4, 0.1, 0.3, -0.2, 0.0, *z, 0.0))[:3]) == pytest.approx(np.zeros(3), abs=0.0)


@pytest.mark.slow
def test_a_pinched_card_stays_level_until_its_moment_is_twice_the_torsion_times_the_pinch():
    """40 g held 18 mm off its centre, as by two soft tips; what holds it bends by moment / (2 k_t r^2)."""
    normal, torsion, inertia = 12.0, 4e-3, 2e-5
    value, numbers = contact(kinetic=0.7, torsion_radius=torsion / 0.7)
    r = numbers["torsion_radius"]

    def turn(moment):
        def rhs(_, y):
            touch = Touch(-normal / numbers["stiffness"], 0.0, 0.0, 0.0, y[1], 0.0, 0.0, y[2])
            _, _, _, resisting, _, _, rate, *_ = value(touch)
            return [y[1], (moment + 2.0 * resisting) / inertia, rate]

        return integrate(rhs, 20.0, [0.0, 0.0, 0.0]).y

    card = 0.04 * G * 0.018
    y = turn(card)
    assert y[0, -1] == pytest.approx(card / (2.0 * numbers["tangential_stiffness"] * r**2), rel=1e-6)
    assert abs(turn(0.999 * 2.0 * torsion * normal)[1, -1]) < 1e-10
    assert turn(1.001 * 2.0 * torsion * normal)[1, -1] > 1.0


def test_sliding_and_spinning_share_one_limit_along_the_motion():
    """Steady: (F, M / r) is the limit mu f_n against (v, r omega)."""
    r, normal = 6e-3, 3.0
    value, numbers = contact(torsion_radius=r)
    for v, omega in (((0.3, -0.4), 0.0), ((0.0, 0.0), 50.0), ((0.06, 0.08), 30.0), ((0.1, 0.0), -60.0)):
        motion = np.array([*v, r * omega])

        def rates(_, z, v=v, omega=omega):
            return value(Touch(-normal / numbers["stiffness"], 0.0, *v, omega, *z))[4:7]

        z = integrate(rates, 1.0, [1e-5, 0.0, 1e-5]).y[:, -1]
        _, f_1, f_2, moment, *_ = value(Touch(-normal / numbers["stiffness"], 0.0, *v, omega, *z))
        expected = -numbers["kinetic"] * normal * motion / np.linalg.norm(motion)
        assert np.array([f_1, f_2, moment / r]) == pytest.approx(expected, rel=1e-5, abs=1e-7)
