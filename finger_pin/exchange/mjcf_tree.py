"""MJCF of a tree of bodies: a hand that was read and changed, or one of your own.

Bodies, joints, tendons, couplings, loops, actuators, objects and keyframes have their counterparts in MuJoCo. What
stops, couples and holds joints and tendons is given the stiffness and damping of the description, as far as MuJoCo's
soft constraints can have them at the model's own inertia (`mujoco_compliance`, the other way round).
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence

import numpy as np

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.tree_parts import TreeTendon
from finger_pin.description.waypoints import Waypoint
from finger_pin.exceptions import InputError
from finger_pin.exchange.mjcf_bodies import BodyWriter
from finger_pin.exchange.mjcf_compliance import IMPEDANCE, soft
from finger_pin.exchange.mjcf_drives import add_actuators, add_equalities, add_keyframes
from finger_pin.exchange.mjcf_geoms import CONTACTS_LEFT_OUT, HIDDEN, IDLE, add_geom, add_objects, add_pairs
from finger_pin.mechanism.body_places import rotation
from finger_pin.mechanism.xml_numbers import numbers

# Longest step of MuJoCo, s, and its share of the time 1 / omega of the stiffest spring.
_MAX_STEP, _STEP_SHARE = 1e-3, 0.2
# Length of a wrap, which has none here, m.
_CYLINDER_LENGTH = 0.02

_HEADER = """
  {title}

  Written from a tree of bodies. Tendons that an ideal source pulls have a motor: its control is their tension, N.
  Joints, tendons, couplings, actuators and keyframes are as described; ranges, couplings and loops are MuJoCo's soft
  constraints, of the description's stiffness and damping at the model's own inertia, and so are contacts.
  Left out, because MuJoCo has no counterpart, or is told of it otherwise:
  - friction of tendons and joints that grows with their load: finger_pin.mujoco.add_friction(spec, of=hand) adds it;
  - what takes energy from an impact on a stop by its depth: stops without a damper are critically damped;{rest}
