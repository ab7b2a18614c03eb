"""Sampled execution of a controller: asked once a period, its tensions held in between."""

from __future__ import annotations

import numpy as np

from finger_pin.blocks.controller import ControlSignals
from finger_pin.blocks.reference import ReferenceSignals
from finger_pin.closed_loop import ClosedLoop
from finger_pin.routing import Array


class SampledController:
    """A controller that is asked at multiples of a period, in order, and then answers for any time up to the next.

    Attributes:
        period: Sampling period, s.
    """

    def __init__(self, loop: ClosedLoop, period: float) -> None:
        """Sample the controller of a loop."""
        self.period = period
        self._loop = loop
        self._samples: list[ControlSignals] = []

    def sample(self, time: float, x: Array) -> Array:
        """Ask the controller at the next sampling instant; return its tensions, shape (a,)."""
        state = self._loop.finger.layout.unpack(x.copy())
        reference = self._loop.reference.at(time)
        signals = self._loop.controller.command(time, reference, state.position, state.velocity)
        self._samples.append(signals)
        return signals.tension[: self._loop.finger.routing.actuated]

    def command(
        self, time: Array | float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return what was held at the given times; a sampling instant belongs to the period that it begins."""
        index = np.floor(np.asarray(time) / self.period * (1.0 + 1e-12)).astype(int)
        index = np.minimum(index, len(self._samples) - 1)
        torques = np.array([sample.torque for sample in self._samples])
        tensions = np.array([sample.tension for sample in self._samples])
        return ControlSignals(torques[index], tensions[index])
