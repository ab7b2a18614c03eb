"""Law (9) over a time step of MuJoCo: one text, which numba compiles for the plugin and Warp for its kernels.

Plain functions of single numbers, with the laws of `finger_pin.laws` written so that single precision keeps their
digits: small changes are computed as such, never as differences of large numbers.
"""

from __future__ import annotations

import math

#: The floor that keeps (9a) finite where nothing is pressed, N: higher ones are friction that users have asked for.
NUMERICAL_FLOOR = 1e-4


def coefficient(speed: float, kinetic: float, static: float, stribeck: float, exponent: float) -> float:
    """Return M(v) of (9b)."""
    ratio = abs(speed) / stribeck
    return kinetic + (static - kinetic) * math.exp(-ratio * ((2.0 - exponent) + (exponent - 1.0) * ratio))


def one_minus_exp(x: float) -> float:
    """Return 1 - exp(-x) of x >= 0, exact to rounding for small x too."""
    if x > 0.64:
        return 1.0 - math.exp(-x)
    # The series at an eighth of it, and three times 1 - exp(-2 y) = g (2 - g) with g = 1 - exp(-y).
    y = 0.125 * x
    higher_terms = 1.0 / 720.0 - y * (1.0 / 5040.0 - y * (1.0 / 40320.0 - y / 362880.0))
    eighth = y * (1.0 - y * (1.0 / 2.0 - y * (1.0 / 6.0 - y * (1.0 / 24.0 - y * (1.0 / 120.0 - y * higher_terms)))))
    quarter = eighth * (2.0 - eighth)
    half = quarter * (2.0 - quarter)
    return half * (2.0 - half)


def capstan(surface: float, turn: float) -> float:
    """Return mu^d of (16)."""
    loss = one_minus_exp(surface * turn)
    return loss / (2.0 - loss)


def bristle_stiffness(
    stiffness: float, hardening: float, force: float, level: float, speed: float, surface: float, turn: float
) -> float:
    """Return the stiffness with which bristles that slip by F^s / level move as they do by `laws.bristle_slip`.

    With a = 1 where they are bent further and -1 where they spring back, that at F^s times (1 - a g) / (1 - a r).
    """
    if hardening == 0.0:
        return stiffness
    kinetic, share = capstan(surface, turn), abs(force) / level
    steepness = 1.0 / max((1.0 - kinetic) * (1.0 + kinetic), 1e-6)
    slack = max(1.0 - share, 0.0)
    if force * speed > 0.0:
        factor = steepness / (1.0 + (steepness - 1.0) * slack)
    else:
        slip = min(share, 1.0) / (1.0 + (steepness - 1.0) * slack) + steepness * max(share - 1.0, 0.0)
        factor = (1.0 + slip) / (1.0 + share)
    return (stiffness + hardening * abs(force)) * factor


def slide(force: float, displacement: float, level: float) -> tuple[float, float]:
    """Return the change of F^s by (9a) over s0 v dt at this speed and level, exactly, and the share that is left."""
    slipped = one_minus_exp(abs(displacement) / level)
    return (math.copysign(level, displacement) - force) * slipped, 1.0 - slipped


def delivered(pull: float, tension: float, force: float, viscous: float, speed: float) -> tuple[float, float]:
    """Return the friction on a tension, and the tension behind it.

    Of a pulled tendon the length's speed is negative when it is wound in.
    """
    sign = 1.0 if pull > 0.0 else -1.0
    loss = sign * (force + viscous * speed)
    return loss, max(tension - loss, 0.0)


def sliding_level(
    of_pin: bool,
    coulomb: float,
    static: float,
    stribeck: float,
    exponent: float,
    floor: float,
    drag: float,
    speed: float,
    pressing: float,
    turn: float,
) -> float:
    """Return the level of friction, F^n M + drag, by (9b), (16): the ``static`` of a tendon is a ratio."""
    kinetic = coulomb if of_pin else capstan(coulomb, turn)
    sliding_coefficient = coefficient(speed, kinetic, static if of_pin else static * kinetic, stribeck, exponent)
    # The drag of a pin lets go at M^c / M^d of it.
    drag_share = sliding_coefficient / kinetic if of_pin and kinetic > 0.0 else 1.0
    return max(pressing * sliding_coefficient + drag * drag_share, floor)


def row_terms(
    level: float,
    stiffness: float,
    viscous: float,
    micro_damping: float,
    speed: float,
    tension: float,
    largest: float,
    force: float,
    dt: float,
) -> tuple[float, float, float]:
    """Return a friction's part of its row: F - x, c + b, and the most that it exerts."""
    if tension == 0.0 and force == 0.0:
        return 0.0, stiffness * dt + viscous + micro_damping, min(level + viscous * abs(speed), largest)
    displacement = stiffness * dt * speed
    change, remaining = slide(force, displacement, level)
    # The micro-damping's sigma_1 z', as z goes at this speed; it may help the motion.
    micro = micro_damping * (change / displacement if displacement != 0.0 else 1.0)
    limit = max(level, abs(force + change)) + (viscous + micro) * abs(speed)
    pull = force - (displacement - change) * remaining + min(micro, 0.0) * speed
    return pull, stiffness * dt + viscous + max(micro, 0.0), min(limit, largest)
