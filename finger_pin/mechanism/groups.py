"""Groups of rows by their names, which are those of a result's dimensions, and what friction in them takes."""

from __future__ import annotations

from typing import NamedTuple

from finger_pin.laws.actuator import ACTUATOR, ACTUATOR_WITH_STATE
from finger_pin.laws.bristle import PIN_FRICTION
from finger_pin.laws.law import Law
from finger_pin.laws.limiter import STROKE_LIMITER
from finger_pin.laws.muscle import MUSCLE
from finger_pin.laws.spring import CONSTANT_FORCE, DEAD_BAND_SPRING, ELASTIC_TENDON, JOINT_SPRING
from finger_pin.mechanism.rows import Energy, energy

#: The tables of actuators without and with a state, and of muscles.
STATELESS, STATEFUL, MUSCLES = "actuator", "actuator_with_state", "muscle"
#: The table of tendons that stretch and only pull.
ELASTIC = "elastic_cords"
#: The table of couplings of actuated tendons.
TIES = "tendon_coupling"
#: Tables of sources of tension that are rows: those with an end, and ideal winches.
SOURCES_WITH_END, WINCHES = "tension_sources", "winches"
#: The tables of cords, in the order of evaluation; those of further wraps have a number, from 2, at the end.
CORDS, WRAPS, CANALS, BRANCHES = "tendon_cords", "tendon_wraps", "tendon_canals", "tendon_branches"

#: What actuators and ideal sources of tension supply.
SOURCES = Energy("actuators", "actuators")
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


class TreeTable(NamedTuple):
    """The law of a table of a tree's rows, and its energies.

    Attributes:
        law: Of the rows.
        stored: The energy that the rows store.
        powers: The law's powers, supplies first; named by table and law without.
    """

    law: Law
    stored: Energy
    powers: tuple[Energy, ...] = ()


_TENDON_SPRINGS = Energy("tendon_spring", "tendons' springs"), (Energy("tendon_spring_damping", "tendons' dampers"),)
_ACTUATORS = Energy("joint_springs", "joints' springs"), (SOURCES,)
#: The tables of a tree's actuators, by name.
ACTUATORS = {
    STATELESS: TreeTable(ACTUATOR, *_ACTUATORS),
    STATEFUL: TreeTable(ACTUATOR_WITH_STATE, *_ACTUATORS),
    MUSCLES: TreeTable(MUSCLE, Energy("muscle_passive", "muscles' passive elements"), (Energy("muscles", "muscles"),)),
}
#: All tables of a tree's rows, and of couplings of actuated tendons, by name.
TREE_TABLES = {
    "tendon_spring": TreeTable(DEAD_BAND_SPRING, *_TENDON_SPRINGS),
    ELASTIC: TreeTable(ELASTIC_TENDON, *_TENDON_SPRINGS),
    "tendon_limit": TreeTable(
        STROKE_LIMITER, Energy("tendon_limit", "tendons' limits"), (Energy("tendon_limit_limiter", "tendons' limits"),)
    ),
    "tendon_dry_friction": TreeTable(PIN_FRICTION, energy("tendon_dry_friction")),
    "coupling": TreeTable(JOINT_SPRING, Energy("coupling", "couplings"), (Energy("coupling_damping", "couplings"),)),
    TIES: TreeTable(JOINT_SPRING, Energy("coupling", "couplings"), (Energy("coupling_damping", "couplings"),)),
    "loop": TreeTable(JOINT_SPRING, Energy("loop", "loops"), (Energy("loop_damping", "loops"),)),
    "gravity_compensation": TreeTable(CONSTANT_FORCE, Energy("gravity_compensation", "weights compensated")),
    **ACTUATORS,
}


def is_canal(group: str) -> bool:
    """Return whether a table of rows is friction of canals or wraps."""
    return group.startswith((WRAPS, CANALS, BRANCHES))
