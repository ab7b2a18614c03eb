"""The energy account of a trajectory: powers integrated over time, and what is left unexplained."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from finger_pin.control.closed_loop import ClosedLoop, LoopSignals
from finger_pin.control.compiled import compiled_control
from finger_pin.core.control import Control
from finger_pin.core.evaluation import CompiledFinger
from finger_pin.core.integrator import integrate_compiled
from finger_pin.core.stepper import TABLEAUS, Stepper
from finger_pin.core.textbook import Trajectory
from finger_pin.description.routing import Array
from finger_pin.mechanism.kinematics import Motion
from finger_pin.simulation.energy import FINGERTIP, Flows, energies, powers

# Three-point Gauss quadrature on [0, 1]. All nodes are inside the step: a controller that is sampled changes its
# tensions at the ends of steps, where a node would see those of the next one.
_NODES = 0.5 + np.sqrt(0.15) * np.array([-1.0, 0.0, 1.0])
_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0
# Coefficients of u^3, u^2 and u in the integrals from 0 to u of the parabolas that are one at a node and zero at the
# other two, shape (3, 3).
_PARABOLAS = np.linalg.inv(np.vander(_NODES, 3)) / np.array([[3.0], [2.0], [1.0]])
_CHUNK = 4096
# What may stay open, of all energy exchanged and in J, before the stretches of the motion where most of it stands open
# are integrated again, and how finely; at most so many stretches, in about so many steps altogether.
_CLOSED, _NOTHING, _FINE = 1e-5, 1e-12, 1e-10
_MOST_REFINED, _MOST_STEPS = 500, 50_000
# A power may bend inside a step where no force does, as that which a limiter loses where it would have to pull: how
# often steps are halved there.
_HALVINGS = 8


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
    done: Array | None = None,
) -> Account:
    """Keep the energy account of a trajectory.

    Args:
        loop: The system.
        trajectory: Its solution.
        times: Saved times, shape (m,), beginning at the trajectory's start.
        signals: The signals at those times.
        motion: Fingertip and energies of the rigid body at those times.
        done: The integrals of all powers up to those times, `Works.values`, where they are known already.
    """
    booked = powers(signals.finger)
    if done is None:
        done = np.zeros((len(times), len(booked.names)))
        for part, ends, states in _apart(loop, trajectory):
            # A finger without motors, say, has fewer powers than the hand.
            columns = [booked.names.index(name) for name in (*part.finger.mechanism.books.powers, FINGERTIP)]
            done[:, columns] += Works(part, times).add(ends, states).values
    works = Flows(done, booked.names, booked.supplies)
    stored = energies(loop.finger, signals.finger, motion)
    total = np.sum(list(stored.values()), axis=0)
    gained = total - total[0]
    # A controller that acts in between is not asked again, and without the compiled core a method of scipy is as fine
    # as its tolerance: there the account stays as it is.
    compiled = loop.drives is None and isinstance(loop.dynamics, CompiledFinger)
    control, taken = compiled_control(loop) if compiled else None, 0
    for stretch in _open(gained - works.net, works.values, times, trajectory.breakpoints):
        if control is not None and taken < _MOST_STEPS:
            taken += _refine(loop, control, trajectory, stretch, times, works.values)
    return Account(stored=stored, powers=booked, works=works, residual=gained - works.net)


def _open(residual: Array, works: Array, times: Array, breakpoints: Array) -> list[tuple[float, float]]:
    """Return the stretches of steps in which the account does not close; none where all of it is as good as closed."""
    allowed = max(_CLOSED * float(np.sum(np.max(np.abs(works), axis=0, initial=0.0))), _NOTHING)
    if len(breakpoints) < 2 or not allowed < float(np.max(np.abs(residual))) < np.inf:
        return []
    jumps = np.abs(np.diff(residual))
    order = np.argsort(jumps)
    worst = order[np.cumsum(jumps[order]) > 0.1 * allowed][-_MOST_REFINED:]
    first = np.searchsorted(breakpoints, times[worst], side="right") - 1
    last = np.searchsorted(breakpoints, times[worst + 1], side="left")
    found: list[tuple[float, float]] = []
    for begin, end in sorted(zip(breakpoints[first], breakpoints[np.minimum(last, len(breakpoints) - 1)], strict=True)):
        # Every stretch begins anew on the motion that was simulated: they share no step.
        begin = max(begin, found[-1][1]) if found else begin
        if begin < end:
            found.append((float(begin), float(end)))
    return found


def _refine(
    loop: ClosedLoop, control: Control, trajectory: Trajectory, stretch: tuple[float, float], times: Array, works: Array
) -> int:
    """Integrate a stretch again, finely, and put its works in place of those of the steps that passed it.

    A step may end well and yet pass in between too far from the motion for its powers, as where a joint that starts
    deep in a stiff limiter is thrown back.

    Returns:
        Steps that it took.
    """
    begin, end = stretch
    start, tolerances = trajectory.interpolate(np.array([begin]))[0], _FINE * loop.finger.layout.scales()
    tableau = TABLEAUS["Rodas5P"]()
    stepper = Stepper(loop.finger.mechanism, control, start, tableau, _FINE, tolerances, loop.fingertip_force, begin)
    looks = itertools.count()
    fine = integrate_compiled(
        stepper,
        end,
        loop.finger.layout.names,
        knots=loop.knots(),
        chunk=_CHUNK,
        stop=lambda: next(looks) > _MOST_STEPS // _CHUNK,
    )
    if fine.failure or fine.interrupted:
        return fine.statistics.steps
    inside = (times > begin) & (times < end)
    at = np.append(times[inside], end)
    steps = trajectory.breakpoints[(trajectory.breakpoints >= begin) & (trajectory.breakpoints <= end)]
    allowed = 1e-3 * _CLOSED * float(np.sum(np.max(np.abs(works), axis=0)))
    more = Works(loop, at).add(_halved(loop, fine, allowed), fine.interpolate).values
    more -= Works(loop, at).add(steps, trajectory.interpolate).values
    works[inside] += more[:-1]
    works[times >= end] += more[-1]
    return fine.statistics.steps


def _halved(loop: ClosedLoop, trajectory: Trajectory, allowed: float) -> Array:
    """Return ends of steps, some of them halved until no work, J, changes by more than is allowed for one."""
    ends = trajectory.breakpoints
    for _ in range(_HALVINGS):
        middles = 0.5 * (ends[:-1] + ends[1:])
        both = [
            Works(loop, ends).add(panels, trajectory.interpolate).values for panels in (ends, np.union1d(ends, middles))
        ]
        bent = np.max(np.abs(np.diff(both[1] - both[0], axis=0)), axis=1) > allowed
        if not bent.any():
            break
        ends = np.union1d(ends, middles[bent])
    return ends


def _apart(loop: ClosedLoop, trajectory: Trajectory) -> list[tuple[ClosedLoop, Array, Callable[[Array], Array]]]:
    """Return loops with their breakpoints and states: of the fingers of a hand that move apart, or of the whole."""
    sizes = [part.finger.layout.size for part in loop.parts]
    if sizes and sizes == [len(places) for places, _, _ in trajectory.islands]:
        # Islands stand in the order of their first joint, as fingers do.
        return [(part, ends, states) for part, (_, ends, states) in zip(loop.parts, trajectory.islands, strict=True)]
    return [(loop, trajectory.breakpoints, trajectory.interpolate)]


class Works:
    """Integrals of all powers up to the saved times, taken over steps as they come.

    Inside a step the power is taken for the parabola through its values at the nodes: over whole steps that is the
    quadrature, and what it errs by inside a step does not add up.

    Attributes:
        values: Shape (m, powers + 1), J.
    """

    def __init__(self, loop: ClosedLoop, times: Array) -> None:
        """Begin at nothing; times have shape (m,), in order."""
        self._loop, self._times = loop, times
        count = len(loop.finger.mechanism.books.powers) + 1
        self.values, self._reached = np.zeros((len(times), count)), np.zeros(count)

    def add(self, ends: Array, states: Callable[[Array], Array]) -> Works:
        """Go on over steps, given by their ends with the start first, and what maps times to packed states."""
        for first in range(0, len(ends) - 1, _CHUNK):
            self._add(ends[first : first + _CHUNK + 1], states)
        return self

    def _add(self, ends: Array, states: Callable[[Array], Array]) -> None:
        begin, length = ends[:-1], np.diff(ends)
        nodes = (begin[:, None] + length[:, None] * _NODES).ravel()
        powers = self._loop.powers(nodes, states(nodes)).reshape(len(begin), len(_NODES), -1)
        values = powers * length[:, None, None]
        steps = sum(weight * values[:, node] for node, weight in enumerate(_WEIGHTS))
        before = self._reached + np.cumsum(steps, axis=0) - steps
        rows = saved(self._times, ends)
        times = self._times[rows]
        step = np.clip(np.searchsorted(begin, times, side="right") - 1, 0, None)
        share = np.vander((times - begin[step]) / length[step], 4)[:, :3] @ _PARABOLAS
        self.values[rows] = before[step] + sum(share[:, node, None] * values[step, node] for node in range(len(_NODES)))
        self._reached = before[-1] + steps[-1]


def saved(times: Array, ends: Array) -> slice:
    """Return which of the saved times lie in steps, those at their ends among them."""
    first, last = np.searchsorted(times, ends[0]), np.searchsorted(times, ends[-1] * (1.0 + 1e-12), side="right")
    return slice(int(first), int(last))
