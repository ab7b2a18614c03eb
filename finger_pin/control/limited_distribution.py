"""From joint torques to tendon tensions within limits: a quadratic programme, for redundant routings above all.

    min |f|^2   subject to   H_c^T f = tau,   f0 <= f <= f_max

The least tension that does the job, over all internal tensions that a routing has, not along one direction only. Where
there is one direction and no upper limit binds, it is (21), (22): f^m is orthogonal to f^k, so |f|^2 grows with
lambda, and the least lambda that the minimum allows is that of (22).

Where no tensions within the limits exert tau, the nearest torque is exerted, min |H_c^T f - tau|, still within the
limits, and what is missing is returned.
"""

from __future__ import annotations

import numpy as np
import scipy
from proxsuite import proxqp

from finger_pin.control.distribution import Plan
from finger_pin.description.routing import Array, Routing

# The solver meets feasible programmes of this size in about ten iterations.
_ACCURACY, _ITERATIONS = 1e-10, 300
# So near to a limit, N, a tension is at it.
_TIGHT = 1e-6


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
        settings.eps_abs, settings.eps_rel, settings.max_iter = _ACCURACY, 0.0, _ITERATIONS
        settings.initial_guess = proxqp.InitialGuess.NO_INITIAL_GUESS
        self._programme.init(
            np.eye(tendons), np.zeros(tendons), self._matrix, np.zeros(joints), None, None, None, np.zeros(tendons),
            maximum,
        )  # fmt: skip

    def plan(self, torque: Array, minimum: Array) -> Plan:
        """Return the least tensions within the limits, and the torque that they fall short of."""
        joints, tendons = self._shape
        wanted = torque.reshape(-1, joints)
        floors = np.minimum(np.broadcast_to(minimum, (*torque.shape[:-1], tendons)), self.maximum)
        rows = [self._one(each, floor) for each, floor in zip(wanted, floors.reshape(-1, tendons), strict=True)]
        tension = np.array([row[0] for row in rows])
        free = (tension > floors.reshape(-1, tendons) + _TIGHT) & (tension < self.maximum - _TIGHT)
        slope = np.array([self._slope(each) for each in free])
        return Plan(
            tension.reshape(floors.shape),
            np.array([row[1] for row in rows]).reshape(torque.shape),
            slope.reshape(*floors.shape, joints),
        )

    def _slope(self, free: Array) -> Array:
        """Return df / dtau when only the tensions that are free may change, shape (t, n), 1/m."""
        slope = np.zeros(self._shape[::-1])
        slope[free] = np.linalg.pinv(self._matrix[:, free]) / self._scale
        return slope

    def _one(self, torque: Array, minimum: Array) -> tuple[Array, Array]:
        wanted = torque / self._scale
        if not np.isfinite(wanted).all():
            return np.full(len(minimum), np.nan), np.full(len(torque), np.nan)
        found = self._least(wanted, minimum)
        if found is not None:
            return found, np.zeros(len(torque))
        # A box of no width has one answer, which the solver below does not take.
        free = self.maximum > minimum
        nearest = minimum.copy()
        rest = wanted - self._matrix[:, ~free] @ minimum[~free]
        if free.any():
            bounds = (minimum[free], self.maximum[free])
            nearest[free] = scipy.optimize.lsq_linear(self._matrix[:, free], rest, bounds, method="bvls").x
        exerted = self._matrix @ nearest
        # Of all tensions that exert the nearest torque, again the least.
        found = self._least(exerted, minimum)
        return nearest if found is None else found, self._scale * (wanted - exerted)

    def _least(self, torque: Array, minimum: Array) -> Array | None:
        programme = self._programme
        programme.update(b=torque, l_box=minimum, u_box=self.maximum)
        programme.solve()
        if programme.results.info.status != proxqp.PROXQP_SOLVED:
            return None
        return np.asarray(np.clip(programme.results.x, minimum, self.maximum))
