"""A sinusoid about an offset, the usual motion of references."""

from __future__ import annotations

from typing import Any

import numpy as np


def harmonic(time: Any, offset: Any, amplitude: Any, frequency: Any, phase: Any) -> Any:
    """Return offset + amplitude sin(2 pi frequency time + phase), rad."""
    return offset + amplitude * np.sin(2.0 * np.pi * frequency * time + phase)


def harmonic_rate(time: Any, amplitude: Any, frequency: Any, phase: Any) -> Any:
    """Return the time derivative of `harmonic`, rad/s."""
    circular = 2.0 * np.pi * frequency
    return amplitude * circular * np.cos(circular * time + phase)
