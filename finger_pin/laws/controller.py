"""The paper's controller, number by number: (19), (22)."""

from __future__ import annotations

from typing import Any


def proportional_torque(gain: Any, reference: Any, position: Any) -> Any:
    """Return tau^d = K_P (theta^d - theta), N m, equation (19)."""
    return gain * (reference - position)


def internal_level(minimum: Any, minimal: Any, internal: Any) -> Any:
    """Return (f0 - f^m) / f^k, whose largest entry is lambda of (22)."""
    return (minimum - minimal) / internal
