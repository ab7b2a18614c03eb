"""An actuator whose force is affine in its input and in its own motion, within limits: a motor, or a servo."""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.laws.law import Law, Row


def _wanted(row: Row, p: Any) -> Any:
    gain, offset, by_length, by_speed, _, _ = p
    return gain * row.command + offset + by_length * row.length + by_speed * row.speed


def _value(row: Row, p: Any) -> Any:
    wanted = _wanted(row, p)
    return np.minimum(np.maximum(wanted, p[4]), p[5]), 0.0 * row.length, wanted


def _slopes(row: Row, p: Any, signals: Any) -> Any:
    gain, _, by_length, by_speed, least, most = p
    free = 1.0 * (signals[0] > least) * (signals[0] < most)
    force = (free * by_length, free * by_speed, 0.0, 0.0, 0.0, free * gain, 0.0)
    return force, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _account(row: Row, p: Any, force: Any, rate: Any, signals: Any) -> Any:
    return 0.0 * force, force * row.speed


#: g u + b_0 + b_1 l + b_2 l', as MuJoCo's actuators without dynamics: b_1 = -k_p and g = k_p make a servo.
ACTUATOR = Law(
    name="actuator",
    parameters=("gain", "offset", "by_length", "by_speed", "least", "most"),
    value=_value,
    slopes=_slopes,
    account=_account,
    signals=("wanted",),
    supplies=("actuators",),
)
