"""The paper's conclusions as experiments: many runs, measurements in them, and verdicts.

Every experiment takes a scenario, so that the same questions can be put to any finger.
"""

from finger_pin.studies.conclusions.delivery import DELIVERY_RUNS, PassiveDelivery, check_delivery, passive_delivery
from finger_pin.studies.conclusions.findings import (
    Finding,
    Verdict,
    delivery_findings,
    findings_table,
    influence_findings,
    transmission_findings,
    write_findings,
)
from finger_pin.studies.conclusions.influence import (
    INFLUENCE_RUNS,
    FrictionInfluence,
    check_influence,
    friction_influence,
)
from finger_pin.studies.conclusions.posture import TRANSMISSION_RUNS, Transmission, transmission

__all__ = [
    "DELIVERY_RUNS",
    "INFLUENCE_RUNS",
    "TRANSMISSION_RUNS",
    "Finding",
    "FrictionInfluence",
    "PassiveDelivery",
    "Transmission",
    "Verdict",
    "check_delivery",
    "check_influence",
    "delivery_findings",
    "findings_table",
    "friction_influence",
    "influence_findings",
    "passive_delivery",
    "transmission",
    "transmission_findings",
    "write_findings",
]
