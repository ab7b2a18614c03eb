"""The controller of a loop: its commands, and its answers to whatever runs it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Self

from finger_pin.core.control import Control
from finger_pin.description.routing import Array, Routing
from finger_pin.references.reference import LoopReference, ReferenceSignals
from finger_pin.references.signal import Signal

if TYPE_CHECKING:
    from finger_pin.control.measurement import SampledSensor
    from finger_pin.control.proportional import ControlSignals
    from finger_pin.mechanism.finger import Finger


class LoopController(ABC):
    """A controller in a loop: its commands, its sensors, its knots, its compiled form.

    A new kind of controller needs `command`, and overrides what it can answer better: by default it is Python, and may
    remember what it was asked.

    Attributes:
        measures: Whether it takes readings of sensors, by `sense`; then it has to be sampled.
        sensors: Its own sensors, besides encoders and tension sensors.
        problem: Message of an error inside, or empty; the motion ends there.
        problem_time: When, s.
    """

    measures = False
    sensors: Sequence[SampledSensor] = ()
    problem = ""
    problem_time = float("-inf")

    @abstractmethod
    def command(
        self, time: Array | float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return the commands for shapes (..., n)."""

    def sense(self, readings: Mapping[str, Array], elapsed: float) -> None:  # noqa: B027 - most do not listen
        """Take the sensors' readings, by their names, ``tendon_tension`` among them, and the time since the last, s."""

    def measured(self, name: str, times: Array) -> Array:
        """Return the last readings of a sensor at times (m,), shape (m,) or (m, k); of a sampled controller."""
        raise LookupError(name)

    def as_control(self, reference: LoopReference, finger: Finger) -> Control | None:
        """Return its arrays for the compiled core, with a reference; None if it is Python."""
        return None

    def signals(self) -> tuple[Signal, ...]:
        """Return the functions of time that it follows; steps end at their knots."""
        return ()

    def without_memory(self) -> LoopController | None:
        """Return a controller without memory, which may be asked for the start; None if there is none."""
        return None

    @classmethod
    def joined(cls, controllers: Sequence[Self], routing: Routing) -> LoopController | None:
        """Return one controller of this kind for all fingers of a hand; None if they have to stand side by side."""
        return None
