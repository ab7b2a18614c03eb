"""Sensors of a sampled controller, read in order, sample by sample, and recorded."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from finger_pin.control.interface import Instant, SampledSensor
from finger_pin.exceptions import InputError
from finger_pin.typing import Array


def readings(sensors: Sequence[SampledSensor], now: Instant) -> dict[str, Array]:
    """Return the readings of sensors, by their names."""
    routing, by_name = now.loop.finger.routing, {}
    for sensor in sensors:
        names = sensor.labels or {"joint": routing.joints, "tendon": routing.tendons}.get(sensor.dimension, ())
        shape = (len(names),) if sensor.dimension else ()
        values = np.asarray(sensor.read(now), dtype=float)
        if sensor.name in by_name:
            raise InputError("controller.sensors", "there is another one of this name", sensor.name)
        if values.shape != shape:
            allowed = f"{sensor.name} must read values of shape {shape}, not {values.shape}"
            raise InputError("controller.sensors", allowed)
        by_name[sensor.name] = values
    return by_name


class JointEncoder(SampledSensor):
    """Joint encoders with an optional resolution."""

    name, units, dimension = "joint_position", "rad", "joint"

    def __init__(self, resolution: float = 0.0) -> None:
        """Take a resolution, rad."""
        self._resolution = resolution

    def read(self, now: Instant) -> Array:
        """Return theta, shape (n,)."""
        exact = now.state.position
        return np.round(exact / self._resolution) * self._resolution if self._resolution else exact


class JointSpeed(SampledSensor):
    """Differences of encoders' readings over the period, zero at the first sample; exact without a resolution."""

    name, units, dimension = "joint_velocity", "rad/s", "joint"

    def __init__(self, period: float, resolution: float = 0.0) -> None:
        """Take the period, s, and the encoders' resolution, rad."""
        self._period, self._encoder = period, JointEncoder(resolution) if resolution else None
        self._last: Array | None = None

    def read(self, now: Instant) -> Array:
        """Return theta', shape (n,)."""
        if self._encoder is None:
            return now.state.velocity
        position = self._encoder.read(now)
        velocity = np.zeros_like(position) if self._last is None else (position - self._last) / self._period
        self._last = position
        return velocity


class TensionSensor(SampledSensor):
    """Sensors of the delivered tensions, of passive tendons at the distal end.

    Their noise is normal, independent from sample to sample, and the same for the same seed.
    """

    name, units, dimension = "tendon_tension", "N", "tendon"

    def __init__(self, noise: float = 0.0, seed: int = 0) -> None:
        """Take the standard deviation of the noise, N, and its seed."""
        self._noise, self._random = noise, np.random.default_rng(seed)

    def read(self, now: Instant) -> Array:
        """Return f, shape (t,)."""
        delivered = now.loop.finger.routing.tendon_tension(now.signals.tendons.strands)
        return delivered + self._noise * self._random.standard_normal(len(delivered))
