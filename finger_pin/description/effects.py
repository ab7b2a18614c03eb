"""Refusal of keys without effect: a table of the conditions under which keys act.

Judged are values that a table gives and that differ from the default, so that a description written out in full can be
read again. What is at a limit where it does nothing, such as a stiffness of zero, is no mistake: sweeps pass there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from finger_pin.description.friction import WITHOUT_STRIBECK
from finger_pin.description.validation import Description, problem


class Rule(NamedTuple):
    """Condition under which entries of a table act.

    Attributes:
        table: Dotted name of the table, in which a star stands for every name; empty for the description itself.
        entries: Entries of that table; none for all of them.
        acts: Whether they act, by description and table.
        says: What is said when they do not.
    """

    table: str
    entries: tuple[str, ...]
    acts: Callable[[Any, Any], object]
    says: str


_STRIBECK = ("stiction", "stribeck_velocity", "stribeck_exponent", "micro_damping")
_BRISTLES = ("stiffness", "floor")
# Entries beside a choice that one value of it does not read.
_ENTRIES_NOT_READ = {
    "law": {"lugre": ("reversal_speed",), "dahl": (*_STRIBECK, "reversal_speed"), "coulomb": (*_STRIBECK, *_BRISTLES)},
    "drive": {"tension": ("position_loop",), "position": ("friction_compensation", "reversal_speed")},
}
_WITHOUT_EFFECT_IN_OPEN_LOOP = 'has no effect with controller.kind = "tensions"'


def wound_tendons(scenario: Any, controller: Any) -> set[str]:
    """Return the names of the tendons that are wound: by a length, or by the angle or the voltage of a motor."""
    angles = {*(controller.spool_angle or ()), *(controller.motor_voltage or ())}
    wound = {*(controller.tendon_winding or {})}
    for name, actuator in scenario.finger.actuators.items():
        if name in angles or wound.intersection(actuator.tendons):
            wound.update(actuator.tendons)
    return wound | {name for name, actuator in scenario.finger.tendons.items() if actuator.winch}


def _paths(finger: Any) -> tuple[str, ...]:
    """Return the names of the tree's tendons whose paths those that are pulled take."""
    return tuple(tendon.along for tendon in finger.tendons.values() if tendon.along)


#: Of a finger, whose links or bodies, tendons and actuators are of a kind.
OF_FINGER = (
    Rule("passive_tendon", (), lambda finger, _: finger.passive_names, "has no effect without passive tendons"),
    Rule(
        "tendon_friction", (), lambda finger, _: finger.tendons or finger.canals, "has no effect where no tendon rubs"
    ),
    Rule(
        "joint_friction", (), lambda finger, _: any(finger.bearings), "has no effect without a joint that has a bearing"
    ),
    Rule(
        "joint_friction",
        _STRIBECK,
        lambda _, friction: friction.law not in WITHOUT_STRIBECK,
        'has no effect with law = "dahl" or "coulomb"',
    ),
    Rule(
        "joint_friction", _BRISTLES, lambda _, friction: friction.law != "coulomb", 'has no effect with law = "coulomb"'
    ),
    Rule(
        "joint_friction",
        ("reversal_speed",),
        lambda _, friction: friction.law not in ("lugre", "dahl"),
        'is for law = "coulomb", or one of your own',
    ),
    Rule(
        "joint_friction",
        ("drag_asymmetry",),
        lambda _, friction: "drag" in friction.model_fields_set,
        "has no effect without drag",
    ),
    Rule(
        "stroke_limiter",
        (),
        lambda finger, _: any(each.limited for each in finger.joints.values()),
        "has no effect without a joint that is limited",
    ),
    Rule(
        "",
        ("touches_itself",),
        lambda finger, _: finger.tree.touching or len(finger.links) > 2,
        "has no effect where no two parts but neighbours could touch",
    ),
    Rule(
        "joints.*", ("link",), lambda finger, _: finger.links, "has no effect beside a tree, whose bodies are the links"
    ),
    Rule(
        "actuators.*",
        ("position_loop",),
        lambda _, actuator: actuator.drive == "position",
        'has no effect with drive = "tension"',
    ),
    Rule(
        "actuators.*",
        ("friction_compensation", "reversal_speed"),
        lambda _, actuator: actuator.drive == "tension",
        'has no effect with drive = "position"',
    ),
    Rule(
        "tree.tendons.*",
        ("rest",),
        lambda _, tendon: "stiffness" in tendon.model_fields_set,
        "has no effect without stiffness",
    ),
    Rule(
        "tree.tendons.*",
        ("limit_damping", "limit_viscous"),
        lambda _, tendon: tendon.range is not None,
        "has no effect without range",
    ),
    Rule(
        "tree.tendons.*",
        ("curvature_offset",),
        lambda finger, tendon: any(finger.tree.tendons[name] is tendon for name in (*finger.canals, *_paths(finger))),
        "has no effect where nothing pulls the tendon",
    ),
    Rule("tree.tendons.*.path.*", ("divisor",), lambda _, piece: piece.kind == "pulley", 'is for kind = "pulley"'),
    Rule(
        "tree.tendons.*.path.*",
        ("body", "position"),
        lambda _, piece: piece.kind != "pulley",
        'has no effect with kind = "pulley"',
    ),
    Rule(
        "tree.tendons.*.path.*",
        ("orientation", "radius", "side", "side_point"),
        lambda _, piece: piece.kind in ("cylinder", "sphere"),
        'is for kind = "cylinder" or "sphere"',
    ),
    Rule("tree.bodies.*.solids.*", ("mesh",), lambda _, solid: solid.kind == "mesh", 'is for kind = "mesh"'),
)
#: Of a hand.
OF_HAND = (Rule("", ("fingers_touch",), lambda hand, _: len(hand.fingers) > 1, "has no effect with a single finger"),)
_CORRECTIONS = ("tendon_friction_feedforward", "joint_friction_compensation", "passive_tension_loop", "distribution")
#: Entries of a controller that act in closed loop alone.
CLOSED_LOOP = ("gain", "damping", "gravity_compensation", "spring_compensation", "fingertip_force", *_CORRECTIONS)
#: Of a scenario; of a hand, that of each of its fingers.
OF_SCENARIO = (
    Rule(
        "controller", CLOSED_LOOP, lambda _, controller: controller.kind == "proportional", _WITHOUT_EFFECT_IN_OPEN_LOOP
    ),
    Rule(
        "controller",
        _CORRECTIONS,
        lambda scenario, _: not scenario.finger.through_space,
        "has no effect where tendons run along paths",
    ),
    Rule(
        "controller",
        ("tensions",),
        lambda _, controller: controller.kind == "tensions",
        'is for controller.kind = "tensions"',
    ),
    Rule(
        "controller",
        ("minimum_tension",),
        lambda scenario, controller: (
            controller.kind == "proportional"
            or {*scenario.finger.actuated_names} - {*(controller.tensions or {}), *wound_tendons(scenario, controller)}
        ),
        "has no effect where controller.tensions has every tendon, or a winding does",
    ),
    Rule(
        "controller",
        ("passive_tension", "passive_tension_loop"),
        lambda scenario, _: scenario.finger.passive_names,
        "has no effect without passive tendons",
    ),
    Rule(
        "controller",
        ("spring_compensation",),
        lambda scenario, _: any(joint.spring for joint in scenario.finger.joints.values()),
        "has no effect without springs of joints",
    ),
)


