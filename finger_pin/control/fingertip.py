"""A force that the fingertip is to exert, as torque at the joints: the other half of statics, (6)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from finger_pin.description.routing import Array
from finger_pin.references.signal import Signal


@dataclass(frozen=True, eq=False)
class FingertipForce:
    """tau = J^T F, the force that the fingertip exerts on its surroundings, at rest and without friction.

    Where it touches nothing, the finger yields to the torque until K_P holds it.

    Attributes:
        wanted: F, three signals, N, base frame.
        jacobian: J of (6), from one position of shape (n,) to shape (3, n).
    """

    wanted: Signal
    jacobian: Callable[[Array], Array]

    def torque(self, time: Array | float, position: Array) -> Array:
        """Return J^T F for motion of shape (..., n) at times of shape (...,), N m."""
        rows = position.reshape(-1, position.shape[-1])
        jacobians = np.array([self.jacobian(row) for row in rows]).reshape(*position.shape[:-1], 3, -1)
        force: Array = np.broadcast_to(self.wanted.at(time)[0], (*position.shape[:-1], 3))
        return np.asarray((force[..., None, :] @ jacobians)[..., 0, :])
