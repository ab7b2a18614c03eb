"""The tendon layer: friction in the canals (14), (16), delivered tension (12), the massive passive tendon (13)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from finger_pin.description.parameters import FingerDescription
from finger_pin.description.routing import Array, Routing
from finger_pin.description.validation import expand
from finger_pin.laws import bristle as friction
from finger_pin.laws.capstan import capstan_coefficient, delivered_tension
from finger_pin.laws.passive_tendon import half_tension, passive_acceleration


@dataclass(frozen=True, eq=False)
class TendonForces:
    """What the tendons do; shapes (..., t) unless said otherwise.

    Attributes:
        curvature: phi, rad, (15).
        coefficient: mu^d, (16).
        velocity: v, m/s; (H_c theta')_i, and p_5' for a passive tendon.
        friction: f^f, N, (9c).
        normal: F^n = |f| + |f^a|, N, (14), with f before micro-damping.
        level: max(F^n M, g_min), N.
        stiction_rate: F^s', N/s, (9a).
        strands: f of (12), shape (..., s), N.
        passive_acceleration: p_5'', shape (..., p), m/s2, (13).
    """

    curvature: Array
    coefficient: Array
    velocity: Array
    friction: Array
    normal: Array
    level: Array
    stiction_rate: Array
    strands: Array
    passive_acceleration: Array


@dataclass(frozen=True, eq=False)
class Tendons:
    """The tendon layer of a finger, independent of the rigid body that it drives.

    Attributes:
        routing: The routing matrices.
        surface: mu_e, shape (t,).
        stiction_ratio: rho, shape (t,).
        stiffness: sigma_0, shape (t,), N/m.
        viscous: b, shape (t,), N s/m.
        stribeck_velocity: omega, shape (t,), m/s.
        floor: g_min, shape (t,), N.
        stribeck_exponent: 1 or 2, shape (t,).
        lag: sigma_1 / sigma_0, shape (t,), s.
        half_stiffness: K_h = 2 K_t, shape (p,), N/m.
        mass: m_5, shape (p,), kg.
    """

    routing: Routing
    surface: Array
    stiction_ratio: Array
    stiffness: Array
    viscous: Array
    stribeck_velocity: Array
    floor: Array
    stribeck_exponent: Array
    lag: Array
    half_stiffness: Array
    mass: Array

    @classmethod
    def from_description(cls, description: FingerDescription) -> Tendons:
        """Read friction and passive tendons, one number per tendon."""
        routing = Routing.from_description(description)
        law, passive = description.tendon_friction, description.passive_tendon
        size = len(routing.tendons)
        return cls(
            routing=routing,
            surface=expand(law.coulomb, size),
            stiction_ratio=expand(law.stiction_ratio, size),
            stiffness=expand(law.stiffness, size),
            viscous=expand(law.viscous, size),
            stribeck_velocity=expand(law.stribeck_velocity, size),
            floor=expand(law.floor, size),
            stribeck_exponent=expand(law.stribeck_exponent, size),
            lag=expand(law.micro_damping, size) / expand(law.stiffness, size),
            half_stiffness=2.0 * expand(passive.stiffness, routing.passive),
            mass=expand(passive.mass, routing.passive),
        )

    def stretch(self, position: Array, passive_position: Array) -> tuple[Array, Array]:
        """Return the stretch of the proximal and distal halves, shapes (..., p), m; negative when slack."""
        proximal = -position @ self.routing.proximal_coupling.T - passive_position
        distal = passive_position - position @ self.routing.distal_coupling.T
        return proximal, distal

    def rest_position(self, position: Array) -> Array:
        """Return p_5 with both halves stretched alike, shape (..., p), m."""
        proximal, distal = self.stretch(position, np.zeros((*position.shape[:-1], self.routing.passive)))
        return 0.5 * (proximal - distal)

    def forces(
        self,
        position: Array,
        velocity: Array,
        passive_position: Array,
        passive_velocity: Array,
        stiction: Array,
        command: Array,
    ) -> TendonForces:
        """Return all tendon forces.

        Micro-damping depends on the normal force, which by (14) depends on the delivered tension, which depends on
        micro-damping. Near slack that loop has two solutions where bristles spring back, so it is not closed: the
        tension in (14) is max(0, f^a - F^s - b v), as it is without micro-damping.

        Args:
            position: theta, shape (..., n), rad.
            velocity: theta', shape (..., n), rad/s.
            passive_position: p_5, shape (..., p), m.
            passive_velocity: p_5', shape (..., p), m/s.
            stiction: F^s, shape (..., t), N.
            command: f^a, shape (..., a), N.
        """
        routing, actuated = self.routing, self.routing.actuated
        curvature = routing.curvature(position)
        coefficient = capstan_coefficient(self.surface, curvature)
        sliding = np.concatenate([velocity @ routing.actuated_coupling.T, passive_velocity], axis=-1)
        settled = friction.friction_force(stiction, sliding, self.viscous)[..., :actuated]
        pressing = delivered_tension(command, settled)
        proximal, distal = (
            half_tension(stretch, self.half_stiffness) for stretch in self.stretch(position, passive_position)
        )
        normal = np.concatenate([np.abs(pressing) + np.abs(command), proximal + distal], axis=-1)
        sliding_coefficient = friction.friction_coefficient(
            sliding,
            coefficient,
            self.stiction_ratio * coefficient,
            self.stribeck_velocity,
            self.stribeck_exponent,
        )
        level = friction.friction_level(normal, sliding_coefficient, self.floor)
        rate = friction.stiction_rate(stiction, sliding, level, self.stiffness)
        loss = friction.friction_force(stiction, sliding, self.viscous, rate, self.lag)
        delivered = delivered_tension(command, loss[..., :actuated])
        halves = np.stack([proximal, distal], axis=-1).reshape(*proximal.shape[:-1], 2 * routing.passive)
        return TendonForces(
            curvature=curvature,
            coefficient=coefficient,
            velocity=sliding,
            friction=loss,
            normal=normal,
            level=level,
            stiction_rate=rate,
            strands=np.concatenate([delivered, halves], axis=-1),
            passive_acceleration=passive_acceleration(proximal, distal, loss[..., actuated:], self.mass),
        )
