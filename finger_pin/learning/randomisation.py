"""Draws at a reset, by key: parameters of the scenario and of sensors, and the delay of the action."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from finger_pin.exceptions import InputError
from finger_pin.learning.distributions import Choice, Distribution, LogUniform, Normal, Uniform, is_number
from finger_pin.learning.sensors import Sensor
from finger_pin.learning.task import Task

#: The delay of the action, s.
DELAY_KEY = "action.delay"
_SENSOR_PREFIX = "observation."
_SENSOR_FIELDS = ("noise", "quantisation", "offset")
# Of a scenario, what acts on an episode: its controller and its duration do not.
_KEY_PREFIXES = ("finger.", "hand.", "environment.", "reference.", "simulation.initial.")


class Randomisation:
    """Distributions, sorted by scenario, sensors and action.

    Attributes:
        keys: Dotted keys of the scenario, in the order in which they are drawn.
    """

    def __init__(self, task: Task) -> None:
        """Read a task."""
        source = task.randomise
        distributions = read_identified(source) if isinstance(source, str | os.PathLike) else source
        if not isinstance(distributions, Mapping):
            raise InputError(
                "randomise", "must be distributions by key, or the path of an identified scenario", distributions
            )
        self._distributions: Mapping[str, Distribution] = dict(distributions)
        for key, distribution in self._distributions.items():
            if not callable(getattr(distribution, "draw", None)):
                allowed = "must be Uniform, LogUniform, Normal, Choice, or have draw(random)"
                raise InputError(f"randomise.{key}", allowed)
            if key.startswith("action.") and key != DELAY_KEY:
                raise InputError("randomise", f"of the action only {DELAY_KEY} can be drawn", key)
            if key.startswith(_SENSOR_PREFIX):
                self._check_sensor(key, task)
                for value in _end_values(distribution):
                    Sensor(**{key.rpartition(".")[2]: value})
            elif key == DELAY_KEY:
                for value in _end_values(distribution):
                    self.delay({DELAY_KEY: value}, 0.0)
            elif not key.startswith(_KEY_PREFIXES):
                prefixes = ", ".join([*_KEY_PREFIXES, _SENSOR_PREFIX, DELAY_KEY])
                raise InputError("randomise", f"does not act on an episode; keys that do begin with {prefixes}", key)
        self.keys = tuple(key for key in self._distributions if key != DELAY_KEY and not key.startswith(_SENSOR_PREFIX))

    @staticmethod
    def _check_sensor(key: str, task: Task) -> None:
        name, _, field_name = key.removeprefix(_SENSOR_PREFIX).rpartition(".")
        if name not in task.sensors or field_name not in _SENSOR_FIELDS:
            keys = ", ".join(f"{_SENSOR_PREFIX}{sensor}.{{{','.join(_SENSOR_FIELDS)}}}" for sensor in task.sensors)
            raise InputError("randomise", f"no such number of a sensor; there are {keys}", key)

    def sample_context(self, random: np.random.Generator) -> dict[str, Any]:
        """Return a value for every key."""
        return {key: distribution.draw(random) for key, distribution in self._distributions.items()}

    def corner_values(self) -> Iterator[list[Any]]:
        """Yield the values at the keys with every distribution at an end: all lowest ones, all highest ones.

        All values of a `Choice` follow each other; the ends of other distributions are unknown.
        """
        corner_values = [_end_values(self._distributions[key]) for key in self.keys]
        if all(len(values) for values in corner_values):
            for row in range(max(map(len, corner_values), default=0)):
                yield [values[min(row, len(values) - 1)] for values in corner_values]

    def sensor(self, name: str, sensor: Sensor, draws: Mapping[str, Any]) -> Sensor:
        """Return a sensor with the drawn parameters."""
        keys = {field_name: f"{_SENSOR_PREFIX}{name}.{field_name}" for field_name in _SENSOR_FIELDS}
        fields = {field_name: draws[key] for field_name, key in keys.items() if key in draws}
        return replace(sensor, **fields) if fields else sensor

    def delay(self, draws: Mapping[str, Any], delay: float) -> float:
        """Return the drawn delay of the action, s; that of the task if none was drawn."""
        delay_draw = draws.get(DELAY_KEY, delay)
        if not is_number(delay_draw) or not 0.0 <= delay_draw < np.inf:
            raise InputError(DELAY_KEY, "must be a finite number of seconds, not negative", delay_draw)
        return float(delay_draw)


def _end_values(distribution: Distribution) -> Sequence[Any]:
    """Return the least and the largest value that a distribution draws; of a normal one three deviations away."""
    if isinstance(distribution, Choice):
        return distribution.values
    if isinstance(distribution, Normal):
        mean, distance = distribution.mean, 3.0 * distribution.deviation
        return max(mean - distance, distribution.low), min(mean + distance, distribution.high)
    return (distribution.low, distribution.high) if isinstance(distribution, Uniform | LogUniform) else ()


def read_identified(path: str | os.PathLike[str]) -> dict[str, Distribution]:
    """Return uniform distributions of the parameters of an identified scenario over their 95 % intervals.

    Args:
        path: Path of ``identified.toml``; ``identification.nc`` is in the same folder.
    """
    import xarray as xr

    result_path = Path(path).with_name("identification.nc")
    if not result_path.is_file():
        raise InputError("randomise", f"has no {result_path.name} beside it, where the intervals stand", str(path))
    with xr.open_dataset(result_path) as identified:
        keys, low, high = (identified[name].values for name in ("parameter", "lower", "upper"))
    distributions: dict[str, Distribution] = {}
    for key, least, most in zip(keys.tolist(), low.tolist(), high.tolist(), strict=True):
        if not np.isfinite([least, most]).all():
            allowed = f"its recordings leave it open, {least:g} to {most:g}: give distributions, one for it among them"
            raise InputError(f"randomise.{key}", allowed)
        distributions[str(key)] = Uniform(least, most)
    return distributions
