"""Controllers: from a desired motion to tensions, by the paper's (19)-(22) and by additions to it.

A torque law (`TorqueLaw`), the friction of joints (`JointCompensation`) and tendons (`TendonFeedforward`), the
distribution over tendons (`PseudoInverse`, or `LimitedDistribution` of `distribution`), a loop around the
passive tendons' tension (`PassiveTensionLoop`). `build_controller` makes them from the entries of a scenario, and
`ClosedLoop` joins one with its finger, its reference and the path of a palm (`PalmPath`).

In open loop tendons are given tensions (`OpenLoopTensions`), and motors in position drive the goals of their spools
(`spool_goals`, `spool_windings`), voltages and supplies (`voltage_signals`); `SteppedDrives` steps the loops of these.
"""

from finger_pin.control.build import build_controller
from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.control.compensated import CompensatedController, PassiveTensionLoop
from finger_pin.control.distribution import PseudoInverse, TensionAllocation, TensionDistribution
from finger_pin.control.interface import Instant, SampledSensor
from finger_pin.control.open_loop import OpenLoopTensions
from finger_pin.control.palm import PalmPath
from finger_pin.control.position_drive import spool_goals, spool_windings, voltage_signals
from finger_pin.control.proportional import TorqueLaw
from finger_pin.control.stepped_drives import SteppedDrives
from finger_pin.control.tendon_feedforward import JointCompensation, TendonFeedforward

__all__ = [
    "ClosedLoop",
    "CompensatedController",
    "Instant",
    "JointCompensation",
    "OpenLoopTensions",
    "PalmPath",
    "PassiveTensionLoop",
    "PseudoInverse",
    "SampledSensor",
    "SteppedDrives",
    "TendonFeedforward",
    "TensionAllocation",
    "TensionDistribution",
    "TorqueLaw",
    "build_controller",
    "spool_goals",
    "spool_windings",
    "voltage_signals",
]
