"""Everything that the compiled core needs to know about a finger and its controller, as plain arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from finger_pin.core.binding import Indices, Layers, Matrix, Vector
from finger_pin.core.rigid_body import (
    BODY_COLUMNS,
    CENTRE,
    INERTIA,
    MASS,
    PRISMATIC,
    ROTATION,
    SPATIAL_LAYERS,
    SQUARE_LAYERS,
    TRANSLATION,
)
from finger_pin.description.routing import Array
from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger


class Plant(NamedTuple):
    """A finger with n joints, t tendons (a actuated, p passive) and s strands.

    The tables of tendons, joints and passive tendons have one row each; their columns are named in `dynamics`.
    """

    parents: Indices
    kinds: Indices
    bodies: Matrix
    gravity: Vector
    tip_body: int
    tip_offset: Vector
    carriers: Indices
    directions: Matrix
    coupling: Matrix
    strand_coupling: Matrix
    curvature_matrix: Matrix
    loads: Matrix
    tendons: Matrix
    joints: Matrix
    passive: Matrix
    actuated: int
    fingertip_force: Vector
    loaded: bool


class Control(NamedTuple):
    """The paper's controller and a harmonic reference; with ``held`` the tensions in ``tension`` are kept instead."""

    held: bool
    tension: Vector
    gain: Vector
    minimum: Vector
    inverse: Matrix
    internal: Vector
    reference: Matrix
    coupling: Matrix
    offset: Vector


class Work(NamedTuple):
    """Scratch memory and results of one evaluation and its linearisation; never holds anything between calls."""

    rotation: Layers
    origin: Matrix
    frame: Matrix
    centre: Vector
    base_acceleration: Vector
    spatial: Layers
    inertia: Matrix
    composite: Matrix
    coriolis: Matrix
    vectors: Matrix
    square: Layers
    jacobian: Matrix
    joint: Matrix
    tendon: Matrix
    strand: Matrix
    direction: Matrix
    active: Indices
    command_by_position: Matrix
    planned: Vector


def build_plant(finger: Finger, fingertip_force: Array) -> Plant:
    """Read a finger into arrays; Pinocchio's model is the source of the rigid body.

    Raises:
        InputError: If a joint neither turns nor slides about a fixed axis, or has a spring.
    """
    if finger.springs.present:
        raise InputError("finger.joints", "springs are for the methods Radau, BDF and LSODA")
    model, routing = finger.rigid_body.model, finger.routing
    size = model.njoints - 1
    parents = np.array([model.parents[i + 1] - 1 for i in range(size)], dtype=np.int64)
    kinds = np.zeros(size, dtype=np.int64)
    bodies = np.zeros((size, BODY_COLUMNS))
    turns = [np.eye(3)]
    for i in range(size):
        kinds[i], axis = _joint_axis(model, i + 1)
        turn = _frame_along(axis)
        above = turns[parents[i] + 1]
        placement, inertia = model.jointPlacements[i + 1], model.inertias[i + 1]
        bodies[i, ROTATION : ROTATION + 9] = (above.T @ placement.rotation @ turn).ravel()
        bodies[i, TRANSLATION : TRANSLATION + 3] = above.T @ placement.translation
        bodies[i, MASS] = inertia.mass
        bodies[i, CENTRE : CENTRE + 3] = turn.T @ inertia.lever
        moments = turn.T @ inertia.inertia @ turn
        bodies[i, INERTIA : INERTIA + 6] = moments[np.triu_indices(3)]
        turns.append(turn)
    frame = model.frames[finger.rigid_body.tip_frame]
    tip_body = int(frame.parentJoint) - 1
    carriers = finger.rigid_body.carriers[1:]
    tendons, joints, limiter = finger.tendons, finger.joint_friction, finger.stroke_limiter
    return Plant(
        parents=parents,
        kinds=kinds,
        bodies=bodies,
        gravity=np.array(model.gravity.linear),
        tip_body=tip_body,
        tip_offset=turns[tip_body + 1].T @ frame.placement.translation,
        carriers=np.array(carriers, dtype=np.int64) - 1,
        directions=np.array(
            [turns[at].T @ axis for at, axis in zip(carriers, finger.rigid_body.proximal_axes[1:], strict=True)]
        ),
        coupling=routing.coupling,
        strand_coupling=routing.strand_coupling,
        curvature_matrix=routing.curvature_matrix,
        loads=np.ascontiguousarray(routing.loads),
        tendons=np.column_stack(
            [
                routing.curvature_offset,
                tendons.surface,
                tendons.stiction_ratio,
                tendons.stiffness,
                tendons.viscous,
                tendons.stribeck_velocity,
                tendons.floor,
                tendons.stribeck_exponent,
                tendons.lag,
            ]
        ),
        joints=np.column_stack(
            [
                joints.kinetic,
                joints.static,
                joints.stiffness,
                joints.viscous,
                joints.stribeck_velocity,
                joints.floor,
                limiter.lower,
                limiter.upper,
                limiter.stiffness,
                limiter.damping,
                joints.stribeck_exponent,
                joints.lag,
            ]
        ),
        passive=np.column_stack([tendons.half_stiffness, tendons.mass]),
        actuated=routing.actuated,
        fingertip_force=np.array(fingertip_force, dtype=float),
        loaded=bool(np.any(fingertip_force)),
    )


