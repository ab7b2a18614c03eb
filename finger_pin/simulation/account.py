"""The energy account of a trajectory: powers integrated over time, and the residual."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from finger_pin.control.closed_loop import ClosedLoop, LoopSignals
from finger_pin.core.stepping.trajectory import Trajectory
from finger_pin.mechanism.state import Motion
from finger_pin.simulation.energy import Flows, energies, powers
from finger_pin.typing import Array

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
_CLOSED, _NOTHING, _SMALL = 1e-5, 1e-12, 1e-3
_HALVINGS, _MOST_SUSPECTED = 8, 20_000

# The ends of steps, and what maps times to powers there.
_Part = tuple[Array, Callable[[Array], Array]]
# Where steps begin, and how long they are, s.
_Steps = tuple[Array, Array]


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
    """Compute the energy account of a trajectory.

    Args:
        loop: The system.
        trajectory: Its solution.
        times: Saved times, shape (m,), beginning at the trajectory's start.
        signals: The signals at those times.
        motion: Fingertip and energies of the rigid body at those times.
    """
    flows = powers(signals.finger)
    stored = energies(loop.finger, signals.finger, motion)
    total = np.sum(list(stored.values()), axis=0)
    parts, done = _parts(loop, trajectory), np.zeros((len(times), len(flows.energy_terms)))
    for ends, power in parts:
        done += _works(power, ends[:-1], np.diff(ends), times, done.shape[1])
    works = Flows(done, flows.energy_terms)
    gained = total - total[0]
    residual = gained - works.net
    allowed = max(_CLOSED * float(np.sum(np.max(np.abs(done), axis=0, initial=0.0))), _NOTHING)
    if allowed < float(np.max(np.abs(residual))) < np.inf:
        opened = np.abs(np.diff(residual))
        refined = [np.zeros(0, dtype=np.int64) for _ in parts]
        for spans in _worst(opened, allowed):
            for index, (ends, power) in enumerate(parts):
                steps = np.setdiff1d(_steps(ends, times, spans), refined[index])
                refined[index] = np.union1d(refined[index], steps)
                coarse, fine = _halved(power, ends[steps], np.diff(ends)[steps], _SMALL * allowed)
                if len(coarse[0]):
                    done += _works(power, *fine, times, done.shape[1]) - _works(power, *coarse, times, done.shape[1])
            works = Flows(done, flows.energy_terms)
            residual = gained - works.net
            if np.sum(np.abs(np.diff(residual))[spans]) > 0.5 * np.sum(opened[spans]):
                break
    return Account(stored=stored, powers=flows, works=works, residual=residual)


def _worst(opened: Array, allowed: float) -> Iterator[NDArray[np.int64]]:
    """Yield the spans of saved times with the largest residuals, which make up half of it, then the others.

    What it opens elsewhere is less than half of what is allowed, J. What stays open where halving steps does not help
    is no error of the quadrature.

    Args:
        opened: By how much it opens in each span, shape (m - 1,), J.
        allowed: Largest residual, J.
    """
    order = np.argsort(-opened)
    sums = np.cumsum(opened[order])
    half, most = np.searchsorted(sums, (0.5 * sums[-1], sums[-1] - 0.5 * allowed)) + 1
    yield order[:half]
    yield order[half:most]


def _steps(ends: Array, times: Array, spans: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the steps between saved times, up to a maximum number."""
    first = np.searchsorted(ends[1:-1], times[spans], side="right")
    last = np.searchsorted(ends[1:-1], times[spans + 1], side="left") + 1
    few = np.cumsum(last - first) <= _MOST_SUSPECTED
    chosen = zip(first[few], last[few], strict=True)
    return np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(np.arange(*each) for each in chosen)]))


def _halved(power: Callable[[Array], Array], begin: Array, length: Array, allowed: float) -> tuple[_Steps, _Steps]:
    """Return the steps, as begins and lengths, of which a work is wrong by more than is allowed, J, and those in place.

    They are halved until none is.
    """
    coarse: _Steps | None = None
    fine: list[_Steps] = []
    for _ in range(_HALVINGS):
        chunks = [slice(first, first + _CHUNK) for first in range(0, len(begin), _CHUNK)]
        errors = [_quadrature_error(power, begin[chunk], length[chunk]) for chunk in chunks]
        bent = np.concatenate([np.zeros(0), *errors]) > allowed
        if coarse is None:
            coarse = begin[bent], length[bent]
        else:
            fine.append((begin[~bent], length[~bent]))
        begin, length = begin[bent], 0.5 * length[bent]
        begin, length = np.concatenate([begin, begin + length]), np.tile(length, 2)
    fine.append((begin, length))
    begin, length = (np.concatenate(each) for each in zip(*fine, strict=True))
    order = np.argsort(begin)
    return coarse or fine[0], (begin[order], length[order])


def _quadrature_error(power: Callable[[Array], Array], begin: Array, length: Array) -> Array:
    """Return the error of the integral of any power over steps, shape (steps,), J."""
    one = np.tensordot(_WEIGHTS, _over(power, begin, length, _NODES), (0, 1))
    other = np.tensordot(_CHECK_WEIGHTS, _over(power, begin, length, _CHECKS), (0, 1))
    return np.asarray(np.max(np.abs(one - other), axis=1))


def _parts(loop: ClosedLoop, trajectory: Trajectory) -> list[_Part]:
    """Return breakpoints and powers of islands, or of the whole."""
    reached = trajectory.breakpoints[-1]
    parts: list[_Part] = []
    for island in trajectory.islands:
        ends = island.times
        parts.append((np.append(ends[ends < reached], reached), island.powers))

    def powers(times: Array) -> Array:
        return loop.powers(times, trajectory.interpolate(times))

    return parts or [(trajectory.breakpoints, powers)]


def _works(power: Callable[[Array], Array], begin: Array, length: Array, times: Array, count: int) -> Array:
    """Return the integrals of all powers over steps, in order, up to the saved times, shape (m, count), J.

    Inside a step the power is taken for the parabola through its values at the nodes: over whole steps that is the
    quadrature, and what it errs by inside a step does not add up.
    """
    works, reached = np.zeros((len(times), count)), np.zeros(count)
    for first in range(0, len(begin), _CHUNK):
        chunk = slice(first, first + _CHUNK)
        values = _over(power, begin[chunk], length[chunk], _NODES)
        before = np.vstack([reached, reached + np.cumsum(np.tensordot(_WEIGHTS, values, (0, 1)), axis=0)])
        until = np.append(begin, np.inf)[min(first + _CHUNK, len(begin))]
        rows = slice(*(int(at) for at in np.searchsorted(times, (begin[first], until))))
        step = np.searchsorted(begin[chunk], times[rows], side="right") - 1
        share = np.minimum((times[rows] - begin[chunk][step]) / length[chunk][step], 1.0)
        parts = np.vander(share, 4)[:, :3] @ _PARABOLAS
        works[rows] = before[step] + np.einsum("mn,mnp->mp", parts, values[step])
        reached = before[-1]
    return works


def _over(power: Callable[[Array], Array], begin: Array, length: Array, nodes: Array) -> Array:
    """Return the powers at nodes of steps, times the steps' lengths, shape (steps, nodes, count)."""
    times = (begin[:, None] + length[:, None] * nodes).ravel()
    weighted = power(times).reshape(len(begin), len(nodes), -1)
    weighted *= length[:, None, None]
    return weighted
