"""Friction of a tendon in its canal: (14), (16) and the delivered tension of (12).

A driven tendon is pulled by its input f^a and delivers what friction leaves of it; the canal presses on it with both
(14b). A passive one slides as a whole; its two halves press it (14c).

A drag that no load makes, of seals, sheaths and a tendon that is bent, adds to the level: F^n M + drag. Steady sliding
of a driven tendon then delivers f = f^a exp(-mu_e phi) - drag / (1 + mu^d) when pulling.

Micro-damping depends on the normal force, which by (14) depends on the delivered tension, which depends on
micro-damping. Near slack that loop has two solutions where bristles spring back, so it is not closed: the tension in
(14) is max(0, f^a - F^s - b v), as it is without micro-damping.

Bristles that give by a length slip as `bristle_slip` says, so that it is the capstan law while the pull changes, too.
"""

from __future__ import annotations

import numpy as np

from finger_pin.laws.bristle import (
    BRISTLE,
    bristle_stiffness,
    friction_coefficient,
    friction_coefficient_slope,
    friction_force,
    friction_level,
    micro_lag,
    micro_slope,
    row_account,
    stiction_rate,
    stiction_rate_slopes,
)
from finger_pin.laws.bristle_slip import slip_level, slip_level_slopes, slip_steepness, slip_steepness_slope
from finger_pin.laws.law import Law, Row, direction, magnitude
from finger_pin.typing import Number, Numbers, Numeric, Parameters

#: Force without a limit, N: more than any tendon bears.
UNLIMITED_FORCE = 1e30
# Shortest time constant for integrators, s: about a hundred times the resolution of time.
_INSTANT = 1e-12


def capstan_coefficient(surface: Numeric, curvature: Numeric) -> Numeric:
    """Return mu^d = (1 - exp(-mu_e phi)) / (1 + exp(-mu_e phi)) = tanh(mu_e phi / 2), equation (16).

    Steady sliding then loses tension by the capstan law, f / f^a = exp(-mu_e phi) when pulling.

    Args:
        surface: mu_e, Coulomb coefficient between tendon and canal.
        curvature: phi, total curvature of the path, rad.
    """
    transmitted = np.exp(-surface * curvature)
    return (1.0 - transmitted) / (1.0 + transmitted)


def capstan_slope(surface: Number, coefficient: Number) -> Number:
    """Return d mu^d / d phi of (16), from mu^d itself."""
    return 0.5 * surface * (1.0 - coefficient * coefficient)


def delivered_tension(command: Number, loss: Number, least: Number = 0.0) -> Number:
    """Return f = max(0, f^a - f^f), N: a tendon cannot push, unless another least tension is given."""
    return np.maximum(least, command - loss)


def _least_level_per_speed(stiffness: Number, viscous: Number) -> Number:
    """Return the least level over the speed, N s/m: beyond the floor's reach, (9a) must not get faster.

    As a driven tendon goes slack that slides against its stretched bristles, the tension in (14), y = |F^s| - b v,
    makes (9a) y' = -sigma_0 b v^2 / (M y): a root of time that ends with an infinite rate, e / (2 M) before which
    sqrt(e sigma_0 b) cuts it off. As a passive one goes slack, the time in which its bristles relax falls to the floor
    within floor / (M K v), and no step may be longer than that; e sigma_0 leaves e sigma_0 / (M K).
    """
    return np.sqrt(_INSTANT * stiffness * viscous) + _INSTANT * stiffness


def _least_level_slope(stiffness: Number, viscous: Number) -> Number:
    """Return the derivative of `_least_level_per_speed` by the stiffness."""
    return 0.5 * np.sqrt(_INSTANT * viscous / stiffness) + _INSTANT


