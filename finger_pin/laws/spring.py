"""Torsion springs at joints, such as those that open a finger whose tendons only close it."""

from __future__ import annotations

from typing import Any


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


def spring_slopes(stiffness: Any, damping: Any) -> tuple[Any, Any]:
    """Return the derivatives of the spring's torque with respect to theta and theta'."""
    return stiffness, damping


def spring_energy(position: Any, stiffness: Any, rest: Any) -> Any:
    """Return the elastic energy k (theta - theta_0)^2 / 2, J."""
    return 0.5 * stiffness * (position - rest) * (position - rest)


def spring_loss(velocity: Any, damping: Any) -> Any:
    """Return the power lost in the damping, c theta'^2, W."""
    return damping * velocity * velocity
