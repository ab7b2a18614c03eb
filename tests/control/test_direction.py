"""The direction of an intended motion: smooth, odd, and free of chatter at reversals."""

import math

import numpy as np

import finger_pin as fp
from finger_pin.control.tendon_feedforward import direction
from finger_pin.references.reference import ReferenceSignals

WISH = 4.0
FEEDFORWARD = {"controller.tendon_friction_feedforward.share": 1.0}


def test_the_direction_is_smooth_and_odd_and_zero_where_nothing_is_meant_to_move():
    speed = np.linspace(-5.0, 5.0, 2001)
    values = direction(speed, 0.5)
    assert direction(0.0, 0.5) == 0.0
    np.testing.assert_allclose(values, -values[::-1], atol=1e-15)
    assert np.all(np.diff(values) >= 0.0)
    assert np.max(np.diff(values) / np.diff(speed)) <= 1.0 / 0.5 + 1e-12


def test_commands_do_not_chatter_at_a_reversal_whatever_the_measured_velocity_says():
    """The command passes from one side to the other once.

    x = M(v) tanh(v / v_r) is odd, at most M^c, and has one maximum: over a sweep of v it varies by at most
    2 (2 M^c - |x_end|). f^a = f (1 + x) / (1 - x) varies by at most 2 f / (1 - M^c)^2 times that, b v by its own sweep.
    A law on the measured velocity would switch at every one of its 2000 changes of sign.
    """
    controller = fp.control.build_controller(
        fp.load_scenario("reversals", FEEDFORWARD | {"controller.minimum_tension": [0.0, 0.0, 0.0, 0.0, WISH]})
    )
    position = np.array([0.0, 0.5, 0.5, 0.3])
    sweep = np.linspace(-0.5, 0.5, 2001)[:, None] * np.array([0.0, 1.0, 0.0, 0.0])
    noise = np.random.default_rng(5).normal(0.0, 1.0, sweep.shape)
    places = np.broadcast_to(position, sweep.shape)
    commands = controller.command(0.0, ReferenceSignals(places, sweep), places, noise).tension
    planned = controller.command(0.0, ReferenceSignals(position, np.zeros(4)), position, np.zeros(4)).tension
    variation = np.abs(np.diff(commands, axis=0)).sum(axis=0)
    for tendon, radius, curvature in ((0, 8e-3, 1.0), (1, 8e-3, 1.0), (3, 5.3e-3, 0.51 + 1.0)):
        kinetic = math.tanh(0.5 * 0.11 * curvature)
        static, speed = 1.5 * kinetic, 0.5 * radius
        end = (kinetic + 0.5 * kinetic * math.exp(-speed / 0.01)) * math.tanh(speed / 1e-3)
        friction = 2.0 * planned[tendon] / (1.0 - static) ** 2 * 2.0 * (2.0 * static - end)
        assert 0.5 * abs(commands[-1, tendon] - commands[0, tendon]) < variation[tendon]
        assert variation[tendon] < friction + 2.0 * speed / (1.0 - static)
    assert variation[2] < 1e-9
