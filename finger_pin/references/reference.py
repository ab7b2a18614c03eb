"""Reference trajectories of the joints, with the coupling that the passive tendons impose (20)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from finger_pin.description.coupling import PassiveCoupling
from finger_pin.description.routing import Routing
from finger_pin.description.scenario import Scenario
from finger_pin.description.signals import JointReference
from finger_pin.description.validation import IN_RADIANS, MOST_ANGLE
from finger_pin.exceptions import InputError
from finger_pin.references.signal import Signal, no_harmonics
from finger_pin.typing import Array

_CONSTANT_REFERENCE = JointReference()


@dataclass(frozen=True, eq=False)
class ReferenceSignals:
    """Desired motion: position, shape (..., n), rad, and velocity, shape (..., n), rad/s."""

    position: Array
    velocity: Array


class Reference(Protocol):
    """A desired motion over time."""

    def at(self, time: Array | float) -> ReferenceSignals:
        """Return theta^d and its rate at one time, or at times of shape (m,)."""


class LoopReference(Reference, Protocol):
    """A reference in a loop: its motion, its knots, its compiled form."""

    def signals(self) -> tuple[Signal, ...]:
        """Return the functions of time in it; steps end at their knots."""

    def planned(self) -> SignalReference | None:
        """Return the signals for the compiled core; None for a Python reference."""


@dataclass(frozen=True, eq=False)
class SignalReference:
    """Reference of one signal per joint, with (20) for the followers.

    Attributes:
        signal: n signals, rad.
        coupling: The joints that passive tendons drive.
    """

    signal: Signal
    coupling: PassiveCoupling

    @classmethod
    def from_scenario(cls, scenario: Scenario, routing: Routing) -> SignalReference:
        """Read a scenario's reference, for the routing of its finger."""
        settings = [scenario.reference.joints.get(name, _CONSTANT_REFERENCE) for name in routing.joints]
        signal = Signal.from_settings(settings, scenario.simulation.rtol).starting_at(scenario.simulation.start_time)
        return cls(signal, scenario.coupling(routing))

    @classmethod
    def from_samples(
        cls, samples: tuple[ArrayLike, ArrayLike], scenario: Scenario, routing: Routing
    ) -> SignalReference:
        """Return the reference through samples of the joints that do not follow (20).

        Args:
            samples: Times, shape (m,), s, and angles, shape (m, k), rad, one column for each of the k joints, in order,
                that no passive tendon drives.
            scenario: Scenario whose passive tendons drive the other joints.
            routing: Routing of its finger.

        Raises:
            InputError: If shapes or numbers are wrong, or an angle is beyond two turns.
        """
        coupling = scenario.coupling(routing)
        free_joints = coupling.free
        names = [routing.joints[index] for index in free_joints]
        signal = Signal.from_samples("reference", samples, names, scenario.simulation.rtol)
        largest = float(np.max(np.abs(np.asarray(samples[1], dtype=float))))
        if largest > MOST_ANGLE:
            raise InputError("reference", f"angles must be at most {MOST_ANGLE:g}{IN_RADIANS}", largest)
        signal = signal.starting_at(scenario.simulation.start_time)
        coefficients = np.zeros((*signal.coefficients.shape[:2], len(routing.joints)))
        coefficients[..., free_joints] = signal.coefficients
        return cls(Signal(no_harmonics(len(routing.joints)), signal.knots, coefficients), coupling)

    def at(self, time: Array | float) -> ReferenceSignals:
        """Return theta^d and its rate at one time, or at times of shape (m,)."""
        position, rate = self.signal.at(time)
        return ReferenceSignals(self.coupling.posture(position[..., self.coupling.free]), rate @ self.coupling.matrix.T)

    def signals(self) -> tuple[Signal, ...]:
        """Return the functions of time in it."""
        return (self.signal,)

    def planned(self) -> SignalReference:
        """Return the planned reference as signals."""
        return self
