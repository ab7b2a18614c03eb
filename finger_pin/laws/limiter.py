"""Stroke limiters (2): Hunt-Crossley contacts at both ends of a joint's range, and dampers beside them."""

from __future__ import annotations

import numpy as np

from finger_pin.laws.law import Law, Row, on_positive_side
from finger_pin.typing import Number, Numbers, Parameters


def penetration(position: Number, lower: Number, upper: Number) -> Number:
    """Return the depth of a joint beyond its range, positive above the upper limit, negative below the lower one."""
    return np.maximum(position - upper, 0.0) - np.maximum(lower - position, 0.0)


def limiter_torque(
    depth: Number, velocity: Number, stiffness: Number, damping: Number, viscous: Number = 0.0
) -> Number:
    """Return tau^r = max(0, k d (1 + c d') + b d') with the sign of the penetration, N m; zero where there is none.

    It enters (18) as -tau^r, so a positive torque acts against positive rotation.

    Args:
        depth: Signed penetration, rad; d is its magnitude.
        velocity: theta', rad/s.
        stiffness: k, N m/rad.
        damping: c, s/rad.
        viscous: b, N m s/rad.
    """
    end = np.sign(depth)
    push = stiffness * depth * end * (1.0 + damping * velocity * end) + viscous * velocity * end
    return end * np.maximum(push, 0.0)


def limiter_energy(depth: Number, stiffness: Number) -> Number:
    """Return the elastic energy k d^2 / 2, J."""
    return 0.5 * stiffness * depth * depth


def limiter_loss(torque: Number, depth: Number, velocity: Number, stiffness: Number) -> Number:
    """Return the power that the contact does not store, (tau^r - k d) theta', W; never negative."""
    return (torque - stiffness * depth) * velocity


def _nearer_end(row: Row, p: Parameters) -> Numbers:
    """Return the side of the nearer limit, 1 or -1, the penetration d, and 1 + c d'."""
    lower, upper, _, damping, _ = p
    end = 2.0 * (row.length > 0.5 * (lower + upper)) - 1.0
    return end, np.maximum(row.length - upper, lower - row.length), 1.0 + damping * row.speed * end


def _value(row: Row, p: Parameters) -> Numbers:
    end, depth, factor = _nearer_end(row, p)
    _, _, stiffness, _, viscous = p
    push = stiffness * end * depth * factor + viscous * row.speed
    # The torque bends or jumps where the joint meets its limit, and bends where the limiter would begin to pull.
    grip = np.minimum(depth, factor + (viscous > 0.0) * (end * push - factor))
    torque = push * on_positive_side(grip, row.side)
    return -torque, 0.0 * row.length, end * np.maximum(depth, 0.0), grip


def _slopes(row: Row, p: Parameters, signals: Numbers) -> tuple[Numbers, Numbers]:
    _, _, stiffness, damping, viscous = p
    _, depth, factor = _nearer_end(row, p)
    pushes = on_positive_side(signals[1], row.side)
    gripping = stiffness * pushes
    by_speed = -damping * depth * gripping - viscous * pushes
    return (-factor * gripping, by_speed, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _account(row: Row, p: Parameters, force: Number, rate: Number, signals: Numbers) -> Numbers:
    (_, _, stiffness, _, _), depth = p, signals[0]
    return limiter_energy(depth, stiffness), limiter_loss(-force, depth, row.speed, stiffness)


#: The limiter of a joint's stroke.
STROKE_LIMITER = Law(
    name="stroke limiter (2)",
    parameters=("lower", "upper", "stiffness", "damping", "viscous"),
    value=_value,
    slopes=_slopes,
    account=_account,
    signals=("depth", "grip"),
    losses=("limiter",),
    kink="grip",
)
