"""Joint position control through the tendons: (19), (21), (22)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

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

    Attributes:
        gain: K_P, shape (n,), N m/rad.
        minimum: f0, shape (t,), N.
        inverse: Pseudo-inverse of H_c^T, shape (t, n), 1/m.
        internal: f^k, shape (t,), internal tensions with the largest entry 1.
    """

    gain: Array
    minimum: Array
    inverse: Array
    internal: Array

    @classmethod
    def from_scenario(cls, scenario: Scenario, routing: Routing) -> ProportionalController:
        """Read the paper's part of a scenario's controller; `build_controller` returns the whole."""
        gain = expand(scenario.controller.gain, len(routing.joints))
        minimum = expand(scenario.controller.minimum_tension, len(routing.tendons))
        return cls.from_routing(routing, gain, minimum)

    @classmethod
    def from_routing(cls, routing: Routing, gain: Array, minimum: Array) -> ProportionalController:
        """Prepare (21) for a routing with force closure."""
        return cls(gain, minimum, np.asarray(np.linalg.pinv(routing.coupling.T)), routing.force_closure().tension)

    def command(
        self, time: Array | float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return tau^d of (19) and f_hat of (21) with lambda of (22)."""
        torque = proportional_torque(self.gain, reference.position, position)
        minimal = torque @ self.inverse.T
        level = np.max(internal_level(self.minimum, minimal, self.internal), axis=-1, keepdims=True)
        return ControlSignals(torque, minimal + level * self.internal)
