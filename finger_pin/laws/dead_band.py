"""A spring and damper along a path, relaxed between two lengths."""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.laws.law import Law, Row
from finger_pin.laws.limiter import penetration
from finger_pin.laws.spring import spring_energy, spring_loss


def _value(row: Row, p: Any) -> Any:
    stiffness, lower, upper, damping = p
    stretch = penetration(row.length, lower, upper)
    return -stiffness * stretch - damping * row.speed, 0.0 * row.length, stretch


def _slopes(row: Row, p: Any, signals: Any) -> Any:
    stiffness, _, _, damping = p
    by_length = -stiffness * np.abs(np.sign(signals[0]))
    return (by_length, -damping, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _account(row: Row, p: Any, force: Any, rate: Any, signals: Any) -> Any:
    stiffness, _, _, damping = p
    return spring_energy(signals[0], stiffness, 0.0), spring_loss(row.speed, damping)


#: The spring of a MuJoCo tendon: it pushes below the first and pulls beyond the second of its spring lengths.
DEAD_BAND_SPRING = Law(
    name="spring with a dead band",
    parameters=("stiffness", "lower", "upper", "damping"),
    value=_value,
    slopes=_slopes,
    account=_account,
    signals=("stretch",),
    losses=("damping",),
)
