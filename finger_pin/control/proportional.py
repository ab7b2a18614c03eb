"""Joint position control through the tendons: (19), with damping, gravity and forces of fingertips; (21), (22)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from finger_pin.control.interface import ControlSignals, LoopController
from finger_pin.core.tables.inputs import InputTable, core_signal, planned_control
from finger_pin.description.routing import ForceClosure, Routing
from finger_pin.description.scenario import Scenario
from finger_pin.laws.input_functions import internal_level, proportional_torque
from finger_pin.mechanism.finger import Finger
from finger_pin.references.reference import LoopReference, ReferenceSignals
from finger_pin.references.signal import Signal
from finger_pin.typing import Array


@dataclass(frozen=True, eq=False)
class TorqueLaw:
    """tau^d = K_P (theta^d - theta) + K_D (theta^d' - theta') + G(theta).

    Proportional-derivative control with gravity compensation (Takegaki and Arimoto, ASME J. Dynamic Systems 103(2),
    1981). With neither damping nor gravity it is (19).

    Attributes:
        gain: K_P, shape (n,), N m/rad.
        damping: K_D, shape (n,), N m s/rad.
        static: G of (18), the torque of springs or both, from one position of shape (n,) to shape (n,), N m; None to
            leave it out.
    """

    gain: Array
    damping: Array
    static: Callable[[Array], Array] | None = None

    def torque(self, reference: ReferenceSignals, position: Array, velocity: Array) -> Array:
        """Return tau^d for motion of shape (..., n), N m."""
        torque: Array = proportional_torque(self.gain, reference.position, position)
        torque = torque + self.damping * (reference.velocity - velocity)
        if self.static is None:
            return torque
        rows = position.reshape(-1, position.shape[-1])
        weight: Array = np.array([self.static(row) for row in rows]).reshape(position.shape)
        return torque + weight


@dataclass(frozen=True, eq=False)
class FingertipForce:
    """tau = J^T F, the force that the fingertip exerts on its surroundings, at rest and without friction.

    Where it touches nothing, the finger yields to the torque until K_P holds it.

    Attributes:
        desired_force: F, three signals for each of t tips, N, base frame.
        jacobian: J of (6), from one position of shape (n,) to shape (3, n), or (t, 3, n).
    """

    desired_force: Signal
    jacobian: Callable[[Array], Array]

    def torque(self, time: Array | float, position: Array) -> Array:
        """Return J^T F for motion of shape (..., n) at times of shape (...,), N m."""
        rows = position.reshape(-1, position.shape[-1])
        force: Array = self.desired_force.at(time)[0]
        force = np.broadcast_to(force, (*position.shape[:-1], force.shape[-1]))
        jacobians = np.array([self.jacobian(row) for row in rows]).reshape(*force.shape, -1)
        return np.asarray((force[..., None, :] @ jacobians)[..., 0, :])


@dataclass(frozen=True, eq=False)
class ProportionalController(LoopController):
    """The paper's controller: proportional torque, distributed over the tendons by the pseudo-inverse.

    The paper has no damping; where there is some, tau^d = K_P (theta^d - theta) + K_D (theta^d' - theta').

    Attributes:
        gain: K_P, shape (n,), N m/rad.
        minimum: f0, shape (t,), N.
        inverse: Pseudo-inverse of H_c^T, shape (t, n), 1/m.
        internal: f^k, shape (t,), internal tensions with the largest entry 1.
        damping: K_D, shape (n,), N m s/rad.
        loop: The finger that each tendon belongs to, shape (t,): each has a lambda of its own; one for all by default.
    """

    gain: Array
    minimum: Array
    inverse: Array
    internal: Array
    damping: Array
    loop: NDArray[np.int64] | None = None

    @classmethod
    def from_scenario(cls, scenario: Scenario, routing: Routing) -> ProportionalController:
        """Read the paper's controller (19)-(22) of a scenario, without additions to it."""
        numbers = scenario.numbers
        return cls.from_routing(routing, numbers["gain"], numbers["minimum_tension"], numbers["damping"])

    @classmethod
    def from_routing(
        cls, routing: Routing, gain: Array, minimum: Array, damping: Array | None = None
    ) -> ProportionalController:
        """Prepare (21) for a routing with force closure; without damping by default."""
        resisting = np.zeros(len(routing.joints)) if damping is None else damping
        return cls(gain, minimum, routing.pseudo_inverse, routing.force_closure().tension, resisting)

    def command(
        self, time: Array | float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return tau^d of (19) and f_hat of (21) with lambda of (22)."""
        torque = proportional_torque(self.gain, reference.position, position)
        torque = torque + self.damping * (reference.velocity - velocity)
        minimal = torque @ self.inverse.T
        levels = internal_level(self.minimum, minimal, self.internal)
        if self.loop is None:
            level = levels.max(axis=-1, keepdims=True)
        else:
            fingers = [np.max(levels[..., self.loop == each], axis=-1) for each in range(int(self.loop.max()) + 1)]
            level = np.stack(fingers, axis=-1)[..., self.loop]
        return ControlSignals(torque, minimal + level * self.internal)

    def as_control(self, reference: LoopReference, finger: Finger) -> InputTable | None:
        """Return the controller as the input table of a finger's mechanism.

        What it plans for tendons that motors in position drive pull is no input.
        """
        desired, routing, mechanism = reference.planned(), finger.routing, finger.mechanism
        if desired is None:
            return None
        tendons = np.arange(len(routing.tendons))
        extra = mechanism.coordinates - len(routing.joints)
        positioned = np.isin(tendons, finger.actuators.positioned)

        def padded(values: Array) -> Array:
            return np.concatenate([values, np.zeros((*values.shape[:-1], extra))], axis=-1)

        matrix = desired.coupling.matrix
        return planned_control(
            mechanism.channels,
            gain=padded(self.gain),
            minimum=self.minimum,
            inverse=padded(self.inverse),
            internal=self.internal,
            channel=np.where((tendons < routing.actuated) & ~positioned, tendons, -1),
            reference=core_signal(desired.signal),
            coupling=np.concatenate([matrix, np.zeros((extra, len(matrix)))]),
            offset=padded(desired.coupling.offset),
            damping=padded(self.damping),
            loop=self.loop,
        )

    def stateless(self) -> ProportionalController:
        """Return itself: it remembers nothing."""
        return self

    @classmethod
    def from_fingers(cls, controllers: Sequence[ProportionalController], routing: Routing) -> ProportionalController:
        """Return the controller of a hand from those of its fingers, with a lambda of (22) for each."""
        tendons, joints = len(routing.tendons), len(routing.joints)
        gain, damping, minimum, internal = np.zeros(joints), np.zeros(joints), np.zeros(tendons), np.zeros(tendons)
        inverse, loop = np.zeros((tendons, joints)), np.zeros(tendons, dtype=np.int64)
        for index, (controller, (j, t)) in enumerate(zip(controllers, routing.fingers, strict=True)):
            gain[j], damping[j] = controller.gain, controller.damping
            minimum[t], internal[t] = controller.minimum, controller.internal
            inverse[np.ix_(t, j)], loop[t] = controller.inverse, index
        return cls(gain, minimum, inverse, internal, damping, loop)


@dataclass(frozen=True, eq=False)
class RoutedController(LoopController):
    """Controller by the pseudo-inverse of H_c(theta)^T, raised by the internal tensions of the posture.

    Where a posture has no force closure, tensions below f0 are raised to it alone, which turns joints.

    Attributes:
        finger: The finger.
        law: tau^d.
        minimum: f0, shape (t,), N.
        fingertip: Force that the fingertip is to exert besides; None for nothing.
    """

    finger: Finger
    law: TorqueLaw
    minimum: Array
    fingertip: FingertipForce | None = None

    def signals(self) -> tuple[Signal, ...]:
        """Return the functions of time of the wanted fingertip force."""
        return () if self.fingertip is None else (self.fingertip.desired_force,)

    def command(
        self, time: Array | float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return tau^d and tensions for shapes (..., n)."""
        torque = self.law.torque(reference, position, velocity)
        if self.fingertip is not None:
            torque = torque + self.fingertip.torque(time, position)
        flat = position.reshape(-1, position.shape[-1])
        planned = [self._planned(*each) for each in zip(torque.reshape(flat.shape), flat, strict=True)]
        return ControlSignals(torque, np.array(planned).reshape(*position.shape[:-1], -1))

    def _planned(self, torque: Array, position: Array) -> Array:
        coupling = self.finger.coupling_at(position)
        minimal = np.linalg.pinv(coupling.T) @ torque
        closure = ForceClosure.from_coupling(coupling, self.finger.routing.tendons)
        if not closure.holds:
            return np.maximum(minimal, self.minimum)
        level = np.max(internal_level(self.minimum, minimal, closure.tension))
        return np.asarray(minimal + level * closure.tension)
