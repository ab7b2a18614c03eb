"""Law (9) against its closed solutions for constant level, and its passivity."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from finger_pin.laws import bristle as friction

STIFFNESS, KINETIC, STATIC, STRIBECK, NORMAL = 5e4, 0.10, 0.15, 0.01, 10.0


def level_at(velocity, normal=NORMAL, floor=1e-4):
    return friction.friction_level(normal, friction.friction_coefficient(velocity, KINETIC, STATIC, STRIBECK), floor)


def slide(velocity, distance, start=0.0):
    """Integrate (9a) at constant velocity over a distance; return the stiction at its end."""
    solution = solve_ivp(
        lambda _, stiction: friction.stiction_rate(stiction, velocity, level_at(velocity), STIFFNESS),
        (0.0, distance / abs(velocity)),
        [start],
        method="Radau",
        rtol=1e-10,
        atol=1e-12,
    )
    return solution.y[0, -1]


@pytest.mark.slow
@pytest.mark.parametrize("velocity", [0.002, -0.002, 0.05, -0.05])
def test_sliding_settles_at_normal_force_times_coefficient_against_the_motion(velocity):
    expected = math.copysign(NORMAL * (KINETIC + (STATIC - KINETIC) * math.exp(-abs(velocity) / STRIBECK)), velocity)
    assert slide(velocity, 1e-3) == pytest.approx(expected, rel=1e-8)
    coefficient = friction.friction_coefficient(velocity, KINETIC, STATIC, STRIBECK)
    total = friction.steady_force(velocity, NORMAL, coefficient, 3.0)
    assert total == pytest.approx(expected + 3.0 * velocity, rel=1e-14)
    assert friction.friction_force(expected, velocity, 3.0) == pytest.approx(total, rel=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("velocity", [0.002, -0.05])
@pytest.mark.parametrize("start", [0.0, 0.6, -0.9])
def test_stiction_approaches_its_level_exponentially_in_distance(velocity, start):
    steady = math.copysign(NORMAL * (KINETIC + (STATIC - KINETIC) * math.exp(-abs(velocity) / STRIBECK)), velocity)
    for distance in (1e-7, 1e-5, 5e-5):
        expected = steady + (start - steady) * math.exp(-STIFFNESS * distance / abs(steady))
        assert slide(velocity, distance, start) == pytest.approx(expected, rel=1e-7)


def test_coefficient_falls_from_stiction_to_coulomb_with_the_stribeck_velocity():
    coefficient = [friction.friction_coefficient(v, KINETIC, STATIC, STRIBECK) for v in (0.0, STRIBECK, 1e3)]
    assert coefficient[0] == STATIC
    assert coefficient[1] == pytest.approx(KINETIC + (STATIC - KINETIC) / math.e, rel=1e-14)
    assert coefficient[2] == KINETIC
    velocities = np.linspace(0.0, 0.1, 200)
    curve = friction.friction_coefficient(velocities, KINETIC, STATIC, STRIBECK)
    assert np.all(np.diff(curve) < 0.0)
    np.testing.assert_array_equal(curve, friction.friction_coefficient(-velocities, KINETIC, STATIC, STRIBECK))


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_before_sliding_friction_is_a_spring_of_stiffness_sigma_0(direction):
    distance = 1e-11
    force = slide(direction * 1e-3, distance)
    assert force / (direction * distance) == pytest.approx(STIFFNESS, rel=1e-6)


def test_without_motion_stiction_neither_grows_nor_relaxes_even_above_its_level():
    assert friction.stiction_rate(5.0, 0.0, level_at(0.0, normal=1.0), STIFFNESS) == 0.0


def test_stiction_at_its_level_never_grows_beyond_it():
    velocities = np.linspace(-0.2, 0.2, 81)
    levels = level_at(velocities)
    upper = friction.stiction_rate(levels, velocities, levels, STIFFNESS)
    lower = friction.stiction_rate(-levels, velocities, levels, STIFFNESS)
    assert np.all(upper <= 1e-9) and np.all(lower >= -1e-9)


def test_friction_power_is_bristle_power_plus_losses_that_are_never_negative():
    draw = np.random.default_rng(0)
    stiction, velocity = draw.normal(0.0, 2.0, 500), draw.normal(0.0, 0.1, 500)
    normal, viscous = draw.uniform(0.0, 20.0, 500), 3.0
    normal[:50] = 0.0
    for f, v, n in zip(stiction, velocity, normal, strict=True):
        friction_level = max(n * (KINETIC + (STATIC - KINETIC) * math.exp(-abs(v) / STRIBECK)), 1e-4)
        level = level_at(v, n)
        stored = f * friction.stiction_rate(f, v, level, STIFFNESS) / STIFFNESS
        supplied = friction.friction_force(f, v, viscous) * v
        lost = f * f * abs(v) / friction_level + viscous * v * v
        assert supplied - stored == pytest.approx(lost, rel=1e-9, abs=1e-12)
        package = friction.coulomb_loss(f, v, level) + friction.viscous_loss(v, viscous)
        assert package == pytest.approx(lost, rel=1e-12)
        assert friction.coulomb_loss(f, v, level) >= 0.0 and friction.viscous_loss(v, viscous) >= 0.0


def test_bristle_energy_is_the_work_done_on_the_spring():
    step = 1e-4
    stretch = np.arange(0.0, 1e-2, step) + 0.5 * step
    work = np.sum(STIFFNESS * stretch) * step
    assert friction.bristle_energy(STIFFNESS * 1e-2, STIFFNESS) == pytest.approx(work, rel=1e-12)


def test_an_unloaded_contact_slides_at_the_floor():
    assert level_at(0.0, normal=0.0) == 1e-4
    assert level_at(0.3, normal=0.0) == 1e-4
    assert friction.stiction_rate(1e-4, 0.3, level_at(0.3, normal=0.0), STIFFNESS) == pytest.approx(0.0, abs=1e-9)
    assert np.isfinite(friction.stiction_rate(1.0, 0.3, level_at(0.3, normal=0.0), STIFFNESS))


def test_the_level_is_proportional_to_the_normal_force():
    assert level_at(0.02, normal=20.0) == pytest.approx(2.0 * level_at(0.02, normal=10.0), rel=1e-14)


@pytest.mark.slow
def test_a_full_cycle_of_sliding_dissipates_the_area_of_its_hysteresis_loop():
    """Back and forth by d at one speed, starting from steady sliding: 4 L d less what each reversal spares.

    After a reversal F = -L + 2 L exp(-s0 x / L), whose integral over d is -L d + 2 (L^2 / s0)(1 - exp(-s0 d / L)).
    """
    speed, distance = 0.02, 1e-3
    level = NORMAL * (KINETIC + (STATIC - KINETIC) * math.exp(-speed / STRIBECK))
    stroke = level * distance - 2.0 * level**2 / STIFFNESS * (1.0 - math.exp(-STIFFNESS * distance / level))

    def rates(time, x):
        velocity = -speed if time < distance / speed else speed
        return [friction.stiction_rate(x[0], velocity, level_at(velocity), STIFFNESS), x[0] * velocity]

    work, start = 0.0, level
    for begin in (0.0, distance / speed):
        span = (begin, begin + 0.999999999 * distance / speed)
        solution = solve_ivp(rates, span, [start, 0.0], method="Radau", rtol=1e-10, atol=1e-13)
        start, work = solution.y[0, -1], work + solution.y[1, -1]
    assert work == pytest.approx(2.0 * stroke, rel=1e-5)


def test_the_law_broadcasts_over_contacts_and_time():
    velocity = np.array([[0.01, -0.02, 0.0], [0.3, 0.0, -0.1]])
    kinetic = np.array([0.1, 0.2, 0.3])
    whole = friction.friction_coefficient(velocity, kinetic, 2.0 * kinetic, STRIBECK)
    for row, column in np.ndindex(velocity.shape):
        one = friction.friction_coefficient(velocity[row, column], kinetic[column], 2.0 * kinetic[column], STRIBECK)
        assert whole[row, column] == one
