"""From joint torques to tendon tensions: the pseudo-inverse with internal tension, (21), (22)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from finger_pin.description.routing import Array, Routing
from finger_pin.laws.controller import internal_level


@dataclass(frozen=True, eq=False)
class Plan:
    """Planned tensions.

    Attributes:
        tension: f_hat, shape (..., t), N; H_c^T f_hat is the wanted torque less the shortfall.
        shortfall: Torque that limits keep from being exerted, shape (..., n), N m.
        slope: df_hat / dtau while the same tendons are at their limits, shape (..., t, n), 1/m.
    """

    tension: Array
    shortfall: Array
    slope: Array


class TensionDistribution(Protocol):
    """A rule that shares a torque out to tendons."""

    def plan(self, torque: Array, minimum: Array) -> Plan:
        """Return tensions of at least f0, shape (t,) or (..., t), for torques of shape (..., n)."""


@dataclass(frozen=True, eq=False)
class PseudoInverse:
    """The paper's: f_hat = pinv(H_c^T) tau^d + lambda f^k, with the least lambda that keeps every tendon at f0.

    Attributes:
        inverse: Pseudo-inverse of H_c^T, shape (t, n), 1/m.
        internal: f^k, shape (t,), internal tensions with the largest entry 1.
    """

    inverse: Array
    internal: Array

    @classmethod
    def from_routing(cls, routing: Routing) -> PseudoInverse:
        """Prepare (21) for a routing with force closure."""
        return cls(np.asarray(np.linalg.pinv(routing.coupling.T)), routing.force_closure().tension)

    def plan(self, torque: Array, minimum: Array) -> Plan:
        """Return f_hat of (21) with lambda of (22); nothing is short."""
        minimal = torque @ self.inverse.T
        levels = internal_level(minimum, minimal, self.internal)
        tight = np.argmax(levels, axis=-1)
        level = np.take_along_axis(levels, tight[..., None], axis=-1)
        raised = self.inverse[tight] / self.internal[tight][..., None]
        slope = self.inverse - self.internal[:, None] * raised[..., None, :]
        return Plan(minimal + level * self.internal, np.zeros_like(torque), slope)
