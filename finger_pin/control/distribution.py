"""Distribution of joint torques over tendons: the pseudo-inverse with internal tension, (21), (22)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy
from proxsuite import proxqp

from finger_pin.description.routing import Routing
from finger_pin.laws.input_functions import internal_level
from finger_pin.typing import Array

# Tolerance of the scaled programme, and its greatest number of iterations: feasible ones of this size take about ten.
_QP_TOLERANCE, _QP_ITERATIONS = 1e-10, 300
# Distance from a limit within which a tension is at it, N.
_LIMIT_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class TensionAllocation:
    """Planned tensions.

    Attributes:
        tension: f_hat, shape (..., t), N; H_c^T f_hat is the wanted torque less the torque_deficit.
        torque_deficit: Torque that limits keep from being exerted, shape (..., n), N m.
        slope: df_hat / dtau while the same tendons are at their limits, shape (..., t, n), 1/m.
    """

    tension: Array
    torque_deficit: Array
    slope: Array


class TensionDistribution(Protocol):
    """A rule that shares a torque out to tendons."""

    def plan(self, torque: Array, minimum: Array) -> TensionAllocation:
        """Return tensions of at least f0, shape (t,) or (..., t), for torques of shape (..., n)."""


@dataclass(frozen=True, eq=False)
class PseudoInverse:
    """The paper's distribution: f_hat = pinv(H_c^T) tau^d + lambda f^k, the least lambda that keeps every tendon at f0.

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

    def plan(self, torque: Array, minimum: Array) -> TensionAllocation:
        """Return f_hat of (21) with lambda of (22), and no torque deficit."""
        minimal = torque @ self.inverse.T
        levels = internal_level(minimum, minimal, self.internal)
        limiting = np.argmax(levels, axis=-1)
        level = np.take_along_axis(levels, limiting[..., None], axis=-1)
        raised = self.inverse[limiting] / self.internal[limiting][..., None]
        slope = self.inverse - self.internal[:, None] * raised[..., None, :]
        return TensionAllocation(minimal + level * self.internal, np.zeros_like(torque), slope)


class LimitedDistribution:
    """The quadratic programme, solved by ProxQP (Bambade et al., Robotics: Science and Systems 2022).

    It starts afresh at every call, so that a plan depends on nothing but its arguments; not to be shared between
    threads.

    Attributes:
        maximum: f_max, shape (t,), N.
    """

    def __init__(self, routing: Routing, maximum: Array) -> None:
        """Prepare the programme for a routing."""
        self.maximum = maximum
        self._scale = float(np.max(np.abs(routing.coupling)))
        self._matrix = routing.coupling.T / self._scale
        joints, tendons = self._matrix.shape
        self._shape = (joints, tendons)
        self._programme = proxqp.dense.QP(tendons, joints, 0, True)
        settings = self._programme.settings
        settings.eps_abs, settings.eps_rel, settings.max_iter = _QP_TOLERANCE, 0.0, _QP_ITERATIONS
        settings.initial_guess = proxqp.InitialGuess.NO_INITIAL_GUESS
        self._programme.init(
            np.eye(tendons), np.zeros(tendons), self._matrix, np.zeros(joints), None, None, None, np.zeros(tendons),
            maximum,
        )  # fmt: skip

    def plan(self, torque: Array, minimum: Array) -> TensionAllocation:
        """Return the least tensions within the limits, and the torque that they fall short of."""
        joints, tendons = self._shape
        torques = torque.reshape(-1, joints)
        minimums = np.minimum(np.broadcast_to(minimum, (*torque.shape[:-1], tendons)), self.maximum)
        rows = [self._plan_one(each, floor) for each, floor in zip(torques, minimums.reshape(-1, tendons), strict=True)]
        tension = np.array([row[0] for row in rows])
        above_minimum = tension > minimums.reshape(-1, tendons) + _LIMIT_TOLERANCE
        free = above_minimum & (tension < self.maximum - _LIMIT_TOLERANCE)
        slope = np.array([self._slope(each) for each in free])
        return TensionAllocation(
            tension.reshape(minimums.shape),
            np.array([row[1] for row in rows]).reshape(torque.shape),
            slope.reshape(*minimums.shape, joints),
        )

    def _slope(self, free: Array) -> Array:
        """Return df / dtau when only the tensions that are free may change, shape (t, n), 1/m."""
        slope = np.zeros(self._shape[::-1])
        slope[free] = np.linalg.pinv(self._matrix[:, free]) / self._scale
        return slope

    def _plan_one(self, torque: Array, minimum: Array) -> tuple[Array, Array]:
        scaled_torque = torque / self._scale
        if not np.isfinite(scaled_torque).all():
            return np.full(len(minimum), np.nan), np.full(len(torque), np.nan)
        tension = self._least_tensions(scaled_torque, minimum)
        if tension is not None:
            return tension, np.zeros(len(torque))
        # A box of no width has one answer, which the solver below does not take.
        free = self.maximum > minimum
        nearest = minimum.copy()
        remaining = scaled_torque - self._matrix[:, ~free] @ minimum[~free]
        if free.any():
            bounds = (minimum[free], self.maximum[free])
            nearest[free] = scipy.optimize.lsq_linear(self._matrix[:, free], remaining, bounds, method="bvls").x
        exerted = self._matrix @ nearest
        # Of all tensions that exert the nearest torque, again the least.
        tension = self._least_tensions(exerted, minimum)
        return nearest if tension is None else tension, self._scale * (scaled_torque - exerted)

    def _least_tensions(self, torque: Array, minimum: Array) -> Array | None:
        programme = self._programme
        programme.update(b=torque, l_box=minimum, u_box=self.maximum)
        programme.solve()
        if programme.results.info.status != proxqp.PROXQP_SOLVED:
            return None
        return np.asarray(np.clip(programme.results.x, minimum, self.maximum))
