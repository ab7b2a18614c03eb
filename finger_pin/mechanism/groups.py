"""Groups of rows by their names, which are those of a result's dimensions, and what friction in them takes."""

from __future__ import annotations

from finger_pin.mechanism.rows import Energy

#: The tables of actuators without and with a state, and of muscles.
STATELESS, STATEFUL, MUSCLES = "actuator", "actuator_with_state", "muscle"
#: The table of tendons that stretch and only pull.
ELASTIC = "elastic_cords"
#: Tables of sources of tension that are rows: those with an end, and ideal winches.
SOURCES_WITH_END, WINCHES = "tension_sources", "winches"
#: The tables of cords, in the order of evaluation; those of further wraps have a number, from 2, at the end.
CORDS, WRAPS, CANALS, BRANCHES = "tendon_cords", "tendon_wraps", "tendon_canals", "tendon_branches"

#: What friction in the joints takes, in the order of its law.
JOINT_LOSSES = (
    Energy("joint_coulomb", "joints sliding"),
    Energy("joint_viscous", "joints viscous"),
    Energy("joint_micro_damping", "joints' micro-damping"),
)
#: What friction in the canals takes, in the order of its law.
TENDON_LOSSES = (
    Energy("tendon_coulomb", "tendons sliding"),
    Energy("tendon_viscous", "tendons viscous"),
    Energy("tendon_micro_damping", "tendons' micro-damping"),
)


def is_canal(group: str) -> bool:
    """Return whether a table of rows is friction of canals or wraps."""
    return group.startswith((WRAPS, CANALS, BRANCHES))
