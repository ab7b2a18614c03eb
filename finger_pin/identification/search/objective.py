"""The function that a search knows: residuals of a vector within bounds, with what the search remembers of it."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from typing import Generic, Protocol, Self, TypeVar

import numpy as np

from finger_pin.identification.likelihood import Likelihood
from finger_pin.typing import Array


class Stopped(Exception):
    """Stop of a search that its caller asked for."""


class Function(Protocol):
    """Residuals of every signal, shape (m,) each, as a function of a vector z, shape (p,).

    Attributes:
        box: The least and the greatest z.
        feasible: Returns z, or the nearest allowed point by changing only free entries, shape (p,) (all by default).
        likelihood: Likelihood of the residuals.
        exact: Whether residuals have no errors of integration.
        accuracy: How small these are: ``plain``, ``fine`` or ``rough``, of which fewer residuals are means.
    """

    box: tuple[Array, Array]
    feasible: Callable[..., Array]
    likelihood: Likelihood
    exact: bool
    accuracy: str

    def residuals(self, z: Array) -> list[Array]:
        """Return the residuals, infinite where there are none."""

    def slopes(self, z: Array) -> list[Array]:
        """Return their derivatives by z, shape (m, p) each."""

    def with_accuracy(self, accuracy: str) -> Self:
        """Return the function with an accuracy."""

    def block_means(self, values: list[Array]) -> list[Array]:
        """Return the means of residuals, or of slopes, that the rough function has."""


_Function = TypeVar("_Function", bound=Function)


class Objective(Generic[_Function]):
    """Function with a memory and a stop.

    Attributes:
        function: The function.
        stop: Asked before every evaluation.
        evaluations: Number of evaluations, of slopes two for each entry.
        best: The least objective so far, and where.
    """

    def __init__(self, function: _Function, stop: Callable[[], bool] = lambda: False) -> None:
        """Start from a function of the parameters, without a best point."""
        self.function, self.stop, self.evaluations = function, stop, 0
        self.box, self.likelihood, self.feasible = function.box, function.likelihood, function.feasible
        self.exact, self.accuracy = function.exact, function.accuracy
        self.best: tuple[float, Array] = (math.inf, np.zeros(0))
        self._slopes: tuple[Array, list[Array]] | None = None

    @property
    def width(self) -> Array:
        """Greatest less least z, shape (p,)."""
        return self.box[1] - self.box[0]

    def residuals(self, z: Array) -> list[Array]:
        """Return the residuals."""
        self._count(1)
        residuals = self.function.residuals(z)
        objective = self.likelihood.minus_twice_log(residuals)
        if objective < self.best[0]:
            self.best = (objective, z.copy())
        return residuals

    def slopes(self, z: Array) -> list[Array]:
        """Return the derivatives of the residuals, shape (m, p) each; at the place of the last ones those."""
        if self._slopes is None or not np.array_equal(self._slopes[0], z):
            self._count(2 * len(z))
            self._slopes = (z.copy(), self.function.slopes(z))
        return self._slopes[1]

    def thread_copy(self) -> Objective[_Function]:
        """Return a copy with a memory of its own, for another thread."""
        twin = copy.copy(self)
        twin.evaluations, twin.best = 0, (math.inf, np.zeros(0))
        return twin

    def join(self, twin: Objective[_Function]) -> None:
        """Add the evaluations of a twin, and take its best point if that is better, or if there is none yet."""
        self.evaluations += twin.evaluations
        if (twin.accuracy == "rough") != (self.accuracy == "rough"):
            self.best = self.best if len(self.best[1]) else (math.inf, twin.best[1])
            return
        self._slopes = twin._slopes or self._slopes
        self.best = min(self.best, twin.best, key=lambda point: point[0])

    def _count(self, evaluations: int) -> None:
        if self.stop():
            raise Stopped
        self.evaluations += evaluations
