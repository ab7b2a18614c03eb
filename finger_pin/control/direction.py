"""The direction in which something is to slide, as a smooth number, and the friction that law (9) then settles at."""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.laws.bristle import friction_coefficient


def direction(velocity: Any, reversal_speed: Any) -> Any:
    """Return the direction of a desired motion, tanh(v / v_r): -1 to 1, smooth at a reversal.

    The velocity is the desired one. A measured one would close a loop through the sign of a small, noisy number, and
    chatter; a desired one passes through zero once per reversal, and the compensation moves once from one side to the
    other. Where nothing is meant to move the direction is 0, and nothing is compensated.

    Args:
        velocity: Desired velocity v^d.
        reversal_speed: v_r, in the unit of the velocity.
    """
    return np.tanh(velocity / reversal_speed)


def signed_coefficient(
    velocity: Any, kinetic: Any, static: Any, stribeck: Any, exponent: Any, reversal_speed: Any
) -> Any:
    """Return M(v) of (9b) times the direction: the friction of steady sliding over its normal force.

    Args:
        velocity: Desired velocity v^d.
        kinetic: M^d.
        static: M^c.
        stribeck: omega, in the unit of the velocity.
        exponent: Of the Stribeck curve, 1 or 2.
        reversal_speed: v_r, in the unit of the velocity.
    """
    return friction_coefficient(velocity, kinetic, static, stribeck, exponent) * direction(velocity, reversal_speed)
