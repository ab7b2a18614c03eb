"""The paper's conclusions as experiments: many runs, what was measured in them, and what it says.

Every experiment takes a scenario, so that the same questions can be put to any finger.
"""

from __future__ import annotations

from finger_pin.experiments.findings import Finding, write_findings
from finger_pin.experiments.friction_influence import FrictionInfluence, friction_influence
from finger_pin.experiments.passive_delivery import PassiveDelivery, passive_delivery
from finger_pin.experiments.transmission import Transmission, transmission

__all__ = [
    "Finding",
    "FrictionInfluence",
    "PassiveDelivery",
    "Transmission",
    "friction_influence",
    "passive_delivery",
    "transmission",
    "write_findings",
]
