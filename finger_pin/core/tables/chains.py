"""Joints of a model as chains of bodies with one coordinate each."""

from __future__ import annotations

from functools import lru_cache
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from finger_pin.exceptions import InputError
from finger_pin.mechanism.rigid_body import FREE_JOINTS, RigidBody
from finger_pin.mechanism.solids import WORLD
from finger_pin.typing import Array


class BodyColumns(NamedTuple):
    """Columns of the table of bodies, the first of several: placement, inertia, and that of the joint's motor."""

    rotation: int
    translation: int
    mass: int
    centre: int
    inertia: int
    armature: int


_WIDTHS = BodyColumns(rotation=9, translation=3, mass=1, centre=3, inertia=6, armature=1)
BODY = BodyColumns(*accumulate(_WIDTHS[:-1], initial=0))
PRISMATIC = 1

# Less of a unit axis is rounding.
_AXIS_ROUNDING = 1e-8
_UPPER_TRIANGLE = np.triu_indices(3)
# Farther than anything slides, m, but for what is moved along a path.
_LARGEST_SLIDE = 1e3


class Chains(NamedTuple):
    """The bodies of a `Structure`, and the places of the model's joints among them.

    Attributes:
        parents, roots, kinds, charts, chart_frames: As in `Structure` and `Parameters`.
        bodies: Likewise, without inertias.
        slides: Largest displacement of each sliding body, shape (n,), m.
        last: Of every joint of the model, the base first, its last body; -1 for the base.
        turns: Rotation of the joint's frame to that body's, shape (3, 3) each.
    """

    parents: NDArray[np.int64]
    roots: NDArray[np.int64]
    kinds: NDArray[np.int64]
    bodies: Array
    slides: Array
    charts: NDArray[np.int64]
    chart_frames: Array
    last: list[int]
    turns: list[Array]


class _Body(NamedTuple):
    """One coordinate of a joint: its kind, sliding or turning, and its axis in the frame of the joint."""

    kind: int
    axis: Array


def read_chains(model: pin.Model) -> Chains:
    """Read the bodies of a model."""
    size = int(model.nv)
    parents, kinds = np.full(size, -1, dtype=np.int64), np.zeros(size, dtype=np.int64)
    bodies, slides, charts, frames = np.zeros((size, sum(_WIDTHS))), np.full(size, _LARGEST_SLIDE), [], []
    # Of every joint of the model, the base first: its last body, and how that one's frame is turned.
    last, turns = [-1], [np.eye(3)]
    for joint in range(1, model.njoints):
        parent, placement = int(model.parents[joint]), model.jointPlacements[joint]
        above, rotation, translation = last[parent], turns[parent].T @ placement.rotation, placement.translation
        translation, turn = turns[parent].T @ translation, np.eye(3)
        chain = _coordinates(model, joint)
        first = int(model.joints[joint].idx_v)
        if model.names[joint] in WORLD:
            slides[first] = model.upperPositionLimit[model.joints[joint].idx_q]
        if len(chain) == 3 and chain[0].kind != PRISMATIC:
            charts.append(first)
            frames.append(rotation)
        for i, part in enumerate(chain, start=first):
            turned = _frame_along(tuple(part.axis.tolist()))
            parents[i], kinds[i] = above, part.kind
            bodies[i, BODY.rotation : BODY.rotation + 9] = (rotation @ turned).ravel()
            bodies[i, BODY.translation : BODY.translation + 3] = translation
            bodies[i, BODY.armature] = model.armature[i]
            above, rotation, translation, turn = i, turned.T, np.zeros(3), turned
        last.append(above)
        turns.append(turn)
    roots: NDArray[np.int64] = np.arange(size)
    for body in np.flatnonzero(parents >= 0):
        roots[body] = roots[parents[body]]
    attitudes = np.array(charts, dtype=np.int64), np.array(frames).reshape(-1, 3, 3)
    return Chains(parents, roots, kinds, bodies, slides, *attitudes, last, turns)


def weighed(chains: Chains, model: pin.Model) -> Array:
    """Return the placements and inertias of the bodies of a model of this form, columns `BODY`."""
    bodies = chains.bodies.copy()
    for inertia, last, turn in zip(list(model.inertias)[1:], chains.last[1:], chains.turns[1:], strict=True):
        bodies[last, BODY.mass] = inertia.mass
        bodies[last, BODY.centre : BODY.centre + 3] = turn.T @ inertia.lever
        bodies[last, BODY.inertia : BODY.inertia + 6] = (turn.T @ inertia.inertia @ turn)[_UPPER_TRIANGLE]
    return bodies


def _coordinates(model: pin.Model, index: int) -> list[_Body]:
    """Return the coordinates of a joint, each about or along an axis of its frame."""
    joint = model.joints[index]
    if joint.shortname() in FREE_JOINTS:
        kind = PRISMATIC if joint.nq == joint.nv else 0
        return [_Body(kind, axis) for axis in np.eye(3)]
    data = joint.createData()
    joint.calc(data, np.zeros(1) if joint.nq == 1 else pin.neutral(model), np.zeros(1))
    subspace = np.asarray(data.S)[:, 0] if np.ndim(data.S) == 2 else np.asarray(data.S)
    linear, angular = subspace[:3], subspace[3:]
    if np.max(np.abs(angular)) < _AXIS_ROUNDING:
        return [_Body(PRISMATIC, linear)]
    if np.max(np.abs(linear)) < _AXIS_ROUNDING:
        return [_Body(0, angular)]
    raise InputError(f"joint {model.names[index]}", "must turn about or slide along a fixed axis", joint.shortname())


@lru_cache
def _frame_along(axis: tuple[float, float, float]) -> Array:
    """Return a rotation whose third column is a unit axis."""
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    first = np.cross(helper, axis)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first), axis])


def tree_arrays(body: RigidBody, chains: Chains) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return fields of `Structure`, the tree, its tips and the loads of joints as pins, and those of `Parameters`."""
    model, last, turns = body.model, chains.last, chains.turns
    joint_of = np.repeat(np.arange(1, model.njoints), [joint.nv for joint in model.joints[1:]])
    tips = [model.frames[tip] for tip in body.tips]
    holders = [int(tip.parentJoint) for tip in tips]
    parent_links = [body.parent_links[joint] for joint in joint_of]
    offsets = [turns[joint].T @ tip.placement.translation for joint, tip in zip(holders, tips, strict=True)]
    directions = [turns[at].T @ body.proximal_axes[joint] for at, joint in zip(parent_links, joint_of, strict=True)]
    structure = {
        "parents": chains.parents,
        "roots": chains.roots,
        "kinds": chains.kinds,
        "charts": chains.charts,
        "tip_body": np.array([last[joint] for joint in holders], dtype=np.int64),
        "parent_links": np.array([last[joint] for joint in parent_links], dtype=np.int64),
        "supported_by": np.ascontiguousarray(body.supports[:, joint_of - 1]),
    }
    return structure, {
        "chart_frames": chains.chart_frames,
        "tip_offset": np.array(offsets).reshape(-1, 3),
        "directions": np.array(directions).reshape(-1, 3),
    }