def sliding_tension(
    command: Numeric, coefficient: Numeric, speed: Numeric, viscous: Numeric, drag: Number = 0.0, floor: Number = 0.0
) -> Numeric:
    """Return the f, N, that a driven tendon delivers in steady sliding, in the shape of the arguments.

    From f = f^a - s max(M (f + f^a) + drag, g_min) - b v, with s the sign of v: where M = mu^d and b = 0, the capstan
    law less drag / (1 + mu^d) when pulling.

    Args:
        command: f^a, N.
        coefficient: M(v) of (9b).
        speed: v, m/s; positive where the tendon is drawn in.
        viscous: b, N s/m.
        drag: N.
        floor: g_min, N.
    """
    sign = np.sign(speed)
    signed, lost = sign * coefficient, viscous * speed
    delivered = ((1.0 - signed) * command - sign * drag - lost) / (1.0 + signed)
    return np.maximum(0.0, delivered - sign * np.maximum(0.0, floor - sign * (command - delivered - lost)))


def _level(normal: Number, sliding: Number, row: Row, p: Parameters) -> Number:
    """Return F^n M + drag, or its floor."""
    stiffness = bristle_stiffness(row.state, p[BRISTLE.stiffness], p[BRISTLE.hardening])
    least_level = _least_level_per_speed(stiffness, p[BRISTLE.viscous]) * magnitude(row.speed, row.side)
    return friction_level(1.0, normal * sliding + p[BRISTLE.drag], np.maximum(p[BRISTLE.floor], least_level))


def _friction(row: Row, normal: Number, p: Parameters) -> Numbers:
    """Return the rate of F^s under a normal force, the friction, mu^d, M(v) and the level."""
    surface, ratio, base_stiffness, viscous, stribeck, _, exponent, _, hardening = p[:9]
    coefficient = capstan_coefficient(surface, row.curvature)
    sliding = friction_coefficient(row.speed, coefficient, ratio * coefficient, stribeck, exponent, row.side)
    level = _level(normal, sliding, row, p)
    slips_at = slip_level(row.state, level, slip_steepness(coefficient, hardening))
    stiffness = bristle_stiffness(row.state, base_stiffness, hardening)
    rate = stiction_rate(row.state, row.speed, slips_at, stiffness, row.side)
    loss = friction_force(row.state, row.speed, viscous, rate, micro_lag(row.state, p))
    return rate, loss, coefficient, sliding, level


def _rate_slopes(
    row: Row, normal: Number, coefficient: Number, sliding: Number, level: Number, p: Parameters
) -> Numbers:
    """Return the derivatives of F^s' by v, F^s, F^n and phi, and of the micro-damping's force by F^s, negative."""
    surface, ratio, base_stiffness, viscous, stribeck, floor, exponent, _, hardening, _ = p[:10]
    stiffness, speed = bristle_stiffness(row.state, base_stiffness, hardening), magnitude(row.speed, row.side)
    steepness = slip_steepness(coefficient, hardening)
    slips_at = slip_level(row.state, level, steepness)
    slips_by_stiction, slips_by_level, slips_by_steepness = slip_level_slopes(row.state, level, steepness)
    by_stiction, by_speed, by_slip = stiction_rate_slopes(
        row.state, row.speed, slips_at, stiffness, row.side, hardening
    )
    by_stiction, by_free = by_stiction + by_slip * slips_by_stiction, by_slip * slips_by_level
    level_per_speed, level_slope = _least_level_per_speed(stiffness, viscous), _least_level_slope(stiffness, viscous)
    limited = 1.0 * (level > floor) * (level <= level_per_speed * speed)
    by_stiction = by_stiction + limited * by_free * speed * level_slope * hardening * np.sign(row.state)
    by_speed = by_speed + limited * by_free * level_per_speed * direction(row.speed, row.side)
    by_level = by_free * (level > floor) * (1.0 - limited)
    slope = friction_coefficient_slope(row.speed, coefficient, ratio * coefficient, stribeck, exponent, row.side)
    # M is proportional to mu^d, which depends on the posture through the curvature, as s does.
    share = sliding / np.maximum(coefficient, 1e-300)
    by_steepness = by_slip * slips_by_steepness * slip_steepness_slope(coefficient, hardening)
    by_curvature = (by_level * normal * share + by_steepness) * capstan_slope(surface, coefficient)
    micro = micro_slope(row, slips_at, p)
    return by_speed + by_level * normal * slope, by_stiction, by_level * sliding, by_curvature, micro


