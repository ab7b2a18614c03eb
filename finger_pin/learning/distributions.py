"""Distributions of parameters sampled at every reset: of scenario, sensors and action."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any, Protocol

import numpy as np
from scipy.special import ndtr, ndtri

from finger_pin.exceptions import InputError


class Distribution(Protocol):
    """A distribution of a number or a name."""

    def draw(self, random: np.random.Generator) -> Any:
        """Return one draw."""


@dataclass(frozen=True)
class Uniform:
    """Uniform distribution between ``low`` and ``high``."""

    low: float
    high: float

    def __post_init__(self) -> None:
        """Check the bounds."""
        _check_bounds(self)

    def draw(self, random: np.random.Generator) -> float:
        """Return one draw."""
        return float(random.uniform(self.low, self.high))


@dataclass(frozen=True)
class LogUniform:
    """Log-uniform distribution between positive ``low`` and ``high``."""

    low: float
    high: float

    def __post_init__(self) -> None:
        """Check the bounds."""
        _check_bounds(self)
        if self.low <= 0.0:
            raise InputError("LogUniform.low", "must be above 0", self.low)

    def draw(self, random: np.random.Generator) -> float:
        """Return one draw."""
        return float(math.exp(random.uniform(math.log(self.low), math.log(self.high))))


@dataclass(frozen=True)
class Normal:
    """Normal distribution, cut at ``low`` and ``high``."""

    mean: float
    deviation: float
    low: float = -math.inf
    high: float = math.inf

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not (
            all(map(is_number, vars(self).values())) and math.isfinite(self.mean) and 0.0 <= self.deviation < math.inf
        ):
            raise InputError("Normal", "mean must be finite, deviation finite and not negative", [*vars(self).values()])
        if not self.low <= self.mean <= self.high:
            raise InputError("Normal.mean", f"must be between low = {self.low:g} and high = {self.high:g}", self.mean)

    def draw(self, random: np.random.Generator) -> float:
        """Return one draw."""
        if self.deviation == 0.0:
            return self.mean
        below, above = (float(ndtr((end - self.mean) / self.deviation)) for end in (self.low, self.high))
        # However narrow the range is; at a share of 0 the number would be infinite.
        value = self.mean + self.deviation * ndtri(random.uniform(max(below, 1e-300), above))
        return float(min(max(value, self.low), self.high))


@dataclass(frozen=True)
class Choice:
    """Uniform choice among values, numbers or names."""

    values: Sequence[Any]

    def __post_init__(self) -> None:
        """Check that there is at least one value."""
        if isinstance(self.values, str) or not len(self.values):
            raise InputError("Choice.values", "must be a list of at least one value", self.values)

    def draw(self, random: np.random.Generator) -> Any:
        """Return one draw."""
        return self.values[int(random.integers(len(self.values)))]


def is_number(value: Any) -> bool:
    """Return whether a value is a real number, of Python or NumPy."""
    return isinstance(value, Real) and not isinstance(value, bool)


def _check_bounds(bounds: Uniform | LogUniform) -> None:
    numbers = is_number(bounds.low) and is_number(bounds.high)
    if not (numbers and math.isfinite(bounds.low) and math.isfinite(bounds.high) and bounds.low <= bounds.high):
        allowed = "low and high must be finite, and low not above high"
        raise InputError(type(bounds).__name__, allowed, [bounds.low, bounds.high])
