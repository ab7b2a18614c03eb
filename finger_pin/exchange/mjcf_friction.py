"""Friction of a finger in its MJCF, computed by `finger_pin.mujoco` in MuJoCo's step."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.friction import JointFrictionSettings, TendonFrictionSettings, bristles
from finger_pin.exchange.mujoco_friction import (
    COUNT,
    GROUP,
    LEAST_LOSS,
    MASS,
    NAME,
    PIN,
    PLUGIN,
    TENDON,
    Coefficients,
    PluginFriction,
    check_friction,
)
from finger_pin.mechanism.tendons import Tendons
from finger_pin.typing import Array


def add_friction_elements(root: ET.Element, description: FingerDescription, tendons: Tendons, massless: bool) -> None:
    """Add friction of tendons (9), (14), (16) and of joints (9), (17) to an MJCF that has both.

    A passive tendon without its mass is a spring, and rubs as a driven tendon that its spring pulls.
    """
    check_friction(description, tendons.at_bends)
    frictions = [*_tendon_frictions(description, tendons, massless), *_joint_frictions(description)]
    elements = {(each.tag, each.get("name")): each for kind in ("joint", "fixed") for each in root.iter(kind)}
    for friction in frictions:
        owner = elements["joint" if friction.of_joint else "fixed", friction.name]
        owner.set("frictionloss", repr(max(friction.least_level, LEAST_LOSS)))
        # Viscous friction is part of it; a joint's spring keeps its damping.
        spring = description.joints[friction.name].spring if friction.kind == PIN else None
        owner.set("damping", repr(float(spring.damping) if spring else 0.0))
    default = ET.Element("default")
    friction_class = ET.SubElement(default, "default", {"class": NAME})
    ET.SubElement(friction_class, "general", gaintype="dcmotor", input="none")
    root.insert(1, default)
    extension = ET.Element("extension")
    plugin = ET.SubElement(extension, "plugin", plugin=PLUGIN)
    instance = ET.SubElement(plugin, "instance", name=NAME)
    ET.SubElement(instance, "config", key=COUNT, value=str(len(frictions)))
    root.insert(2, extension)
    actuators = root.find("actuator")
    assert actuators is not None
    place = {"tendon" if not frictions[0].of_joint else "joint": frictions[0].name, "instance": NAME, "class": NAME}
    states = {"actdim": str(sum(friction.states for friction in frictions)), "group": str(GROUP), "gear": "0"}
    ET.SubElement(actuators, "plugin", {"name": NAME, **place, **states})
    table = ET.SubElement(ET.SubElement(root, "custom"), "tuple", name=NAME)
    for friction in frictions:
        for kind, name, value in friction.elements():
            ET.SubElement(table, "element", objtype=kind, objname=name, prm=repr(float(value)))


def _tendon_frictions(description: FingerDescription, tendons: Tendons, massless: bool) -> list[PluginFriction]:
    settings, numbers, frictions = description.tendon_friction, description.numbers["tendon_friction"], []
    for index, (name, tendon) in enumerate(description.tendons.items()):
        law = _coefficients(settings, numbers, "stiction_ratio", index, float(tendons.routing.curvature_offset[index]))
        cord = description.cord(name)
        crossed = [(True, arm.name, arm.turn) for arm in cord.elements]
        if tendon.kind == "actuated":
            frictions.append(PluginFriction(TENDON, name, name, False, 1.0, law, tuple(crossed)))
        elif massless:
            # Its viscous friction is left out with its mass.
            law = law._replace(viscous=0.0)
            frictions.append(PluginFriction(TENDON, name, name, False, 1.0, law, tuple(crossed)))
        else:
            split, mass = cord.mass_after, f"{name}_mass"
            halves = [(False, f"{name}_{half}", 0.0) for half in ("proximal", "distal")]
            elements = (halves[0], *crossed[:split], halves[1], *crossed[split:])
            frictions.append(PluginFriction(MASS, mass, mass, True, 1.0, law, elements))
    return frictions


def _coefficients(
    settings: TendonFrictionSettings | JointFrictionSettings,
    numbers: Mapping[str, Array],
    stiction: str,
    index: int,
    curvature_offset: float = 0.0,
) -> Coefficients:
    """Return the coefficients of one tendon or joint, of which one has another name."""
    values = {**numbers, **bristles(settings, numbers), "stiction": numbers[stiction]}
    names = [name for name in Coefficients._fields if name != "curvature_offset"]
    return Coefficients(**{name: float(values[name][index]) for name in names}, curvature_offset=curvature_offset)


def _joint_frictions(description: FingerDescription) -> list[PluginFriction]:
    settings, numbers = description.joint_friction, description.numbers["joint_friction"]
    return [
        PluginFriction(PIN, name, name, True, 1.0, _coefficients(settings, numbers, settings.break_away_entry, index))
        for index, name in enumerate(description.joints)
    ]
