"""URDF of a finger, and the Pinocchio model read from it."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import pinocchio as pin

from finger_pin.blocks.rigid_body import RigidBody
from finger_pin.exceptions import InputError
from finger_pin.parameters import FingerDescription, Link

TIP_FRAME = "fingertip"


def to_urdf(description: FingerDescription) -> str:
    """Return the URDF of a finger as text."""
    robot = ET.Element("robot", name=description.name)
    ET.SubElement(robot, "link", name="base")
    parent, length, twist = "base", 0.0, 0.0
    for name, joint in description.joints.items():
        if joint.link is None:
            raise InputError(f"finger.joints.{name}.link", "is needed to generate a URDF")
        child = f"{name}_link"
        _add_link(robot, child, joint.link)
        element = ET.SubElement(robot, "joint", name=name, type="revolute")
        ET.SubElement(element, "parent", link=parent)
        ET.SubElement(element, "child", link=child)
        ET.SubElement(element, "origin", xyz=_numbers(length, 0, 0), rpy=_numbers(twist, 0, 0))
        ET.SubElement(element, "axis", xyz="0 0 1")
        lower, upper = joint.range
        ET.SubElement(element, "limit", lower=repr(lower), upper=repr(upper), effort="10", velocity="100")
        parent, length, twist = child, joint.link.length, joint.link.twist
    ET.SubElement(robot, "link", name=TIP_FRAME)
    tip = ET.SubElement(robot, "joint", name=f"{TIP_FRAME}_fixed", type="fixed")
    ET.SubElement(tip, "parent", link=parent)
    ET.SubElement(tip, "child", link=TIP_FRAME)
    ET.SubElement(tip, "origin", xyz=_numbers(length, 0, 0), rpy=_numbers(twist, 0, 0))
    ET.indent(robot)
    return ET.tostring(robot, encoding="unicode") + "\n"


def build_rigid_body(description: FingerDescription) -> RigidBody:
    """Return the rigid body of a finger: its URDF read by Pinocchio, with its gravity."""
    model = pin.buildModelFromXML(to_urdf(description))
    model.gravity.linear[:] = description.gravity
    return RigidBody(model, TIP_FRAME)


def _add_link(robot: ET.Element, name: str, link: Link) -> None:
    axial, transverse = link.inertia
    element = ET.SubElement(robot, "link", name=name)
    inertial = ET.SubElement(element, "inertial")
    ET.SubElement(inertial, "origin", xyz=_numbers(link.mass_centre, 0, 0), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=repr(link.mass))
    moments = {"ixx": axial, "ixy": 0.0, "ixz": 0.0, "iyy": transverse, "iyz": 0.0, "izz": transverse}
    ET.SubElement(inertial, "inertia", {key: repr(value) for key, value in moments.items()})


def _numbers(*values: float) -> str:
    return " ".join(repr(float(value)) for value in values)
