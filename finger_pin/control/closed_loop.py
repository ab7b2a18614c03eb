"""A finger under control: reference, controller, fingertip force and finger as one system x' = f(t, x)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from finger_pin.control import build_controller
from finger_pin.control.proportional import Controller, ControlSignals
from finger_pin.control.reference import HarmonicReference, ReferenceSignals
from finger_pin.description.routing import Array
from finger_pin.description.scenario import Scenario
from finger_pin.mechanism.finger import Finger, FingerSignals
from finger_pin.mechanism.rigid_body import Motion


class Reference(Protocol):
    """Anything that gives a desired motion."""

    def at(self, time: Array | float) -> ReferenceSignals:
        """Return theta^d and its rate at one time, or at times of shape (m,)."""


class Dynamics(Protocol):
    """Anything that evaluates a finger: `Finger`, or the compiled core."""

    def evaluate(self, x: Array, command: Array, fingertip_force: Array | None = None) -> FingerSignals:
        """Return all signals at packed states under given tensions."""

    def motion(self, position: Array, velocity: Array) -> Motion:
        """Return fingertip and energies of the rigid body."""


@dataclass(frozen=True, eq=False)
class LoopSignals:
    """Everything at one instant or at many: what was desired, what was commanded, what the finger does."""

    reference: ReferenceSignals
    control: ControlSignals
    finger: FingerSignals


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """A finger with its controller and reference. `rhs` is a pure function of time and state.

    Attributes:
        finger: The finger.
        controller: Turns reference and motion into tensions.
        reference: The desired motion.
        fingertip_force: F, shape (3,), N, base frame.
        dynamics: What evaluates the finger.
    """

    finger: Finger
    controller: Controller
    reference: Reference
    fingertip_force: Array
    dynamics: Dynamics

    @classmethod
    def from_scenario(
        cls, scenario: Scenario, controller: Controller | None = None, reference: Reference | None = None
    ) -> ClosedLoop:
        """Build the loop that a scenario describes, with a controller or reference of one's own if given."""
        finger = Finger(scenario.finger)
        return cls(
            finger=finger,
            controller=controller or build_controller(scenario, finger),
            reference=reference or HarmonicReference.from_scenario(scenario, finger.routing),
            fingertip_force=np.array(scenario.environment.fingertip_force),
            dynamics=finger,
        )

    def initial_state(self) -> Array:
        """Return the packed state at rest on the reference, shape (size,)."""
        return self.finger.rest_state(self.reference.at(0.0).position)

    def evaluate(self, time: Array | float, x: Array) -> LoopSignals:
        """Return all signals at one time and state, or at times (m,) and states (m, size)."""
        state = self.finger.layout.unpack(x)
        reference = self.reference.at(time)
        control = self.controller.command(time, reference, state.position, state.velocity)
        command = control.tension[..., : self.finger.routing.actuated]
        return LoopSignals(reference, control, self.dynamics.evaluate(x, command, self.fingertip_force))

    def rhs(self, time: float, x: Array) -> Array:
        """Return x', shape (size,)."""
        return self.evaluate(time, x).finger.rate
