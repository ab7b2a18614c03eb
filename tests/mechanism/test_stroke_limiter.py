"""Stroke limiters (2): Hunt-Crossley contacts at both ends, by hand."""

import math

import numpy as np
import pytest
from exerted import exert

from finger_pin.laws.limiter import limiter_energy, limiter_loss, limiter_torque, penetration
from finger_pin.mechanism.joints import StrokeLimiter

K, C = 50.0, 0.5


def by_hand(position, velocity, lower, upper):
    """tau^r of one joint from the model's words: max(0, k d (1 + c d')), acting back into the range."""
    if position > upper:
        return max(0.0, K * (position - upper) * (1.0 + C * velocity))
    if position < lower:
        return -max(0.0, K * (lower - position) * (1.0 - C * velocity))
    return 0.0


@pytest.mark.parametrize(
    ("position", "velocity", "expected"),
    [
        (0.5, 9.0, 0.0),
        (1.0, 9.0, 0.0),
        (0.0, -9.0, 0.0),
        (1.1, 0.0, 5.0),
        (1.1, 1.0, 7.5),
        (1.1, -1.0, 2.5),
        (1.1, -3.0, 0.0),
        (-0.2, 0.0, -10.0),
        (-0.2, -1.0, -15.0),
        (-0.2, 1.0, -5.0),
        (-0.2, 3.0, 0.0),
    ],
)
def test_torque_opposes_penetration_at_either_end(position, velocity, expected):
    torque = limiter_torque(penetration(position, 0.0, 1.0), velocity, K, C)
    assert torque == pytest.approx(expected, rel=1e-12, abs=0.0)
    assert by_hand(position, velocity, 0.0, 1.0) == pytest.approx(expected, rel=1e-12, abs=0.0)


def test_limiters_never_pull_the_joint_outwards():
    draw = np.random.default_rng(2)
    position, velocity = draw.uniform(-1.0, 2.0, 2000), draw.normal(0.0, 20.0, 2000)
    torque = limiter_torque(penetration(position, 0.0, 1.0), velocity, K, C)
    assert np.all(torque[position > 1.0] >= 0.0)
    assert np.all(torque[position < 0.0] <= 0.0)
    assert np.all(torque[(position >= 0.0) & (position <= 1.0)] == 0.0)
    assert np.any(torque[position > 1.0] == 0.0) and np.any(torque[position > 1.0] > 0.0)


def test_the_limiter_loses_energy_and_never_makes_any():
    draw = np.random.default_rng(3)
    depth, velocity = draw.uniform(-0.2, 0.2, 2000), draw.normal(0.0, 5.0, 2000)
    torque = limiter_torque(depth, velocity, K, C)
    loss = limiter_loss(torque, depth, velocity, K)
    assert np.all(loss >= 0.0) and np.any(loss > 0.0)
    stored = K * depth * velocity
    np.testing.assert_allclose(torque * velocity, stored + loss, rtol=1e-12, atol=1e-12)


def test_stored_energy_is_the_work_of_a_slow_push():
    step = 1e-4
    depths = np.arange(0.0, 0.1, step) + 0.5 * step
    work = np.sum(limiter_torque(depths, 0.0, K, C)) * step
    assert limiter_energy(0.1, K) == pytest.approx(work, rel=1e-9)
    assert limiter_energy(-0.1, K) == limiter_energy(0.1, K)


def test_a_bounce_loses_the_energy_that_hunt_and_crossley_lose():
    """Between depth and velocity, J v dv = -k d (1 + c v) dd: the exit speed solves v + ln(1 - c v) / c = same in.

    With y = c v the first integral is y_in - ln(1 + y_in) = y_out - ln(1 + y_out), y_out negative.
    """
    inertia, entry = 1e-4, 1.2
    depth, velocity, step = 0.0, entry, 2e-6
    while depth >= 0.0:
        torque = limiter_torque(depth, velocity, K, C)
        middle = limiter_torque(depth + 0.5 * step * velocity, velocity - 0.5 * step * torque / inertia, K, C)
        depth += step * (velocity - 0.5 * step * torque / inertia)
        velocity -= step * middle / inertia

    def invariant(y):
        return y - math.log1p(y)

    assert velocity < 0.0
    assert abs(velocity) < entry
    assert invariant(C * velocity) == pytest.approx(invariant(C * entry), rel=1e-3)


def test_limiters_read_the_ranges_of_table_and_their_own_constants(ub):
    limiter = StrokeLimiter(ub)
    ten, ninety = math.radians(10.0), math.radians(90.0)
    np.testing.assert_allclose(limiter.lower, [-ten, 0.0, 0.0, 0.0], rtol=1e-12)
    np.testing.assert_allclose(limiter.upper, [ten, ninety, ninety, ninety], rtol=1e-12)
    position = np.array([-ten - 0.01, 0.3, ninety + 0.02, -0.03])
    velocity = np.array([-0.1, 5.0, 0.2, 0.4])
    expected = [by_hand(*row) for row in zip(position, velocity, limiter.lower, limiter.upper, strict=True)]
    assert expected[1] == 0.0 and all(expected[i] != 0.0 for i in (0, 2, 3))
    table = limiter.rows(4)
    force = exert([table], position, velocity, {}, np.zeros(0))["limiter"].force
    np.testing.assert_allclose(-force @ table.arm, expected, rtol=1e-10)
