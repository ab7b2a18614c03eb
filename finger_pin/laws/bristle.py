"""Law (9): the adapted LuGre friction of tendons and joints.

Plain functions of numbers or arrays (they broadcast), without state. `stiction_rate` is (9a), `friction_level` is
F^n M with M from (9b), `friction_force` is (9c). The derivatives serve implicit integrators.

Two options lead from the paper's law to the usual LuGre model (Canudas de Wit et al., IEEE Trans. Automatic Control
40(3), 1995), where F^s = sigma_0 z: the Stribeck exponent, 1 in the paper and 2 there, and the micro-damping sigma_1,
0 in the paper, whose force is sigma_1 z' = lag F^s' with lag = sigma_1 / sigma_0.

Bristles may harden: sigma_0 (F^s) = sigma_0 + |F^s| / delta, a spring z = delta ln(1 + |F^s| / (delta sigma_0)), so
that they give by about a length, delta, at any level. A stiffness that followed the level itself would not be passive:
as a load falls, energy F^s^2 / (2 sigma_0) would come from nowhere. Of the state F^s alone, with an energy V(F^s),
passivity under any load demands V' sigma_0 = F^s for stretching and for letting go, so that the stiffness may depend on
F^s, and on nothing else.

A drag that differs by direction makes the level jump where the speed changes sign, as gears do: there the rate (9a),
sigma_0 (v - F^s |v| / level), does not depend on the level. F^s slides on at drag (1 + a) one way and -drag (1 - a)
the other way. Sliding takes F^s^2 |v| / level at any level, so that this too is passive.

Without micro-damping the law is passive whatever happens. With it, while |F^s| <= F^n M^c and F^n is constant, it is
if b >= sigma_1 (M^c - M^d) / M^d (Barabanov and Ortega, IEEE Trans. Automatic Control 45(4), 2000), and in any case
as long as |v| <= 4 F^n M (1 + b / sigma_1) / sigma_1, which covers sticking.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from finger_pin.laws.law import Law, Row, direction, magnitude
from finger_pin.typing import Array, Number, Numbers, Numeric, Parameters


class BristleColumns(NamedTuple):
    """Columns of the parameters that the laws of pins and tendons share."""

    stiffness: int = 2
    viscous: int = 3
    stribeck_velocity: int = 4
    floor: int = 5
    stribeck_exponent: int = 6
    lag: int = 7
    hardening: int = 8
    drag: int = 9


#: Positions in ``p``; the compiler takes them for constants.
BRISTLE = BristleColumns()
# Least power in (9b), 1: of a row that is held on a side it has left by many omega, as where the shortest way of a cord
# changes to the other side of what it wraps about, exp(|v| / omega) would overflow.
_LEAST_POWER = -30.0


def friction_coefficient(
    velocity: Numeric, kinetic: Numeric, static: Numeric, stribeck: Numeric, exponent: Number = 1.0, side: Number = 0.0
) -> Numeric:
    """Return M(v) = M^d + (M^c - M^d) exp(-(|v| / omega)^p), equation (9b) with p = 1.

    Args:
        velocity: Sliding velocity v.
        kinetic: M^d, Coulomb (kinetic) coefficient.
        static: M^c, stiction coefficient.
        stribeck: omega, Stribeck velocity.
        exponent: p, 1 or 2.
        side: As in `Row`.
    """
    ratio = magnitude(velocity, side) / stribeck
    return kinetic + (static - kinetic) * np.exp(-_stribeck_power(ratio, exponent))


def friction_coefficient_slope(
    velocity: Number, kinetic: Number, static: Number, stribeck: Number, exponent: Number = 1.0, side: Number = 0.0
) -> Number:
    """Return dM/dv of (9b)."""
    ratio = magnitude(velocity, side) / stribeck
    power = _stribeck_power(ratio, exponent)
    power_slope = ((2.0 - exponent) + 2.0 * (exponent - 1.0) * ratio) * (power > _LEAST_POWER)
    return -direction(velocity, side) * (static - kinetic) / stribeck * power_slope * np.exp(-power)


def _stribeck_power(ratio: Numeric, exponent: Number) -> Numeric:
    """Return (|v| / omega)^p of (9b), not below `_LEAST_POWER`; exact for 1 and 2, without the cost of a power."""
    return np.maximum(ratio * ((2.0 - exponent) + (exponent - 1.0) * ratio), _LEAST_POWER)


def friction_level(normal: Number, coefficient: Number, floor: Number, drag: Number = 0.0) -> Number:
    """Return max(F^n M + drag, g_min), the stiction that steady sliding settles at.

    The floor keeps (9a) finite for an unloaded contact.
    """
    return np.maximum(normal * coefficient + drag, floor)


def directed_drag(drag: Numeric, asymmetry: Numeric, sign: Numeric) -> Numeric:
    """Return the drag in a direction of motion, 1 or -1: drag (1 + a) or drag (1 - a)."""
    return drag * (1.0 + asymmetry * sign)


def bristle_stiffness(stiction: Number, stiffness: Number, hardening: Number) -> Number:
    """Return the stiffness of bristles at F^s, sigma_0 + |F^s| / delta, with the hardening 1 / delta."""
    return stiffness + hardening * np.abs(stiction)


def bristle_deflection(force: Number, stiffness: Number, hardening: Number) -> Number:
    """Return the deflection of bristles under a force before they slip, m or rad."""
    hardens = 1.0 * (hardening > 0.0)
    length = 1.0 / (hardening + (1.0 - hardens))
    return (1.0 - hardens) * force / stiffness + hardens * length * np.log1p(force / (stiffness * length))


def stiction_rate(stiction: Number, velocity: Number, level: Number, stiffness: Number, side: Number = 0.0) -> Number:
    """Return F^s' = sigma_0 (v - F^s |v| / level), equation (9a), with the stiffness at F^s."""
    return stiffness * (velocity - stiction * magnitude(velocity, side) / level)