def idle(described: Description, rules: tuple[Rule, ...]) -> Iterator[tuple[str, Any, str]]:
    """Yield the entries that are set and have no effect: dotted name, value and message."""
    for rule in rules:
        for name, table in _tables(described, rule.table):
            for entry in rule.entries or type(table).model_fields:
                value = getattr(table, entry)
                if (
                    entry in table.model_fields_set
                    and _differs(table, entry, value)
                    and not rule.acts(described, table)
                ):
                    yield f"{name}{entry}", value, f"{rule.says}; leave it out"


def without_unread(inherited: dict[str, Any], choices: dict[str, Any]) -> dict[str, Any]:
    """Return a copy of a table less the entries that another value of a choice, such as the law, does not read."""
    unread = {
        entry
        for choice, value in choices.items()
        if isinstance(value, str) and inherited.get(choice) != value
        for entry in _ENTRIES_NOT_READ.get(choice, {}).get(value, ())
    }
    return {entry: value for entry, value in inherited.items() if entry not in unread}


def refuse_idle(described: Description, rules: tuple[Rule, ...]) -> None:
    """Raise the error of the first entry that is given and has no effect."""
    for entry, value, message in idle(described, rules):
        raise problem(entry, message, shown(value))


def shown(value: Any) -> Any:
    """Return a value as messages show it, None for a table."""
    return None if isinstance(value, Description | dict) else value


def _tables(described: Any, name: str) -> Iterator[tuple[str, Description]]:
    """Yield the tables that a name stands for, with what comes before their entries' names."""
    tables: list[tuple[str, Any]] = [("", described)]
    for part in name.split(".") if name else ():
        if part == "*":
            tables = [(f"{before}{key}.", each) for before, table in tables for key, each in table.items()]
        else:
            inner = [(f"{before}{part}.", getattr(table, part)) for before, table in tables]
            tables = [(before, each) for before, each in inner if each]
    yield from tables


def _differs(table: Description, entry: str, value: Any) -> bool:
    """Return whether a value, one number or one each, differs from the default and from zero."""
    default = type(table).model_fields[entry].default
    uniform = isinstance(value, tuple) and all(each == default for each in value)
    # Zero asks for none of what there is not.
    none = not isinstance(value, bool) and value == 0
    return value is not None and value != default and not uniform and not none
