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

from finger_pin.core.steps.trajectory import Trajectory
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.simulation.recording import RunArrays
from finger_pin.simulation.setup import Setup
from finger_pin.threads import in_threads
from finger_pin.typing import Array

#: Change of a number, of its size: far above rounding, far below where anything bends.
RELATIVE_CHANGE = 1e-7
# A signal that changes so much more than its number does, both of their size, says nothing of the number any more.
_LARGEST_GAIN = 1e4

_Variation = TypeVar("_Variation")


def make_variations(
    values: Sequence[float], sizes: Sequence[float], make: Callable[[list[float]], _Variation]
) -> tuple[list[_Variation], Array]:
    """Return the results of a function of the values with one of them changed each, and the changes.

    A value at the edge of its range is changed the other way.

    Args:
        values: p numbers.
        sizes: Their magnitudes.
        make: Function of values.
    """
    variations, changes = [], []
    for k, (value, size) in enumerate(zip(values, sizes, strict=True)):
        varied = list(values)
        try:
            varied[k] = value + RELATIVE_CHANGE * size
            variation = make(varied)
        except InputError:
            varied[k] = value - RELATIVE_CHANGE * size
            variation = make(varied)
        variations.append(variation)
        changes.append(varied[k] - value)
    return variations, np.array(changes)


def with_exact_encoders(scenario: Scenario) -> Scenario:
    """Return a scenario whose position drives read exact angles.

    A small change of the angle stays within one step of an encoder, so that derivatives are those of a run that reads
    it exactly.
    """
    finger = scenario.finger
    exact = {
        name: each.updated(motor={"encoder": {"resolution": 0.0}})
        for name, each in finger.actuators.items()
        if each.drive == "position" and each.motor.encoder is not None and each.motor.encoder.resolution > 0.0
    }
    return scenario.updated(finger={"actuators": finger.actuators | exact}) if exact else scenario


def repeat_steps(trajectory: Trajectory, setups: Sequence[Setup]) -> list[Trajectory]:
    """Return the trajectories of setups with one parameter changed each, on the steps of that of the unchanged one."""
    return in_threads(lambda setup: setup.integrate(steps=trajectory.steps), setups)


def add_slopes(
    run: RunArrays, base: RunArrays, values: Sequence[float], varied_runs: Sequence[RunArrays], changes: Array
) -> RunArrays:
    """Add the derivatives of all variables to a run, as `RunArrays.slopes`, and return it.

    Args:
        run: The run that gets them.
        values: Numbers that it was given.
        base: The run on the steps of those with a number changed.
        varied_runs: Runs with one value changed, for each value.
        changes: By how much.
    """
    for name in run.variables:
        slopes = [(each[name] - base[name]) / change for each, change in zip(varied_runs, changes, strict=True)]
        run.slopes[name] = np.stack(slopes) if slopes else np.zeros((0, *run[name].shape))
    run.attrs["sensitivities_lost"] = _loss_time(run, np.abs(np.asarray(values, dtype=float)))
    return run


def _loss_time(run: RunArrays, sizes: Array) -> float:
    """Return the time at which the motion becomes too sensitive to a parameter, s; infinite if it never does."""
    loss_time = np.inf
    for name, slope in run.slopes.items():
        scale = float(np.max(np.abs(run[name]), initial=0.0)) or 1.0
        gain = np.abs(slope).reshape(*slope.shape[:2], -1).max(axis=-1, initial=0.0) * sizes[:, None] / scale
        beyond = np.flatnonzero(gain.max(axis=0, initial=0.0) > _LARGEST_GAIN)
        if len(beyond):
            loss_time = min(loss_time, float(run.time[beyond[0]]))
    return loss_time
