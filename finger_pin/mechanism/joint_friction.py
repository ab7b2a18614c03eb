"""Joint friction: law (9) loaded by the joint's reaction force (17)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from finger_pin.description.parameters import FingerDescription
from finger_pin.description.routing import Array
from finger_pin.description.validation import expand
from finger_pin.laws import bristle as friction
from finger_pin.laws.reaction import joint_reaction


@dataclass(frozen=True, eq=False)
class JointForces:
    """What the joints' friction does; shapes (..., n).

    Attributes:
        reaction: R, N, (17).
        friction: tau^f, N m, (9c).
        level: max(R M, g_min), N m.
        stiction_rate: F^s', N m/s, (9a).
    """

    reaction: Array
    friction: Array
    level: Array
    stiction_rate: Array


@dataclass(frozen=True, eq=False)
class JointFriction:
    """Friction of all joints.

    Attributes:
        loads: Shape (n, s), one where a strand loads a joint.
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
        return cls(
            loads=loads,
            kinetic=expand(law.coulomb, size),
            static=expand(law.stiction, size),
            stiffness=expand(law.stiffness, size),
            viscous=expand(law.viscous, size),
            stribeck_velocity=expand(law.stribeck_velocity, size),
            floor=expand(law.floor, size),
            stribeck_exponent=expand(law.stribeck_exponent, size),
            lag=expand(law.micro_damping, size) / expand(law.stiffness, size),
        )

    def forces(
        self, velocity: Array, stiction: Array, strands: Array, directions: Array, fingertip_force: Array
    ) -> JointForces:
        """Return reaction and friction of every joint.

        Args:
            velocity: theta', shape (..., n), rad/s.
            stiction: F^s, shape (..., n), N m.
            strands: f of (12), shape (..., s), N.
            directions: e_j in the base frame, shape (..., n, 3).
            fingertip_force: F, shape (3,) or (..., 3), N, base frame.
        """
        along = (directions @ fingertip_force[..., None])[..., 0]
        squared = np.sum(fingertip_force**2, axis=-1)[..., None]
        across = np.sqrt(np.maximum(squared - along**2, 0.0))
        reaction = joint_reaction(strands @ self.loads.T, along, across)
        coefficient = friction.friction_coefficient(
            velocity, self.kinetic, self.static, self.stribeck_velocity, self.stribeck_exponent
        )
        level = friction.friction_level(reaction, coefficient, self.floor)
        rate = friction.stiction_rate(stiction, velocity, level, self.stiffness)
        return JointForces(
            reaction=reaction,
            friction=friction.friction_force(stiction, velocity, self.viscous, rate, self.lag),
            level=level,
            stiction_rate=rate,
        )