"""


def tree_to_mjcf(
    description: FingerDescription,
    posture: Sequence[float] | None,
    timestep: float | None,
    integrator: str,
    limits: bool,
    shapes: bool,
) -> str:
    """Return the MJCF of a finger that has a tree of bodies, as text; arguments are those of `to_mjcf`."""
    writer = _Writer(description, limits, shapes)
    step = min(_MAX_STEP, float(f"{_STEP_SHARE / writer.fastest:.0e}")) if timestep is None else timestep
    root = ET.Element("mujoco", model=description.name)
    root.append(ET.Comment(_header(description)))
    ET.SubElement(root, "compiler", angle="radian", autolimits="false")
    option = {"timestep": numbers(step), "gravity": numbers(*description.gravity), "integrator": integrator}
    ET.SubElement(root, "option", option | {"cone": "elliptic", "impratio": "10"})
    writer.write(root, step)
    add_keyframes(root, description, posture, writer.place)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _header(description: FingerDescription) -> str:
    left_out = [f"{line};" for line in description.tree.left_out]
    left_out += ["servos, their spools and what stretches on the way;"] if description.actuators else []
    if np.any(description.joint_friction.drag_asymmetry):
        left_out += ["by how much the drag of joints differs by direction (drag_asymmetry): frictionloss is the mean;"]
    if any(joint.spring and joint.spring.hysteresis for joint in description.joints.values()):
        left_out += ["what springs of joints hold against their motion (hysteresis);"]
    if any(each.slack is not None and each.damping for each in description.tree.tendons.values()):
        left_out += ["that cords with slack are not damped while they are slack: dampers act at any length;"]
    if any(body.shapes for body in description.tree.bodies.values()) or description.tree.objects:
        left_out += [f"{line};" for line in CONTACTS_LEFT_OUT]
    left_out += [
        f"angular_damping of object {name}, {each.angular_damping:g} N m s/rad, which is its damping, {each.damping:g};"
        for name, each in description.tree.objects.items()
        if each.damping != each.angular_damping
    ]
    left_out += (
        ["paths of joints, whose bodies are mocap bodies: lead them by mocap_pos;"] if description.tree.on_paths else []
    )
    lines = "".join(f"\n  - {line}" for line in left_out)
    return _HEADER.format(title=description.title or description.name, rest=lines).replace("--", "- -")


class _Writer(BodyWriter):
    """Writer of bodies, tendons, drives and constraints."""

    def __init__(self, description: FingerDescription, limits: bool, shapes: bool) -> None:
        super().__init__(description, limits, shapes)
        self.names = {name for each in self.tree.bodies.values() for name in (*each.solids, *each.shapes)}
        self.waypoint_attributes: dict[tuple[str, Waypoint], dict[str, str]] = {}

    @property
    def fastest(self) -> float:
        """Frequency omega of the stiffest spring against the inertia that it meets at the references, rad/s."""
        tendons, of_tendons, of_joints = self.tree.tendons.items(), self.mobility.tendons, self.mobility.joints
        springs = {name: joint.spring.stiffness for name, joint in self.description.joints.items() if joint.spring}
        squares = [tendon.stiffness * of_tendons[name] for name, tendon in tendons]
        squares += [stiffness * of_joints[name] for name, stiffness in springs.items()]
        for actuator in self.tree.actuators.values():
            kind, name = actuator.drives
            mobility = {"joint": of_joints, "tendon": of_tendons, "wrench": self.mobility.bodies}[kind][name]
            if actuator.wrench:
                mobility *= float(np.linalg.norm(actuator.wrench.force)) ** 2
            squares.append(abs(actuator.by_length) * actuator.gear**2 * mobility)
        stops = [tendon.limit_stiffness * of_tendons[name] for name, tendon in tendons if tendon.range]
        if self.limits:
            stiffness = self.description.numbers["stroke_limiter"]["stiffness"]
            stops += (stiffness * [*of_joints.values()]).tolist()
        squares += [(1.0 - IMPEDANCE) / IMPEDANCE**2 * square for square in stops]
        return math.sqrt(max([1.0, *squares]))

    def write(self, root: ET.Element, step: float) -> None:
        """Write all but the keyframes; controls that come late are kept for steps of a length, s."""
        tree = self.tree
        world = self.add_bodies(root)
        if self.shapes:
            geoms = add_objects(world, tree)
            add_pairs(ET.SubElement(root, "contact"), self.description, geoms, self.mobility)
        tendons = ET.SubElement(root, "tendon")
        for name, tendon in tree.tendons.items():
            self._add_tendon(tendons, name, tendon)
        for name, pulled in self.description.tendons.items():
            if pulled.along is None:
                fixed = ET.SubElement(tendons, "fixed", name=name)
                for joint, crossing in pulled.crossings.items():
                    ET.SubElement(fixed, "joint", joint=joint, coef=numbers(-crossing.radius))
        add_equalities(root, self.description, self.elements, self.mobility)
        add_actuators(root, self.description, step, self.elements)

    def _add_tendon(self, table: ET.Element, name: str, tendon: TreeTendon) -> None:
        if tendon.path is not None and any((tendon.joints or {}).values()):
            allowed = "is not written: a tendon of MuJoCo has joints or a path"
            raise InputError(f"{self.description.entry('tree.tendons', name)}.joints", allowed)
        rest = tendon.rest
        if tendon.slack is not None:
            rest = (-1e3, float(self.paths.reference_lengths[name]) + tendon.slack)
        attributes = {"stiffness": numbers(tendon.stiffness), "springlength": numbers(*rest)}
        attributes |= {"damping": numbers(tendon.damping), "frictionloss": numbers(tendon.friction)}
        attributes["limited"] = str(tendon.range is not None).lower()
        if tendon.range is not None:
            attributes["range"] = numbers(*tendon.range)
            stop = tendon.limit_stiffness, tendon.limit_viscous, self.mobility.tendons[name]
            attributes |= soft(*stop, "limit", stop=True)
        kind = "fixed" if tendon.path is None else "spatial"
        element = ET.SubElement(table, kind, {"name": name, **attributes})
        for joint, gain in (tendon.joints or {}).items() if kind == "fixed" else ():
            ET.SubElement(element, "joint", joint=joint, coef=numbers(gain))
        for point, waypoint in (tendon.path or {}).items():
            self._add_waypoint(element, f"{name}_{point}", point, waypoint)

    def _add_waypoint(self, path: ET.Element, full_name: str, name: str, waypoint: Waypoint) -> None:
        """Add a piece of a path; tendons share the sites and wraps of one name at one place."""
        if waypoint.kind == "pulley":
            ET.SubElement(path, "pulley", divisor=numbers(waypoint.divisor))
            return
        if (name, waypoint) not in self.waypoint_attributes:
            self.waypoint_attributes[name, waypoint] = self._place_waypoint(name, full_name, waypoint)
        ET.SubElement(path, "site" if waypoint.kind == "point" else "geom", self.waypoint_attributes[name, waypoint])

    def _is_drawn(self, name: str, wrap: Waypoint) -> bool:
        """Return whether a wrap is a solid of its body, which is written already."""
        solid = self.tree.bodies[wrap.body].solids.get(name) if wrap.body and self.shapes else None
        compared = ("kind", "radius", "position", "orientation")
        return solid is not None and all(getattr(solid, key) == getattr(wrap, key) for key in compared)

    def _place_waypoint(self, name: str, full_name: str, waypoint: Waypoint) -> dict[str, str]:
        """Add the site or geom of a waypoint, and the site at its side; return what its path says of them."""
        carrier, is_wrap = self.elements[waypoint.body], waypoint.kind != "point"
        is_drawn = is_wrap and self._is_drawn(name, waypoint)
        label = full_name if name in self.names and not is_drawn else name
        self.names.add(label)
        if not is_wrap:
            ET.SubElement(carrier, "site", name=label, pos=numbers(*waypoint.position))
            return {"site": label}
        if not is_drawn:
            sizes = (waypoint.radius, _CYLINDER_LENGTH)[: 1 + (waypoint.kind == "cylinder")]
            pose, hidden = (waypoint.position, waypoint.orientation), {**IDLE, "group": HIDDEN}
            add_geom(carrier, label, waypoint.kind, sizes, *pose, hidden)
        position = np.array(waypoint.position)
        if waypoint.side is not None:
            position = position + rotation(waypoint.orientation) @ np.array(waypoint.side)
        elif waypoint.side_point is not None:
            carrier, position = self.elements[waypoint.side_point.body], np.array(waypoint.side_point.position)
        else:
            return {"geom": label}
        side = f"{full_name}_side" if f"{label}_side" in self.names else f"{label}_side"
        self.names.add(side)
        ET.SubElement(carrier, "site", name=side, pos=numbers(*position))
        return {"geom": label, "sidesite": side}
