"""Torsion springs of the joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.parameters import FingerDescription, Spring
from finger_pin.description.routing import Array
from finger_pin.laws.spring import JOINT_SPRING, spring_torque
from finger_pin.mechanism.energies import Energy
from finger_pin.mechanism.hysteresis import OF_JOINTS, hysteresis_rows
from finger_pin.mechanism.rows import Rows

_ENERGY = Energy("joint_springs", "joints' springs")


@dataclass(frozen=True, eq=False)
class JointSprings:
    """The springs of all joints; all zero at a joint that has none.

    Attributes:
        stiffness: k, shape (n,), N m/rad.
        rest: theta_0, shape (n,), rad.
        damping: c, shape (n,), N m s/rad.
        hysteresis: h, shape (n,).
    """

    stiffness: Array
    rest: Array
    damping: Array
    hysteresis: Array

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

    @property
    def _sprung(self) -> NDArray[np.intp]:
        return np.flatnonzero((self.stiffness != 0.0) | (self.damping != 0.0))

    def rows(self, names: tuple[str, ...], width: int) -> Rows:
        """Return the table of the springs, of those joints that have one."""
        sprung = self._sprung
        return Rows(
            group="joint_springs",
            law=JOINT_SPRING,
            names=tuple(names[joint] for joint in sprung),
            parameters=np.array([self.stiffness, self.rest, self.damping])[:, sprung],
            arm=np.eye(len(names), width)[sprung],
            stored=_ENERGY,
            powers=(_ENERGY,),
        )

    def hysteresis_rows(self, names: tuple[str, ...], width: int) -> list[Rows]:
        """Return the table of the springs' hysteresis, of those that have some; no table without any."""
        springs = self.rows(names, width)
        return hysteresis_rows("spring_hysteresis", springs, self.hysteresis[self._sprung], OF_JOINTS, _ENERGY)
