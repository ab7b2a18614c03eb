"""Places of bodies on the joints of a rigid body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from finger_pin.description.tree_parts import TreeJoint
from finger_pin.mechanism.path_elements import Place
from finger_pin.typing import Array


@dataclass(frozen=True)
class Placed:
    """The place of a body.

    Attributes:
        joint: Index of the joint that carries it in Pinocchio's model, 0 for the base.
        frame: Its placement in that joint's frame.
    """

    joint: int
    frame: pin.SE3

    def place(self, position: tuple[float, float, float]) -> Place:
        """Return a point of the body."""
        return Place(self.joint, np.array(self.frame.act(np.array(position))))


def rotation(quaternion: tuple[float, float, float, float]) -> Array:
    """Return the rotation of a unit quaternion x, y, z, w, shape (3, 3)."""
    matrix: Array = pin.Quaternion(np.array(quaternion)).normalized().matrix()
    return matrix


def joint_placement(place: pin.SE3, joint: TreeJoint) -> pin.SE3:
    """Return the placement of a joint at zero, of a body with a place: at the joint's reference the body is there."""
    back = np.zeros(6)
    first = 3 if joint.kind == "hinge" else 0
    back[first : first + 3] = -joint.reference * np.array(joint.axis)
    return place * pin.SE3(np.eye(3), np.array(joint.anchor)) * pin.exp6(back)
