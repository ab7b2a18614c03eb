"""Joint position control through the tendons: (19), (21), (22)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from finger_pin.control.reference import ReferenceSignals
from finger_pin.description.routing import Array, Routing
from finger_pin.description.scenario import Scenario
from finger_pin.description.validation import expand
from finger_pin.laws.controller import internal_level, proportional_torque


@dataclass(frozen=True, eq=False)
class ControlSignals:
    """What a controller asks for.

    Attributes:
        torque: tau^d, shape (..., n), N m.
        tension: f_hat, shape (..., t), N: commands of the actuated tendons, then the planned passive tensions.
        shortfall: What tension limits keep from being exerted of tau^d, shape (..., n), N m; None without limits.
        inputs: Of the actuators of a tree, shape (..., k); None without any.
    """

    torque: Array
    tension: Array
    shortfall: Array | None = None
    inputs: Array | None = None


class Controller(Protocol):
    """Anything that turns references and measured motion into tendon tensions."""

    def command(
        self, time: Array | float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return the commands for shapes (..., n)."""


@dataclass(frozen=True, eq=False)
class ProportionalController:
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
        """Read the paper's part of a scenario's controller; `build_controller` returns the whole."""
        gain = expand(scenario.controller.gain, len(routing.joints))
        minimum = expand(scenario.controller.minimum_tension, len(routing.tendons))
        damping = expand(scenario.controller.damping, len(routing.joints))
        return cls.from_routing(routing, gain, minimum, damping)

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
