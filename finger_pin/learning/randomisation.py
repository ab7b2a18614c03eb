"""Draws at a reset, by key: numbers of the scenario, of sensors, and the delay of the action."""

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
DELAY = "action.delay"
_SENSOR = "observation."
_OF_SENSOR = ("noise", "quantisation", "offset")
# Of a scenario, what acts on an episode: its controller and its duration do not.
_ACTING = ("finger.", "hand.", "environment.", "reference.", "simulation.initial.")


class Randomisation:
    """Distributions, sorted by scenario, sensors and action.

    Attributes:
        keys: Dotted keys of the scenario, in the order in which they are drawn.
    """

    def __init__(self, task: Task) -> None:
        """Read a task.

        Raises:
            InputError: If a key of a sensor or of the action is none.
        """
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
            if key.startswith("action.") and key != DELAY:
                raise InputError("randomise", f"of the action only {DELAY} can be drawn", key)
            if key.startswith(_SENSOR):
                self._check_sensor(key, task)
                for end in _ends(distribution):
                    Sensor(**{key.rpartition(".")[2]: end})
            elif key == DELAY:
                for end in _ends(distribution):
                    self.delay({DELAY: end}, 0.0)
            elif not key.startswith(_ACTING):
                known = ", ".join([*_ACTING, _SENSOR, DELAY])
                raise InputError("randomise", f"does not act on an episode; keys that do begin with {known}", key)
        other = (DELAY,)
        self.keys = tuple(key for key in self._distributions if key not in other and not key.startswith(_SENSOR))

    @staticmethod
    def _check_sensor(key: str, task: Task) -> None:
        name, _, number = key.removeprefix(_SENSOR).rpartition(".")
        if name not in task.sensors or number not in _OF_SENSOR:
            known = ", ".join(f"{_SENSOR}{each}.{{{','.join(_OF_SENSOR)}}}" for each in task.sensors)
            raise InputError("randomise", f"no such number of a sensor; there are {known}", key)

    def sample_context(self, random: np.random.Generator) -> dict[str, Any]:
        """Return a value for every key."""
        return {key: each.draw(random) for key, each in self._distributions.items()}

    def ends(self) -> Iterator[list[Any]]:
        """Yield the values at the keys with every distribution at an end: all least ones, all largest ones.

        Of a `Choice` all values follow each other; what another distribution may draw is not known.
        """
        ends = [_ends(self._distributions[key]) for key in self.keys]
        if all(len(each) for each in ends):
            for row in range(max(map(len, ends), default=0)):
                yield [each[min(row, len(each) - 1)] for each in ends]

    def sensor(self, name: str, sensor: Sensor, drawn: Mapping[str, Any]) -> Sensor:
        """Return a sensor with the numbers that were drawn for it."""
        keys = {number: f"{_SENSOR}{name}.{number}" for number in _OF_SENSOR}
        drawn_entries = {number: drawn[key] for number, key in keys.items() if key in drawn}
        return replace(sensor, **drawn_entries) if drawn_entries else sensor

    def delay(self, drawn: Mapping[str, Any], delay: float) -> float:
        """Return the delay of the action that was drawn, s; that of the task if none was.

        Raises:
            InputError: If it is negative.
        """
        drawn_delay = drawn.get(DELAY, delay)
        if not is_number(drawn_delay) or not 0.0 <= drawn_delay < np.inf:
            raise InputError(DELAY, "must be a finite number of seconds, not negative", drawn_delay)
        return float(drawn_delay)


def _ends(distribution: Distribution) -> Sequence[Any]:
    """Return the least and the largest value that a distribution draws; of a normal one three deviations away."""
    if isinstance(distribution, Choice):
        return distribution.values
    if isinstance(distribution, Normal):
        mean, far = distribution.mean, 3.0 * distribution.deviation
        return max(mean - far, distribution.low), min(mean + far, distribution.high)
    return (distribution.low, distribution.high) if isinstance(distribution, Uniform | LogUniform) else ()


def read_identified(path: str | os.PathLike[str]) -> dict[str, Distribution]:
    """Return the parameters of an identified scenario, each even over its 95 % interval.

    Args:
        path: Of ``identified.toml``, beside which ``identification.nc`` stands.

    Raises:
        InputError: If there is none, or a parameter is open at one side: it has no interval to draw from.
    """
    import xarray as xr

    results = Path(path).with_name("identification.nc")
    if not results.is_file():
        raise InputError("randomise", f"has no {results.name} beside it, where the intervals stand", str(path))
    with xr.open_dataset(results) as identified:
        keys, low, high = (identified[name].values for name in ("parameter", "lower", "upper"))
    distributions: dict[str, Distribution] = {}
    for key, least, most in zip(keys.tolist(), low.tolist(), high.tolist(), strict=True):
        if not np.isfinite([least, most]).all():
            allowed = f"its recordings leave it open, {least:g} to {most:g}: give distributions, one for it among them"
            raise InputError(f"randomise.{key}", allowed)
        distributions[str(key)] = Uniform(least, most)
    return distributions
