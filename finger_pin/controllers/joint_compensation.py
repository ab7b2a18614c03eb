"""Joint friction, (9) and (17), as a torque to add: what the tensions that cross a joint cost it."""

from __future__ import annotations

from dataclasses import dataclass

from finger_pin.blocks.joint_friction import JointFriction, joint_reaction
from finger_pin.controllers.direction import signed_coefficient
from finger_pin.routing import Array


@dataclass(frozen=True, eq=False)
class JointCompensation:
    """tau = M(v) R direction(v) + b v, the steady sliding of (9) with the reaction (17) of the planned tensions.

    No external force is known to it. The torque asks for tensions, which load the joints: whoever plans the tensions
    closes that loop.

    Attributes:
        friction: The joints' friction as it is believed to be.
        share: Part of the friction that is compensated.
        reversal_speed: v_r, rad/s.
    """

    friction: JointFriction
    share: float
    reversal_speed: float

    def torque(self, strands: Array, desired_velocity: Array) -> Array:
        """Return the torque, shape (..., n), N m.

        Args:
            strands: Planned tensions of the strands, shape (..., s), N.
            desired_velocity: theta^d', shape (..., n), rad/s.
        """
        law = self.friction
        coefficient = signed_coefficient(
            desired_velocity, law.kinetic, law.static, law.stribeck_velocity, law.stribeck_exponent, self.reversal_speed
        )
        reaction = joint_reaction(strands @ law.loads.T, 0.0, 0.0)
        torque: Array = self.share * (coefficient * reaction + law.viscous * desired_velocity)
        return torque
