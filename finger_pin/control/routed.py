"""The paper's controller (19)-(22) for tendons whose arms depend on the posture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from finger_pin.control.loop_controller import LoopController
from finger_pin.control.proportional import ControlSignals
from finger_pin.control.torque import TorqueLaw
from finger_pin.description.routing import Array, ForceClosure
from finger_pin.laws.controller import internal_level
from finger_pin.mechanism.finger import Finger
from finger_pin.references.reference import ReferenceSignals


@dataclass(frozen=True, eq=False)
class RoutedController(LoopController):
    """tau^d by the pseudo-inverse of H_c(theta)^T, raised by the internal tensions of the posture.

    Where a posture has no force closure, tensions below f0 are raised to it alone, which turns joints.

    Attributes:
        finger: The finger.
        law: tau^d.
        minimum: f0, shape (t,), N.
    """

    finger: Finger
    law: TorqueLaw
    minimum: Array

    def command(
        self, time: Array | float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return tau^d and tensions for shapes (..., n)."""
        torque = self.law.torque(reference, position, velocity)
        flat = position.reshape(-1, position.shape[-1])
        planned = [self._planned(*each) for each in zip(torque.reshape(flat.shape), flat, strict=True)]
        return ControlSignals(torque, np.array(planned).reshape(*position.shape[:-1], -1))

    def _planned(self, torque: Array, position: Array) -> Array:
        coupling = self.finger.coupling_at(position)
        minimal = np.linalg.pinv(coupling.T) @ torque
        closure = ForceClosure.of(coupling, self.finger.routing.tendons)
        if not closure.holds:
            return np.maximum(minimal, self.minimum)
        level = np.max(internal_level(self.minimum, minimal, closure.tension))
        return np.asarray(minimal + level * closure.tension)
