"""The massive passive tendon: its two halves (5), (12), and its motion (13)."""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.laws.law import Law, Row


def half_tension(stretch: Any, stiffness: Any) -> Any:
    """Return max(0, K_h stretch), N: one half of a passive tendon, equations (5) and (12)."""
    return np.maximum(0.0, stiffness * stretch)


def half_energy(stretch: Any, stiffness: Any) -> Any:
    """Return the elastic energy of one half of a passive tendon, J; zero when slack."""
    return 0.5 * stiffness * np.maximum(0.0, stretch) ** 2


def _value(row: Row, p: Any) -> Any:
    (stiffness,) = p
    return half_tension(-row.length, stiffness), 0.0 * row.length


def _slopes(row: Row, p: Any, signals: Any) -> Any:
    (stiffness,) = p
    by_length = -stiffness * (row.length < 0.0)
    return (by_length, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _account(row: Row, p: Any, force: Any, rate: Any, signals: Any) -> Any:
    (stiffness,) = p
    return (half_energy(-row.length, stiffness),)


#: One half of a passive tendon, a spring that only pulls; it is stretched where its length is negative.
TENDON_HALF = Law(
    name="half of a passive tendon (5), (12)", parameters=("stiffness",), value=_value, slopes=_slopes, account=_account
)
