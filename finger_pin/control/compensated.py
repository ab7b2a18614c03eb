"""The whole controller: torque, friction of joints and passive tendons, tensions, friction of tendons, in turn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from finger_pin.control.distribution import TensionAllocation, TensionDistribution
from finger_pin.control.interface import ControlSignals, LoopController
from finger_pin.control.tendon_feedforward import JointCompensation, TendonFeedforward, undivided
from finger_pin.control.torque import FingertipForce, TorqueLaw
from finger_pin.description.routing import Routing
from finger_pin.references.reference import ReferenceSignals
from finger_pin.references.signal import Signal
from finger_pin.typing import Array

# Newton's method converges in a few iterations; if it cycles, plain iteration takes over.
_SETTLED, _NEWTON, _TURNS = 1e-9, 20, 200


@dataclass(frozen=True, eq=False)
class CompensatedController(LoopController):
    """A controller with the interface of the paper's, and any of the compensations.

    The torque that the tendons have to exert is tau = tau^d + tau^f(f_hat): friction of the joints grows with the
    tensions, and the tensions with the torque that overcomes it. Below the critical joint friction
    (`critical_friction`) there are tensions at which the two agree, and these are commanded.

    Attributes:
        routing: The routing.
        law: tau^d.
        distribution: From torque to planned tensions.
        minimum: f0, shape (t,), N.
        tendons: Compensates tendon friction; None to leave it.
        joints: Compensates joint friction; None to leave it.
        fingertip: Force that the fingertip is to exert besides; None for nothing.
    """

    routing: Routing
    law: TorqueLaw
    distribution: TensionDistribution
    minimum: Array
    tendons: TendonFeedforward | None = None
    joints: JointCompensation | None = None
    fingertip: FingertipForce | None = None

    def command(
        self, time: Array | float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return the torque that is asked of the tendons and the commands, for shapes (..., n)."""
        return self.command_above(self.minimum, time, reference, position, velocity)

    def signals(self) -> tuple[Signal, ...]:
        """Return the functions of time of the wanted fingertip force."""
        return () if self.fingertip is None else (self.fingertip.wanted,)

    def stateless(self) -> CompensatedController:
        """Return itself: it remembers nothing."""
        return self

    def command_above(
        self, minimum: Array, time: Array | float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return the commands with another minimum f0, shape (t,), N."""
        wanted = self.law.torque(reference, position, velocity)
        if self.fingertip is not None:
            wanted = wanted + self.fingertip.torque(time, position)
        plan = self.distribution.plan(wanted, minimum)
        if self.tendons is not None or self.joints is not None:
            if self.joints is not None:
                wanted = wanted + self.joints.unloaded_torque(reference.velocity)
            matrix = self._friction_matrix(position, reference.velocity)
            wanted, plan = self._closed(wanted, matrix, minimum, plan)
        command = plan.tension
        if self.tendons is not None:
            command = self.tendons.command(command, position, reference.velocity)
        return ControlSignals(wanted, command, plan.torque_deficit)

    def _closed(
        self, wanted: Array, matrix: Array, minimum: Array, plan: TensionAllocation
    ) -> tuple[Array, TensionAllocation]:
        """Return the torque and the plan that agree: tau = wanted + matrix f_hat, and f_hat is the plan for tau.

        Newton's method: between changes of the tendons that are at a limit, all is linear.
        """
        tension: Array = plan.tension
        identity = np.eye(tension.shape[-1])
        for turn in range(_TURNS):
            torque = wanted + (matrix @ tension[..., None])[..., 0]
            plan = self.distribution.plan(torque, minimum)
            gap: Array = plan.tension - tension
            if not np.any(np.abs(gap) > _SETTLED * np.max(plan.tension, axis=-1, keepdims=True)):
                break
            if turn < _NEWTON:
                gap = np.asarray(np.linalg.solve(identity - plan.slope @ matrix, gap[..., None])[..., 0], dtype=float)
            tension = tension + gap
        return torque, plan

    def _friction_matrix(self, position: Array, desired_velocity: Array) -> Array:
        """Return the slope by f_hat of the compensation of joints and passive tendons, shape (..., n, t), m."""
        routing = self.routing
        strands = undivided(routing)
        if self.tendons is not None:
            strands = self.tendons.strand_matrix(position, desired_velocity)
        matrix = routing.coupling.T - routing.strand_coupling.T @ strands
        if self.joints is not None:
            matrix = matrix + self.joints.load_matrix(strands, desired_velocity)
        return matrix
