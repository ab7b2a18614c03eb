"""The massive passive tendon: its two halves (5), (12), and its motion (13)."""

from __future__ import annotations

from typing import Any

import numpy as np


def half_tension(stretch: Any, stiffness: Any) -> Any:
    """Return max(0, K_h stretch), N: one half of a passive tendon, equations (5) and (12)."""
    return np.maximum(0.0, stiffness * stretch)


def half_energy(stretch: Any, stiffness: Any) -> Any:
    """Return the elastic energy of one half of a passive tendon, J; zero when slack."""
    return 0.5 * stiffness * np.maximum(0.0, stretch) ** 2


def passive_acceleration(proximal: Any, distal: Any, loss: Any, mass: Any) -> Any:
    """Return p_5'' = (f5_3 - f5_4 - f5^f) / m_5, m/s2, equation (13)."""
    return (proximal - distal - loss) / mass
