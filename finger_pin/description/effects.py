"""Refusal of keys without effect: a table of the conditions under which keys act.

Judged are values that a table gives and that differ from the default, so that a description written out in full can be
read again. What is at a limit where it does nothing, such as a stiffness of zero, is no mistake: sweeps pass there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from finger_pin.description.fields import without
from finger_pin.description.friction import WITHOUT_STRIBECK
from finger_pin.description.tree_couplings import coupled
from finger_pin.description.validation import Description, problem


class Rule(NamedTuple):
    """Condition under which entries of a table act.

    Attributes:
        table: Dotted name of the table, in which a star stands for every name; empty for the description itself.
        entries: Entries of that table; none for all of them.
        acts: Whether they act, by description and table.
        says: What is said when they do not.
        refused: Choices in the table, and values of them, with which they do not act.
    """

    table: str
    entries: tuple[str, ...]
    acts: Callable[[Any, Any], object]
    says: str
    refused: tuple[tuple[str, str], ...] = ()


def _with(table: str, entries: tuple[str, ...], choice: str, *values: str) -> Rule:
    """Return the rule of entries that act with some values of a choice in their table."""
    named, own = " or ".join(f'"{value}"' for value in values), choice.rpartition(".")[2]
    return Rule(table, entries, lambda _, each: getattr(each, own) in values, f"is for {choice} = {named}")


def _without(table: str, entries: tuple[str, ...], choice: str, *values: str, says: str = "") -> Rule:
    """Return the rule of entries that act with all values of a choice in their table but some."""
    named, own = " or ".join(f'"{value}"' for value in values), choice.rpartition(".")[2]
    says, refused = says or f"has no effect with {choice} = {named}", tuple((own, value) for value in values)
    return Rule(table, entries, lambda _, each: getattr(each, own) not in values, says, refused)


def _beside(table: str, entries: tuple[str, ...], other: str) -> Rule:
    """Return the rule of entries that act where another is set."""
    return Rule(table, entries, lambda _, each: other in each.model_fields_set, f"has no effect without {other}")


_STRIBECK = ("stiction", "stribeck_velocity", "stribeck_exponent", "micro_damping")
_BRISTLES = ("stiffness", "floor")


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


_OF_COULOMB, _PIECES = 'is for law = "coulomb", or one of your own', "tree.tendons.*.path.*"
#: Of a finger, whose links or bodies, tendons and actuators are of a kind.
OF_FINGER = (
    Rule("passive_tendon", (), lambda finger, _: finger.passive_names, "has no effect without passive tendons"),
    Rule("tendon_friction", (), lambda it, _: it.tendons or it.canals, "has no effect where no tendon rubs"),
    Rule("joint_friction", (), lambda it, _: any(it.bearings), "has no effect without a joint that has a bearing"),
    _without("joint_friction", _STRIBECK, "law", *WITHOUT_STRIBECK),
    _without("joint_friction", _BRISTLES, "law", "coulomb"),
    _without("joint_friction", ("reversal_speed",), "law", "lugre", "dahl", says=_OF_COULOMB),
    _beside("joint_friction", ("drag_asymmetry",), "drag"),
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
    Rule("joints.*", ("link",), lambda it, _: it.links, "has no effect beside a tree, whose bodies are the links"),
    _without("actuators.*", ("position_loop",), "drive", "tension"),
    _without("actuators.*", ("friction_compensation", "reversal_speed"), "drive", "position"),
    Rule(
        "tendons.*",
        ("along",),
        lambda finger, tendon: not coupled(finger.tree.couplings, tendon.along),
        "is for a tendon without coupling: tree.actuators pull it, so that it rubs by the sum of its tensions",
    ),
    _beside("tree.tendons.*", ("rest",), "stiffness"),
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
    _with(_PIECES, ("divisor",), "kind", "pulley"),
    _without(_PIECES, ("body", "position"), "kind", "pulley"),
    _with(_PIECES, ("orientation", "radius", "side", "side_point"), "kind", "cylinder", "sphere"),
    _with("tree.bodies.*.solids.*", ("mesh",), "kind", "mesh"),
)
# What is put on top of a table leaves out the entries that another value of these choices does not read.
_CHOICES = ("law", "drive")
#: Of a hand.
OF_HAND = (Rule("", ("fingers_touch",), lambda hand, _: len(hand.fingers) > 1, "has no effect with a single finger"),)
_CORRECTIONS = ("tendon_friction_feedforward", "joint_friction_compensation", "passive_tension_loop", "distribution")
#: Entries of a controller that act in closed loop alone.
CLOSED_LOOP = ("gain", "damping", "gravity_compensation", "spring_compensation", "fingertip_force", *_CORRECTIONS)
#: Of a scenario; of a hand, that of each of its fingers.
OF_SCENARIO = (
    _without("controller", CLOSED_LOOP, "controller.kind", "tensions"),
    Rule(
        "controller",
        _CORRECTIONS,
        lambda scenario, _: not scenario.finger.through_space,
        "has no effect where tendons run along paths",
    ),
    _with("controller", ("tensions",), "controller.kind", "tensions"),
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
    tables: dict[str, list[tuple[str, Description]]] = {}
    for rule in rules:
        if rule.table not in tables:
            tables[rule.table] = list(_tables(described, rule.table))
        for name, table in tables[rule.table]:
            entries = table.model_fields_set
            if entries and rule.entries:
                entries = entries.intersection(rule.entries)
            if not entries or rule.acts(described, table):
                continue
            for entry in rule.entries or type(table).model_fields:
                if entry in entries and _differs(table, entry):
                    yield f"{name}{entry}", getattr(table, entry), f"{rule.says}; leave it out"


def without_unread(inherited: dict[str, Any], choices: dict[str, Any]) -> dict[str, Any]:
    """Return a copy of a table less the entries that another value of a choice, such as the law, does not read."""
    unread = {
        entry
        for choice in _CHOICES
        if choice in choices and choices[choice] != inherited.get(choice)
        for rule in OF_FINGER
        if (choice, choices[choice]) in rule.refused
        for entry in rule.entries
    }
    return without(inherited, *unread)


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


def _differs(table: Description, entry: str) -> bool:
    """Return whether a value, one number or one each, differs from the default and from zero."""
    value, default = getattr(table, entry), type(table).model_fields[entry].default
    uniform = isinstance(value, tuple) and all(each == default for each in value)
    # Zero asks for none of what there is not.
    none = not isinstance(value, bool) and value == 0
    return value is not None and value != default and not uniform and not none
