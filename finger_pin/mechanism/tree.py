"""A tree of bodies from its description, and the rows of its tendons, couplings and actuators."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from finger_pin.description.parameters import FingerDescription
from finger_pin.exceptions import InputError
from finger_pin.laws.actuator import ACTUATOR
from finger_pin.laws.bristle import PIN_FRICTION
from finger_pin.laws.dead_band import DEAD_BAND_SPRING
from finger_pin.laws.law import Law
from finger_pin.laws.limiter import STROKE_LIMITER
from finger_pin.laws.spring import JOINT_SPRING
from finger_pin.mechanism.energies import Energy
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.mechanism.routes import Placed, Route, Routes, rotation
from finger_pin.mechanism.rows import Rows
from finger_pin.mechanism.tendons import SOURCES

_TIP = "fingertip"
# Dry friction of a tendon holds until it has slid so far, m.
_HOLDS = 1e-4
_UNLIMITED = (-np.inf, np.inf)
# What rows of a tree store and exchange, by table.
_STORED = {
    "tendon_spring": Energy("tendon_spring", "tendons' springs"),
    "tendon_limit": Energy("tendon_limit", "tendons' limits"),
    "coupling": Energy("coupling", "couplings"),
    "actuator": Energy("joint_springs", "joints' springs"),
}
_EXCHANGED = {
    "tendon_spring": (Energy("tendon_spring_damping", "tendons' dampers"),),
    "tendon_limit": (Energy("tendon_limit_limiter", "tendons' limits"),),
    "coupling": (Energy("coupling_damping", "couplings"),),
    "actuator": (SOURCES,),
}


def build_tree(description: FingerDescription) -> tuple[RigidBody, Routes]:
    """Return the rigid body of a tree, with the description's gravity, and its tendons.

    Raises:
        InputError: If a joint moves nothing that has inertia.
    """
    tree = description.tree
    assert tree is not None
    model = pin.Model()
    model.name = description.name
    model.gravity.linear[:] = description.gravity
    placed: dict[str | None, Placed] = {None: Placed(0, pin.SE3.Identity())}
    for name, body in tree.bodies.items():
        joint, place = placed[body.parent].joint, placed[body.parent].frame
        place = place * pin.SE3(rotation(body.orientation), np.array(body.position))
        for own, moved in tree.joints.items():
            if moved.body == name:
                axis, to_anchor = np.array(moved.axis), pin.SE3(np.eye(3), np.array(moved.anchor))
                hinge = moved.kind == "hinge"
                # At its reference, the body is where its placement says.
                back = np.zeros(6)
                back[3 * hinge : 3 * hinge + 3] = -moved.reference * axis
                kind = (pin.JointModelRevoluteUnaligned if hinge else pin.JointModelPrismaticUnaligned)(axis)
                joint = model.addJoint(joint, kind, place * to_anchor * pin.exp6(back), own)
                model.armature[model.joints[joint].idx_v] = moved.armature
                place = to_anchor.inverse()
        placed[name] = Placed(joint, place)
        xx, yy, zz, xy, xz, yz = body.inertia
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if joint:
            model.appendBodyToJoint(joint, pin.Inertia(body.mass, np.array(body.centre), inertia), place)
    tip = placed[tree.tip.body]
    there = tip.frame * pin.SE3(np.eye(3), np.array(tree.tip.position))
    model.addFrame(pin.Frame(_TIP, tip.joint, 0, there, pin.FrameType.OP_FRAME))
    pin.crba(model, data := model.createData(), pin.neutral(model))
    for name, moment in zip(tree.joints, np.diag(data.M), strict=True):
        if not moment > 0.0:
            raise InputError(f"finger.tree.joints.{name}", "moves nothing that has mass or inertia")
    rigid_body = RigidBody(model, _TIP)
    return rigid_body, Routes.of(tree, rigid_body, placed)


def along_paths(description: FingerDescription, routes: Routes, table: Rows) -> Rows:
    """Return a table of tendons with those along paths of a tree: drawn in, a tendon gets shorter."""
    assert description.tree is not None
    if table.group != "driven_tendons" and not table.pulls:
        return table
    arm, offset, paths = table.arm.copy(), table.offset.copy(), list(table.paths)
    rest = np.array([joint.reference for joint in description.tree.joints.values()])
    lengths = dict(zip(routes.routes, routes.length(rest), strict=True))
    for k, name in enumerate(table.pulls or table.names):
        along = description.tendons[name].along
        if along is not None:
            route = routes.routes[along].times(-1.0)
            arm[k, : len(rest)], paths[k] = route.coefficients, route.legs
            offset[k] += lengths[along]
    return replace(table, arm=arm, measure=arm, offset=offset, paths=tuple(paths))


def tree_rows(description: FingerDescription, routes: Routes, width: int) -> list[Rows]:
    """Return the rows of tendons, couplings and actuators of a tree, as wide as there are coordinates."""
    tree = description.tree
    assert tree is not None
    joints = {name: Route(row, ()) for name, row in zip(tree.joints, np.eye(len(tree.joints)), strict=True)}
    tendons = routes.routes

    def table(group: str, law: Law, along: dict[str, Route], numbers: Sequence[Sequence[float]], **more: Any) -> Rows:
        arm = np.zeros((len(along), width))
        arm[:, : len(joints)] = [route.coefficients for route in along.values()]
        paths = tuple(route.legs for route in along.values())
        booked = {"stored": _STORED.get(group), "powers": _EXCHANGED.get(group, ())}
        return Rows(group, law, tuple(along), np.array(numbers, dtype=float).T, arm, paths=paths, **(booked | more))

    sprung = {name: each for name, each in tree.tendons.items() if each.stiffness or each.damping}
    limited = {name: each for name, each in tree.tendons.items() if each.range is not None}
    rubbing = {name: each for name, each in tree.tendons.items() if each.friction}
    tables: list[Rows] = []
    numbers: list[tuple[float, ...]]
    if sprung:
        numbers = [(each.stiffness, *each.rest, each.damping) for each in sprung.values()]
        tables.append(table("tendon_spring", DEAD_BAND_SPRING, {name: tendons[name] for name in sprung}, numbers))
    if limited:
        numbers = [(*each.range, each.limit_stiffness, each.limit_damping) for each in limited.values() if each.range]
        tables.append(table("tendon_limit", STROKE_LIMITER, {name: tendons[name] for name in limited}, numbers))
    if rubbing:
        # Law (9) whose level is its floor.
        numbers = [(0, 0, each.friction / _HOLDS, 0, 1, each.friction, 1, 0) for each in rubbing.values()]
        tables.append(table("tendon_dry_friction", PIN_FRICTION, {name: tendons[name] for name in rubbing}, numbers))
    if tree.couplings:
        along = {}
        for name, each in tree.couplings.items():
            other = each.ratio * joints[each.other].coefficients if each.other else 0.0
            along[name] = Route(joints[each.joint].coefficients - other, ())
        numbers = [(each.stiffness, each.offset, each.damping) for each in tree.couplings.values()]
        tables.append(table("coupling", JOINT_SPRING, along, numbers))
    if tree.actuators:
        along = {
            name: (joints[each.joint] if each.joint else tendons[str(each.tendon)]).times(each.gear)
            for name, each in tree.actuators.items()
        }
        numbers = [
            (
                *(each.gain, each.offset, each.by_length, each.by_speed),
                *(each.input_range or _UNLIMITED),
                *(each.force_range or _UNLIMITED),
            )
            for each in tree.actuators.values()
        ]
        channels = len(description.actuated_names) + np.arange(len(tree.actuators))
        tables.append(table("actuator", ACTUATOR, along, numbers, channels=channels))
    return tables
