"""Joint friction: law (9) loaded by the joint's reaction force (17)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.friction import JointFrictionSettings, TendonFrictionSettings
from finger_pin.description.parameters import FingerDescription
from finger_pin.description.routing import Array
from finger_pin.description.validation import expand
from finger_pin.laws.bristle import PIN_FRICTION
from finger_pin.mechanism.energies import Energy
from finger_pin.mechanism.rows import Rows

#: What friction in the joints takes, in the order of its law.
LOSSES = (
    Energy("joint_coulomb", "joints sliding"),
    Energy("joint_viscous", "joints viscous"),
    Energy("joint_micro_damping", "joints' micro-damping"),
)


@dataclass(frozen=True, eq=False)
class JointFriction:
    """Friction of all joints.

    Attributes:
        loads: Shape (n, s), one where a strand loads a joint.
        bearing: Whether each joint has a pin that rubs, shape (n,).
        kinetic: M^d, shape (n,), m.
        static: M^c, shape (n,), m.
        stiffness: sigma_0, shape (n,), N m/rad.
        viscous: b, shape (n,), N m s/rad.
        stribeck_velocity: omega, shape (n,), rad/s.
        floor: g_min, shape (n,), N m.
        stribeck_exponent: 1 or 2, shape (n,).
        lag: sigma_1 / sigma_0, shape (n,), s.
    """

    loads: Array
    bearing: NDArray[np.bool_]
    kinetic: Array
    static: Array
    stiffness: Array
    viscous: Array
    stribeck_velocity: Array
    floor: Array
    stribeck_exponent: Array
    lag: Array

    @classmethod
    def from_description(cls, description: FingerDescription, loads: Array) -> JointFriction:
        """Read one number per joint; ``loads`` comes from the routing."""
        law, size = description.joint_friction, len(description.joints)
        tree = description.tree
        bearing = np.array([tree is None or tree.joints[name].bearing for name in description.joints])
        return cls(
            loads=bearing[:, None] * loads,
            bearing=bearing,
            kinetic=expand(law.coulomb, size),
            static=expand(law.stiction, size),
            **bristles(law, size),
        )

    def rows(
        self,
        names: tuple[str, ...],
        drives: Mapping[str, Array],
        actuated: int,
        width: int,
        canals: Mapping[str, Array] | None = None,
    ) -> Rows:
        """Return the table of the joints' friction.

        Args:
            names: Of the joints.
            drives: Weights with which further tables pull the strands, as of `Tendons.pulled`; all of it adds up.
            actuated: Number of driven tendons.
            width: Number of coordinates.
            canals: Weights with which canals of a tree, and what pulls through them, load the pins, shape (n, rows).
        """
        size = len(names)
        # Strands beyond the actuated ones are halves of passive tendons.
        loads = {"driven_tendons": self.loads[:, :actuated], "passive_halves": self.loads[:, actuated:]}
        loads |= {group: self.loads @ weights for group, weights in drives.items()} | dict(canals or {})
        return Rows(
            group="joint_friction",
            law=PIN_FRICTION,
            names=names,
            parameters=np.array([getattr(self, name) for name in PIN_FRICTION.parameters]),
            arm=np.eye(size, width),
            loads=loads,
            pins=np.where(self.bearing, np.arange(size), -1),
            stored=Energy("joint_bristles", "joint bristles"),
            powers=LOSSES,
        )


def bristles(law: JointFrictionSettings | TendonFrictionSettings, size: int) -> dict[str, Array]:
    """Return the numbers that friction of tendons and of joints share, by the laws' names, one for each of ``size``."""
    names = ("stiffness", "viscous", "stribeck_velocity", "floor", "stribeck_exponent")
    found: dict[str, Array] = {name: expand(getattr(law, name), size) for name in names}
    return found | {"lag": expand(law.micro_damping, size) / found["stiffness"]}
