"""Sensitivities of a run: derivatives of what is recorded by the numbers that the run is given.

A run whose steps are free is no smooth function of its numbers: a step more or less changes it by its tolerance. So the
run is made once, then again for every number, changed a little, on the same steps (internal numerical differentiation:
Bock, "Numerical treatment of inverse problems in chemical reaction kinetics", 1981). What comes out is the derivative
of what the integrator has computed, through start, tables, controllers and outputs alike; rejected steps are not
repeated, and the runs go on side by side. Where bodies touch and part, steps end at the touch, which moves with the
numbers: there the runs are made on steps of their own, tight, with a larger change to either side.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from finger_pin.core.stepping.stepper import in_threads
from finger_pin.description.routing import Array
from finger_pin.exceptions import InputError
from finger_pin.simulation.run_arrays import RunArrays

#: Loosest tolerances of a run that is differentiated, on common steps and on steps of its own.
TIGHT, TIGHTER = 1e-8, 1e-9
# Changes of a number, of its size: on common steps far above rounding; on others also far above the tolerances.
_CHANGE, _LARGE = 1e-8, 1e-4
# A signal that changes so much more than its number does, both of their size, says nothing of the number any more.
_LOST = 1e4

Again = Callable[[Sequence[float]], RunArrays]


def add_slopes(run: RunArrays, values: Sequence[float], again: Again, *, apart: bool) -> RunArrays:
    """Put the derivatives of all variables into a run, as `RunArrays.slopes`, and return it.

    Args:
        run: What is to have them.
        values: Numbers that it was given.
        again: Makes the run with other values.
        apart: Whether on steps of their own.
    """

    def moved(k: int, change: float) -> tuple[float, RunArrays]:
        other = list(values)
        other[k] += change * (abs(values[k]) or 1.0)
        return other[k], again(other)

    def slope(k: int) -> dict[str, Array]:
        size, ends = _LARGE if apart else _CHANGE, []
        for change in (size, -size):
            try:
                ends.append(moved(k, change))
            except InputError:
                # At the edge of what is allowed there is one side only.
                continue
            if len(ends) == 1 and not apart:
                break
        if len(ends) < 2:
            ends.append((values[k], run))
        (right, up), (left, down) = ends
        return {name: (up[name] - down[name]) / (right - left) for name in run.variables}

    found = in_threads(slope, range(len(values)))
    for name in run.variables:
        run.slopes[name] = np.stack([each[name] for each in found]) if found else np.zeros((0, *run[name].shape))
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
