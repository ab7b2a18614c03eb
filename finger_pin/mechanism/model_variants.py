"""Variants of a Pinocchio model with the same joints: on a floating base, and with every subtree in one piece."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray


def floating(fixed: pin.Model) -> pin.Model:
    """Return the same joints on a base that floats free of gravity."""
    model = pin.Model()
    base = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    for index in range(1, fixed.njoints):
        parent = int(fixed.parents[index])
        at = model.addJoint(base + parent, fixed.joints[index], fixed.jointPlacements[index], fixed.names[index])
        model.inertias[at] = fixed.inertias[index]
    model.gravity.linear[:] = 0.0
    return model


class DepthFirst(NamedTuple):
    """The joints of a model with every subtree in one piece.

    Attributes:
        model: The model.
        positions: Indices of its positions in those of the model as listed, shape (nq,).
        velocities: Indices of its velocities, likewise, shape (nv,).
        matrix: Indices in a matrix of its velocities of that of the velocities as listed.
    """

    model: pin.Model
    positions: NDArray[np.int64]
    velocities: NDArray[np.int64]
    matrix: tuple[NDArray[np.int64], ...]


def depth_first(listed: pin.Model) -> DepthFirst:
    """Return the joints of a model depth first, for mass and Coriolis matrices.

    Pinocchio takes the velocities of a subtree for a range of columns there: of joints that are listed level by level
    it would mix those of neighbours.
    """
    paths = [tuple(path) for path in listed.supports]
    model, index, positions, velocities = pin.Model(), {0: 0}, list[int](), list[int]()
    for joint in sorted(range(1, listed.njoints), key=paths.__getitem__):
        moved, parent = listed.joints[joint], index[int(listed.parents[joint])]
        at = index[joint] = model.addJoint(parent, moved, listed.jointPlacements[joint], listed.names[joint])
        model.inertias[at] = listed.inertias[joint]
        positions += range(moved.idx_q, moved.idx_q + moved.nq)
        velocities += range(moved.idx_v, moved.idx_v + moved.nv)
    model.armature = np.asarray(listed.armature)[velocities]
    places = np.argsort(velocities)
    return DepthFirst(model, np.array(positions, dtype=int), np.array(velocities, dtype=int), np.ix_(places, places))
