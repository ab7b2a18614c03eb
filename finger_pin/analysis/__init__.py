"""What a finger's statics say without simulating it: self-locking and fingertip forces.

Layered beside the views: it reads descriptions, fingers and scenarios, and nothing of the simulation.
"""

from __future__ import annotations

from finger_pin.analysis.self_locking import (
    CriticalFriction,
    SelfLockingMap,
    SelfLockingMargin,
    critical_friction,
    self_locking_map,
    self_locking_margin,
)

__all__ = [
    "CriticalFriction",
    "SelfLockingMap",
    "SelfLockingMargin",
    "critical_friction",
    "self_locking_map",
    "self_locking_margin",
]
