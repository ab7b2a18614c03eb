"""Sensitivities of a run: derivatives of recorded variables by the parameters that the run is given.

The run is made again for every parameter, changed a little, on the same steps and on the same branches within each, so
that the difference is the derivative of what the integrator has computed (internal numerical differentiation: Bock,
"Numerical treatment of inverse problems in chemical reaction kinetics", 1981). Rates are continuous where they bend, so
that a bend that is passed a little later or sooner does not count; inputs that jump do so when the parameters say.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from finger_pin.core.stepping.trajectory import Trajectory
from finger_pin.core.threads import in_threads
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.simulation.recording import RunArrays
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
    """Return variations, made of the values with one of them changed, and the changes.

    At the edge of what is allowed a number is changed the other way.

    Args:
        values: p numbers.
        sizes: Of what size they are.
        make: Function of values.

    Raises:
        InputError: If neither way is allowed.
    """
    variations, changes = [], []
    for k, (value, size) in enumerate(zip(values, sizes, strict=True)):
        other = list(values)
        try:
            other[k] = value + CHANGE * size
            made = make(other)
        except InputError:
            other[k] = value - CHANGE * size
            made = make(other)
        variations.append(made)
        changes.append(other[k] - value)
    return variations, np.array(changes)


def with_exact_encoders(scenario: Scenario) -> Scenario:
    """Return a scenario whose position drives read exact angles.

    Between the steps of an encoder a loop would not feel what a parameter does to its angle: derivatives of a run are
    those of one that reads it exactly.
    """
    finger = scenario.finger
    rounding = {
        name: each.updated(motor={"encoder": {"resolution": 0.0}})
        for name, each in finger.actuators.items()
        if each.drive == "position" and each.motor.encoder is not None and each.motor.encoder.resolution > 0.0
    }
    return scenario.updated(finger={"actuators": finger.actuators | rounding}) if rounding else scenario


def nearby(trajectory: Trajectory, others: Sequence[Setup]) -> list[Trajectory]:
    """Return the trajectories of setups with one parameter changed each, on the steps of that of the unchanged one."""
    return in_threads(lambda other: other.integrate(steps=trajectory.steps), others)


def add_slopes(
    run: RunArrays, base: RunArrays, values: Sequence[float], moved: Sequence[RunArrays], changes: Array
) -> RunArrays:
    """Add the derivatives of all variables to a run, as `RunArrays.slopes`, and return it.

    Args:
        run: The run that is to have them.
        values: Numbers that it was given.
        base: The run on the steps of those with a number changed.
        moved: These, for each number.
        changes: By how much.
    """
    for name in run.variables:
        parts = [(each[name] - base[name]) / change for each, change in zip(moved, changes, strict=True)]
        run.slopes[name] = np.stack(parts) if parts else np.zeros((0, *run[name].shape))
    run.attrs["sensitivities_lost"] = _lost(run, np.abs(np.asarray(values, dtype=float)))
    return run


def _lost(run: RunArrays, sizes: Array) -> float:
    """Return the time at which the motion becomes too sensitive to a parameter, s; infinite if it never does."""
    first = np.inf
    for name, slope in run.slopes.items():
        scale = float(np.max(np.abs(run[name]), initial=0.0)) or 1.0
        gain = np.abs(slope).reshape(*slope.shape[:2], -1).max(axis=-1, initial=0.0) * sizes[:, None] / scale
        beyond = np.flatnonzero(gain.max(axis=0, initial=0.0) > _LOST)
        if len(beyond):
            first = min(first, float(run.time[beyond[0]]))
    return first
