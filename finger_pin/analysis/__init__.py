"""What a finger's statics say without simulating it, self-locking and fingertip forces, and how good (17) is.

It reads descriptions, fingers, scenarios and results, and nothing of the simulation.
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
from finger_pin.analysis.pin_wrench import PinWrench, pin_wrench
from finger_pin.analysis.reaction import JointReactions, ReactionDifference, fingertip_loads, joint_reactions
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
    "JointReactions",
    "PinWrench",
    "ReactionDifference",
    "RequiredTension",
    "SelfLockingMap",
    "SelfLockingMargin",
    "critical_friction",
    "fingertip_loads",
    "force_polytope",
    "joint_reactions",
    "largest_force",
    "pin_wrench",
    "self_locking_map",
    "self_locking_margin",
    "tension_for_force",
]