def _account(row: Row, rate: Number, coefficient: Number, level: Number, p: Parameters) -> Numbers:
    """Return `row_account`, with what bristles lose that slip by `slip_level`."""
    steepness = slip_steepness(coefficient, p[BRISTLE.hardening])
    return row_account(row, rate, slip_level(row.state, level, steepness), p)


def _driven_value(row: Row, p: Parameters) -> Numbers:
    acting, least = p[10:12]
    pressing = delivered_tension(row.command, friction_force(row.state, row.speed, p[BRISTLE.viscous]), least)
    normal = np.abs(pressing) + np.abs(row.command)
    rate, loss, coefficient, sliding, level = _friction(row, normal, p)
    force = delivered_tension(row.command, loss, least) - acting * row.command
    return force, rate, loss, normal, coefficient, sliding, level, pressing


def _driven_slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    (_, _, _, viscous, _, _, _, _, _, _, acting, least), lag = p, micro_lag(row.state, p)
    loss, normal, coefficient, sliding, level, pressing = signals
    by_speed, by_stiction, by_normal, by_curvature, micro = _rate_slopes(row, normal, coefficient, sliding, level, p)
    taut = 1.0 * (delivered_tension(row.command, loss, least) > least)
    pressed = by_normal * np.sign(pressing) * (pressing > least)
    by_command = pressed + by_normal * (1.0 - 2.0 * (row.command < 0.0))
    by_state = taut * (micro - 1.0)
    force = (0.0, -taut * viscous, by_state, -taut * lag, 0.0, taut - acting, 0.0)
    return force, (0.0, by_speed - pressed * viscous, by_stiction - pressed, 0.0, by_command, by_curvature)


def _driven_account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    acting, least = p[10:12]
    stored, coulomb, viscous, micro = _account(row, rate, signals[2], signals[4], p)
    # Only where a tension is cut, so that a wrong tension elsewhere shows in the residual.
    slack = (row.command - signals[0] - least) * row.speed * (row.command - signals[0] <= least)
    return stored, (1.0 - acting) * row.command * row.speed, coulomb, viscous, micro, slack


def _passive_value(row: Row, p: Parameters) -> Numbers:
    rate, loss, coefficient, sliding, level = _friction(row, row.load, p)
    return -loss, rate, loss, row.load, coefficient, sliding, level


def _passive_slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    _, normal, coefficient, sliding, level = signals
    by_speed, by_stiction, by_normal, by_curvature, micro = _rate_slopes(row, normal, coefficient, sliding, level, p)
    force = (0.0, -p[BRISTLE.viscous], micro - 1.0, -micro_lag(row.state, p), 0.0, 0.0, 0.0)
    return force, (0.0, by_speed, by_stiction, by_normal, 0.0, by_curvature)


def _passive_account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    return _account(row, rate, signals[2], signals[4], p)


_PARAMETERS = ("surface", "ratio", *BRISTLE._fields)

#: A tendon that its input pulls through a canal. Where the input acts on the finger by itself, as an elastic tendon
#: does, ``acting`` is 1 and the row exerts what friction changes of it; else 0. It delivers at least ``least``, N.
DRIVEN_TENDON = Law(
    name="driven tendon (12), (14), (16)",
    parameters=(*_PARAMETERS, "acting", "least"),
    value=_driven_value,
    slopes=_driven_slopes,
    account=_driven_account,
    signals=("friction", "normal_force", "coefficient", "sliding_coefficient", "level", "pressing"),
    supplies=("actuators",),
    losses=("coulomb", "viscous", "micro_damping", "slack"),
    scale=1.0,
    kink="speed",
)

