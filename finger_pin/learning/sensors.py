"""Errors of sensors: noise, quantisation, an offset, and a delay of whole control periods."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from finger_pin.exceptions import InputError
from finger_pin.learning.distributions import is_number
from finger_pin.typing import Array


@dataclass(frozen=True)
class Sensor:
    """A sensor of one variable, in the variable's unit.

    Attributes:
        noise: Standard deviation of the noise added to every sample.
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
            if not is_number(value) or not np.isfinite(value) or (value < 0.0 and name != "offset"):
                raise InputError(f"Sensor.{name}", "must be finite, and not negative but for an offset", value)

    def periods(self, period: float, name: str) -> int:
        """Return the delay in control periods."""
        count = round(self.delay / period)
        if abs(count * period - self.delay) > 1e-9:
            allowed = f"must be a multiple of the control period {period:g} s"
            raise InputError(f"observation.{name}.delay", allowed, self.delay)
        return count


class Measurement:
    """Sensors of one variable in w worlds."""

    def __init__(self, worlds: int, periods: int) -> None:
        """Create perfect sensors with a delay in control periods."""
        self._noise, self._quantisation, self._offset = np.zeros((3, worlds))
        self._is_perfect = True
        self._periods, self._history = periods, np.zeros((periods + 1, worlds))
        # Number of samples in the present episode of each world.
        self._count = np.zeros(worlds, dtype=np.int64)

    def reset(self, world: int, sensor: Sensor) -> None:
        """Reset the sensor of a world, without samples."""
        numbers = sensor.noise, sensor.quantisation, sensor.offset
        self._noise[world], self._quantisation[world], self._offset[world] = numbers
        self._is_perfect = not (self._noise.any() or self._quantisation.any() or self._offset.any())
        self._count[world] = 0

    def sample(self, values: Array, worlds: NDArray[np.int64], randoms: Sequence[np.random.Generator]) -> Array:
        """Return the observation in some worlds; before a delay has passed it is the episode's first sample.

        Args:
            values: True values in these worlds, shape (k, ...).
            worlds: Their indices, shape (k,).
            randoms: Generators of all worlds.
        """
        reading = values if self._is_perfect else self._disturb(values, worlds, randoms)
        if not self._periods:
            return reading
        if self._history.shape[2:] != reading.shape[1:]:
            self._history = np.zeros((*self._history.shape[:2], *reading.shape[1:]))
        is_first, rows = self._count[worlds] == 0, len(self._history)
        self._history[:, worlds[is_first]] = reading[is_first]
        self._history[self._count[worlds] % rows, worlds] = reading
        self._count[worlds] += 1
        # The next row holds the oldest sample.
        return self._history[self._count[worlds] % rows, worlds]

    def _disturb(self, values: Array, worlds: NDArray[np.int64], randoms: Sequence[np.random.Generator]) -> Array:
        column_shape = (-1, *(1 for _ in values.shape[1:]))
        reading = values + self._offset[worlds].reshape(column_shape)
        for row, world in enumerate(worlds.tolist()):
            if self._noise[world]:
                reading[row] += randoms[world].normal(0.0, self._noise[world], reading.shape[1:])
        step = self._quantisation[worlds].reshape(column_shape)
        return np.where(step > 0.0, step * np.round(reading / np.where(step > 0.0, step, 1.0)), reading)


def measurements(sensors: Mapping[str, Sensor], worlds: int, period: float) -> dict[str, Measurement]:
    """Return the sensors of all variables in some worlds."""
    return {name: Measurement(worlds, sensor.periods(period, name)) for name, sensor in sensors.items()}
