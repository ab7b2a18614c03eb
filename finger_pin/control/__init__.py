"""Controllers: from a desired motion to tensions, by the paper's (19)-(22) and by additions to it.

A torque law (`TorqueLaw`), the friction of joints (`JointCompensation`) and tendons (`TendonFeedforward`), the
distribution over tendons (`PseudoInverse`, or `LimitedDistribution` of `limited_distribution`), a loop around the
passive tendons' tension (`PassiveTensionLoop`). `build_controller` makes them from the entries of a scenario.
"""

from finger_pin.control.build import build_controller
from finger_pin.control.compensated import CompensatedController
from finger_pin.control.distribution import PseudoInverse, TensionAllocation, TensionDistribution
from finger_pin.control.interface import Instant, SampledSensor
from finger_pin.control.passive_loop import PassiveTensionLoop
from finger_pin.control.tendon_feedforward import JointCompensation, TendonFeedforward
from finger_pin.control.torque import TorqueLaw

__all__ = [
    "CompensatedController",
    "Instant",
    "JointCompensation",
    "PassiveTensionLoop",
    "PseudoInverse",
    "SampledSensor",
    "TendonFeedforward",
    "TensionAllocation",
    "TensionDistribution",
    "TorqueLaw",
    "build_controller",
]