#: The friction of a passive tendon, which its halves load.
PASSIVE_FRICTION = Law(
    name="passive tendon (14), (16)",
    parameters=_PARAMETERS,
    value=_passive_value,
    slopes=_passive_slopes,
    account=_passive_account,
    signals=("friction", "normal_force", "coefficient", "sliding_coefficient", "level"),
    losses=("coulomb", "viscous", "micro_damping"),
    scale=1.0,
    kink="speed",
)


def _canal_value(row: Row, p: Parameters) -> Numbers:
    # Lowest tension: tendons that cannot push end at zero.
    lowest = -UNLIMITED_FORCE * (p[10] <= 0.0)
    tension = np.maximum(row.command, lowest)
    delivered = tension - friction_force(row.state, row.speed, p[BRISTLE.viscous])
    pressing = np.maximum(delivered, lowest)
    normal = np.abs(pressing) + np.abs(tension)
    rate, loss, coefficient, sliding, level = _friction(row, normal, p)
    force = np.maximum(-loss, lowest - tension)
    return force, rate, loss, normal, coefficient, sliding, level, pressing


def _canal_slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    _, _, _, viscous, _, _, _, _, _, _, one_way_flag = p
    lag, one_way = micro_lag(row.state, p), 1.0 * (one_way_flag > 0.0)
    loss, normal, coefficient, sliding, level, pressing = signals
    by_speed, by_stiction, by_normal, by_curvature, micro = _rate_slopes(row, normal, coefficient, sliding, level, p)
    pulled = 1.0 - one_way * (row.command <= 0.0)
    tension = pulled * row.command
    taut = 1.0 - one_way * (loss >= tension)
    pressed = by_normal * np.sign(pressing)
    by_command = pulled * (pressed + by_normal * np.sign(tension))
    by_state = taut * (micro - 1.0)
    force = (0.0, -taut * viscous, by_state, -taut * lag, 0.0, pulled * (taut - 1.0), 0.0)
    return force, (0.0, by_speed - pressed * viscous, by_stiction - pressed, 0.0, by_command, by_curvature)


def _canal_account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    stored, coulomb, viscous, micro = _account(row, rate, signals[2], signals[4], p)
    return stored, coulomb, viscous, micro, -(signals[0] + force) * row.speed


#: The friction of a tendon that other rows pull, along its length or a part of it: it exerts what friction changes of
#: their tension, which is its input. With ``one_way`` they only pull, and friction never pushes.
CANAL_FRICTION = Law(
    name="tendon in its canal (14), (16)",
    parameters=(*_PARAMETERS, "one_way"),
    value=_canal_value,
    slopes=_canal_slopes,
    account=_canal_account,
    signals=("friction", "normal_force", "coefficient", "sliding_coefficient", "level", "pressing"),
    losses=("coulomb", "viscous", "micro_damping", "slack"),
    scale=1.0,
    kink="speed",
)


def _cord_tension(row: Row, p: Parameters) -> Numbers:
    (both_ways,) = p
    return np.maximum(row.command, 0.0) + both_ways * np.maximum(-row.command, 0.0), 0.0 * row.command


def _cord_slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    (both_ways,) = p
    by_command = 1.0 * (row.command > 0.0) - both_ways * (row.command < 0.0)
    return (0.0, 0.0, 0.0, 0.0, 0.0, by_command, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _cord_account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    # Without an arm it has no speed, and no power.
    return 0.0 * force, force * row.speed


#: The tension of a cord that turns a joint, by its share of what drives the joint: its input where that pulls it, and
#: its magnitude where one cord, or what stands for a pair, turns it both ways. It has no arm: the drive itself acts.
CORD_TENSION = Law(
    "tension of a cord", ("both_ways",), _cord_tension, _cord_slopes, _cord_account, supplies=("actuators",)
)
