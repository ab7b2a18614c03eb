"""Runs of one experiment: simulated in processes, and reduced to a few numbers each."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from finger_pin.description.routing import Array
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import IntegrationError, SelfLockingWarning, StudyError
from finger_pin.studies.many import simulate_many

Progress = Callable[[int], None]

_VARIABLES = (
    "tracking_error",
    "tendon_command",
    "tendon_tension",
    "tendon_friction",
    "joint_friction",
    "joint_reaction",
    "energy_exchanged_joint_coulomb",
    "energy_exchanged_tendon_coulomb",
)


@dataclass(frozen=True, eq=False)
class Measures:
    """What came out of m runs, after their start; shapes (m,).

    Attributes:
        error: Tracking error, root mean square over time and joints, rad.
        tension: Largest command of an actuated tendon, N.
        reaction: Joint reaction, the sum of the tensions that cross a joint, mean over time and joints, N.
        joint_friction: Joint friction torque, mean of its size over time and joints, N m.
        tendon_friction: Tendon friction force, mean of its size over time and tendons, N.
        joint_work: Lost by joints sliding, J.
        tendon_work: Lost by tendons sliding, J.
    """

    error: Array
    tension: Array
    reaction: Array
    joint_friction: Array
    tendon_friction: Array
    joint_work: Array
    tendon_work: Array

    def part(self, chosen: slice) -> Measures:
        """Return some of the runs."""
        return Measures(**{name: getattr(self, name)[chosen] for name in self.__dataclass_fields__})


def simulated(
    scenarios: Sequence[Scenario], variables: Sequence[str] | None = None, progress: Progress | None = None
) -> xr.Dataset:
    """Return the runs of `simulate_many`, all of them finished.

    Args:
        scenarios: What to simulate, of one duration.
        variables: What to keep; all by default.
        progress: Called with the number of runs that have been finished since its last call.

    Raises:
        IntegrationError: If a run could not be finished.
    """
    before = 0

    def tell(done: int, total: int) -> None:
        nonlocal before
        if progress is not None:
            progress(done - before)
        before = done

    with warnings.catch_warnings():
        # Experiments go to the edge on purpose.
        warnings.simplefilter("ignore", SelfLockingWarning)
        try:
            runs = simulate_many(scenarios, variables=variables, progress=tell)
        except StudyError as error:
            runs = error.result
    for failure, end in zip(runs["failure"].values, runs["end_time"].values, strict=True):
        if failure:
            raise IntegrationError(float(end), str(failure), "other factors of friction, tension or speed")
    return runs


def measured(
    scenarios: Sequence[Scenario], actuated: int, settling: float, progress: Progress | None = None
) -> Measures:
    """Simulate scenarios of one duration, and measure what comes after ``settling``, s."""
    runs = simulated(scenarios, _VARIABLES, progress).sel(time=slice(settling, None))

    def mean(name: str, dimension: str) -> Array:
        return np.asarray(abs(runs[name]).mean(("time", dimension)).values)

    def work(name: str) -> Array:
        values = runs[f"energy_exchanged_{name}_coulomb"].transpose("run", "time").values
        return np.asarray(values[:, -1] - values[:, 0])

    command = runs["tendon_command"].isel(tendon=slice(actuated))
    return Measures(
        error=np.sqrt((runs["tracking_error"] ** 2).mean(("time", "joint")).values),
        tension=command.max(("time", "tendon")).values,
        reaction=mean("joint_reaction", "joint"),
        joint_friction=mean("joint_friction", "joint"),
        tendon_friction=mean("tendon_friction", "tendon"),
        joint_work=work("joint"),
        tendon_work=work("tendon"),
    )
