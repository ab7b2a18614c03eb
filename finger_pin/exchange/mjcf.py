"""MJCF of a finger: the part of the model that MuJoCo can express, as text. MuJoCo itself is not needed here.

Exported are the rigid body, the routing, the passive tendons with their lumped mass, the springs of joints, viscous
friction, gravity and the shapes; on request law (9) too, which MuJoCo then needs `finger_pin.mujoco` for, and soft
constraints for the stroke limiters (2). MuJoCo has no counterpart of the cut at zero of a delivered tension (12); it is
left out, and the file says so at its head.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence

import numpy as np

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.links import TIP
from finger_pin.description.loading import DescriptionLike, describe
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.exchange.mjcf_bodies import BodyWriter
from finger_pin.exchange.mjcf_friction import add_friction_elements
from finger_pin.exchange.mjcf_geoms import CONTACTS_LEFT_OUT
from finger_pin.exchange.mjcf_tree import tree_to_mjcf
from finger_pin.mechanism.tendons import Tendons
from finger_pin.mechanism.urdf import TENSION_LIMIT
from finger_pin.mechanism.xml_numbers import numbers as _numbers
from finger_pin.typing import Array

#: Time step, s, of a model without lumped masses.
TIMESTEP = 1e-4

# Lower end of a tendon's dead band, m below zero: never reached.
_NO_LOWER_END = 1000.0
# A slide does not turn, but MuJoCo wants a positive inertia of every body that moves, kg m2.
_NO_INERTIA = 1e-12

_HEADER = """
  {title}

  Controls are tendon tensions f^a, N. The length of an actuated tendon is l = H_c theta, m, positive when the tendon is
  drawn towards its actuator, so that a positive control pulls.{passive}

{friction}
  Left out, because MuJoCo has no counterpart:{rough}{held}
  - the cut of a delivered tension at zero (viscous drag can make a tendon push when its control is near zero);
  - {stops};
  - {contacts};
  - an external force at the fingertip: apply it to the site "{tip}".{servos}
  Added: controls are clamped to 0 to {limit:g} N; shapes touch other objects, not each other.
"""
_FRICTION_LEFT_OUT = """
  - stiction and Coulomb friction of tendons and joints (the dynamic friction law; only its viscous part is here);"""
_FRICTION_PLUGIN = """
  Friction of tendons and joints (the dynamic friction law) is the plugin "finger_pin.friction": import
  finger_pin.mujoco in Python before loading this file.
