"""The whole controller: torque, friction of joints and passive tendons, tensions, friction of tendons, in turn.

Around it a loop may control the passive tendons' tension, by the internal tension.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from finger_pin.control.distribution import TensionAllocation, TensionDistribution
from finger_pin.control.interface import ControlSignals, LoopController
from finger_pin.control.proportional import FingertipForce, TorqueLaw
from finger_pin.control.tendon_feedforward import JointCompensation, TendonFeedforward, frictionless_strands
from finger_pin.description.routing import Routing
from finger_pin.references.reference import ReferenceSignals
from finger_pin.references.signal import Signal
from finger_pin.typing import Array

# Relative change at which tensions agree, Newton iterations, and all iterations: plain ones follow if Newton's cycle.
_TENSION_TOLERANCE, _NEWTON_ITERATIONS, _MAX_ITERATIONS = 1e-9, 20, 200


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
        return self.command_with_minimum(self.minimum, time, reference, position, velocity)

    def signals(self) -> tuple[Signal, ...]:
        """Return the functions of time of the wanted fingertip force."""
        return () if self.fingertip is None else (self.fingertip.desired_force,)

    def stateless(self) -> CompensatedController:
        """Return itself: it remembers nothing."""
        return self

    def command_with_minimum(
        self, minimum: Array, time: Array | float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return the commands with another minimum f0, shape (t,), N."""
        torque = self.law.torque(reference, position, velocity)
        if self.fingertip is not None:
            torque = torque + self.fingertip.torque(time, position)
        plan = self.distribution.plan(torque, minimum)
        if self.tendons is not None or self.joints is not None:
            if self.joints is not None:
                torque = torque + self.joints.unloaded_torque(reference.velocity)
            matrix = self._friction_matrix(position, reference.velocity)
            torque, plan = self._consistent_plan(torque, matrix, minimum, plan)
        command = plan.tension
        if self.tendons is not None:
            command = self.tendons.command(command, position, reference.velocity)
        return ControlSignals(torque, command, plan.torque_deficit)

    def _consistent_plan(
        self, base_torque: Array, matrix: Array, minimum: Array, plan: TensionAllocation
    ) -> tuple[Array, TensionAllocation]:
        """Return the torque and the plan that agree: tau = base + matrix f_hat, and f_hat is the plan for tau.

        Newton's method: between changes of the tendons that are at a limit, all is linear.
        """
        tension: Array = plan.tension
        identity = np.eye(tension.shape[-1])
        for iteration in range(_MAX_ITERATIONS):
            torque = base_torque + (matrix @ tension[..., None])[..., 0]
            plan = self.distribution.plan(torque, minimum)
            step: Array = plan.tension - tension
            if not np.any(np.abs(step) > _TENSION_TOLERANCE * np.max(plan.tension, axis=-1, keepdims=True)):
                break
            if iteration < _NEWTON_ITERATIONS:
                step = np.asarray(np.linalg.solve(identity - plan.slope @ matrix, step[..., None])[..., 0], dtype=float)
            tension = tension + step
        return torque, plan

    def _friction_matrix(self, position: Array, desired_velocity: Array) -> Array:
        """Return the slope by f_hat of the compensation of joints and passive tendons, shape (..., n, t), m."""
        routing = self.routing
        strands = frictionless_strands(routing)
        if self.tendons is not None:
            strands = self.tendons.strand_matrix(position, desired_velocity)
        matrix = routing.coupling.T - routing.strand_coupling.T @ strands
        if self.joints is not None:
            matrix = matrix + self.joints.load_matrix(strands, desired_velocity)
        return matrix


class PassiveTensionLoop(LoopController):
    """A PI loop from the measured tension of the passive tendons to the internal tension.

    A passive tendon cannot be commanded; (20) only chooses an angle of the follower joint at which, free of friction
    and with the actuated tendons in balance, it would carry f5^d. Here f5^d is also planned: it is the least tension of
    the passive tendons in (22), corrected by the error of the measured one,

        f0_5 = max(f0_5, f5^d + k_P e + I),   I' = k_I e,   e = f5^d - f5.

    Where the other tendons' f0 requires more internal tension than f5^d does, (22) decides and f5 stays above
    f5^d; the integral stops at f0_5 or at its limit. It lasts from sample to sample: one object, one simulation.

    Attributes:
        controller: The controller whose internal tension is set.
        target: f5^d, shape (p,), N.
        proportional: k_P.
        integral: k_I, 1/s.
        limit: Largest |I|, N.
        correction: k_P e + I at present, shape (p,), N.
    """

    needs_sensors = True

    def __init__(
        self, controller: CompensatedController, target: Array, proportional: float, integral: float, limit: float
    ) -> None:
        """Start with zero correction."""
        self.controller = controller
        self.target = np.asarray(target, dtype=float)
        self.proportional, self.integral, self.limit = proportional, integral, limit
        self.correction = np.zeros(len(self.target))
        self._sum = np.zeros(len(self.target))

    def sense(self, readings: Mapping[str, Array], elapsed: float) -> None:
        """Update from measured tensions, shape (t,), N, and the time since the last sample, s."""
        actuated = self.controller.routing.actuated
        error = self.target - readings["tendon_tension"][actuated:]
        # Below its own f0 the desired tension has no effect; an integral that went there would take time to come back.
        lowest = np.clip(self.controller.minimum[actuated:] - self.target, -self.limit, 0.0)
        self._sum = np.clip(self._sum + self.integral * elapsed * error, lowest, self.limit)
        self.correction = self.proportional * error + self._sum

    def stateless(self) -> CompensatedController:
        """Return the controller inside, without the correction."""
        return self.controller

    def command(
        self, time: Array | float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return the commands for shapes (..., n) with the present correction."""
        actuated = self.controller.routing.actuated
        minimum = self.controller.minimum.copy()
        minimum[actuated:] = np.maximum(minimum[actuated:], self.target + self.correction)
        return self.controller.command_with_minimum(minimum, time, reference, position, velocity)
