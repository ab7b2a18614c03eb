"""The torque that a controller commands at the joints: (19), with damping and with gravity."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from finger_pin.laws.input_functions import proportional_torque
from finger_pin.references.reference import ReferenceSignals
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
