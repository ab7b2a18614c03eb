"""What a controller measures: angles in steps, velocities from them, tensions with noise."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from finger_pin.control.proportional import ControlSignals
from finger_pin.description.routing import Array
from finger_pin.mechanism.state import State
from finger_pin.references.reference import ReferenceSignals


class MeasuringController(ABC):
    """A controller that also listens to tension sensors; it needs sampled execution."""

    @abstractmethod
    def sense(self, tension: Array, elapsed: float) -> None:
        """Take delivered tensions, shape (t,), N, T5's at its distal end, and the time since the last ones, s."""

    @abstractmethod
    def command(
        self, time: Array | float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return the commands for shapes (..., n)."""


@dataclass(frozen=True, eq=False)
class MeasuredMotion:
    """Measured angles and velocities, shape (n,), rad and rad/s."""

    position: Array
    velocity: Array


class Sensors:
    """Encoders and tension sensors, read in order, sample by sample.

    An encoder of a resolution reads the nearest multiple of it, and velocities are then differences of its readings
    over the period, zero at the first sample. Without one, angles and velocities are exact. The noise of the tension
    sensors is normal, independent from sample to sample, and the same for the same seed.
    """

    def __init__(self, period: float, encoder_resolution: float = 0.0, tension_noise: float = 0.0, seed: int = 0):
        """Set up sensors.

        Args:
            period: From sample to sample, s.
            encoder_resolution: rad; 0 for exact angles and velocities.
            tension_noise: Standard deviation, N.
            seed: Of the noise.
        """
        self._period, self._resolution, self._noise = period, encoder_resolution, tension_noise
        self._random = np.random.default_rng(seed)
        self._last: Array | None = None

    def motion(self, state: State) -> MeasuredMotion:
        """Read the encoders."""
        if self._resolution == 0.0:
            return MeasuredMotion(state.position, state.velocity)
        position = np.round(state.position / self._resolution) * self._resolution
        velocity = np.zeros_like(position) if self._last is None else (position - self._last) / self._period
        self._last = position
        return MeasuredMotion(position, velocity)

    def tension(self, delivered: Array) -> Array:
        """Read the tension sensors, shape (t,), N."""
        return delivered + self._noise * self._random.standard_normal(len(delivered))
