"""What is to be found, and how far what is computed is from what was measured."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from finger_pin.description.family import Family
from finger_pin.description.routing import Array
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError

# Step of differences where there are no slopes, of the range of a parameter.
_STEP = 1e-5
#: What may be found of an output itself, besides the scenario's numbers.
OF_OUTPUTS = ("offset", "scale", "delay")


class Model(Protocol):
    """A recording beside a scenario."""

    def compute(self, scenario: Scenario) -> list[Array]:
        """Return what the scenario says of every output, shape (m,) each."""


@dataclass(frozen=True, eq=False)
class Signal:
    """An output of a recording.

    Attributes:
        recording: Name of the recording.
        name: variable.label.
        unit: SI unit.
        measured: Shape (m,), those that are numbers.
        rows: Which rows of the recording they are, shape (m,).
        instant: Time of each, s; of steady readings its number.
        load: What fed the model there; not a number where several inputs do.
        ordered: Whether its samples follow each other in time, so that neighbours may err alike.
    """

    recording: str
    name: str
    unit: str
    measured: Array
    rows: NDArray[np.intp]
    instant: Array
    load: Array
    ordered: bool


class Stopped(Exception):
    """Somebody asked for an end."""


@dataclass(eq=False)
class Problem:
    """Recordings and the parameters to be found in them, searched for as logarithms where they are positive.

    Attributes:
        scenario: Where all other numbers come from.
        keys: Dotted keys.
        low: Least values.
        high: Greatest values.
        models: A model for each recording.
        signals: All outputs, in the order of the models.
        held: Numbers that the scenario is given first, by key.
        stop: Asked before every evaluation.
        evaluations: How many scenarios were computed.
        best: The least objective so far, and where.
    """

    scenario: Scenario
    keys: tuple[str, ...]
    low: Array
    high: Array
    models: Sequence[Model]
    signals: Sequence[Signal]
    held: Mapping[str, float]
    stop: Callable[[], bool] = lambda: False
    evaluations: int = 0
    best: tuple[float, Array] = (math.inf, np.zeros(0))

    def __post_init__(self) -> None:
        """Check that every key allows its bounds."""
        if self.held:
            self.scenario = Family(self.scenario, tuple(self.held)).at(list(self.held.values()))
        self.family = Family(self.scenario, self.keys)
        self.logarithmic = self.low > 0.0
        for k, key in enumerate(self.keys):
            alone = Family(self.scenario, (key,))
            for bound in (self.low[k], self.high[k]):
                try:
                    alone.at([float(bound)])
                except InputError as error:
                    raise InputError(f"identify.parameters.{key}", error.allowed, float(bound)) from None

    @property
    def start(self) -> Array:
        """The scenario's own numbers, within the bounds, transformed; the middle where it has none."""
        middle = self.values(0.5 * (self.to_search(self.low) + self.to_search(self.high)))
        own = zip(self.family.values, middle, strict=True)
        values = [float(value) if isinstance(value, int | float) else other for value, other in own]
        return self.to_search(np.clip(values, self.low, self.high))

    def to_search(self, values: Array) -> Array:
        """Return values as they are searched for: logarithms of what is positive."""
        safe = np.where(self.logarithmic, values, 1.0)
        return np.where(self.logarithmic, np.log(safe), values)

    def values(self, z: Array) -> Array:
        """Return the values that are searched for at z."""
        return np.where(self.logarithmic, np.exp(np.where(self.logarithmic, z, 0.0)), z)

    @property
    def box(self) -> tuple[Array, Array]:
        """The bounds of the search."""
        return self.to_search(self.low), self.to_search(self.high)

    def residuals(self, z: Array) -> list[Array]:
        """Return measured less computed of every signal, shape (m,) each."""
        if self.stop():
            raise Stopped
        self.evaluations += 1
        scenario = self.family.at(self.values(z).tolist())
        computed = [each for model in self.models for each in model.compute(scenario)]
        residuals = [s.measured - c[s.rows] for s, c in zip(self.signals, computed, strict=True)]
        objective = minus_twice_likelihood(residuals, np.ones(len(residuals)))
        if objective < self.best[0]:
            self.best = (objective, z.copy())
        return residuals

    def slopes(self, z: Array) -> list[Array]:
        """Return the derivatives of the residuals by z, shape (m, p) each."""
        low, high = self.box
        columns = []
        for k in range(len(z)):
            step = _STEP * (high[k] - low[k])
            ends = []
            for way in (1.0, -1.0):
                moved = z.copy()
                moved[k] = np.clip(z[k] + way * step, low[k], high[k])
                ends.append((moved[k], self.residuals(moved)))
            (right, up), (left, down) = ends
            columns.append([(u - d) / (right - left) for u, d in zip(up, down, strict=True)])
        return [np.stack([column[s] for column in columns], axis=1) for s in range(len(self.signals))]

    def subset(self, kept: Sequence[NDArray[np.bool_]]) -> Problem:
        """Return the problem with some of the samples of every signal."""
        signals = [
            Signal(s.recording, s.name, s.unit, s.measured[k], s.rows[k], s.instant[k], s.load[k], s.ordered)
            for s, k in zip(self.signals, kept, strict=True)
        ]
        return Problem(self.scenario, self.keys, self.low, self.high, self.models, signals, self.held, self.stop)


def minus_twice_likelihood(residuals: Sequence[Array], weights: Array) -> float:
    """Return the sum of w n log(SSE / n), least where the likelihood is greatest; a noise for each signal."""
    terms = (w * len(e) * math.log(max(float(np.mean(e * e)), 1e-300)) for e, w in _some(residuals, weights))
    return sum(terms)


def _some(residuals: Sequence[Array], weights: Array) -> Iterator[tuple[Array, float]]:
    return ((e, float(w)) for e, w in zip(residuals, weights, strict=True) if len(e))
