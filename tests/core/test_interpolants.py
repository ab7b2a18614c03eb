"""Touches that integrators that are not ours pass over: each step is checked on its interpolant, and taken again."""

import numpy as np
import pytest
from test_contact_motion import G, scene

from finger_pin.core.collision.interpolants import meetings
from finger_pin.core.signals.compiled_finger import CompiledMechanism
from finger_pin.core.stepping.solve_ivp import integrate
from finger_pin.description.objects import Object

SPRING = {"stiffness": 1e4, "damping": 0.0, "friction": 0.0}


def throw(method, checked):
    """Return the least height and the last velocity of a ball of 2 mm that falls on a plate of 1 mm for 0.2 s."""
    plate = Object(shape="box", sides=(0.1, 0.1, 0.001), position=(0.0, 0.0, -0.0005), surface=SPRING)
    ball = Object(shape="sphere", radius=0.002, mass=1e-3, position=(0.0, 0.0, 0.102), surface=SPRING)
    mechanism, start = scene((0.0, 0.0, -G), plate=plate, ball=ball)
    compiled, command = CompiledMechanism(mechanism), np.zeros(mechanism.channels)
    meeting = meetings(mechanism) if checked else None

    def rhs(_, x):
        return compiled.evaluate(x, command).rate

    atol = np.full(mechanism.size, 1e-8)
    found = integrate(rhs, start, 0.2, method=method, rtol=1e-6, atol=atol, meeting=meeting)
    assert not found.failure
    states = found.interpolate(np.append(found.breakpoints, 0.2))
    return states[:, 2].min(), states[-1, 9]


@pytest.mark.slow
@pytest.mark.parametrize("method", ["Radau", "BDF", "LSODA"])
def test_a_small_ball_bounces_off_a_thin_plate_whatever_the_method(method):
    """It falls for sqrt(2 h / g), stays for pi sqrt(m / k), and leaves as fast as it came."""
    fall, stay = np.sqrt(0.2 / G), np.pi * np.sqrt(1e-3 / 1e4)
    height, velocity = throw(method, checked=True)
    assert height > 0.0
    assert velocity == pytest.approx(G * fall - G * (0.2 - fall - stay), abs=5e-3)


def test_without_looking_at_its_interpolant_a_step_passes_through_the_plate():
    height, velocity = throw("Radau", checked=False)
    assert height < -0.05 and velocity == pytest.approx(-0.2 * G, rel=1e-3)
