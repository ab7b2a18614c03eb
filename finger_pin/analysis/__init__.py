"""What a finger's statics say without simulating it: self-locking and fingertip forces.

It reads descriptions, fingers and scenarios, and nothing of the simulation.
"""

from __future__ import annotations

from finger_pin.analysis.force_capability import (
    ForcePolytope,
    Friction,
    RequiredTension,
    force_polytope,
    largest_force,
    tension_for_force,
)
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
    "ForcePolytope",
    "Friction",
    "RequiredTension",
    "SelfLockingMap",
    "SelfLockingMargin",
    "critical_friction",
    "force_polytope",
    "largest_force",
    "self_locking_map",
    "self_locking_margin",
    "tension_for_force",
]
