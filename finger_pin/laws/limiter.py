"""Stroke limiters (2): Hunt-Crossley contacts at both ends of a joint's range, which never pull."""

from __future__ import annotations

from typing import Any

import numpy as np

from finger_pin.laws.law import Law, Row, beyond


def penetration(position: Any, lower: Any, upper: Any) -> Any:
    """Return how far a joint is beyond its range, positive above the upper limit, negative below the lower one."""
    return np.maximum(position - upper, 0.0) - np.maximum(lower - position, 0.0)


def limiter_torque(depth: Any, velocity: Any, stiffness: Any, damping: Any, side: Any = 0.0) -> Any:
    """Return tau^r = max(0, k d (1 + c d')) with the sign of the penetration, N m.

    It enters (18) as -tau^r, so a positive torque acts against positive rotation.

    Args:
        depth: Signed penetration, rad; d is its magnitude.
        velocity: theta', rad/s.
        stiffness: k, N m/rad.
        damping: c, s/rad.
        side: See `Row`: 1 without the clamp, -1 without the contact.
    """
    factor = 1.0 + damping * velocity * np.sign(depth)
    return stiffness * depth * factor * beyond(factor, side)


def limiter_slopes(depth: Any, velocity: Any, stiffness: Any, damping: Any, side: Any = 0.0) -> tuple[Any, Any]:
    """Return the derivatives of the limiter torque with respect to theta and theta'; zero inside the range."""
    sign = np.sign(depth)
    factor = 1.0 + damping * velocity * sign
    touching = np.abs(sign) * beyond(factor, side)
    return stiffness * factor * touching, stiffness * damping * np.abs(depth) * touching


def limiter_energy(depth: Any, stiffness: Any) -> Any:
    """Return the elastic energy k d^2 / 2, J."""
    return 0.5 * stiffness * depth * depth


def limiter_loss(torque: Any, depth: Any, velocity: Any, stiffness: Any) -> Any:
    """Return the power that the contact does not store, (tau^r - k d) theta', W; never negative."""
    return (torque - stiffness * depth) * velocity


def _value(row: Row, p: Any) -> Any:
    lower, upper, stiffness, damping = p
    depth = penetration(row.length, lower, upper)
    # What the contact would exert if it could pull too, over its stiffness.
    grip = np.abs(depth) + depth * damping * row.speed
    return -limiter_torque(depth, row.speed, stiffness, damping, row.side), 0.0 * row.length, depth, grip


def _slopes(row: Row, p: Any, signals: Any) -> Any:
    _, _, stiffness, damping = p
    by_length, by_speed = limiter_slopes(signals[0], row.speed, stiffness, damping, row.side)
    return (-by_length, -by_speed, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _account(
    row: Row,
    p: Any,
    force: Any,
    rate: Any,
    signals: Any,
) -> Any:
    stiffness, depth = p[2], signals[0]
    return limiter_energy(depth, stiffness), limiter_loss(-force, depth, row.speed, stiffness)


#: The limiter of a joint's stroke.
STROKE_LIMITER = Law(
    name="stroke limiter (2)",
    parameters=("lower", "upper", "stiffness", "damping"),
    value=_value,
    slopes=_slopes,
    account=_account,
    signals=("depth", "grip"),
    losses=("limiter",),
    kink="grip",
)
