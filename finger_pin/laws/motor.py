"""A direct-current motor, seen at the output of its gearbox: tau = K_t i, limited in voltage and in current.

    i = clip((U - K_t w) / R, -I_max, I_max),   |U| <= V

It is driven by a voltage, its command; or by a current, K_t i being T, command times gain, plus what is to overcome
friction: sign(w) level + b w with the level c + m |u T + sign(w) level| of gears that slide slowly, in which u T is the
part of their load that grows with T. Then the electronics apply U = R i + K_t w as far as they can. Where the current
is limited they apply less than was asked for, so that U i = R i^2 + tau w always. A command of `OPEN_CIRCUIT` lets the
motor go: i = 0, and U = K_t w is what it induces.
"""

from __future__ import annotations

import numpy as np

from finger_pin.laws.law import Law, Row
from finger_pin.typing import Number, Numbers, Parameters

#: The voltage that means none: no current flows.
OPEN_CIRCUIT = 1e30
# Least share of a torque that gears are expected to leave.
_LEAST_SHARE = 1e-3


def friction_torque(speed: Number, torque: Number, p: Parameters) -> tuple[Number, Number, Number]:
    """Return the torque that is expected to overcome friction, N m, smooth over a reversal, and its slopes.

    With s = tanh(w / w_r) for the sign of w, the level is linear in its load of either sign; one sign comes out.

    Args:
        speed: w, rad/s.
        torque: T, N m; a negative one pulls no tendon.
        p: Numbers of `MOTOR`.

    Returns:
        The torque, and its derivatives by w and by T.
    """
    _, _, _, _, _, _, dry, by_torque, by_load, viscous, reversal = p
    sign, pull = np.tanh(speed / reversal), np.maximum(torque, 0.0)
    # Of numbers, np.where would make arrays in compiled code.
    side = 2.0 * (by_torque * pull + by_load * sign * dry >= 0.0) - 1.0
    share = np.maximum(1.0 - side * by_load * sign, _LEAST_SHARE)
    level = (dry + side * by_torque * pull) / share
    by_sign = level * (1.0 + side * by_load * sign / share * (share > _LEAST_SHARE))
    by_speed = by_sign * (1.0 - sign * sign) / reversal + viscous
    return sign * level + viscous * speed, by_speed, sign * side * by_torque / share * (torque > 0.0)


def requested_voltage(speed: Number, command: Number, p: Parameters) -> Number:
    """Return the voltage that the drive asks for before any limit, V; see `MOTOR` for ``p``."""
    constant, resistance, _, _, by_current, gain, _, _, _, _, _ = p
    torque = gain * command + friction_torque(speed, gain * command, p)[0]
    return by_current * (resistance * torque / constant + constant * speed) + (1.0 - by_current) * command


def free_current(speed: Number, requested: Number, p: Parameters) -> Number:
    """Return the current without its limit, A, for a requested voltage, V."""
    constant, resistance, supply, _, _, _, _, _, _, _, _ = p
    return (np.minimum(np.maximum(requested, -supply), supply) - constant * speed) / resistance


def _value(row: Row, p: Parameters) -> Numbers:
    constant, resistance, _, limit, _, _, _, _, _, _, _ = p
    free = free_current(row.speed, requested_voltage(row.speed, row.command, p), p)
    current = np.minimum(np.maximum(free, -limit), limit) * (row.command < OPEN_CIRCUIT)
    voltage = resistance * current + constant * row.speed
    return constant * current, 0.0 * row.length, current, voltage


def _slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    constant, resistance, supply, limit, by_current, gain, _, _, _, _, _ = p
    requested = requested_voltage(row.speed, row.command, p)
    within_limit = np.abs(free_current(row.speed, requested, p)) < limit
    current_slope = constant / resistance * within_limit * (row.command < OPEN_CIRCUIT)
    voltage_slope = current_slope * (np.abs(requested) < supply)
    _, friction_slope, by_torque = friction_torque(row.speed, gain * row.command, p)
    by_speed = voltage_slope * by_current * (resistance * friction_slope / constant + constant)
    by_speed = by_speed - current_slope * constant
    by_command = voltage_slope * (by_current * resistance * gain * (1.0 + by_torque) / constant + 1.0 - by_current)
    return (0.0, by_speed, 0.0, 0.0, 0.0, by_command, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    (current, voltage), (_, resistance, _, _, _, _, _, _, _, _, _) = signals, p
    return 0.0 * row.length, voltage * current, resistance * current * current


#: The torque of a motor on its rotor: ``by_current`` is 1 or 0, ``gain`` torque per command, the rest of (9)'s kind.
MOTOR = Law(
    name="motor",
    parameters=(
        "torque_constant",
        "resistance",
        "voltage",
        "current_limit",
        "by_current",
        "gain",
        "dry",
        "by_torque",
        "by_load",
        "viscous",
        "reversal_speed",
    ),
    value=_value,
    slopes=_slopes,
    account=_account,
    signals=("current", "voltage"),
    supplies=("electrical",),
    losses=("heat",),
)
