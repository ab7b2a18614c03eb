"""Bodies of a finger, a hand or a tree as MJCF: joints with springs, dampers and ranges, geoms, and fingertips."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.links import TIP
from finger_pin.description.tree_parts import Body
from finger_pin.exceptions import InputError
from finger_pin.exchange.mjcf_compliance import Mobility, quaternion, soft
from finger_pin.exchange.mjcf_geoms import add_assets, add_body_geoms
from finger_pin.mechanism.tree_mechanism import build_body
from finger_pin.mechanism.xml_numbers import numbers
from finger_pin.typing import Array

# The least friction loss that MuJoCo keeps, N m, and the inertia that MuJoCo wants of all that moves, kg m2.
_LEAST_LOSS, _NO_INERTIA = 1e-6, 1e-12
_WORLD = "world"


class BodyWriter:
    """Writes bodies.

    Attributes:
        description: The finger.
        tree: Its bodies.
        limits: Whether joints stop at the ends of their ranges.
        shapes: Whether geoms are written.
        rigid_body: Of the finger.
        paths: Its tendons.
        mobility: Of its joints, tendons and bodies.
        elements: What was written, by body; that of the world by None.
    """

    def __init__(self, description: FingerDescription, limits: bool, shapes: bool) -> None:
        """Take a finger, to be written with or without limits and shapes."""
        self.description, self.tree, self.limits, self.shapes = description, description.bodies, limits, shapes
        self.rigid_body, self.paths = build_body(description)
        self.mobility = Mobility(self.tree, self.rigid_body, self.paths)
        self.elements: dict[str | None, ET.Element] = {}

    def add_bodies(self, root: ET.Element) -> ET.Element:
        """Add all bodies and fingertips; return the element of the world."""
        if self.shapes:
            add_assets(root, self.tree)
        self.elements[None] = ET.SubElement(root, "worldbody")
        for name, body in self.tree.bodies.items():
            self._add_body(name, body)
        for name, tip in ({"": self.tree.tip} if self.tree.tip else self.tree.tips).items():
            # What is called a tip is read as one.
            site = name if "tip" in name.lower() else "_".join(filter(None, (name, TIP)))
            site = tip.body if tip.body and tip.body.endswith(TIP) else site
            ET.SubElement(self.elements[tip.body], "site", name=site, pos=numbers(*tip.position))
        return self.elements[None]

    def place(self, name: str, q: Array) -> pin.SE3:
        """Return the place of a body at a posture, shape (n,)."""
        data, placed = self.rigid_body.model.createData(), self.paths.placed[name]
        pin.forwardKinematics(self.rigid_body.model, data, q)
        return data.oMi[placed.joint] * placed.frame

    def _add_body(self, name: str, body: Body) -> None:
        parent = self.elements[body.parent]
        joints = self.tree.joints_of(name)
        if name == _WORLD and body.parent is None and not joints:
            self.elements[name] = parent
            if self.shapes:
                add_body_geoms(parent, body)
            return
        pose = {"pos": numbers(*body.position), "quat": quaternion(body.orientation)}
        is_mocap = self._is_mocap(name, body)
        attributes = {"mocap": "true"} if is_mocap else {}
        attributes |= {"gravcomp": numbers(body.gravity_compensation)} if body.gravity_compensation else {}
        element = self.elements[name] = ET.SubElement(parent, "body", {"name": name, **pose, **attributes})
        if body.mass or any(body.inertia):
            inertia = {"pos": numbers(*body.centre), "mass": numbers(body.mass), "fullinertia": numbers(*body.inertia)}
            ET.SubElement(element, "inertial", inertia)
        elif joints and not is_mocap:
            least = {"pos": "0 0 0", "mass": numbers(_NO_INERTIA), "diaginertia": numbers(*[_NO_INERTIA] * 3)}
            ET.SubElement(element, "inertial", least)
        friction = self.description.numbers["joint_friction"]
        loss = np.maximum(friction["floor"], friction["drag"])
        for k, (joint, moved) in enumerate(self.tree.joints.items()):
            if moved.body == name and not is_mocap:
                place = {"axis": numbers(*moved.axis), "pos": numbers(*moved.anchor), "ref": numbers(moved.reference)}
                attributes = {"name": joint, "type": moved.kind, **place, "armature": numbers(moved.armature)}
                attributes["frictionloss"] = numbers(loss[k] if moved.bearing and loss[k] >= _LEAST_LOSS else 0.0)
                ET.SubElement(element, "joint", attributes | self._joint(k, joint))
        if self.shapes:
            add_body_geoms(element, body)

    def _is_mocap(self, name: str, body: Body) -> bool:
        """Return whether a body is written as a mocap body, whose path the user gives by ``mocap_pos``."""
        joints = self.tree.joints_of(name)
        on_paths = [key for key in joints if key in self.tree.on_paths]
        if on_paths and (body.parent is not None or on_paths != joints):
            allowed = "is not written: a mocap body of MuJoCo stands in the world, and all of its joints have paths"
            raise InputError(f"{self.description.entry('tree.joints', on_paths[0])}.path", allowed)
        return bool(on_paths)

    def _joint(self, k: int, name: str) -> dict[str, str]:
        """Return spring, damper and range of a joint."""
        joint, values = self.description.joints[name], self.description.numbers
        viscous = float(values["joint_friction"]["viscous"][k]) * self.tree.joints[name].bearing
        spring = joint.spring
        attributes = {"damping": numbers(viscous + (spring.damping if spring else 0.0))}
        if spring is not None:
            attributes |= {"stiffness": numbers(spring.stiffness), "springref": numbers(spring.rest)}
        limited = joint.limited and self.limits
        attributes |= {"range": numbers(*joint.range), "limited": str(limited).lower()}
        if limited:
            stiffness, damper = (float(values["stroke_limiter"][entry][k]) for entry in ("stiffness", "viscous"))
            attributes |= soft(stiffness, damper, self.mobility.joints[name], "limit", stop=True)
        return attributes
