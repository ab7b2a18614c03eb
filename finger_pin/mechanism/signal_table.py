"""The one table of the signals of a finger: names, dimensions, units, equations, and where each stands."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import attrgetter, methodcaller
from typing import Any

import numpy as np

from finger_pin.laws.capstan import capstan_coefficient
from finger_pin.mechanism.contact_signals import CONTACT_SECTIONS
from finger_pin.mechanism.groups import CANALS
from finger_pin.mechanism.rows import Rows, weighted_sum
from finger_pin.mechanism.sheaths import SHEATHS
from finger_pin.mechanism.signals import FingerSignals, Quantity, Section
from finger_pin.mechanism.state import BLOCKS
from finger_pin.typing import Array


def _coefficient(signals: FingerSignals) -> Array:
    """Return mu^d, (16), of all curvature together."""
    whole = signals.at_first_place("coefficient")
    sheathed = np.any(signals.sheath_weights, axis=1)
    if not signals.finger.wraps and not sheathed.any():
        return whole
    surface = np.concatenate([signals.rows[name].rows.parameters[0] for name in ("driven_tendons", "passive_tendons")])
    curvature = signals.at_all_places("curvature")
    return np.where(signals.has_several_places | sheathed, capstan_coefficient(surface, curvature), whole)


def _normal_force(signals: FingerSignals) -> Array:
    """Return F^n = |f| + |f^a|, (14), with f before micro-damping."""
    of_first, actuated = signals.at_first_place("normal_force"), signals.finger.routing.actuated
    several = signals.has_several_places | np.any(signals.sheath_weights, axis=1)
    if not several.any():
        return of_first
    ends = np.abs(signals.strands[..., :actuated]) + np.abs(_entering(signals)[..., :actuated])
    return np.where(several, np.concatenate([ends, of_first[..., actuated:]], axis=-1), of_first)


def _wrap_tension(signals: FingerSignals) -> Array:
    """Return the tension behind every place of the tendons that rub at several."""
    driven = signals.rows["driven_tendons"]
    first = (driven.force + driven.rows["acting"] * driven.row.command)[..., signals.wrapped]
    behind = (signals.rows[name].row.command + signals.rows[name].force for name in signals.finger.wraps)
    return np.concatenate([first, *behind], axis=-1)


def _entering(signals: FingerSignals) -> Array:
    """Return f^a, what pulls at the canal's entrance; of a passive tendon its proximal half."""
    proximal = signals.strands[..., signals.finger.routing.actuated :: 2]
    pulling, weights = signals.rows["driven_tendons"].row.command, signals.sheath_weights
    if weights.size:
        # What pulls there is what sheaths have left.
        pulling = pulling + weighted_sum(signals.rows[SHEATHS].field("friction"), weights[: pulling.shape[-1]].T)
    return np.concatenate([pulling, proximal], axis=-1)


def _spring_torque(signals: FingerSignals) -> Array:
    springs = signals.rows["joint_springs"]
    return -weighted_sum(springs.force, springs.rows.arm)[..., : len(signals.finger.routing.joints)]


def _states(*blocks: str) -> dict[str, Quantity]:
    """Return the signals of blocks of the state, by name."""
    signals = {}
    for block, entry in ((block, BLOCKS[block]) for block in blocks):
        words, value = (entry.unit, entry.long_name), attrgetter(f"state.{block}")
        signals[entry.variable] = Quantity((entry.dimension,), *words, value, entry.equation, of_finger=False)
    return signals


ALWAYS, WITH_MOTORS = "Always", "With motors"
_JOINT, _TENDON, _MOTOR, _WRAP = ("joint",), ("tendon",), ("motor",), ("wrap",)

