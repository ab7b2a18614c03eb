"""Closed-loop control of the passive tendons' tension, by the internal tension."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from finger_pin.control.compensated import CompensatedController
from finger_pin.control.interface import ControlSignals, LoopController
from finger_pin.references.reference import ReferenceSignals
from finger_pin.typing import Array


class PassiveTensionLoop(LoopController):
    """A PI loop from the measured tension of the passive tendons to the internal tension.

    A passive tendon cannot be commanded; (20) only chooses an angle of the follower joint at which, free of friction
    and with the actuated tendons in balance, it would carry f5^d. Here f5^d is also planned: it is the least tension of
    the passive tendons in (22), corrected by the error of the measured one,

        f0_5 = max(f0_5, f5^d + k_P e + I),   I' = k_I e,   e = f5^d - f5.

    Where the other tendons' f0 requires more internal tension than f5^d does, (22) decides and f5 stays above
    f5^d; the integral stops at f0_5 or at its limit. It lasts from sample to sample: one object, one simulation.

    Attributes:
        controller: The controller whose internal tension is set.
        target: f5^d, shape (p,), N.
        proportional: k_P.
        integral: k_I, 1/s.
        limit: Largest |I|, N.
        correction: k_P e + I at present, shape (p,), N.
    """

    needs_sensors = True

    def __init__(
        self, controller: CompensatedController, target: Array, proportional: float, integral: float, limit: float
    ) -> None:
        """Start with zero correction."""
        self.controller = controller
        self.target = np.asarray(target, dtype=float)
        self.proportional, self.integral, self.limit = proportional, integral, limit
        self.correction = np.zeros(len(self.target))
        self._sum = np.zeros(len(self.target))

    def sense(self, readings: Mapping[str, Array], elapsed: float) -> None:
        """Update from measured tensions, shape (t,), N, and the time since the last sample, s."""
        actuated = self.controller.routing.actuated
        error = self.target - readings["tendon_tension"][actuated:]
        # Below its own f0 the desired tension has no effect; an integral that went there would take time to come back.
        lowest = np.clip(self.controller.minimum[actuated:] - self.target, -self.limit, 0.0)
        self._sum = np.clip(self._sum + self.integral * elapsed * error, lowest, self.limit)
        self.correction = self.proportional * error + self._sum

    def stateless(self) -> CompensatedController:
        """Return the controller inside, without the correction."""
        return self.controller

    def command(
        self, time: Array | float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return the commands for shapes (..., n) with the present correction."""
        actuated = self.controller.routing.actuated
        minimum = self.controller.minimum.copy()
        minimum[actuated:] = np.maximum(minimum[actuated:], self.target + self.correction)
        return self.controller.command_with_minimum(minimum, time, reference, position, velocity)
