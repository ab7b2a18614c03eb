"""What a finger's statics say without simulating it: self-locking and fingertip forces.

It reads descriptions, fingers and scenarios, and nothing of the simulation.
"""

from __future__ import annotations

from finger_pin.analysis.locking import CriticalFriction, critical_friction
from finger_pin.analysis.locking_map import SelfLockingMap, self_locking_map
from finger_pin.analysis.locking_margin import (
    SelfLockingMargin,
    locking_advice,
    self_locking_margin,
    warn_of_self_locking,
)
from finger_pin.analysis.polytope import ForcePolytope, force_polytope
from finger_pin.analysis.tip_force import RequiredTension, largest_force, tension_for_force
from finger_pin.analysis.tip_statics import Friction

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
    "locking_advice",
    "self_locking_map",
    "self_locking_margin",
    "tension_for_force",
    "warn_of_self_locking",
]
