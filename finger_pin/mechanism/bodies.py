"""Rigid body of a finger, a hand or a tree: its bodies and joints as a Pinocchio model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from finger_pin.description.caching import memoised
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.links import TIP
from finger_pin.description.objects import inertia_matrix
from finger_pin.description.tree import Tree
from finger_pin.description.tree_parts import TreeJoint
from finger_pin.exceptions import InputError
from finger_pin.mechanism.body_places import Placed, joint_placement, rotation
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.mechanism.urdf import to_urdf

# Inertia of what moves along a path, which takes none, kg or kg m2.
_ON_PATH = 1e-9
_Z = (0.0, 0.0, 1.0)


def build_rigid_body(description: FingerDescription) -> RigidBody:
    """Return the rigid body of a finger, a hand or a tree, with its gravity."""
    return place_bodies(description)[0]


def _values(description: FingerDescription) -> tuple[object, ...]:
    turned = [(name, each.orientation) for name, each in description.hand.fingers.items()] if description.hand else []
    return (description.name, description.gravity, *turned, description.bodies)


@memoised(_values)
def place_bodies(description: FingerDescription) -> tuple[RigidBody, Mapping[str | None, Placed]]:
    """Return a rigid body and, on its joints, the places of the bodies of its tree, by name; the base's by None."""
    tree, hand, is_tree = description.bodies, description.hand, bool(description.tree.bodies)
    tips = {TIP: tree.tip} if tree.tip else {f"{name}.{TIP}": tip for name, tip in tree.tips.items()}
    model, placed = _joined(tree)
    if is_tree or hand is not None:
        for name, tip in tips.items():
            placement = placed[tip.body].frame * pin.SE3(np.eye(3), np.array(tip.position))
            model.addFrame(pin.Frame(name, placed[tip.body].joint, 0, placement, pin.FrameType.OP_FRAME))
    else:
        # A finger of links is what its URDF says, here as in any other program that reads it.
        model = pin.buildModelFromXML(to_urdf(description, drawn=False))
    model.name = description.name
    model.gravity.linear[:] = description.gravity
    body = RigidBody(model, list(tips))
    for index, name in enumerate(body.joints, start=1):
        if hand is not None and not body.parent_links[index]:
            body.proximal_axes[index] = hand.fingers[name.split(".")[0]].rotation[:, 0]
    if not is_tree:
        body.topology = _form(tree)
    for name, moment in zip(tree.joints, np.diag(body.mass_matrix(pin.neutral(model))), strict=True):
        if not moment > 0.0:
            raise InputError(description.entry("tree.joints", name), "moves nothing that has mass or inertia")
    return body, placed


def _form(tree: Tree) -> tuple[object, ...]:
    """Return all that a tree of links has but what it weighs: bodies of one form share their topology."""
    places = ((name, each.parent, each.position, each.orientation) for name, each in tree.bodies.items())
    return (*places, *tree.joints, *tree.tips)


def _joined(tree: Tree) -> tuple[pin.Model, dict[str | None, Placed]]:
    """Return the joints of a tree, with the inertias of its bodies, and the places of these."""
    model, placed = pin.Model(), dict[str | None, Placed]({None: Placed(0, pin.SE3.Identity())})
    for name, body in tree.bodies.items():
        joint, place = placed[body.parent].joint, placed[body.parent].frame
        place = place * pin.SE3(rotation(body.orientation), np.array(body.position))
        for joint_name in tree.joints_of(name):
            moved = tree.joints[joint_name]
            joint = model.addJoint(joint, _joint_model(moved), joint_placement(place, moved), joint_name)
            model.armature[model.joints[joint].idx_v] = moved.armature if moved.path is None else _ON_PATH
            place = pin.SE3(np.eye(3), np.array(moved.anchor)).inverse()
        placed[name] = Placed(joint, place)
        if joint and (body.mass or any(body.inertia)):
            inertia = pin.Inertia(body.mass, np.array(body.centre), inertia_matrix(body.inertia))
            model.appendBodyToJoint(joint, inertia, place)
    return model, placed


def _joint_model(joint: TreeJoint) -> Any:
    if joint.kind == "slide":
        return pin.JointModelPrismaticUnaligned(np.array(joint.axis))
    return pin.JointModelRZ() if joint.axis == _Z else pin.JointModelRevoluteUnaligned(np.array(joint.axis))
