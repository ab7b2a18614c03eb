"""What sensors make of the truth: noise, quantisation, an offset, and a delay of whole control periods."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from finger_pin.description.routing import Array
from finger_pin.exceptions import InputError


@dataclass(frozen=True)
class Sensor:
    """A sensor of one variable, in the variable's unit.

    Attributes:
        noise: Standard deviation of what is added to every sample.
        quantisation: Step to which samples are rounded; 0 for none.
        offset: Added to all samples, such as that of an encoder that was mounted turned.
        delay: Age of a sample when it is observed, s; a whole number of control periods.
    """

    noise: float = 0.0
    quantisation: float = 0.0
    offset: float = 0.0
    delay: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name, value in vars(self).items():
            if not np.isfinite(value) or (value < 0.0 and name != "offset"):
                raise InputError(f"Sensor.{name}", "must be finite, and not negative but for an offset", value)

    def periods(self, period: float, name: str) -> int:
        """Return the delay in control periods.

        Raises:
            InputError: If it is not a whole number of them.
        """
        count = round(self.delay / period)
        if abs(count * period - self.delay) > 1e-9:
            allowed = f"must be a multiple of the control period {period:g} s"
            raise InputError(f"observation.{name}.delay", allowed, self.delay)
        return count


class Measurement:
    """A sensor in use during an episode."""

    def __init__(self, sensor: Sensor, name: str, period: float) -> None:
        """Begin with no samples."""
        self._sensor, self._kept = sensor, deque[Array](maxlen=sensor.periods(period, name) + 1)

    def sample(self, truth: Array, random: np.random.Generator) -> Array:
        """Return what is observed when the truth is this; the first sample stands for those before it."""
        sensor = self._sensor
        seen = np.array(truth, dtype=float)
        if sensor.offset:
            seen += sensor.offset
        if sensor.noise:
            seen += random.normal(0.0, sensor.noise, seen.shape)
        if sensor.quantisation:
            seen = sensor.quantisation * np.round(seen / sensor.quantisation)
        kept = self._kept
        kept.append(seen)
        return kept[0]
