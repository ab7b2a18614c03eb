"""Statics, without a run: self-locking, fingertip forces and equilibria.

It reads descriptions, fingers, scenarios and results, and nothing of the simulation.
"""

from finger_pin.analysis.closure import ClosureRange, closure_over_range, locking_over_range, posed
from finger_pin.analysis.equilibrium import Equilibrium, equilibrium
from finger_pin.analysis.inverse_kinematics import TipPosture, inverse_kinematics
from finger_pin.analysis.locking import CriticalFriction, critical_friction
from finger_pin.analysis.locking_map import SelfLockingMap, self_locking_map
from finger_pin.analysis.locking_margin import SelfLockingMargin, locking_advice, quick_margin, self_locking_margin
from finger_pin.analysis.path_jumps import PathJump, path_jumps
from finger_pin.analysis.polytope import ForcePolytope, force_polytope
from finger_pin.analysis.servo_limits import gear_shares, tension_limits
from finger_pin.analysis.spring_return import SpringReturn, spring_return
from finger_pin.analysis.steady import SteadyState, rubbing_cords, settled_posture, steady_state
from finger_pin.analysis.taut_posture import taut_posture
from finger_pin.analysis.tip_force import RequiredTension, largest_force, tension_for_force
from finger_pin.analysis.tip_statics import Friction

__all__ = [
    "ClosureRange",
    "CriticalFriction",
    "Equilibrium",
    "ForcePolytope",
    "Friction",
    "PathJump",
    "RequiredTension",
    "SelfLockingMap",
    "SelfLockingMargin",
    "SpringReturn",
    "SteadyState",
    "TipPosture",
    "closure_over_range",
    "critical_friction",
    "equilibrium",
    "force_polytope",
    "gear_shares",
    "inverse_kinematics",
    "largest_force",
    "locking_advice",
    "locking_over_range",
    "path_jumps",
    "posed",
    "quick_margin",
    "rubbing_cords",
    "self_locking_map",
    "self_locking_margin",
    "settled_posture",
    "spring_return",
    "steady_state",
    "taut_posture",
    "tension_for_force",
    "tension_limits",
]
