"""Tendon friction, (9) and (16), added to the commands so that the finger gets the tensions that were planned."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from finger_pin.description.routing import Routing
from finger_pin.laws.bristle import directed_drag, friction_coefficient
from finger_pin.laws.capstan import capstan_coefficient
from finger_pin.mechanism.joints import JointFriction, static_drag
from finger_pin.mechanism.tendons import Tendons
from finger_pin.typing import Array

# Greatest |x| that is compensated: from 1 on, no tension overcomes the friction that it causes.
_MAX_COEFFICIENT = 0.9


def frictionless_strands(routing: Routing) -> Array:
    """Return W, shape (s, t), without friction: both halves of a passive tendon carry its planned tension."""
    return routing.strand_tension(np.eye(len(routing.tendons))).T


@dataclass(frozen=True, eq=False)
class TendonFeedforward:
    """The steady sliding of (9), with (16), solved for the command.

    With x = M(v) times the direction s and a drag d, f = f^a - x (f + f^a) - s d - b v gives

        f^a = (f (1 + x) + s d + b v) / (1 - x),

    which is f exp(mu_e phi) where M = mu^d, d = 0 and b = 0: the inverse of the capstan law. The passive tendons have
    no command; the halves of one carry m (1 + x) and m (1 - x) with mean m, and the difference is a torque that the
    others have to make up for.

    Attributes:
        tendons: The tendons.
        surface: mu_e as it is believed to be, shape (t,).
        stiction_ratio: rho as it is believed to be, shape (t,).
        share: Part of the friction that is compensated.
        reversal_speed: v_r, m/s.
    """

    tendons: Tendons
    surface: Array
    stiction_ratio: Array
    share: float
    reversal_speed: float

    def coefficient(self, position: Array, desired_velocity: Array) -> Array:
        """Return x of every tendon, shape (..., t), for motion of shape (..., n)."""
        tendons = self.tendons
        kinetic = capstan_coefficient(self.surface, tendons.routing.curvature(position))
        static, velocity = self.stiction_ratio * kinetic, self._velocity(desired_velocity)
        signed = signed_coefficient(velocity, kinetic, static, *tendons.stribeck, self.reversal_speed)
        clipped: Array = np.clip(signed, -_MAX_COEFFICIENT, _MAX_COEFFICIENT)
        return clipped

    def command(self, planned: Array, position: Array, desired_velocity: Array) -> Array:
        """Return f^a, shape (..., t), N, that deliver planned tensions of that shape; passive ones stay as they are."""
        actuated = self.tendons.routing.actuated
        x = self.coefficient(position, desired_velocity)[..., :actuated]
        velocity = self._velocity(desired_velocity)[..., :actuated]
        loss = self.tendons.viscous[:actuated] * velocity
        loss = loss + self.tendons.drag[:actuated] * direction(velocity, self.reversal_speed)
        delivered = planned[..., :actuated]
        required = (delivered * (1.0 + x) + loss) / (1.0 - x)
        command = np.maximum(0.0, delivered + self.share * (required - delivered))
        return np.concatenate([command, planned[..., actuated:]], axis=-1)

    def strand_matrix(self, position: Array, desired_velocity: Array) -> Array:
        """Return W, shape (..., s, t): the strands' tensions are W f_hat for a delivered plan f_hat."""
        routing = self.tendons.routing
        frictionless = frictionless_strands(routing)
        rows = np.arange(routing.actuated, len(frictionless))
        columns = np.argmax(frictionless[rows], axis=1)
        x = self.share * self.coefficient(position, desired_velocity)[..., columns]
        matrix = np.broadcast_to(frictionless, (*position.shape[:-1], *frictionless.shape)).copy()
        matrix[..., rows, columns] += np.where((rows - routing.actuated) % 2 == 0, x, -x)
        return matrix

    def _velocity(self, desired_velocity: Array) -> Array:
        """Return v of the tendons, shape (..., t), m/s; that of a passive one is its middle's, both halves alike."""
        tendons = self.tendons
        actuated = desired_velocity @ tendons.routing.actuated_coupling.T
        return np.concatenate([actuated, tendons.rest_position(desired_velocity)], axis=-1)


@dataclass(frozen=True, eq=False)
class JointCompensation:
    """tau = (M(v) R + drag) direction(v) + b v: steady sliding by (9) with the reaction (17) of the planned tensions.

    No external force is known to it. The torque asks for tensions, which load the joints: the plan of the tensions
    closes that loop.

    Attributes:
        friction: The joints' friction.
        kinetic: M^d as it is believed to be, shape (n,), m.
        static: M^c as it is believed to be, shape (n,), m.
        viscous: b as it is believed to be, shape (n,), N m s/rad.
        share: Part of the friction that is compensated.
        reversal_speed: v_r, rad/s.
    """

    friction: JointFriction
    kinetic: Array
    static: Array
    viscous: Array
    share: float
    reversal_speed: float

    def load_matrix(self, strand_matrix: Array, desired_velocity: Array) -> Array:
        """Return the slope of the torque by planned tensions, shape (..., n, t), m: M(v) direction(v) dR/df_hat.

        Tensions are not negative, so that without an external force R = S, the sum of those that cross the joint.

        Args:
            strand_matrix: W, shape (..., s, t); the tensions of the strands are W f_hat.
            desired_velocity: theta^d', shape (..., n), rad/s.
        """
        coefficient = self._signed(desired_velocity, self.kinetic, self.static)
        matrix: Array = self.share * coefficient[..., None] * (self.friction.loads @ strand_matrix)
        return matrix

    def unloaded_torque(self, desired_velocity: Array) -> Array:
        """Return the torque without a load, the drag and b v, shape (..., n), N m."""
        sliding = self.friction.drag
        drag = self._signed(desired_velocity, sliding, static_drag(sliding, self.kinetic, self.static))
        drag = directed_drag(drag, self.friction.drag_asymmetry, direction(desired_velocity, self.reversal_speed))
        return self.share * (drag + self.viscous * desired_velocity)

    def _signed(self, velocity: Array, kinetic: Array, static: Array) -> Array:
        signed: Array = signed_coefficient(velocity, kinetic, static, *self.friction.stribeck, self.reversal_speed)
        return signed


def direction(velocity: Any, reversal_speed: Any) -> Any:
    """Return the direction of a desired motion, tanh(v / v_r): -1 to 1, smooth at a reversal.

    The velocity is the desired one. A measured one would close a loop through the sign of a small, noisy number, and
    chatter; a desired one passes through zero once per reversal, and the compensation moves once from one side to the
    other. Where nothing is meant to move the direction is 0, and nothing is compensated.

    Args:
        velocity: Desired velocity v^d.
        reversal_speed: v_r, in the unit of the velocity.
    """
    return np.tanh(velocity / reversal_speed)


def signed_coefficient(
    velocity: Any, kinetic: Any, static: Any, stribeck: Any, exponent: Any, reversal_speed: Any
) -> Any:
    """Return M(v) of (9b) times the direction: the friction of steady sliding over its normal force.

    Args:
        velocity: Desired velocity v^d.
        kinetic: M^d.
        static: M^c.
        stribeck: omega, in the unit of the velocity.
        exponent: Of the Stribeck curve, 1 or 2.
        reversal_speed: v_r, in the unit of the velocity.
    """
    return friction_coefficient(velocity, kinetic, static, stribeck, exponent) * direction(velocity, reversal_speed)
