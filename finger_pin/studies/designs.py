"""Designs: the points of a sweep, and parsers of a key's values: START:STOP:N, LOW:HIGH, or A,B,C.

A `Grid` has a dimension per key. A `PointList` and a `LatinHypercube` are lists of points: they have one dimension,
``sample``, along which every key has its coordinate.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from scipy.stats import qmc

from finger_pin.description.tables import split
from finger_pin.exceptions import InputError
from finger_pin.studies.keys import Point, Value

_VALUES_MESSAGE = "must be KEY=START:STOP:N, KEY=START:STOP:N:log or KEY=A,B,C"
_BOOLEANS = {"true": True, "false": False}
_RANGE_MESSAGE = "must be KEY=LOW:HIGH or KEY=LOW:HIGH:log"
SAMPLE = "sample"
#: More points than this are a mistake.
MAX_POINTS = 1_000_000


def parse_values(text: str) -> tuple[str, tuple[Value, ...]]:
    """Return the key and the values of ``KEY=START:STOP:N``, ``KEY=START:STOP:N:log`` or ``KEY=A,B,C``.

    START and STOP are among the N values. A, B and C are numbers, or names, or true and false.
    """
    key, text_value = _split(text, _VALUES_MESSAGE)
    if ":" not in text_value:
        words = [word.strip() for word in text_value.split(",")]
        if not all(words) or any(_is_number(word) for word in words):
            return key, tuple(_number(text, word, _VALUES_MESSAGE) for word in words)
        return key, tuple(_BOOLEANS.get(word, word) for word in words)
    parts, logarithmic = _split_range(text_value)
    if len(parts) != 3 or not parts[2].strip().isdecimal():
        raise InputError("over", _VALUES_MESSAGE, text)
    start, stop = (_number(text, word, _VALUES_MESSAGE) for word in parts[:2])
    count = int(parts[2]) if len(parts[2].strip()) < 10 else MAX_POINTS + 1
    if not 1 <= count <= MAX_POINTS:
        raise InputError("over", f"N must be from 1 to {MAX_POINTS}", text)
    if logarithmic and not (start > 0.0 and stop > 0.0):
        raise InputError("over", "START and STOP must be above 0 for logarithmic steps", text)
    values = np.geomspace(start, stop, count) if logarithmic else np.linspace(start, stop, count)
    return key, tuple(values.tolist())


def parse_range(text: str) -> tuple[str, Range]:
    """Return the key and the range of ``KEY=LOW:HIGH`` or ``KEY=LOW:HIGH:log``."""
    key, text_value = _split(text, _RANGE_MESSAGE)
    parts, logarithmic = _split_range(text_value)
    if len(parts) != 2:
        raise InputError("over", _RANGE_MESSAGE, text)
    low, high = (_number(text, part, _RANGE_MESSAGE) for part in parts)
    interval = Range(low, high, logarithmic)
    interval.check(key)
    return key, interval


def _split(text: str, allowed: str) -> tuple[str, str]:
    key, equals, text_value = text.partition("=")
    if not equals or not key.strip() or not text_value.strip():
        raise InputError("over", allowed, text)
    return key.strip(), text_value


def _split_range(text_value: str) -> tuple[list[str], bool]:
    parts = text_value.split(":")
    logarithmic = parts[-1].strip() == "log"
    return (parts[:-1] if logarithmic else parts), logarithmic


def _is_number(text_value: str) -> bool:
    try:
        float(text_value)
    except ValueError:
        return False
    return True


def _number(text: str, text_value: str, allowed: str) -> float:
    if not _is_number(text_value):
        raise InputError("over", f"{allowed}; {text_value.strip() or 'nothing'} is not a number", text)
    number = float(text_value)
    if not math.isfinite(number):
        raise InputError("over", f"{allowed}; numbers must be finite", text)
    return number


class Design(Protocol):
    """The points of a sweep."""

    @property
    def values(self) -> Mapping[str, tuple[Value, ...]]:
        """The values of every key: along its own dimension, or of every sample."""

    @property
    def dims(self) -> tuple[str, ...]:
        """The dimensions: the keys, or ``sample``."""

    def points(self) -> list[Point]:
        """Return the points, the last dimension varying fastest."""


@dataclass(frozen=True)
class Grid:
    """Full factorial: all combinations of the values of some keys.

    Attributes:
        values: By key.
    """

    values: Mapping[str, tuple[Value, ...]]

    def __init__(self, values: Mapping[str, Sequence[Value]]) -> None:
        """Check and keep the values."""
        object.__setattr__(self, "values", _read_values(values))
        for key, axis in self.values.items():
            if len(set(axis)) < len(axis):
                repeated = next(value for value in axis if axis.count(value) > 1)
                raise InputError(key, "must not come twice", repeated)
        _check_count(math.prod(map(len, self.values.values())))

    @property
    def dims(self) -> tuple[str, ...]:
        """The keys."""
        return tuple(self.values)

    def points(self) -> list[Point]:
        """Return the points, the last key varying fastest."""
        return [dict(zip(self.values, point, strict=True)) for point in itertools.product(*self.values.values())]


@dataclass(frozen=True)
class PointList:
    """A list of points: the first values of all keys together, then the second ones.

    Attributes:
        values: By key, equally many for each.
    """

    values: Mapping[str, tuple[Value, ...]]

    def __init__(self, values: Mapping[str, Sequence[Value]]) -> None:
        """Check and keep the values."""
        object.__setattr__(self, "values", _read_values(values))
        first, *others = self.values
        for key in others:
            if len(self.values[key]) != len(self.values[first]):
                raise InputError(key, f"must have as many values as {first}, {len(self.values[first])}, in a list")
        _check_count(len(self.values[first]))

    @property
    def dims(self) -> tuple[str, ...]:
        """The one dimension."""
        return (SAMPLE,)

    def points(self) -> list[Point]:
        """Return the points."""
        return [dict(zip(self.values, point, strict=True)) for point in zip(*self.values.values(), strict=True)]


@dataclass(frozen=True)
class Range:
    """An interval of values.

    Attributes:
        low: Its lower end.
        high: Its upper end.
        logarithmic: Whether values are spread evenly in their logarithms.
    """

    low: float
    high: float
    logarithmic: bool = False

    def check(self, key: str) -> None:
        """Raise unless the ends are finite, in order and, for logarithms, positive."""
        ends = [self.low, self.high]
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise InputError(key, "must be two finite numbers, the lower one first", ends)
        if self.logarithmic and self.low <= 0.0:
            raise InputError(key, "must be above 0 for logarithmic steps", ends)

    def at(self, share: Any) -> Any:
        """Return the values at shares of the way from low to high, of any shape."""
        if self.logarithmic:
            return np.clip(self.low * (self.high / self.low) ** np.asarray(share), self.low, self.high)
        return self.low + (self.high - self.low) * np.asarray(share)

    def share(self, value: float) -> float:
        """Return where a value lies between low and high, from 0 to 1."""
        if self.logarithmic:
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)


@dataclass(frozen=True)
class LatinHypercube:
    """Latin hypercube: each of ``samples`` equal slices of every range holds exactly one point.

    Drawn by `scipy.stats.qmc.LatinHypercube` (McKay, Beckman and Conover, Technometrics 21, 1979).

    Attributes:
        ranges: By key.
        samples: Number of points.
        seed: Of the random numbers; the same seed gives the same points.
    """

    ranges: Mapping[str, Range]
    samples: int
    seed: int = 0

    def __post_init__(self) -> None:
        """Check."""
        if not self.ranges:
            raise InputError("over", "at least one key is needed")
        for key, interval in self.ranges.items():
            split(key)
            interval.check(key)
        if self.samples < 1:
            raise InputError("samples", "must be at least 1", self.samples)
        if self.seed < 0:
            raise InputError("seed", "must be at least 0", self.seed)
        _check_count(self.samples)

    @property
    def values(self) -> Mapping[str, tuple[Value, ...]]:
        """The values of every key at every sample."""
        shares = qmc.LatinHypercube(len(self.ranges), rng=np.random.default_rng(self.seed)).random(self.samples)
        return {
            key: tuple(each.at(column).tolist())
            for (key, each), column in zip(self.ranges.items(), shares.T, strict=True)
        }

    @property
    def dims(self) -> tuple[str, ...]:
        """The one dimension."""
        return (SAMPLE,)

    def points(self) -> list[Point]:
        """Return the points."""
        return PointList(self.values).points()


def _read_values(values: Mapping[str, Sequence[Value]]) -> dict[str, tuple[Value, ...]]:
    if not values:
        raise InputError("over", "at least one key is needed")
    values_by_key: dict[str, tuple[Value, ...]] = {}
    for key, axis_values in values.items():
        split(key)
        if isinstance(axis_values, str) or not isinstance(axis_values, Iterable):
            raise InputError(key, "must be given a list of values", axis_values)
        axis = np.asarray(list(axis_values)).tolist()
        if not axis:
            raise InputError(key, "needs at least one value")
        if len({isinstance(value, str) for value in axis_values}) > 1 or not isinstance(
            axis[0], str | bool | int | float
        ):
            raise InputError(key, "must be given numbers, or names, or true and false", list(axis_values))
        values_by_key[key] = tuple(value if isinstance(value, str | bool) else float(value) for value in axis)
        for value in values_by_key[key]:
            if isinstance(value, float) and not math.isfinite(value):
                raise InputError(key, "must be a finite number", value)
    return values_by_key


def _check_count(count: int) -> None:
    if count > MAX_POINTS:
        raise InputError("over", f"makes {count} points; at most {MAX_POINTS} are run")
