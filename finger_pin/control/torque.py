"""The torque that a controller commands at the joints: (19), with damping and with gravity."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from finger_pin.description.routing import Array
from finger_pin.laws.controller import proportional_torque
from finger_pin.references.reference import ReferenceSignals


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
