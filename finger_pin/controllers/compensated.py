"""The wiring: torque law, then friction of joints and passive tendons, then tensions, then friction of tendons."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from finger_pin.blocks.controller import ControlSignals
from finger_pin.blocks.reference import ReferenceSignals
from finger_pin.controllers.distribution import Distribution, Plan
from finger_pin.controllers.joint_compensation import JointCompensation
from finger_pin.controllers.tendon_feedforward import TendonFeedforward
from finger_pin.controllers.torque import TorqueLaw
from finger_pin.routing import Array, Routing

# The loop through the joints' friction settles by a factor of two to four at every turn.
_SETTLED, _TURNS = 1e-9, 200


@dataclass(frozen=True, eq=False)
class CompensatedController:
    """A controller with the face of the paper's, and any of the compensations.

    The torque that the tendons have to exert is tau = tau^d + tau^f(f_hat): friction of the joints grows with the
    tensions, and the tensions with the torque that overcomes it. The two are made to agree by turns; below the
    critical joint friction (`critical_friction`) they do.

    Attributes:
        routing: The routing.
        law: tau^d.
        distribution: From torque to planned tensions.
        minimum: f0, shape (t,), N.
        tendons: Compensates tendon friction; None to leave it.
        joints: Compensates joint friction; None to leave it.
    """

    routing: Routing
    law: TorqueLaw
    distribution: Distribution
    minimum: Array
    tendons: TendonFeedforward | None = None
    joints: JointCompensation | None = None

    def command(
        self, time: Array | float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return the torque that is asked of the tendons and the commands, for shapes (..., n)."""
        return self.command_above(self.minimum, reference, position, velocity)

    def command_above(
        self, minimum: Array, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return the commands with another minimum f0, shape (t,), N."""
        wanted = self.law.torque(reference, position, velocity)
        plan = self.distribution.plan(wanted, minimum)
        torque = wanted
        if self.tendons is not None or self.joints is not None:
            for _ in range(_TURNS):
                torque = wanted + self._friction(plan, position, reference.velocity)
                last, plan = plan, self.distribution.plan(torque, minimum)
                change = np.abs(plan.tension - last.tension)
                if not np.any(change > _SETTLED * np.max(plan.tension, axis=-1, keepdims=True)):
                    break
        command = plan.tension
        if self.tendons is not None:
            command = self.tendons.command(command, position, reference.velocity)
        return ControlSignals(torque, command, plan.shortfall)

    def _friction(self, plan: Plan, position: Array, desired_velocity: Array) -> Array:
        """Return the torque that overcomes the friction of joints and passive tendons, shape (..., n), N m."""
        routing = self.routing
        if self.tendons is None:
            mean = plan.tension[..., routing.actuated :]
            strands = np.concatenate([plan.tension[..., : routing.actuated], np.repeat(mean, 2, axis=-1)], axis=-1)
            torque = np.zeros_like(position)
        else:
            strands = self.tendons.strands(plan.tension, position, desired_velocity)
            torque = plan.tension @ routing.coupling - strands @ routing.strand_coupling
        if self.joints is not None:
            torque = torque + self.joints.torque(strands, desired_velocity)
        return torque
