"""Law (9): the adapted LuGre friction of tendons and joints.

Plain functions of numbers or arrays (they broadcast), without state. `stiction_rate` is (9a), `friction_level` is
F^n M with M from (9b), `friction_force` is (9c). The derivatives serve implicit integrators.
"""

from __future__ import annotations

from typing import Any

import numpy as np


def friction_coefficient(velocity: Any, kinetic: Any, static: Any, stribeck: Any) -> Any:
    """Return M(v) = M^d + (M^c - M^d) exp(-|v| / omega), equation (9b).

    Args:
        velocity: Sliding velocity v.
        kinetic: M^d, Coulomb (kinetic) coefficient.
        static: M^c, stiction coefficient.
        stribeck: omega, Stribeck velocity.
    """
    return kinetic + (static - kinetic) * np.exp(-np.abs(velocity) / stribeck)


def friction_coefficient_slope(velocity: Any, kinetic: Any, static: Any, stribeck: Any) -> Any:
    """Return dM/dv of (9b)."""
    return -np.sign(velocity) * (static - kinetic) / stribeck * np.exp(-np.abs(velocity) / stribeck)


def friction_level(normal: Any, coefficient: Any, floor: Any) -> Any:
    """Return max(F^n M, g_min), the stiction that steady sliding settles at.

    The floor keeps (9a) finite for an unloaded contact.
    """
    return np.maximum(normal * coefficient, floor)


def stiction_rate(stiction: Any, velocity: Any, level: Any, stiffness: Any) -> Any:
    """Return F^s' = sigma_0 (v - F^s |v| / level), equation (9a)."""
    return stiffness * (velocity - stiction * np.abs(velocity) / level)


def stiction_rate_slopes(stiction: Any, velocity: Any, level: Any, stiffness: Any) -> tuple[Any, Any, Any]:
    """Return the derivatives of (9a) with respect to F^s, v and the level."""
    speed = np.abs(velocity)
    by_stiction = -stiffness * speed / level
    by_velocity = stiffness * (1.0 - stiction * np.sign(velocity) / level)
    by_level = stiffness * stiction * speed / (level * level)
    return by_stiction, by_velocity, by_level


def friction_force(stiction: Any, velocity: Any, viscous: Any) -> Any:
    """Return F^f = F^s + b v, equation (9c)."""
    return stiction + viscous * velocity


def bristle_energy(stiction: Any, stiffness: Any) -> Any:
    """Return the elastic energy of the bristles, F^s^2 / (2 sigma_0)."""
    return stiction * stiction / (2.0 * stiffness)


def coulomb_loss(stiction: Any, velocity: Any, level: Any) -> Any:
    """Return the power lost by sliding, F^s^2 |v| / level: F^f v less the viscous loss and the bristles' power."""
    return stiction * stiction * np.abs(velocity) / level


def viscous_loss(velocity: Any, viscous: Any) -> Any:
    """Return the power lost in the viscous part of (9c), b v^2."""
    return viscous * velocity * velocity


def steady_force(velocity: Any, normal: Any, coefficient: Any, viscous: Any) -> Any:
    """Return the friction of steady sliding, F^n M(v) sign(v) + b v: (9) with F^s' = 0, the curves of Fig. 3."""
    return normal * coefficient * np.sign(velocity) + viscous * velocity