"""
_NO_STOPS = 'the stroke limiters (Hunt-Crossley); joint ranges are given with limited="false"'
_SOFT_STOPS = "what stops take of an impact by its depth (Hunt-Crossley); they are critically damped soft constraints"
_HYSTERESIS_LEFT_OUT = """
  - what springs of joints and passive tendons hold against their motion (hysteresis);"""
_SERVOS_LEFT_OUT = """
  - servos, winches, their spools and what stretches on the way or in a sheath: controls pull at the entrance of the
    canals."""
_WITH_MASS = """
  A passive tendon is a slide joint, its lumped mass, between two springs that only pull."""
_WITHOUT_MASS = """
  A passive tendon is one spring that only pulls, without its lumped mass and the drag on it."""


def to_mjcf(
    description: DescriptionLike | Scenario,
    *,
    posture: Sequence[float] | None = None,
    timestep: float | None = None,
    integrator: str = "implicitfast",
    massless: bool = False,
    shapes: bool = True,
    friction: bool = False,
    limits: bool | None = None,
) -> str:
    """Return the MJCF of a finger as text, or of a hand with its palm at rest.

    The coordinates are the joints in order, then one slide per passive tendon: its position p_5. Bodies and frames
    are named as in the URDF, those of a tree as there. Numbers are written so that reading them gives the same floats.

    Args:
        description: The finger or hand, its name, the path of its file, or the scenario that has it.
        posture: theta of the keyframe ``start``, shape (n,), rad, with the lumped masses where both halves are
            stretched alike; all joints at zero by default.
        timestep: Of MuJoCo, s; by default a step that the lumped masses are stable with.
        integrator: One of MuJoCo's.
        massless: Replace each passive tendon by one spring K_t (5): coarser, with steps of 0.1 ms, not microseconds.
        shapes: Whether to write the shapes.
        friction: Whether to write law (9) of tendons and joints, with which the model loads only where
            `finger_pin.mujoco` has been imported. Not of a tree.
        limits: Whether joints stop at the ends of their ranges, as softly as by (2); by default those of a tree alone.

    Raises:
        InputError: If it is no finger or hand, a joint has no link, an entry has no counterpart in MuJoCo, the posture
            has the wrong size, or the time step is not positive.
    """
    description = describe(description.finger if isinstance(description, Scenario) else description)
    if timestep is not None and not timestep > 0.0:
        raise InputError("timestep", "must be above 0", timestep)
    if description.couplings and (friction or description.tree.bodies):
        allowed = "is not written beside friction=True, which counts a source's tension alone, or a tree"
        raise InputError("couplings", allowed, next(iter(description.couplings)))
    if description.tree.bodies:
        if friction:
            call = "finger_pin.mujoco.add_friction(mujoco.MjSpec.from_string(text), of=hand)"
            raise InputError("friction", f"of a tree is added to what is written without: {call}")
        return tree_to_mjcf(description, posture, timestep, integrator, limits is not False, shapes)
    tendons = Tendons.from_description(description)
    writer = BodyWriter(description, bool(limits), shapes)
    joints = len(description.joints)
    position = np.zeros(joints) if posture is None else np.asarray(posture, dtype=float)
    if position.shape != (joints,):
        raise InputError("posture", f"must be {joints} numbers, one per joint", posture)
    time_step = _stable_step(tendons, massless) if timestep is None else timestep
    root = ET.Element("mujoco", model=description.name)
    root.append(ET.Comment(_header(description, tendons, massless, friction, bool(limits))))
    ET.SubElement(root, "compiler", angle="radian", autolimits="false")
    option = {"timestep": _numbers(time_step), "gravity": _numbers(*description.gravity), "integrator": integrator}
    ET.SubElement(root, "option", option)
    world = writer.add_bodies(root)
    if not massless:
        _add_masses(world, description, tendons)
    _add_tendons(root, tendons, massless)
    if friction:
        add_friction_elements(root, description, tendons, massless)
    passive = np.zeros(0) if massless else tendons.rest_position(position)
    ET.SubElement(ET.SubElement(root, "keyframe"), "key", name="start", qpos=_numbers(*position, *passive))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _header(description: FingerDescription, tendons: Tendons, massless: bool, friction: bool, limits: bool) -> str:
    """Return the comment that says what of the description the model has and lacks."""
    notes = {"title": description.title or description.name, "passive": "", "tip": TIP, "limit": TENSION_LIMIT}
    notes |= {"friction": _FRICTION_PLUGIN, "rough": ""} if friction else {"friction": "", "rough": _FRICTION_LEFT_OUT}
    springs = [joint.spring.hysteresis for joint in description.joints.values() if joint.spring]
    notes["held"] = _HYSTERESIS_LEFT_OUT if any(springs) or tendons.hysteresis.any() else ""
    notes["stops"] = _SOFT_STOPS if limits else _NO_STOPS
    notes["contacts"] = ";\n  - ".join(CONTACTS_LEFT_OUT)
    notes["servos"] = _SERVOS_LEFT_OUT if description.drive_cords else ""
    if tendons.routing.passive:
        notes["passive"] = _WITHOUT_MASS if massless else _WITH_MASS
    return _HEADER.format(**notes).replace("--", "- -")


def _stable_step(tendons: Tendons, massless: bool) -> float:
    """Return a time step, s, to one digit: explicit stiffness is stable below 2 / omega, omega^2 = 2 K_h / m_5."""
    if massless or not tendons.routing.passive:
        return TIMESTEP
    fastest = math.sqrt(float(np.max(2.0 * tendons.half_stiffness / tendons.mass)))
    return min(TIMESTEP, float(f"{0.8 / fastest:.0e}"))


def _add_masses(world: ET.Element, description: FingerDescription, tendons: Tendons) -> None:
    """Add a slide perpendicular to gravity for every lumped mass (13)."""
    gravity = np.array(description.gravity)
    helper = np.eye(3)[np.argmin(np.abs(gravity))]
    axis = np.cross(gravity, helper) if np.any(gravity) else helper
    axis = axis / np.linalg.norm(axis)
    actuated = tendons.routing.actuated
    for index, name in enumerate(tendons.routing.passive_names):
        body = ET.SubElement(world, "body", name=f"{name}_mass")
        inertia = {"pos": _numbers(0, 0, 0), "mass": _numbers(tendons.mass[index])}
        ET.SubElement(body, "inertial", {**inertia, "diaginertia": _numbers(*[_NO_INERTIA] * 3)})
        slide = {"name": f"{name}_mass", "type": "slide", "axis": _numbers(*axis)}
        ET.SubElement(body, "joint", {**slide, "damping": _numbers(tendons.viscous[actuated + index])})


def _add_tendons(root: ET.Element, tendons: Tendons, massless: bool) -> None:
    """Add tendons whose lengths are sums of coordinates: (3) for the actuated ones, stretches (12) for passive ones."""
    routing = tendons.routing
    table, actuators = ET.SubElement(root, "tendon"), ET.SubElement(root, "actuator")
    limits = {"gear": _numbers(1), "ctrllimited": "true", "ctrlrange": _numbers(0, TENSION_LIMIT)}
    for index, name in enumerate(routing.tendons[: routing.actuated]):
        _add_tendon(table, name, routing.joints, routing.coupling[index], damping=tendons.viscous[index])
        ET.SubElement(actuators, "motor", {"name": name, "tendon": name, **limits})
    for index, name in enumerate(routing.passive_names):
        stiffness, slack = tendons.half_stiffness[index], tendons.slack[index]
        if massless:
            coupling = -routing.coupling[routing.actuated + index]
            _add_tendon(table, name, routing.joints, coupling, stiffness=0.5 * stiffness, slack=slack)
            continue
        coordinates = (*routing.joints, f"{name}_mass")
        proximal = np.append(-routing.proximal_coupling[index], -1.0)
        distal = np.append(-routing.distal_coupling[index], 1.0)
        _add_tendon(table, f"{name}_proximal", coordinates, proximal, stiffness=stiffness, slack=0.5 * slack)
        _add_tendon(table, f"{name}_distal", coordinates, distal, stiffness=stiffness, slack=0.5 * slack)
    # Both ways, at a length of its own.
    for name, each in tendons.description.couplings.items():
        arms = [routing.coupling[routing.tendons.index(end)] for end in (each.follower, each.other) if end]
        arm = sum(factor * arm for factor, arm in zip((1.0, -each.slope), arms, strict=False))
        spring = {"stiffness": each.stiffness, "damping": each.damping, "slack": -each.offset}
        _add_tendon(table, name, routing.joints, arm, **spring, pulls_only=False)


def _add_tendon(
    table: ET.Element,
    name: str,
    coordinates: Sequence[str],
    coupling: Array,
    damping: float = 0.0,
    stiffness: float = 0.0,
    slack: float = 0.0,
    pulls_only: bool = True,
) -> None:
    """Add a tendon; one with stiffness pulls at lengths above its slack, and may push below."""
    attributes = {"damping": _numbers(damping)} if damping or stiffness == 0.0 else {}
    if stiffness != 0.0:
        attributes["stiffness"] = _numbers(stiffness)
        attributes["springlength"] = _numbers(-_NO_LOWER_END if pulls_only else slack, slack)
    tendon = ET.SubElement(table, "fixed", {"name": name, **attributes})
    for coordinate, factor in zip(coordinates, coupling, strict=True):
        if factor != 0.0:
            ET.SubElement(tendon, "joint", joint=coordinate, coef=_numbers(factor))
