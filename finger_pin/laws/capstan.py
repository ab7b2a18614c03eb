"""Friction of a tendon in its canal: (14), (16) and the delivered tension of (12)."""

from __future__ import annotations

from typing import Any

import numpy as np


def capstan_coefficient(surface: Any, curvature: Any) -> Any:
    """Return mu^d = tanh(mu_e phi / 2), equation (16).

    Steady sliding then loses tension by the capstan law, f / f^a = exp(-mu_e phi) when pulling.

    Args:
        surface: mu_e, Coulomb coefficient between tendon and canal.
        curvature: phi, total curvature of the path, rad.
    """
    return np.tanh(0.5 * surface * curvature)


def capstan_slope(surface: Any, coefficient: Any) -> Any:
    """Return d mu^d / d phi of (16), from mu^d itself."""
    return 0.5 * surface * (1.0 - coefficient * coefficient)


def delivered_tension(command: Any, loss: Any) -> Any:
    """Return f = max(0, f^a - f^f), N: a tendon cannot push."""
    return np.maximum(0.0, command - loss)