def stiction_rate_slopes(
    stiction: Number, velocity: Number, level: Number, stiffness: Number, side: Number = 0.0, hardening: Number = 0.0
) -> tuple[Number, Number, Number]:
    """Return the derivatives of (9a) with respect to F^s, v and the level; the stiffness is that at F^s."""
    speed = magnitude(velocity, side)
    by_stiction = hardening * np.sign(stiction) * (velocity - stiction * speed / level) - stiffness * speed / level
    by_velocity = stiffness * (1.0 - stiction * direction(velocity, side) / level)
    by_level = stiffness * stiction * speed / (level * level)
    return by_stiction, by_velocity, by_level


def friction_force(
    stiction: Number, velocity: Number, viscous: Number, rate: Number = 0.0, lag: Number = 0.0
) -> Number:
    """Return F^f = F^s + lag F^s' + b v, equation (9c) with lag = 0.

    Args:
        stiction: F^s.
        velocity: Sliding velocity v.
        viscous: b.
        rate: F^s' of (9a).
        lag: sigma_1 / sigma_0, micro-damping over bristle stiffness, s.
    """
    return stiction + viscous * velocity + lag * rate


def bristle_energy(stiction: Number, stiffness: Number, hardening: Number = 0.0) -> Number:
    """Return the elastic energy of the bristles, F^s^2 / (2 sigma_0), or the integral of F^s / sigma_0 (F^s).

    With the length delta of hardening and u = |F^s| / (delta sigma_0) that is delta^2 sigma_0 (u - ln(1 + u)).
    """
    hardens = 1.0 * (hardening > 0.0)
    length = 1.0 / (hardening + (1.0 - hardens))
    stretch = np.abs(stiction) / (length * stiffness)
    hard = length * length * stiffness * (stretch - np.log1p(stretch))
    return (1.0 - hardens) * stiction * stiction / (2.0 * stiffness) + hardens * hard


def coulomb_loss(stiction: Number, velocity: Number, level: Number) -> Number:
    """Return the power lost by sliding, F^s^2 |v| / level: F^f v less the viscous loss and the bristles' power."""
    return stiction * stiction * np.abs(velocity) / level


def viscous_loss(velocity: Number, viscous: Number) -> Number:
    """Return the power lost in viscous friction, as in (9c), or in a damper: b v^2."""
    return viscous * velocity * velocity


def micro_loss(rate: Number, velocity: Number, lag: Number) -> Number:
    """Return the power lost in the micro-damping, sigma_1 z' v.

    It is positive while the bristles follow the motion; while they spring back, it may be negative.
    """
    return lag * rate * velocity


def passive_micro_damping(viscous: Number, kinetic: Number, static: Number) -> Array:
    """Return the most sigma_1 with which friction never drives motion, b M^d / (M^c - M^d); see the module."""
    excess = static - kinetic
    return np.where(excess > 0.0, viscous * kinetic / np.where(excess > 0.0, excess, 1.0), np.inf)