def held_control(plant: Plant) -> Control:
    """Return the control that keeps given tensions."""
    tendons, joints = plant.coupling.shape
    return Control(
        held=True,
        tension=np.zeros(plant.actuated),
        gain=np.zeros(joints),
        minimum=np.zeros(tendons),
        inverse=np.zeros((tendons, joints)),
        internal=np.ones(tendons),
        reference=np.zeros((joints, 4)),
        coupling=np.eye(joints),
        offset=np.zeros(joints),
    )


def build_work(plant: Plant) -> Work:
    """Allocate the scratch memory for a plant."""
    tendons, joints = plant.coupling.shape
    strands = plant.strand_coupling.shape[0]
    base = np.zeros(6)
    base[3:] = -plant.gravity
    return Work(
        rotation=np.zeros((joints, 3, 3)),
        origin=np.zeros((joints, 3)),
        frame=np.zeros((3, 3)),
        centre=np.zeros(3),
        base_acceleration=base,
        spatial=np.zeros((SPATIAL_LAYERS, joints, 6)),
        inertia=np.zeros((joints, 10)),
        composite=np.zeros((joints, 10)),
        coriolis=np.zeros((joints, 12)),
        vectors=np.zeros((2, 6)),
        square=np.zeros((SQUARE_LAYERS, joints, joints)),
        jacobian=np.zeros((3, joints)),
        joint=np.zeros((17, joints)),
        tendon=np.zeros((7, tendons)),
        strand=np.zeros((1, strands)),
        direction=np.zeros((joints, 3)),
        active=np.zeros(1, dtype=np.int64),
        command_by_position=np.zeros((tendons, joints)),
        planned=np.zeros(tendons),
    )


def _joint_axis(model: pin.Model, index: int) -> tuple[int, Array]:
    """Return whether a joint slides (1) or turns (0), and its axis in its own frame."""
    joint = model.joints[index]
    data = joint.createData()
    joint.calc(data, np.zeros(1) if joint.nq == 1 else pin.neutral(model), np.zeros(1))
    subspace = np.asarray(data.S)[:, 0] if np.ndim(data.S) == 2 else np.asarray(data.S)
    linear, angular = subspace[:3], subspace[3:]
    if np.allclose(angular, 0.0):
        return PRISMATIC, linear
    if np.allclose(linear, 0.0):
        return 0, angular
    raise InputError(f"joint {model.names[index]}", "must turn about or slide along a fixed axis", joint.shortname())


def _frame_along(axis: Array) -> Array:
    """Return a rotation whose third column is a unit axis."""
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    first = np.cross(helper, axis)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first), axis])
