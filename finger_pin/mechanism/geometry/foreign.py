"""A Pinocchio model of a user's own in the frames that tendons are wound in: z along the axis, x along the finger."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pinocchio as pin

from finger_pin.description.parameters import FingerDescription
from finger_pin.description.routing import Array
from finger_pin.exceptions import InputError
from finger_pin.mechanism.rigid_body import RigidBody

#: Width of a finger whose links are not known, in parts of the largest radius that a tendon winds at.
_WIDTH = 1.8


def turned_model(body: RigidBody) -> tuple[pin.Model, list[Array]]:
    """Return the joints of a body with their axes along z, and the rotation of each frame, the base first.

    Raises:
        InputError: If a joint does not turn.
    """
    own, model, turns = body.model, pin.Model(), [np.eye(3)]
    for index in range(1, own.njoints):
        joint, parent, placement = own.joints[index], int(own.parents[index]), own.jointPlacements[index]
        data = joint.createData()
        joint.calc(data, np.zeros(1), np.zeros(1))
        subspace = np.ravel(data.S)
        if joint.nv != 1 or np.any(subspace[:3]):
            raise InputError(f"joint {own.names[index]}", "the viewer shows tendons around joints that turn")
        turn = _frame(subspace[3:], _onwards(body, index))
        above = pin.SE3(turns[parent], np.zeros(3))
        at = model.addJoint(
            parent, pin.JointModelRZ(), above.inverse() * placement * pin.SE3(turn, np.zeros(3)), own.names[index]
        )
        model.inertias[at] = own.inertias[index]
        turns.append(turn)
    return model, turns


def chain(model: pin.Model, first: int, count: int) -> pin.Model:
    """Return some joints of a tree, each on the one before, as a model of their own."""
    own = pin.Model()
    for index in range(first, first + count):
        own.addJoint(index - first, model.joints[index], model.jointPlacements[index], model.names[index])
    for before, after in pairwise(range(first, first + count)):
        if int(model.parents[after]) != before:
            raise InputError(f"joint {model.names[after]}", f"must be carried by {model.names[before]}")
    return own


def width_of(description: FingerDescription) -> float:
    """Return the width of a finger, m, about, from the radii of its tendons."""
    return _WIDTH * max(
        abs(each.radius) for tendon in description.tendons.values() for each in tendon.crossings.values()
    )


def placed_solids(solids: pin.GeometryModel, turns: list[Array]) -> Iterator[tuple[pin.GeometryObject, pin.SE3]]:
    """Yield the solids of a model with their placements in the frames that were turned."""
    for each in solids.geometryObjects:
        yield each, pin.SE3(turns[each.parentJoint], np.zeros(3)).inverse() * each.placement


def _onwards(body: RigidBody, index: int) -> Array:
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
