"""A polynomial of degree five, the piece of steps, ramps, points and samples."""

from __future__ import annotations

from typing import Any


def quintic(s: Any, c5: Any, c4: Any, c3: Any, c2: Any, c1: Any, c0: Any) -> Any:
    """Return c5 s^5 + ... + c1 s + c0, by Horner's rule."""
    return ((((c5 * s + c4) * s + c3) * s + c2) * s + c1) * s + c0


def quintic_rate(s: Any, c5: Any, c4: Any, c3: Any, c2: Any, c1: Any) -> Any:
    """Return the derivative of `quintic` with respect to s."""
    return (((5.0 * c5 * s + 4.0 * c4) * s + 3.0 * c3) * s + 2.0 * c2) * s + c1


def quintic_curvature(s: Any, c5: Any, c4: Any, c3: Any, c2: Any) -> Any:
    """Return the second derivative of `quintic` with respect to s."""
    return ((20.0 * c5 * s + 12.0 * c4) * s + 6.0 * c3) * s + 2.0 * c2
