"""The energy account of a trajectory: powers integrated over time, and what is left unexplained."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from finger_pin.control.closed_loop import ClosedLoop, LoopSignals
from finger_pin.core.textbook import Trajectory
from finger_pin.description.routing import Array
from finger_pin.mechanism.rigid_body import Motion
from finger_pin.simulation.energy import Flows, energies, powers

# Three-point Gauss quadrature on [0, 1]. All nodes are inside the step: a controller that is sampled changes its
# tensions at the ends of steps, where a node would see those of the next one.
_NODES = 0.5 + np.sqrt(0.15) * np.array([-1.0, 0.0, 1.0])
_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0
# Coefficients of u^3, u^2 and u in the integrals from 0 to u of the parabolas that are one at a node and zero at the
# other two, shape (3, 3).
_PARABOLAS = np.linalg.inv(np.vander(_NODES, 3)) / np.array([[3.0], [2.0], [1.0]])
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

    stored: dict[str, Array]
    powers: Flows
    works: Flows
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
    booked = powers(signals.finger)
    count = len(booked.names)
    done = [_works(*part, times, count) for part in _apart(loop, trajectory)]
    works = Flows(np.sum(done, axis=0), booked.names, booked.supplies)
    stored = energies(loop.finger, signals.finger, motion)
    total = np.sum(list(stored.values()), axis=0)
    return Account(stored=stored, powers=booked, works=works, residual=total - total[0] - works.net)


def _apart(loop: ClosedLoop, trajectory: Trajectory) -> list[tuple[ClosedLoop, Array, Callable[[Array], Array]]]:
    """Return loops with their breakpoints and states: of the fingers of a hand that move apart, or of the whole."""
    sizes = [part.finger.layout.size for part in loop.parts]
    if sizes and sizes == [len(places) for places, _, _ in trajectory.islands]:
        # Islands stand in the order of their first joint, as fingers do.
        return [(part, ends, states) for part, (_, ends, states) in zip(loop.parts, trajectory.islands, strict=True)]
    return [(loop, trajectory.breakpoints, trajectory.interpolate)]


def _works(loop: ClosedLoop, breakpoints: Array, states: Callable[[Array], Array], times: Array, count: int) -> Array:
    """Return the integrals of all powers from the start to the saved times, shape (m, count).

    Inside a step the power is taken for the parabola through its values at the nodes: over whole steps that is the
    quadrature, and what it errs by inside a step does not add up.
    """
    begin, length = breakpoints[:-1], np.diff(breakpoints)
    works, reached = np.zeros((len(times), count)), np.zeros(count)
    if len(length) == 0:
        return works
    inside = np.clip(np.searchsorted(begin, times, side="right") - 1, 0, len(begin) - 1)
    for first in range(0, len(begin), _CHUNK):
        part = slice(first, first + _CHUNK)
        nodes = (begin[part, None] + length[part, None] * _NODES).ravel()
        values = loop.powers(nodes, states(nodes))
        values = values.reshape(-1, len(_NODES), count) * length[part, None, None]
        steps = sum(weight * values[:, node] for node, weight in enumerate(_WEIGHTS))
        before = reached + np.cumsum(steps, axis=0) - steps
        rows = slice(*np.searchsorted(inside, (first, first + _CHUNK)))
        step = inside[rows] - first
        share = np.vander((times[rows] - begin[inside[rows]]) / length[inside[rows]], 4)[:, :3] @ _PARABOLAS
        works[rows] = before[step] + sum(share[:, node, None] * values[step, node] for node in range(len(_NODES)))
        reached = before[-1] + steps[-1]
    return works
