"""Cogging of a motor: magnets that hold on to the teeth of its stator, n times a turn, and give back what they take.

    tau = -A sin(n theta + phi),   E = A / n (1 - cos(n theta + phi))

It is the first harmonic of such a torque.
"""

from __future__ import annotations

import numpy as np

from finger_pin.laws.law import Law, Row
from finger_pin.typing import Number, Numbers, Parameters


def _value(row: Row, p: Parameters) -> Numbers:
    amplitude, per_turn, phase = p
    return -amplitude * np.sin(per_turn * row.length + phase), 0.0 * row.length


def _slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    amplitude, per_turn, phase = p
    stiffness = amplitude * per_turn * np.cos(per_turn * row.length + phase)
    return (-stiffness, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    amplitude, per_turn, phase = p
    return (amplitude / per_turn * (1.0 - np.cos(per_turn * row.length + phase)),)


#: The cogging torque of a motor on its rotor.
COGGING = Law(
    name="cogging", parameters=("amplitude", "per_turn", "phase"), value=_value, slopes=_slopes, account=_account
)
