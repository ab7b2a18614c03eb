"""Torsion springs at joints, such as those that open a finger whose tendons only close it."""

from __future__ import annotations

from typing import Any

from finger_pin.laws.law import Law, Row


def spring_torque(position: Any, velocity: Any, stiffness: Any, rest: Any, damping: Any) -> Any:
    """Return tau^k = k (theta - theta_0) + c theta', N m.

    It enters (18) as -tau^k, so a positive torque acts against positive rotation.

    Args:
        position: theta, rad.
        velocity: theta', rad/s.
        stiffness: k, N m/rad.
        rest: theta_0, rad.
        damping: c, N m s/rad.
    """
    return stiffness * (position - rest) + damping * velocity


def spring_energy(position: Any, stiffness: Any, rest: Any) -> Any:
    """Return the elastic energy k (theta - theta_0)^2 / 2, J."""
    return 0.5 * stiffness * (position - rest) * (position - rest)


def spring_loss(velocity: Any, damping: Any) -> Any:
    """Return the power lost in the damping, c theta'^2, W."""
    return damping * velocity * velocity


def _value(row: Row, p: Any) -> Any:
    stiffness, rest, damping = p
    return -spring_torque(row.length, row.speed, stiffness, rest, damping), 0.0 * row.length


def _slopes(row: Row, p: Any, signals: Any) -> Any:
    stiffness, _, damping = p
    return (-stiffness, -damping, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _account(row: Row, p: Any, force: Any, rate: Any, signals: Any) -> Any:
    stiffness, rest, damping = p
    return spring_energy(row.length, stiffness, rest), spring_loss(row.speed, damping)


#: A torsion spring between the links of a joint.
JOINT_SPRING = Law(
    name="joint spring",
    parameters=("stiffness", "rest", "damping"),
    value=_value,
    slopes=_slopes,
    account=_account,
    losses=("damping",),
)


def _constant(row: Row, p: Any) -> Any:
    return p[0] + 0.0 * row.length, 0.0 * row.length


def _constant_slopes(row: Row, p: Any, signals: Any) -> Any:
    return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def _constant_account(row: Row, p: Any, force: Any, rate: Any, signals: Any) -> Any:
    return (-p[0] * row.length,)


#: A force that is the same everywhere, such as a weight that is compensated; it stores what it lets down.
CONSTANT_FORCE = Law("constant force", ("force",), _constant, _constant_slopes, _constant_account)
