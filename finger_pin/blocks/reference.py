"""Reference trajectories of the joints, with the coupling that the passive tendons impose (20)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from finger_pin.exceptions import InputError
from finger_pin.routing import Array, Routing


def harmonic(time: Any, offset: Any, amplitude: Any, frequency: Any, phase: Any) -> Any:
    """Return offset + amplitude sin(2 pi frequency time + phase), rad."""
    return offset + amplitude * np.sin(2.0 * np.pi * frequency * time + phase)


def harmonic_rate(time: Any, amplitude: Any, frequency: Any, phase: Any) -> Any:
    """Return the time derivative of `harmonic`, rad/s."""
    circular = 2.0 * np.pi * frequency
    return amplitude * circular * np.cos(circular * time + phase)


@dataclass(frozen=True, eq=False)
class PassiveCoupling:
    """Equation (20): the references of the joints that passive tendons drive follow from the others.

    The last joint of every passive tendon that couples two or more joints is a follower: its reference is such that
    the tendon, free of friction, carries its desired tension.

    Attributes:
        matrix: Shape (n, n); theta^d = matrix @ base + offset.
        offset: Shape (n,), rad.
        followers: Indices of the follower joints.
    """

    matrix: Array
    offset: Array
    followers: tuple[int, ...]

    @classmethod
    def from_routing(cls, routing: Routing, tension: Array, stiffness: Array) -> PassiveCoupling:
        """Solve H_c theta^d = -f^d / K_t for the follower joints.

        Args:
            routing: The routing.
            tension: f_5^d, shape (p,), N.
            stiffness: K_t, shape (p,), N/m.

        Raises:
            InputError: If two passive tendons would determine the same joint.
        """
        size = len(routing.joints)
        rows, followers = [], []
        for index, row in enumerate(routing.coupling[routing.actuated :]):
            crossed = np.flatnonzero(row)
            if len(crossed) > 1:
                rows.append(index)
                followers.append(int(crossed[-1]))
        matrix, offset = np.eye(size), np.zeros(size)
        if not rows:
            return cls(matrix, offset, ())
        coupling = routing.coupling[routing.actuated + np.array(rows)]
        driven = coupling[:, followers]
        if len(set(followers)) < len(followers) or np.linalg.matrix_rank(driven) < len(followers):
            names = ", ".join(routing.passive_names[index] for index in rows)
            raise InputError("finger.tendons", f"the passive tendons {names} determine the same joint twice")
        matrix[followers] = 0.0
        matrix[followers] = -np.linalg.solve(driven, coupling @ matrix)
        offset[followers] = -np.linalg.solve(driven, (tension / stiffness)[rows])
        return cls(matrix, offset, tuple(followers))


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

    def at(self, time: Array | float) -> ReferenceSignals:
        """Return theta^d and its rate at one time, or at times of shape (m,)."""
        instant = np.asarray(time, dtype=float)[..., None]
        base = harmonic(instant, self.offset, self.amplitude, self.frequency, self.phase)
        rate = harmonic_rate(instant, self.amplitude, self.frequency, self.phase)
        matrix = self.coupling.matrix.T
        return ReferenceSignals(base @ matrix + self.coupling.offset, rate @ matrix)
