"""Joint friction, (9) and (17), as a torque to add: the loss at a joint under the tensions that cross it."""

from __future__ import annotations

from dataclasses import dataclass

from finger_pin.control.direction import signed_coefficient
from finger_pin.description.routing import Array
from finger_pin.mechanism.joint_friction import JointFriction


@dataclass(frozen=True, eq=False)
class JointCompensation:
    """tau = M(v) R direction(v) + b v, the steady sliding of (9) with the reaction (17) of the planned tensions.

    No external force is known to it. The torque asks for tensions, which load the joints: the plan of the tensions
    closes that loop.

    Attributes:
        friction: The joints' friction as it is believed to be.
        share: Part of the friction that is compensated.
        reversal_speed: v_r, rad/s.
    """

    friction: JointFriction
    share: float
    reversal_speed: float

    def load_matrix(self, strand_matrix: Array, desired_velocity: Array) -> Array:
        """Return the slope of the torque by planned tensions, shape (..., n, t), m: M(v) direction(v) dR/df_hat.

        Tensions are not negative, so that without an external force R = S, the sum of those that cross the joint.

        Args:
            strand_matrix: W, shape (..., s, t); the tensions of the strands are W f_hat.
            desired_velocity: theta^d', shape (..., n), rad/s.
        """
        law = self.friction
        coefficient = signed_coefficient(
            desired_velocity, law.kinetic, law.static, law.stribeck_velocity, law.stribeck_exponent, self.reversal_speed
        )
        matrix: Array = self.share * coefficient[..., None] * (law.loads @ strand_matrix)
        return matrix

    def viscous_torque(self, desired_velocity: Array) -> Array:
        """Return b v, shape (..., n), N m."""
        return self.share * self.friction.viscous * desired_velocity
