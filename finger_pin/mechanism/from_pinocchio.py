"""A Pinocchio model of the user's: the rigid body that tendons act on, and the frames that they are wound in."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from finger_pin.description.finger_description import FingerDescription
from finger_pin.exceptions import InputError, LeftOutWarning
from finger_pin.mechanism.rigid_body import RigidBody
from finger_pin.typing import Array

#: Width of a finger whose links are not known, in parts of the largest radius that a tendon winds at.
_WIDTH = 1.8


def on_model(
    description: FingerDescription,
    model: pin.Model,
    joints: Mapping[str, str] | Mapping[str, Mapping[str, str]],
    tip_frame: str | Mapping[str, str],
    configuration: Array | None,
    base_axis: Sequence[float] | Mapping[str, Sequence[float]],
    visuals: pin.GeometryModel | None,
) -> tuple[RigidBody, pin.GeometryModel]:
    """Return rigid body and solids of a finger on a model whose other joints are locked.

    Arguments and errors are those of `Finger.from_model`.
    """
    fingers = ("",) if description.hand is None else tuple(description.hand.fingers)
    named = _by_joint(joints)
    tips, axes = (
        _by_finger(each, fingers, what) for each, what in ((tip_frame, "tip_frame"), (base_axis, "base_axis"))
    )
    for name in description.joints:
        if name not in named:
            raise InputError(f"joints.{name}", "is missing: name the model's joint")
    chosen = [named[name] for name in description.joints]
    for name, wanted in named.items():
        if name not in description.joints or not model.existJointName(wanted):
            raise InputError(f"joints.{name}", "no such joint in the description or the model", wanted)
    indices = [int(model.getJointId(name)) for name in chosen]
    if indices != sorted(set(indices)):
        raise InputError("joints", "must follow the model's order, each joint once", chosen)
    for index, joint in enumerate(model.joints):
        if index and joint.nv == 0:
            allowed = "follows another one; read the model without mimics, and hold them together by a passive tendon"
            raise InputError(f"joint {model.names[index]}", allowed)
    if dropped := _not_carried_over(description, model, indices):
        warnings.warn(LeftOutWarning(f"{description.name}: not carried over: {'; '.join(dropped)}"), stacklevel=3)
    locked = [index for index in range(1, model.njoints) if index not in indices]
    posture = pin.neutral(model) if configuration is None else np.asarray(configuration, dtype=float)
    if posture.shape != (model.nq,):
        raise InputError("configuration", f"must be {model.nq} numbers, one per coordinate of the model", posture)
    solids = pin.GeometryModel() if visuals is None else visuals
    reduced, shown = pin.buildReducedModel(model, solids, locked, posture)
    reduced = _with_angles(reduced)
    reduced.gravity.linear[:] = description.gravity
    body = RigidBody(reduced, tips)
    for index, name in enumerate(description.joints, start=1):
        if body.parent_links[index] == 0:
            number = fingers.index(name.split(".")[0]) if len(fingers) > 1 or fingers[0] else 0
            body.proximal_axes[index] = np.asarray(axes[number], dtype=float)
    return body, shown


def _not_carried_over(description: FingerDescription, model: pin.Model, indices: Sequence[int]) -> list[str]:
    """Return what joints of a model have beyond a description, whose friction and ranges act."""
    friction, lines = description.numbers["joint_friction"], []
    # Before Pinocchio 4 it had one limit for both directions.
    high = getattr(model, "upperDryFrictionLimit", None)
    losses = model.friction if high is None else np.maximum(high, -model.lowerDryFrictionLimit)
    for place, ((name, joint), index) in enumerate(zip(description.joints.items(), indices, strict=True)):
        kind, entry, other = model.joints[index], f"finger.joints.{name}", model.names[index]
        if kind.nv != 1:
            continue
        unit = "N m" if kind.nq == 2 or not kind.shortname().startswith("JointModelP") else "N"
        damping, theirs = float(friction["viscous"][place]), float(model.damping[kind.idx_v])
        damping += joint.spring.damping if joint.spring else 0.0
        if theirs > damping:
            lines.append(f"damping of joint {other}, {theirs:g} {unit} s/rad: {entry}.spring.damping can say it")
        dry, theirs = max(float(friction[key][place]) for key in ("floor", "drag")), float(losses[kind.idx_v])
        if theirs > dry:
            lines.append(f"dry friction of joint {other}, {theirs:g} {unit}: finger.joint_friction.floor can say it")
        if kind.nq == 1:
            low, high = float(model.lowerPositionLimit[kind.idx_q]), float(model.upperPositionLimit[kind.idx_q])
            lower, upper = joint.range if joint.limited else (-np.inf, np.inf)
            if low < high and (lower < low - 1e-9 or upper > high + 1e-9):
                lines.append(f"range of joint {other}, {low:g} to {high:g}: {entry}.range acts, {lower:g} to {upper:g}")
    return lines


def _with_angles(model: pin.Model) -> pin.Model:
    """Return a model whose hinges that turn on have an angle for coordinate, in place of its cosine and sine."""
    if all(joint.nq != 2 for joint in model.joints[1:]):
        return model
    turned = pin.Model()
    turned.name, turned.gravity = model.name, model.gravity
    for index in range(1, model.njoints):
        joint = model.joints[index]
        if (joint.nq, joint.nv) == (2, 1):
            data = joint.createData()
            joint.calc(data, np.array([1.0, 0.0]), np.zeros(1))
            joint = pin.JointModelRevoluteUnaligned(np.ravel(data.S)[3:])
        parent, placement = int(model.parents[index]), model.jointPlacements[index]
        turned.inertias[turned.addJoint(parent, joint, placement, model.names[index])] = model.inertias[index]
    turned.armature[:] = model.armature
    for frame in list(model.frames)[turned.nframes :]:
        turned.addFrame(frame, False)
    return turned


def _by_joint(joints: Mapping[str, str] | Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """Return the names of a model's joints by those of a description."""
    by_joint: dict[str, str] = {}
    for name, model_joints in joints.items():
        if isinstance(model_joints, str):
            by_joint[name] = model_joints
        else:
            by_joint |= {f"{name}.{joint}": each for joint, each in model_joints.items()}
    return by_joint


