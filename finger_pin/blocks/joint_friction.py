"""Joint friction: law (9) loaded by the joint's reaction force (17)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from finger_pin import friction
from finger_pin.parameters import FingerDescription
from finger_pin.routing import Array
from finger_pin.validation import expand


def joint_reaction(x: Any, y: Any, z: Any) -> Any:
    """Return R, N, the length of the force on the pin, (17)."""
    return np.sqrt(x * x + y * y + z * z)


def joint_reaction_slopes(x: Any, y: Any, z: Any, reaction: Any) -> tuple[Any, Any, Any]:
    """Return the derivatives of R with respect to the components of the force.

    At R = 0 it has a kink, which the floor of the friction level hides.
    """
    safe = np.maximum(reaction, 1e-100)
    return x / safe, y / safe, z / safe


@dataclass(frozen=True, eq=False)
class PinLoads:
    """What presses on the pins of n joints: R_j = |P_j f - A_j^T (F + W_j)|.

    A_j turns the frame of the body proximal to joint j into the base frame. In (17) every strand that crosses a joint
    pulls along the link, P_j f = e_j S_j, and there is no weight.

    Attributes:
        pulls: P, by joint, component and strand, in the frame of the body proximal to the joint, shape (n, 3, s).
        weights: W, weight of everything that the joint carries, base frame, shape (n, 3), N.
    """

    pulls: Array
    weights: Array

    @classmethod
    def of_paper(cls, loads: Array, axes: Array) -> PinLoads:
        """Return those of (17).

        Args:
            loads: Of the routing, shape (n, s).
            axes: e_j in the frame of the body proximal to the joint, shape (n, 3).
        """
        return cls(axes[:, :, None] * loads[:, None, :], np.zeros((len(loads), 3)))

    @property
    def heavy(self) -> bool:
        """Whether weight counts."""
        return bool(np.any(self.weights))

    def external(self, rotations: Array, fingertip_force: Array) -> Array:
        """Return A_j^T (F + W_j), shape (..., n, 3), N.

        Args:
            rotations: A, shape (..., n, 3, 3).
            fingertip_force: F, shape (3,) or (..., 3), N, base frame.
        """
        return np.asarray(np.einsum("...jcr,...jc->...jr", rotations, fingertip_force[..., None, :] + self.weights))


@dataclass(frozen=True, eq=False)
class JointForces:
    """What the joints' friction does; shapes (..., n).

    Attributes:
        reaction: R, N, (17) or as `PinLoads` say.
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
        pins: What presses on the pins.
        kinetic: M^d, shape (n,), m.
        static: M^c, shape (n,), m.
        stiffness: sigma_0, shape (n,), N m/rad.
        viscous: b, shape (n,), N m s/rad.
        stribeck_velocity: omega, shape (n,), rad/s.
        floor: g_min, shape (n,), N m.
        stribeck_exponent: 1 or 2, shape (n,).
        lag: sigma_1 / sigma_0, shape (n,), s.
    """

    pins: PinLoads
    kinetic: Array
    static: Array
    stiffness: Array
    viscous: Array
    stribeck_velocity: Array
    floor: Array
    stribeck_exponent: Array
    lag: Array

    @classmethod
    def from_description(cls, description: FingerDescription, pins: PinLoads) -> JointFriction:
        """Read one number per joint."""
        law, size = description.joint_friction, len(description.joints)
        return cls(
            pins=pins,
            kinetic=expand(law.coulomb, size),
            static=expand(law.stiction, size),
            stiffness=expand(law.stiffness, size),
            viscous=expand(law.viscous, size),
            stribeck_velocity=expand(law.stribeck_velocity, size),
            floor=expand(law.floor, size),
            stribeck_exponent=expand(law.stribeck_exponent, size),
            lag=expand(law.micro_damping, size) / expand(law.stiffness, size),
        )

    def forces(self, velocity: Array, stiction: Array, strands: Array, external: Array) -> JointForces:
        """Return reaction and friction of every joint.

        Args:
            velocity: theta', shape (..., n), rad/s.
            stiction: F^s, shape (..., n), N m.
            strands: f of (12), shape (..., s), N.
            external: What acts from outside, as from `PinLoads.external`, shape (..., n, 3), N.
        """
        force = np.einsum("jrs,...s->...jr", self.pins.pulls, strands) - external
        reaction = joint_reaction(force[..., 0], force[..., 1], force[..., 2])
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
