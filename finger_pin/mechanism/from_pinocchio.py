"""A Pinocchio model of the user's: the rigid body that tendons act on, and the frames that they are wound in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin

from finger_pin.description.finger_description import FingerDescription
from finger_pin.exceptions import InputError
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
    locked = [index for index in range(1, model.njoints) if index not in indices]
    posture = pin.neutral(model) if configuration is None else np.asarray(configuration, dtype=float)
    if posture.shape != (model.nq,):
        raise InputError("configuration", f"must be {model.nq} numbers, one per coordinate of the model", posture)
    solids = pin.GeometryModel() if visuals is None else visuals
    reduced, shown = pin.buildReducedModel(model, solids, locked, posture)
    reduced.gravity.linear[:] = description.gravity
    body = RigidBody(reduced, tips)
    for index, name in enumerate(description.joints, start=1):
        if body.parent_links[index] == 0:
            number = fingers.index(name.split(".")[0]) if len(fingers) > 1 or fingers[0] else 0
            body.proximal_axes[index] = np.asarray(axes[number], dtype=float)
    return body, shown


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


def chain(model: pin.Model, first: int, count: int) -> pin.Model:
    """Return a serial chain of joints of a tree as a separate model."""
    branch = pin.Model()
    for index in range(first, first + count):
        branch.addJoint(index - first, model.joints[index], model.jointPlacements[index], model.names[index])
    for before, after in pairwise(range(first, first + count)):
        if int(model.parents[after]) != before:
            raise InputError(f"joint {model.names[after]}", f"must be carried by {model.names[before]}")
    return branch


def finger_width(description: FingerDescription) -> float:
    """Return the width of a finger, m, about, from the radii of its tendons."""
    return _WIDTH * max(
        abs(each.radius) for tendon in description.tendons.values() for each in tendon.crossings.values()
    )


def placed_solids(solids: pin.GeometryModel, turns: list[Array]) -> Iterator[tuple[pin.GeometryObject, pin.SE3]]:
    """Yield the solids of a model with their placements in the frames that were turned."""
    for solid in solids.geometryObjects:
        yield solid, pin.SE3(turns[solid.parentJoint], np.zeros(3)).inverse() * solid.placement


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
