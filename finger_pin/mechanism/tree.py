"""A tree of bodies from its description, and the rows of what acts on it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from finger_pin.description.parameters import FingerDescription
from finger_pin.description.routing import Array
from finger_pin.description.tree import Tree
from finger_pin.exceptions import InputError
from finger_pin.laws.actuator import ACTUATOR
from finger_pin.laws.bristle import PIN_FRICTION
from finger_pin.laws.dead_band import DEAD_BAND_SPRING
from finger_pin.laws.law import Law
from finger_pin.laws.limiter import STROKE_LIMITER
from finger_pin.laws.spring import JOINT_SPRING
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.mechanism.rows import Rows

_TIP = "fingertip"
# Dry friction of a tendon holds until it has slid so far, m.
_HOLDS = 1e-4
_UNLIMITED = (-np.inf, np.inf)


def build_tree(description: FingerDescription) -> RigidBody:
    """Return the rigid body of a tree, with the description's gravity.

    Raises:
        InputError: If a joint moves nothing that has inertia.
    """
    tree = description.tree
    assert tree is not None
    model = pin.Model()
    model.name = description.name
    model.gravity.linear[:] = description.gravity
    placed: dict[str | None, tuple[int, Any]] = {None: (0, pin.SE3.Identity())}
    for name, body in tree.bodies.items():
        joint, place = placed[body.parent]
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
        placed[name] = (joint, place)
        xx, yy, zz, xy, xz, yz = body.inertia
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if joint:
            model.appendBodyToJoint(joint, pin.Inertia(body.mass, np.array(body.centre), inertia), place)
    joint, place = placed[tree.tip.body]
    there = place * pin.SE3(np.eye(3), np.array(tree.tip.position))
    model.addFrame(pin.Frame(_TIP, joint, 0, there, pin.FrameType.OP_FRAME))
    pin.crba(model, data := model.createData(), pin.neutral(model))
    for name, moved in zip(tree.joints, np.diag(data.M), strict=True):
        if not moved > 0.0:
            raise InputError(f"finger.tree.joints.{name}", "moves nothing that has mass or inertia")
    return RigidBody(model, _TIP)


def rotation(quaternion: Sequence[float]) -> Array:
    """Return the rotation of a quaternion w, x, y, z, shape (3, 3)."""
    w, x, y, z = quaternion
    matrix: Array = pin.Quaternion(w, x, y, z).normalized().matrix()
    return matrix


def tree_rows(description: FingerDescription, width: int) -> list[Rows]:
    """Return the rows of tendons, couplings and actuators of a tree, as wide as there are coordinates."""
    tree = description.tree
    if tree is None:
        return []
    joints = {name: row for name, row in zip(tree.joints, np.eye(len(tree.joints), width), strict=True)}
    tendons = {name: _arm(tree, name, joints) for name in tree.tendons}

    def table(
        group: str, law: Law, arms: dict[str, Array], parameters: Sequence[Sequence[float]], **more: object
    ) -> Rows:
        # One row of numbers for each of the table's, one column for each parameter.
        arm = np.array(list(arms.values()))
        return Rows(group, law, tuple(arms), np.array(parameters, dtype=float).T, arm, **more)  # type: ignore[arg-type]

    sprung = {name: each for name, each in tree.tendons.items() if each.stiffness or each.damping}
    limited = {name: each for name, each in tree.tendons.items() if each.range is not None}
    rubbing = {name: each for name, each in tree.tendons.items() if each.friction}
    tables: list[Rows] = []
    numbers: list[tuple[float, ...]]
    if sprung:
        numbers = [(each.stiffness, *each.rest, each.damping) for each in sprung.values()]
        arms = {name: tendons[name] for name in sprung}
        tables.append(table("tendon_spring", DEAD_BAND_SPRING, arms, numbers))
    if limited:
        numbers = [(*each.range, each.limit_stiffness, each.limit_damping) for each in limited.values() if each.range]
        arms = {name: tendons[name] for name in limited}
        tables.append(table("tendon_limit", STROKE_LIMITER, arms, numbers))
    if rubbing:
        # Law (9) whose level is its floor.
        numbers = [(0, 0, each.friction / _HOLDS, 0, 1, each.friction, 1, 0) for each in rubbing.values()]
        arms = {name: tendons[name] for name in rubbing}
        tables.append(table("tendon_dry_friction", PIN_FRICTION, arms, numbers))
    if tree.couplings:
        nowhere = np.zeros(width)
        arms = {
            name: joints[each.joint] - each.ratio * (joints[each.other] if each.other else nowhere)
            for name, each in tree.couplings.items()
        }
        numbers = [(each.stiffness, each.offset, each.damping) for each in tree.couplings.values()]
        tables.append(table("coupling", JOINT_SPRING, arms, numbers))
    if tree.actuators:
        arms = {
            name: each.gear * (joints[each.joint] if each.joint else tendons[str(each.tendon)])
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
        tables.append(
            table("actuator", ACTUATOR, arms, numbers, channels=channels, stored="joint_springs", powers=("actuators",))
        )
    return tables


def _arm(tree: Tree, name: str, joints: dict[str, Array]) -> Array:
    """Return dl/dq of a tendon that is a sum of joint positions."""
    tendon = tree.tendons[name]
    if tendon.joints is None:
        raise InputError(f"finger.tree.tendons.{name}.path", "paths through space are not there yet")
    arm = np.zeros(len(next(iter(joints.values()))))
    for joint, coefficient in tendon.joints.items():
        arm += coefficient * joints[joint]
    return arm
