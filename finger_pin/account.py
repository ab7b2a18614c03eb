"""The energy account of a trajectory: powers integrated over time, and what is left unexplained."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from finger_pin.blocks.rigid_body import Motion
from finger_pin.closed_loop import ClosedLoop, LoopSignals
from finger_pin.energy import Energies, Powers, energies, powers
from finger_pin.integration import Trajectory
from finger_pin.routing import Array

# Three-point Gauss quadrature on [0, 1]. All nodes are inside the step: a controller that is sampled changes its
# tensions at the ends of steps, where a node would see those of the next one.
_NODES = 0.5 + np.sqrt(0.15) * np.array([-1.0, 0.0, 1.0])
_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0
_CHUNK = 4096


@dataclass(frozen=True, eq=False)
class Account:
    """Energies, powers and works at the saved times, each of shape (m,).

    Attributes:
        stored: J.
        powers: W.
        works: Powers integrated from the start, J.
        residual: Stored less its start, less the net work, J; zero for an exact integration.
    """

    stored: Energies
    powers: Powers
    works: Powers
    residual: Array


def account(loop: ClosedLoop, trajectory: Trajectory, times: Array, signals: LoopSignals, motion: Motion) -> Account:
    """Keep the energy account of a trajectory.

    Args:
        loop: The system.
        trajectory: Its solution.
        times: Saved times, shape (m,), beginning at the trajectory's start.
        signals: The signals at those times.
        motion: Fingertip and energies of the rigid body at those times.
    """
    finger = loop.finger
    ends = trajectory.breakpoints
    steps = _works(loop, trajectory, ends[:-1], ends[1:])
    to_step = np.vstack([np.zeros(steps.shape[1]), np.cumsum(steps, axis=0)])
    before = np.clip(np.searchsorted(ends, times, side="right") - 1, 0, len(ends) - 1)
    works = Powers(*(to_step[before] + _works(loop, trajectory, ends[before], times)).T)
    stored = energies(finger, signals.finger, motion)
    return Account(
        stored=stored,
        powers=powers(finger, signals.finger),
        works=works,
        residual=stored.total - stored.total[0] - works.net,
    )


def _works(loop: ClosedLoop, trajectory: Trajectory, begin: Array, end: Array) -> Array:
    """Return the integrals of all powers over intervals inside single steps, shape (intervals, powers)."""
    result = np.zeros((len(begin), len(fields(Powers))))
    for first in range(0, len(begin), _CHUNK):
        part = slice(first, first + _CHUNK)
        length = (end - begin)[part]
        nodes = (begin[part, None] + length[:, None] * _NODES).ravel()
        signals = loop.evaluate(nodes, trajectory.interpolate(nodes))
        values = np.stack(list(vars(powers(loop.finger, signals.finger)).values()), axis=-1)
        result[part] = np.einsum("k,ikp->ip", _WEIGHTS, values.reshape(len(length), 3, -1)) * length[:, None]
    return result
