"""An actuator whose force is affine in its input and in its own motion, both within limits: a motor, or a servo."""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.laws.law import Law, Row


def _value(row: Row, p: Any) -> Any:
    gain, offset, by_length, by_speed, lowest, highest, least, most = p
    held = np.minimum(np.maximum(row.command, lowest), highest)
    wanted = gain * held + offset + by_length * row.length + by_speed * row.speed
    return np.minimum(np.maximum(wanted, least), most), 0.0 * row.length, wanted


def _slopes(row: Row, p: Any, signals: Any) -> Any:
    gain, _, by_length, by_speed, lowest, highest, least, most = p
    free = 1.0 * (signals[0] > least) * (signals[0] < most)
    by_command = free * gain * (row.command > lowest) * (row.command < highest)
    return (free * by_length, free * by_speed, 0.0, 0.0, 0.0, by_command, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _account(row: Row, p: Any, force: Any, rate: Any, signals: Any) -> Any:
    return 0.0 * force, force * row.speed


#: g u + b_0 + b_1 l + b_2 l', as MuJoCo's actuators without dynamics; g = k_p and b_1 = -k_p make a servo.
ACTUATOR = Law(
    name="actuator",
    parameters=("gain", "offset", "by_length", "by_speed", "lowest", "highest", "least", "most"),
    value=_value,
    slopes=_slopes,
    account=_account,
    signals=("wanted",),
    supplies=("actuators",),
)
