"""Reference trajectories of the joints, with the coupling that the passive tendons impose (20)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from finger_pin.description.coupling import PassiveCoupling
from finger_pin.description.routing import Array, Routing
from finger_pin.description.scenario import JointReference, Scenario
from finger_pin.laws.harmonic import harmonic, harmonic_rate


@dataclass(frozen=True, eq=False)
class ReferenceSignals:
    """Desired motion: position, shape (..., n), rad, and velocity, shape (..., n), rad/s."""

    position: Array
    velocity: Array


@dataclass(frozen=True, eq=False)
class HarmonicReference:
    """One sinusoid about an offset per joint, then equation (20) for the followers.

    Attributes:
        offset: Shape (n,), rad.
        amplitude: Shape (n,), rad.
        frequency: Shape (n,), Hz.
        phase: Shape (n,), rad.
        coupling: The joints that passive tendons drive.
    """

    offset: Array
    amplitude: Array
    frequency: Array
    phase: Array
    coupling: PassiveCoupling

    @classmethod
    def from_scenario(cls, scenario: Scenario, routing: Routing) -> HarmonicReference:
        """Read a scenario's reference, for the routing of its finger."""
        settings = [scenario.reference.joints.get(name, JointReference()) for name in routing.joints]
        return cls(
            offset=np.array([joint.offset for joint in settings]),
            amplitude=np.array([joint.amplitude for joint in settings]),
            frequency=np.array([joint.frequency for joint in settings]),
            phase=np.array([joint.phase for joint in settings]),
            coupling=scenario.coupling(routing),
        )

    def at(self, time: Array | float) -> ReferenceSignals:
        """Return theta^d and its rate at one time, or at times of shape (m,)."""
        instant = np.asarray(time, dtype=float)[..., None]
        base = harmonic(instant, self.offset, self.amplitude, self.frequency, self.phase)
        rate = harmonic_rate(instant, self.amplitude, self.frequency, self.phase)
        matrix = self.coupling.matrix.T
        return ReferenceSignals(base @ matrix + self.coupling.offset, rate @ matrix)
