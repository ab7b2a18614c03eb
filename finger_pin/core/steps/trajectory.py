"""Solution of an integration, common to all integrators, and their callbacks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from finger_pin.core.steps.repetition import Steps
from finger_pin.typing import Array

Watch = Callable[[float, Array], None]


@dataclass(frozen=True)
class Statistics:
    """The cost of an integration: accepted steps, right-hand sides, Jacobians, factorisations, wall time in s."""

    steps: int
    evaluations: int
    jacobians: int
    factorisations: int
    wall_time: float


class Apart(Protocol):
    """Motion of islands that have steps of their own."""

    @property
    def times(self) -> Array:
        """Ends of its steps with the start first, s."""

    def powers(self, times: Array) -> Array:
        """Return its powers at times, and that of the forces at its tips, shape (m, powers + 1), W."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A solution that can be evaluated at any time up to its end.

    Attributes:
        breakpoints: Ends of the accepted steps with the start first, shape (k + 1,), s.
        interpolate: Maps times, shape (m,), to packed states, shape (m, size).
        statistics: The cost.
        failure: Report of the integrator if it failed, otherwise empty.
        interrupted: Whether it was asked to stop.
        islands: Motions of what moves apart, where the core computes all inputs itself; none otherwise.
        steps: Steps of each that moves apart, of a method of the core; none of others.
    """

    breakpoints: Array
    interpolate: Callable[[Array], Array]
    statistics: Statistics
    failure: str = ""
    interrupted: bool = False
    islands: tuple[Apart, ...] = ()
    steps: tuple[Steps, ...] = ()
