"""The energy account of a trajectory: powers integrated over time, and what is left unexplained."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from finger_pin.control.closed_loop import ClosedLoop, LoopSignals
from finger_pin.core.stepping.textbook import Apart, Trajectory
from finger_pin.description.routing import Array
from finger_pin.mechanism.kinematics import Motion
from finger_pin.simulation.energy import Flows, energies, powers

# Three-point Gauss quadrature on [0, 1]. All nodes are inside the step: a controller that is sampled changes its
# tensions at the ends of steps, where a node would see those of the next one.
_NODES = 0.5 + np.sqrt(0.15) * np.array([-1.0, 0.0, 1.0])
_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0
# Five-point Lobatto quadrature, which checks it: at the ends as well, all but a trace, where powers may bend unseen.
_CHECKS = 0.5 + 0.5 * (1.0 - 1e-9) * np.array([-1.0, -np.sqrt(3.0 / 7.0), 0.0, np.sqrt(3.0 / 7.0), 1.0])
_CHECK_WEIGHTS = np.array([9.0, 49.0, 64.0, 49.0, 9.0]) / 180.0
# Coefficients of u^3, u^2 and u in the integrals from 0 to u of the parabolas that are one at a node and zero at the
# other two, shape (3, 3).
_PARABOLAS = np.linalg.inv(np.vander(_NODES, 3)) / np.array([[3.0], [2.0], [1.0]])
_CHUNK = 4096
# A power may bend inside a step where no force does, as that which a limiter loses where it would have to pull; and
# an impact may be one step. Where more than this stays open, of all energy exchanged and in J, steps are halved, so
# often at most, until no work of one is wrong by a thousandth of it: of so many steps those where it opens most.
_CLOSED, _NOTHING = 1e-5, 1e-12
_HALVINGS, _MOST_SUSPECTED = 8, 20_000

# The ends of steps, and what maps times to powers there.
_Part = tuple[Array, Callable[[Array], Array]]


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


def account(
    loop: ClosedLoop,
    trajectory: Trajectory,
    times: Array,
    signals: LoopSignals,
    motion: Motion,
) -> Account:
    """Keep the energy account of a trajectory.

    Args:
        loop: The system.
        trajectory: Its solution.
        times: Saved times, shape (m,), beginning at the trajectory's start.
        signals: The signals at those times.
        motion: Fingertip and energies of the rigid body at those times.
    """
    booked = powers(signals.finger)
    stored = energies(loop.finger, signals.finger, motion)
    total = np.sum(list(stored.values()), axis=0)
    parts, done = _parts(loop, trajectory), np.zeros((len(times), len(booked.booked)))
    found = [_works(part, times, done.shape[1]) for part in parts]
    done += np.sum(found, axis=0)
    works = Flows(done, booked.booked)
    gained = total - total[0]
    residual = gained - works.net
    allowed = max(_CLOSED * float(np.sum(np.max(np.abs(done), axis=0, initial=0.0))), _NOTHING)
    if allowed < float(np.max(np.abs(residual))) < np.inf:
        for (ends, power), own in zip(parts, found, strict=True):
            finer = _halved((ends, power), _suspected(ends, times, residual), 1e-3 * allowed)
            if len(finer):
                done += _works((np.union1d(ends, finer), power), times, done.shape[1]) - own
        works = Flows(done, booked.booked)
        residual = gained - works.net
    return Account(stored=stored, powers=booked, works=works, residual=residual)


def _suspected(ends: Array, times: Array, residual: Array) -> NDArray[np.int64]:
    """Return in which steps the account opens most, at most so many: those between saved times where it does."""
    first = np.searchsorted(ends[1:-1], times[:-1], side="right")
    last = np.searchsorted(ends[1:-1], times[1:], side="left") + 1
    worst = np.argsort(-np.abs(np.diff(residual)))
    worst = worst[np.cumsum(last[worst] - first[worst]) <= _MOST_SUSPECTED]
    return np.unique(np.concatenate([np.zeros(0, int), *(np.arange(first[i], last[i]) for i in worst)]))


def _halved(part: _Part, steps: NDArray[np.int64], allowed: float) -> Array:
    """Return steps halved, and halved again, until no work of one is wrong by more than is allowed, J."""
    (ends, power), found = part, []
    begin, length = ends[steps], np.diff(ends)[steps]
    for _ in range(_HALVINGS):
        chunks = [slice(first, first + _CHUNK) for first in range(0, len(begin), _CHUNK)]
        errors = [_quadrature_error(power, begin[chunk], length[chunk]) for chunk in chunks]
        bent = np.concatenate([np.zeros(0), *errors]) > allowed
        begin, length = begin[bent], 0.5 * length[bent]
        found.append(begin + length)
        begin, length = np.concatenate([begin, begin + length]), np.tile(length, 2)
    return np.concatenate(found)


def _quadrature_error(power: Callable[[Array], Array], begin: Array, length: Array) -> Array:
    """Return the error of the integral of any power over steps, shape (steps,), J."""
    one = np.tensordot(_WEIGHTS, _over(power, begin, length, _NODES), (0, 1))
    other = np.tensordot(_CHECK_WEIGHTS, _over(power, begin, length, _CHECKS), (0, 1))
    return np.asarray(np.max(np.abs(one - other), axis=1))


def _parts(loop: ClosedLoop, trajectory: Trajectory) -> list[_Part]:
    """Return breakpoints and powers of what moves apart, or of the whole."""
    reached = trajectory.breakpoints[-1]
    found: list[_Part] = []
    for island in trajectory.islands:
        ends = island.times
        found.append((np.append(ends[ends < reached], reached), partial(_powers_apart, loop, island)))

    def powers(times: Array) -> Array:
        return loop.powers(times, trajectory.interpolate(times))

    return found or [(trajectory.breakpoints, powers)]


def _powers_apart(loop: ClosedLoop, island: Apart, times: Array) -> Array:
    return island.powers(times, loop.force(times), loop.base(times))


def _works(part: _Part, times: Array, count: int) -> Array:
    """Return the integrals of all powers up to the saved times, in order, shape (m, count), J.

    Inside a step the power is taken for the parabola through its values at the nodes: over whole steps that is the
    quadrature, and what it errs by inside a step does not add up.
    """
    ends, power = part
    works, reached = np.zeros((len(times), count)), np.zeros(count)
    for first in range(0, len(ends) - 1, _CHUNK):
        chunk = ends[first : first + _CHUNK + 1]
        begin, length = chunk[:-1], np.diff(chunk)
        values = _over(power, begin, length, _NODES)
        before = np.vstack([reached, reached + np.cumsum(np.tensordot(_WEIGHTS, values, (0, 1)), axis=0)])
        rows = _saved(times, chunk)
        step = np.clip(np.searchsorted(begin, times[rows], side="right") - 1, 0, None)
        share = np.vander((times[rows] - begin[step]) / length[step], 4)[:, :3] @ _PARABOLAS
        works[rows] = before[step] + np.einsum("mn,mnp->mp", share, values[step])
        reached = before[-1]
    return works


def _saved(times: Array, ends: Array) -> slice:
    """Return the slice of the saved times that lie in steps, those at their ends among them."""
    first, last = np.searchsorted(times, ends[0]), np.searchsorted(times, ends[-1] * (1.0 + 1e-12), side="right")
    return slice(int(first), int(last))


def _over(power: Callable[[Array], Array], begin: Array, length: Array, nodes: Array) -> Array:
    """Return the powers at nodes of steps, times the steps' lengths, shape (steps, nodes, count)."""
    times = (begin[:, None] + length[:, None] * nodes).ravel()
    return power(times).reshape(len(begin), len(nodes), -1) * length[:, None, None]