def steady_force(velocity: Number, normal: Number, coefficient: Number, viscous: Number) -> Number:
    """Return the friction of steady sliding, F^n M(v) sign(v) + b v: (9) with F^s' = 0, the curves of Fig. 3."""
    return normal * coefficient * np.sign(velocity) + viscous * velocity


def _value(row: Row, p: Parameters) -> Numbers:
    kinetic, static, base_stiffness, viscous, stribeck, floor, exponent, _, hardening, drag, static_drag, asymmetry = p
    share = friction_coefficient(row.speed, 0.0, 1.0, stribeck, exponent, row.side)
    coefficient = kinetic + (static - kinetic) * share
    drag_level = directed_drag(drag + (static_drag - drag) * share, asymmetry, direction(row.speed, row.side))
    level = friction_level(row.load, coefficient, floor, drag_level)
    stiffness = bristle_stiffness(row.state, base_stiffness, hardening)
    rate = stiction_rate(row.state, row.speed, level, stiffness, row.side)
    loss = friction_force(row.state, row.speed, viscous, rate, micro_lag(row.state, p))
    return -loss, rate, loss, row.load, coefficient, level


def _slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    kinetic, static, base_stiffness, viscous, stribeck, floor, exponent, _, hardening, drag, static_drag, asymmetry = p
    _, _, coefficient, level = signals
    stiffness = bristle_stiffness(row.state, base_stiffness, hardening)
    by_stiction, by_speed, by_level = stiction_rate_slopes(row.state, row.speed, level, stiffness, row.side, hardening)
    by_level = by_level * (level > floor)
    sign = direction(row.speed, row.side)
    by_share = row.load * (static - kinetic)
    by_share = by_share + directed_drag(static_drag, asymmetry, sign) - directed_drag(drag, asymmetry, sign)
    by_speed = by_speed + by_level * by_share * friction_coefficient_slope(
        row.speed, 0.0, 1.0, stribeck, exponent, row.side
    )
    by_state = micro_slope(row, level, p) - 1.0
    force = (0.0, -viscous, by_state, -micro_lag(row.state, p), 0.0, 0.0, 0.0)
    return force, (0.0, by_speed, by_stiction, by_level * coefficient, 0.0, 0.0)


def micro_lag(stiction: Number, p: Parameters) -> Number:
    """Return sigma_1 over the stiffness at F^s, s, of the numbers of `PIN_FRICTION` or of a tendon."""
    stiffness = p[BRISTLE.stiffness]
    return p[BRISTLE.lag] * (stiffness / bristle_stiffness(stiction, stiffness, p[BRISTLE.hardening]))


def micro_slope(row: Row, level: Number, p: Parameters) -> Number:
    """Return minus the derivative of the micro-damping's force by F^s at a constant rate of F^s."""
    slip = row.speed - row.state * magnitude(row.speed, row.side) / level
    return micro_lag(row.state, p) * p[BRISTLE.hardening] * np.sign(row.state) * slip


def bristle_account(
    speed: Number,
    stiction: Number,
    rate: Number,
    level: Number,
    stiffness: Number,
    viscous: Number,
    lag: Number,
    hardening: Number = 0.0,
) -> Numbers:
    """Return the energy of the bristles, and the powers lost by sliding, in viscous friction and in micro-damping."""
    return (
        bristle_energy(stiction, stiffness, hardening),
        coulomb_loss(stiction, speed, level),
        viscous_loss(speed, viscous),
        micro_loss(rate, speed, lag),
    )


def row_account(row: Row, rate: Number, level: Number, p: Parameters) -> Numbers:
    """Return `bristle_account` of a row, of the numbers of `PIN_FRICTION` or of a tendon."""
    lag, hardening = micro_lag(row.state, p), p[BRISTLE.hardening]
    return bristle_account(row.speed, row.state, rate, level, p[BRISTLE.stiffness], p[BRISTLE.viscous], lag, hardening)


def _account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    return row_account(row, rate, signals[3], p)


#: Friction between two parts that a load presses together, such as the pin of a joint (17), or a seal without one.
PIN_FRICTION = Law(
    name="pin friction (9)",
    parameters=("kinetic", "static", *BRISTLE._fields, "static_drag", "drag_asymmetry"),
    value=_value,
    slopes=_slopes,
    account=_account,
    signals=("friction", "normal_force", "coefficient", "level"),
    losses=("coulomb", "viscous", "micro_damping"),
    scale=1e-2,
    kink="speed",
)
