"""Sensitivities of a run: derivatives of recorded variables by the numbers that the run is given.

They obey a linear equation along the motion, which is solved by itself: S' = A S + E, where A is exact and E a
difference of rates (`core.stepping.collocation`), with relative errors of about the root of the run's tolerance.
Sampled controllers and loops of motors act in between, in Python or with a memory of their own, and some numbers give a
mechanism more rows than it has: there the run is made again for every number, changed a little, on the same steps,
which is the derivative of what the integrator has computed (internal numerical differentiation: Bock, "Numerical
treatment of inverse problems in chemical reaction kinetics", 1981).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from finger_pin.core.stepping.integrator import joined
from finger_pin.core.stepping.island_motion import IslandMotion
from finger_pin.core.stepping.sensitivity_equations import NearbyMotion, differentiate, fits
from finger_pin.core.stepping.stepper import Stepper
from finger_pin.core.stepping.trajectory import Trajectory
from finger_pin.core.threads import in_threads
from finger_pin.exceptions import InputError
from finger_pin.simulation.run_arrays import RunArrays
from finger_pin.simulation.setup import Setup
from finger_pin.typing import Array

#: Change of a number, of its size: far above rounding, far below where anything bends.
CHANGE = 1e-7
# A signal that changes so much more than its number does, both of their size, says nothing of the number any more.
_LOST = 1e4

_Made = TypeVar("_Made")


def changed(
    values: Sequence[float], sizes: Sequence[float], make: Callable[[list[float]], _Made]
) -> tuple[list[_Made], Array]:
    """Return the things made of values with one of them changed each, and the changes.

    At the edge of what is allowed a number is changed the other way.

    Args:
        values: p numbers.
        sizes: Of what size they are.
        make: Function of values.

    Raises:
        InputError: If neither way is allowed.
    """
    found, changes = [], []
    for k, (value, size) in enumerate(zip(values, sizes, strict=True)):
        other = list(values)
        try:
            other[k] = value + CHANGE * size
            made = make(other)
        except InputError:
            other[k] = value - CHANGE * size
            made = make(other)
        found.append(made)
        changes.append(other[k] - value)
    return found, np.array(changes)


def on_steps_of(trajectory: Trajectory, setup: Setup) -> Trajectory:
    """Return the trajectory of a setup that has not been run, on the steps of another one, taken whole.

    When steps were chosen, some were cut out of longer ones, and err otherwise: what is compared is run on them anew.
    """
    return setup.integrate(steps=trajectory.ends or (trajectory.breakpoints,))


def nearby(
    setup: Setup, trajectory: Trajectory, others: Sequence[Setup], changes: Array, allowed: float = 0.0
) -> list[Trajectory]:
    """Return the motions that changed numbers make of one, to first order.

    Args:
        setup: The setup of the run.
        trajectory: Its trajectory.
        others: The same with one number changed each.
        changes: By how much, shape (p,).
        allowed: Relative error of the derivatives, roughly; at the least the root of the run's tolerance.
    """
    motions = [each for each in trajectory.islands if isinstance(each, IslandMotion)]
    steppers = [each.stepper() for each in (setup, *others)] if motions else []
    near = [k for k, each in enumerate(steppers[1:]) if fits(motions, each.parts)]
    found: dict[int, Trajectory] = {}
    if near:
        chosen = [steppers[0], *(steppers[k + 1] for k in near)]
        knots = [each.loop.knots(each.scenario.simulation.rtol) for each in (setup, *(others[k] for k in near))]
        allowed = max(allowed, float(np.sqrt(setup.scenario.simulation.rtol)))
        linear = _linear(motions, chosen, knots, changes[near], allowed)
        for k, stepper, moved in zip(near, chosen[1:], linear, strict=False):
            found[k] = replace(trajectory, interpolate=joined(stepper, moved), islands=())

    def again(k: int) -> Trajectory:
        return found[k] if k in found else on_steps_of(trajectory, others[k])

    return in_threads(again, range(len(others)))


def _linear(
    motions: Sequence[IslandMotion], steppers: Sequence[Stepper], knots: Sequence[Array], changes: Array, allowed: float
) -> list[list[NearbyMotion]]:
    """Return the motions of all islands with each number changed; none if a linear system is singular."""

    def of(island: int) -> list[NearbyMotion]:
        motion = motions[island]
        derivative = differentiate(motion, [each.parts[island] for each in steppers], knots, changes, allowed)
        if derivative is None:
            return []
        return [NearbyMotion(derivative, k, float(change)) for k, change in enumerate(changes)]

    by_island = in_threads(of, range(len(motions)))
    return [list(each) for each in zip(*by_island, strict=True)] if all(by_island) else []


def add_slopes(run: RunArrays, values: Sequence[float], moved: Sequence[RunArrays], changes: Array) -> RunArrays:
    """Put the derivatives of all variables into a run, as `RunArrays.slopes`, and return it.

    Args:
        run: The run that is to have them.
        values: Numbers that it was given.
        moved: The run with each number changed.
        changes: By how much.
    """
    for name in run.variables:
        parts = [(each[name] - run[name]) / change for each, change in zip(moved, changes, strict=True)]
        run.slopes[name] = np.stack(parts) if parts else np.zeros((0, *run[name].shape))
    run.attrs["sensitivities_lost"] = _lost(run, np.abs(np.asarray(values, dtype=float)))
    return run


def _lost(run: RunArrays, sizes: Array) -> float:
    """Return the time from which on some number sways the motion beyond all measure, s; infinite if none does."""
    first = np.inf
    for name, slope in run.slopes.items():
        scale = float(np.max(np.abs(run[name]), initial=0.0)) or 1.0
        gain = np.abs(slope).reshape(*slope.shape[:2], -1).max(axis=-1, initial=0.0) * sizes[:, None] / scale
        beyond = np.flatnonzero(gain.max(axis=0, initial=0.0) > _LOST)
        if len(beyond):
            first = min(first, float(run.time[beyond[0]]))
    return first