def _by_finger(values: Any, fingers: tuple[str, ...], entry: str) -> list[Any]:
    """Return one item for each finger, of one for all or of a table by finger."""
    if not isinstance(values, Mapping):
        if entry == "tip_frame" and len(fingers) > 1:
            raise InputError(entry, f"must be a table with a frame for each of {', '.join(fingers)}", values)
        return [values] * len(fingers)
    for name in fingers:
        if name not in values:
            raise InputError(f"{entry}.{name}", f"is missing: there must be one for each of {', '.join(fingers)}")
    return [values[name] for name in fingers]


def turned_model(body: RigidBody, slides: bool = False) -> tuple[pin.Model, list[Array]]:
    """Return the joints of a body with their axes along z, and the rotation of each frame, the base first.

    Args:
        body: The body.
        slides: Whether joints may slide.
    """
    original, model, turns = body.model, pin.Model(), [np.eye(3)]
    for index in range(1, original.njoints):
        joint, parent, placement = original.joints[index], int(original.parents[index]), original.jointPlacements[index]
        data = joint.createData()
        joint.calc(data, np.zeros(1), np.zeros(1))
        subspace = np.ravel(data.S)
        slide = bool(np.any(subspace[:3]))
        if joint.nv != 1 or (slide and not slides):
            raise InputError(f"joint {original.names[index]}", "the viewer shows tendons around joints that turn")
        turn = _frame(subspace[:3] if slide else subspace[3:], _next_place(body, index))
        above = pin.SE3(turns[parent], np.zeros(3)).inverse()
        kind = pin.JointModelPZ() if slide else pin.JointModelRZ()
        at = model.addJoint(parent, kind, above * placement * pin.SE3(turn, np.zeros(3)), original.names[index])
        model.inertias[at] = original.inertias[index]
        turns.append(turn)
    return model, turns


def _next_place(body: RigidBody, index: int) -> Array:
    """Return the next place of the finger after a joint, in its frame: the next joint, or the tip."""
    model = body.model
    after = [joint for joint in range(index + 1, model.njoints) if int(model.parents[joint]) == index]
    if after:
        return np.array(model.jointPlacements[after[0]].translation)
    tips = [model.frames[tip].placement.translation for tip in body.tips if model.frames[tip].parentJoint == index]
    return np.array(tips[0]) if tips else np.zeros(3)


def _frame(axis: Array, along: Array) -> Array:
    """Return a rotation with z along an axis and x as near to a direction as can be."""
    z = axis / np.linalg.norm(axis)
    x = along - (along @ z) * z
    if np.linalg.norm(x) < 0.1 * np.linalg.norm(along) or not np.any(along):
        x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])
