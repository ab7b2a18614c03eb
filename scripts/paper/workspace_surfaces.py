"""Surfaces of the fingertip's workspace: images of the joint ranges by (1), with constraint (4) of passive tendons."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
import pinocchio as pin

from finger_pin.description.coupling import PassiveCoupling
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array
from finger_pin.views.plots.statics import flexion_plane

_PARALLEL = 1e-6


@dataclass(frozen=True, eq=False)
class Section:
    """The flexion plane of a finger: the joints parallel to the last one move, the others are held.

    Attributes:
        patches: Fingertip positions, shape (patches, m, m, 3), m.
        plane: Indices of the two axes of the base frame that the section is drawn in.
        poses: Joints and fingertip of the finger at three poses, straight to flexed, shape (3, n + 1, 3), m.
    """

    patches: Array
    plane: tuple[int, int]
    poses: Array


def fingertip_surface(finger: Finger, samples: int = 45) -> Array:
    """Return the surface that bounds the fingertip's workspace.

    Joints that passive tendons drive follow the others as inextensible tendons demand, H_c theta = 0 in their rows:
    equation (4). Of the other joints, two at a time run through their ranges while the rest sit at their limits. The
    reach of an outstretched finger that never folds back past its own base is bounded by these surfaces.

    Args:
        finger: Any finger.
        samples: Points along either side of a patch.

    Returns:
        Shape (patches, samples, samples, 3), m, base frame; not a number where a driven joint would leave its range.
    """
    return _patches(finger, _constraint(finger).free, _rest(finger), samples, _matrix(finger, True))


def flexion_section(finger: Finger, samples: int = 61, *, coupled: bool = True) -> Section:
    """Return the planar section of the workspace: as `fingertip_surface`, with all but parallel joints held.

    Args:
        finger: Any finger.
        samples: Points along either side of a patch.
        coupled: Whether joints that passive tendons drive follow (4); else they are held as well.
    """
    held, matrix = _rest(finger), _matrix(finger, coupled)
    axes = _joint_axes(finger, held)
    parallel = [j for j in range(len(held)) if np.linalg.norm(np.cross(axes[j], axes[-1])) < _PARALLEL]
    moving = [j for j in _constraint(finger).free if j in parallel]
    patches = _patches(finger, moving, held, samples, matrix)
    low, high = finger.stroke_limiter.lower, finger.stroke_limiter.upper
    poses = []
    for share in (0.0, 0.5, 1.0):
        pose = held.copy()
        pose[moving] = (1.0 - share) * held[moving] + share * high[moving]
        poses.append(_skeleton(finger, np.clip(matrix @ pose, low, high)))
    return Section(patches, flexion_plane(finger), np.array(poses))


def _matrix(finger: Finger, coupled: bool) -> Array:
    """Return the matrix that gives all joints by those that are free, shape (n, n)."""
    constraint = _constraint(finger)
    return (
        constraint.matrix if coupled else np.diag([float(j in constraint.free) for j in range(len(constraint.offset))])
    )


def _constraint(finger: Finger) -> PassiveCoupling:
    return PassiveCoupling.from_routing(finger.routing, finger.tendons.slack, bands=False)


def _rest(finger: Finger) -> Array:
    low, high = finger.stroke_limiter.lower, finger.stroke_limiter.upper
    return np.asarray(np.clip(0.0, low, high))


def _patches(finger: Finger, moving: list[int], held: Array, samples: int, matrix: Array) -> Array:
    low, high = finger.stroke_limiter.lower, finger.stroke_limiter.upper
    # A patch of fewer than two joints is a curve or a point: the missing ones stay where they are.
    pairs: list[tuple[int, ...]] = list(combinations(moving, 2)) or [tuple(moving)]
    patches = []
    for pair in pairs:
        rest = [j for j in moving if j not in pair]
        for corner in product(*((low[j], high[j]) for j in rest)):
            position = np.tile(held, (samples, samples, 1))
            position[..., rest] = corner
            for axis, j in enumerate(pair):
                along = np.linspace(low[j], high[j], samples)
                position[..., j] = along[:, None] if axis == 0 else along
            patches.append(position @ matrix.T)
    positions = np.array(patches)
    tips = np.array([finger.rigid_body.tip_position(q) for q in positions.reshape(-1, len(held))])
    outside = np.any((positions < low - 1e-9) | (positions > high + 1e-9), axis=-1)
    tips = tips.reshape(*positions.shape[:-1], 3)
    tips[outside] = np.nan
    return tips


def _joint_axes(finger: Finger, position: Array) -> Array:
    model = finger.rigid_body.model
    data = model.createData()
    pin.computeJointJacobians(model, data, position)
    frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    # Of a single joint Pinocchio returns a vector.
    turns = (pin.getJointJacobian(model, data, j, frame).reshape(6, -1) for j in range(1, model.njoints))
    return np.array([turn[3:, index] for index, turn in enumerate(turns)])


def _skeleton(finger: Finger, position: Array) -> Array:
    model = finger.rigid_body.model
    data = model.createData()
    pin.forwardKinematics(model, data, position)
    joints = [np.array(data.oMi[j].translation) for j in range(1, model.njoints)]
    return np.array([*joints, finger.rigid_body.tip_position(position)])
