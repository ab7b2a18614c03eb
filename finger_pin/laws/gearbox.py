"""Friction of a gearbox: law (9) with a level that grows with the torque that the gears carry.

    level = [c0 + m0 N] + [c1 + m1 N] exp(-(|v| / w)^p)

The load-dependent Stribeck model of servo identification (Duclusaud and Passault, "Extended friction models for the
physics simulation of servo actuators", 2024, models M1 to M4). They have N = |external - motor| of torques whose sum
moves the rotor. Of T, with which tendons pull against winding in, and the motor's tau that is N = |T + tau|: twice
what is held.

Gears lose more where the motor drives its load than where the load drives the motor, or less. So the level may have a
part m_d |T| while driving, T v > 0, and m_b |T| while driven. Gears that slide then take T (1 + m_d) from the motor to
wind in and leave it T (1 - m_b) to pay out: from m_b = 1 on no tendon turns them. Those two numbers are, in steady
sliding, a level |c_e T + c_m tau| with a coefficient for each side's torque (the authors' model M5),
m_d = (c_e + c_m) / (1 - c_m) and m_b = (c_e + c_m) / (1 + c_m); and a loss mu_avg |T| z + mu_dif T z^2 with bristles z
(github.com/google-deepmind/mujoco, discussion 3528), m_d = mu_avg + mu_dif and m_b = mu_avg - mu_dif. The level jumps
at v = 0, where the rate of (9a) does not depend on it.

Below p = 1 the exponential has an infinite slope at rest. Here (|v| / w)^p is ((v / w)^2 + eps^2)^(p / 2) - eps^p
with eps = 1e-4: smooth, zero at rest, and the level is off by at most eps^p of its Stribeck part, 1e-3 of it for
p = 0.76.
"""

from __future__ import annotations

import numpy as np

from finger_pin.laws.bristle import bristle_account, friction_force, friction_level, stiction_rate, stiction_rate_slopes
from finger_pin.laws.law import Law, Row, direction
from finger_pin.typing import Number, Numbers, Parameters

_EPSILON = 1e-4
# Least level, N m: it keeps (9a) finite for a gearbox without dry friction.
_LEAST_LEVEL = 1e-9


def stribeck_share(speed: Number, stribeck: Number, exponent: Number) -> Number:
    """Return exp(-(|v| / w)^p), smooth and 1 at rest."""
    square = (speed / stribeck) ** 2 + _EPSILON**2
    return np.exp(_EPSILON**exponent - square ** (0.5 * exponent))


def stribeck_share_slope(speed: Number, stribeck: Number, exponent: Number, share: Number) -> Number:
    """Return the derivative of `stribeck_share` by v."""
    square = (speed / stribeck) ** 2 + _EPSILON**2
    return -share * exponent * square ** (0.5 * exponent - 1.0) * speed / (stribeck * stribeck)


def loss_share(pull: Number, speed: Number, driving: Number, driven: Number, side: Number = 0.0) -> Number:
    """Return the share of the tendons' torque T that gears lose, by the direction of power through them."""
    direction_sign = np.sign(pull) * direction(speed, side)
    return 0.5 * ((1.0 + direction_sign) * driving + (1.0 - direction_sign) * driven)


def _value(row: Row, p: Parameters) -> Numbers:
    base, by_load, stribeck, stribeck_by_load, velocity, exponent, viscous, stiffness, driving, driven = p
    share = stribeck_share(row.speed, velocity, exponent)
    dry = base + by_load * row.load + (stribeck + stribeck_by_load * row.load) * share
    torque_loss = loss_share(row.command, row.speed, driving, driven, row.side) * np.abs(row.command)
    level = friction_level(1.0, dry + torque_loss, _LEAST_LEVEL)
    loss = friction_force(row.state, row.speed, viscous)
    return -loss, stiction_rate(row.state, row.speed, level, stiffness, row.side), loss, share, level


def _slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    _, by_load, stribeck, stribeck_by_load, velocity, exponent, viscous, stiffness, driving, driven = p
    _, share, level = signals
    by_stiction, by_speed, by_level = stiction_rate_slopes(row.state, row.speed, level, stiffness, row.side)
    by_level = by_level * (level > _LEAST_LEVEL)
    share_slope = stribeck_share_slope(row.speed, velocity, exponent, share)
    stribeck_slope = (stribeck + stribeck_by_load * row.load) * share_slope
    rate_by_load = by_level * (by_load + stribeck_by_load * share)
    rate_by_command = by_level * loss_share(row.command, row.speed, driving, driven, row.side) * np.sign(row.command)
    rate = (0.0, by_speed + by_level * stribeck_slope, by_stiction, rate_by_load, rate_by_command, 0.0)
    return (0.0, -viscous, -1.0, 0.0, 0.0, 0.0, 0.0), rate


def _account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    _, _, _, _, _, _, viscous, stiffness, _, _ = p
    return bristle_account(row.speed, row.state, rate, signals[2], stiffness, viscous, 0.0)[:3]


#: The friction of a gearbox on its output.
GEARBOX = Law(
    name="gearbox (9)",
    parameters=(
        "base",
        "by_load",
        "stribeck",
        "stribeck_by_load",
        "stribeck_velocity",
        "exponent",
        "viscous",
        "stiffness",
        "driving",
        "driven",
    ),
    value=_value,
    slopes=_slopes,
    account=_account,
    signals=("friction", "stribeck_share", "level"),
    losses=("coulomb", "viscous"),
    scale=1e-2,
    kink="speed",
)