#: Every signal of a finger, such as the torque of its tendons (11), but those of tables of rows of its own.
SECTIONS = (
    Section(
        ALWAYS,
        lambda finger: True,
        {
            **_states("position", "velocity"),
            "joint_acceleration": Quantity(
                _JOINT, "rad/s2", "joint acceleration", methodcaller("at_joints", "acceleration"), "18"
            ),
            "tendon_tension": Quantity(
                _TENDON,
                "N",
                "delivered tension; distal half of a passive tendon",
                lambda signals: signals.finger.routing.tendon_tension(signals.strands),
                "12",
            ),
            "tendon_velocity": Quantity(
                _TENDON, "m/s", "sliding velocity", methodcaller("at_first_place", "speed"), "3"
            ),
            "tendon_friction": Quantity(
                _TENDON, "N", "tendon friction force", methodcaller("at_all_places", "friction"), "9c"
            ),
            **_states("tendon_stiction"),
            "tendon_normal_force": Quantity(_TENDON, "N", "sum of the tensions at both ends", _normal_force, "14"),
            "tendon_friction_coefficient": Quantity(_TENDON, "1", "Coulomb coefficient", _coefficient, "16"),
            "tendon_curvature": Quantity(
                _TENDON, "rad", "total curvature of the path", methodcaller("at_all_places", "curvature"), "15"
            ),
            "joint_torque": Quantity(
                _JOINT, "N m", "torque of the tendons", methodcaller("at_joints", "tendon_torque"), "11"
            ),
            "joint_friction": Quantity(
                _JOINT, "N m", "joint friction torque", methodcaller("field", "joint_friction", "friction"), "9c"
            ),
            "joint_reaction": Quantity(
                _JOINT, "N", "joint reaction force", methodcaller("field", "joint_friction", "normal_force"), "17"
            ),
            "limiter_torque": Quantity(
                _JOINT, "N m", "stroke limiter torque", lambda signals: -signals.rows["limiter"].force, "2"
            ),
            "spring_torque": Quantity(_JOINT, "N m", "torque of the joints' springs", _spring_torque),
            "external_torque": Quantity(
                _JOINT, "N m", "torque of the fingertip force", methodcaller("at_joints", "external"), "6"
            ),
        },
    ),
    Section(
        'With bristles in the joints, any law but `"coulomb"`',
        lambda finger: finger.layout.names_of("joint_stiction"),
        _states("joint_stiction"),
    ),
    Section(
        "With passive tendons",
        lambda finger: finger.routing.passive,
        {
            "passive_tension_proximal": Quantity(
                ("passive_tendon",),
                "N",
                "tension of the proximal half",
                lambda signals: signals.strands[..., signals.finger.routing.actuated :: 2],
                "12",
            ),
            **_states("passive_position", "passive_velocity"),
        },
    ),
    Section(
        "With hysteresis of passive or elastic tendons",
        lambda finger: finger.layout.names_of("elastic_stiction"),
        _states("elastic_stiction"),
    ),
    Section(
        'With `tendon_friction.place = "bends"`, or paths that bend',
        lambda finger: finger.wraps,
        {
            "wrap_tension": Quantity(_WRAP, "N", "tension behind every bend of a tendon", _wrap_tension),
            "wrap_friction": Quantity(
                _WRAP, "N", "friction force at every bend of a tendon", methodcaller("at_places", "friction")
            ),
            "wrap_velocity": Quantity(
                _WRAP, "m/s", "sliding velocity at every bend of a tendon", methodcaller("at_places", "speed")
            ),
            "wrap_curvature": Quantity(
                _WRAP, "rad", "curvature of every bend of a tendon", methodcaller("at_places", "curvature")
            ),
            "wrap_level": Quantity(
                _WRAP, "N", "friction of steady sliding at every bend of a tendon", methodcaller("at_places", "level")
            ),
        },
    ),
    Section(
        "With motors or winches",
        lambda finger: finger.actuators.names or finger.routing.winched.any(),
        {
            "spool_tension": Quantity(
                _TENDON,
                "N",
                "tension at the canal's entrance: at a spool, of an ideal source, or of a passive tendon's proximal "
                "half",
                _entering,
            )
        },
    ),
    Section(
        WITH_MOTORS,
        lambda finger: finger.actuators.names,
        {
            **_states("motor_position", "motor_velocity", "gearbox_stiction"),
            "motor_current": Quantity(
                _MOTOR, "A", "current of the winding", methodcaller("field", "motors", "current")
            ),
            "motor_voltage": Quantity(
                _MOTOR, "V", "voltage at the winding", methodcaller("field", "motors", "voltage")
            ),
            "motor_torque": Quantity(
                _MOTOR, "N m", "torque of the motor, at the spool", methodcaller("field", "motors", "force")
            ),
            "gearbox_friction": Quantity(
                _MOTOR, "N m", "friction torque of the gearbox", methodcaller("field", "gearboxes", "friction"), "9c"
            ),
            "gearbox_load": Quantity(
                _MOTOR, "N m", "torque that the gears carry", methodcaller("field", "gearboxes", "load")
            ),
        },
    ),
    Section(
        "With play in gears", lambda finger: finger.actuators.loose_names, _states("spool_position", "spool_velocity")
    ),
    *CONTACT_SECTIONS,
    Section(
        "With tendons of a tree that are springs",
        lambda finger: finger.cord_names,
        {
            "cord_tension": Quantity(
                ("cord",),
                "N",
                "delivered tension of a cord that servos, muscles or springs pull; negative where a servo pushes it",
                methodcaller("field", CANALS, "pressing"),
                "12",
            )
        },
    ),
)


def finger_signals(finger: Any) -> dict[str, Quantity]:
    """Return all signals of a `Finger` by name."""
    table = {name: each for section in SECTIONS if section.holds(finger) for name, each in section.signals.items()}
    if finger.routing.passive == 1:
        # One passive tendon, the common case, needs no dimension of its own.
        single = {name: each for name, each in table.items() if each.dims == ("passive_tendon",)}
        table |= {name: each._replace(dims=(), value=_only(each.value)) for name, each in single.items()}
    return table | _row_signals(finger.extra_rows)


def _only(value: Callable[[FingerSignals], Array]) -> Callable[[FingerSignals], Array]:
    return lambda signals: value(signals)[..., 0]


def _row_signals(tables: Sequence[Rows]) -> dict[str, Quantity]:
    """Return the signals of the rows of some tables, by name."""
    signals: dict[str, Quantity] = {}
    for table in tables:
        group = table.group
        units = {"length": table.unit, "speed": f"{table.unit}/s", "force": "N m" if table.unit == "rad" else "N"}
        fields = {name: name for name in ("force", "length", "speed", *table.law.signals)}
        fields |= {"input": "command"} if np.any(table.channels >= 0) else {}
        fields |= {"state": "state"} if table.law.scale is not None else {}
        for name, field in fields.items():
            unit = units.get(name, "SI") if table.unit else "SI"
            signals[f"{group}_{name}"] = Quantity(
                (group,), unit, f"{name} of {table.law.name}", methodcaller("field", group, field)
            )
    return signals
