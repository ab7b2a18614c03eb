"""Controllers beyond (19): blocks with the face of the paper's, joined by `CompensatedController`.

A torque law (`TorqueLaw`), the friction of joints (`JointCompensation`) and tendons (`TendonFeedforward`), the
distribution over tendons (`PseudoInverse`, or `LimitedDistribution` of `limited_distribution`), a loop around the
passive tendons' tension (`PassiveTensionLoop`). `build_controller` makes them from the entries of a scenario.
"""

from __future__ import annotations

from finger_pin.controllers.build import build_controller
from finger_pin.controllers.compensated import CompensatedController
from finger_pin.controllers.distribution import Distribution, Plan, PseudoInverse
from finger_pin.controllers.joint_compensation import JointCompensation
from finger_pin.controllers.measurement import MeasuringController, Sensors
from finger_pin.controllers.passive_loop import PassiveTensionLoop
from finger_pin.controllers.tendon_feedforward import TendonFeedforward
from finger_pin.controllers.torque import TorqueLaw

__all__ = [
    "CompensatedController",
    "Distribution",
    "JointCompensation",
    "MeasuringController",
    "PassiveTensionLoop",
    "Plan",
    "PseudoInverse",
    "Sensors",
    "TendonFeedforward",
    "TorqueLaw",
    "build_controller",
]
