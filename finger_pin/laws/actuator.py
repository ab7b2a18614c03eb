"""An actuator whose force is affine in its input and in its own motion, both within limits: a motor, or a servo.

One with a state answers late, or sums up: z' = r_u u + r_l l + r_z z, and its force has a part that is proportional to
z. With r_u = 1 / T = -r_z it is a filter of its input, whose rate may be limited, with r_u = 1 its integral, with
r_u = 1 = -r_l that of a servo's error.
"""

from __future__ import annotations

import numpy as np

from finger_pin.laws.law import Law, Row
from finger_pin.typing import Number, Numbers, Parameters


def _value(row: Row, p: Parameters) -> Numbers:
    gain, offset, by_length, by_speed, lowest, highest, least, most = p
    command = np.minimum(np.maximum(row.command, lowest), highest)
    wanted = gain * command + offset + by_length * row.length + by_speed * row.speed
    return np.minimum(np.maximum(wanted, least), most), 0.0 * row.length, wanted


def _slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    gain, _, by_length, by_speed, lowest, highest, least, most = p
    free = 1.0 * (signals[0] > least) * (signals[0] < most)
    by_command = free * gain * (row.command > lowest) * (row.command < highest)
    return (free * by_length, free * by_speed, 0.0, 0.0, 0.0, by_command, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    return 0.0 * force, force * row.speed


def _work(row: Row, p: Parameters, signals: Numbers) -> Number:
    # With F = F_0 + b l the integral is H(F) / b, with H = F^2 / 2 within the limits, and a line beyond them.
    by_length, least, most, wanted = p[2], p[6], p[7], signals[0]
    limited = np.minimum(np.maximum(wanted, least), most)
    affine = np.where(wanted == limited, 0.5 * wanted**2, limited * wanted - 0.5 * limited**2)
    constant = by_length == 0.0
    return np.where(constant, limited * row.length, affine / np.where(constant, 1.0, by_length))


#: g u + b_0 + b_1 l + b_2 l', as MuJoCo's actuators without dynamics; g = k_p and b_1 = -k_p make a servo.
ACTUATOR = Law(
    name="actuator",
    parameters=("gain", "offset", "by_length", "by_speed", "lowest", "highest", "least", "most"),
    value=_value,
    slopes=_slopes,
    account=_account,
    signals=("wanted",),
    supplies=("actuators",),
    work=_work,
)

# Rate at which a state returns to its limits, 1/s.
_LIMIT_RATE = 1e3


def _command_and_rates(row: Row, p: Parameters) -> Numbers:
    """Return u within its limits, and z' free of its limits and within them."""
    _, _, _, _, lowest, highest, _, _, _, by_input, by_length, by_state, least, most, slew = p
    command = np.minimum(np.maximum(row.command, lowest), highest)
    rate = by_input * command + by_length * row.length + by_state * row.state
    limited = np.minimum(np.maximum(rate, -slew), slew)
    lowest_rate, highest_rate = _LIMIT_RATE * (least - row.state), _LIMIT_RATE * (most - row.state)
    return command, rate, np.minimum(np.maximum(limited, lowest_rate), highest_rate)


def _state_value(row: Row, p: Parameters) -> Numbers:
    gain, offset, by_length, by_speed, _, _, least, most, by_state, _, _, _, _, _, _ = p
    command, free, rate = _command_and_rates(row, p)
    wanted = gain * command + offset + by_length * row.length + by_speed * row.speed + by_state * row.state
    return np.minimum(np.maximum(wanted, least), most), rate, wanted, free


def _state_slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    gain, _, by_length, by_speed, lowest, highest, least, most, by_state = p[:9]
    rate_by_input, rate_by_length, rate_by_state, least_state, most_state, slew = p[9:]
    wanted, rate = signals
    free = 1.0 * (wanted > least) * (wanted < most)
    command_free = 1.0 * (row.command > lowest) * (row.command < highest)
    limited = np.minimum(np.maximum(rate, -slew), slew)
    at_most = 1.0 * (limited > _LIMIT_RATE * (most_state - row.state))
    at_limit = at_most + 1.0 * (limited < _LIMIT_RATE * (least_state - row.state))
    rate_free = (1.0 - at_limit) * (rate > -slew) * (rate < slew)
    force = (free * by_length, free * by_speed, free * by_state, 0.0, 0.0, free * command_free * gain, 0.0)
    rate_slope = rate_free * rate_by_state - at_limit * _LIMIT_RATE
    return force, (rate_free * rate_by_length, 0.0, rate_slope, 0.0, rate_free * command_free * rate_by_input, 0.0)


#: The same with a state: a lag, an integrating input, or the integral part of a servo.
ACTUATOR_WITH_STATE = Law(
    name="actuator with a state",
    parameters=(
        *ACTUATOR.parameters,
        "by_state",
        "state_by_input",
        "state_by_length",
        "state_by_state",
        "least_state",
        "most_state",
        "slew",
    ),
    value=_state_value,
    slopes=_state_slopes,
    account=_account,
    signals=("wanted", "free_rate"),
    supplies=("actuators",),
    scale=1.0,
    work=_work,
)
