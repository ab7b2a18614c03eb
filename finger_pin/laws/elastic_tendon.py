"""An elastic tendon between a spool and the canal: stretched it pulls with K e + D e', and it never pushes."""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.laws.law import Law, Row, beyond


def elastic_energy(stretch: Any, stiffness: Any) -> Any:
    """Return the elastic energy K e^2 / 2, J; zero when slack."""
    return 0.5 * stiffness * np.maximum(0.0, stretch) ** 2


def _value(row: Row, p: Any) -> Any:
    stiffness, damping = p
    pull = -stiffness * row.length - damping * row.speed
    return pull * beyond(pull, row.side), 0.0 * row.length, pull


def _slopes(row: Row, p: Any, signals: Any) -> Any:
    stiffness, damping = p
    taut = beyond(signals[0], row.side)
    return (-stiffness * taut, -damping * taut, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _account(row: Row, p: Any, force: Any, rate: Any, signals: Any) -> Any:
    stiffness, stretch = p[0], np.maximum(0.0, -row.length)
    return elastic_energy(stretch, stiffness), (stiffness * stretch - force) * row.speed


#: f^m = max(0, K e + D e'); the stretch e is the length of the row taken negative.
ELASTIC_TENDON = Law(
    name="elastic tendon",
    parameters=("stiffness", "damping"),
    value=_value,
    slopes=_slopes,
    account=_account,
    signals=("pull",),
    losses=("damping",),
    kink="pull",
)
