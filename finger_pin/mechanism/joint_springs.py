"""Torsion springs of the joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from finger_pin.description.parameters import FingerDescription, Spring
from finger_pin.description.routing import Array
from finger_pin.laws.spring import spring_torque


@dataclass(frozen=True, eq=False)
class JointSprings:
    """The springs of all joints; all zero at a joint that has none.

    Attributes:
        stiffness: k, shape (n,), N m/rad.
        rest: theta_0, shape (n,), rad.
        damping: c, shape (n,), N m s/rad.
    """

    stiffness: Array
    rest: Array
    damping: Array

    @classmethod
    def from_description(cls, description: FingerDescription) -> JointSprings:
        """Read the springs of the joints."""
        springs = [joint.spring or Spring(stiffness=0.0) for joint in description.joints.values()]
        return cls(*(np.array([getattr(each, name) for each in springs]) for name in cls.__annotations__))

    @property
    def present(self) -> bool:
        """Whether any joint has a spring that does something."""
        return bool(np.any(self.stiffness) or np.any(self.damping))

    def torque(self, position: Array, velocity: Array) -> Array:
        """Return tau^k, shape (..., n), N m."""
        torque: Array = spring_torque(position, velocity, self.stiffness, self.rest, self.damping)
        return torque
