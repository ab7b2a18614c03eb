"""Runs of the experiments: scenarios with more or less friction, tension or speed, and their measurements."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from finger_pin.analysis import self_locking_margin
from finger_pin.description.routing import Routing
from finger_pin.description.scenario import Scenario
from finger_pin.description.signals import JointReference
from finger_pin.description.validation import Numbers, expand
from finger_pin.exceptions import IntegrationError, ScenarioWarning, StudyError
from finger_pin.references.reference import SignalReference
from finger_pin.studies.batch import simulate_many
from finger_pin.typing import Array

Progress = Callable[[int], None]
#: Half a period of the swing in which a finger is led to self-locking, s.
SWING = 2.0

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
    """Measurements of m runs, after their start; shapes (m,).

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
        scenarios: Scenarios to simulate, of one duration.
        variables: Variables to keep; all by default.
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
        warnings.simplefilter("ignore", ScenarioWarning)
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
    """Simulate scenarios of one duration, and measure from the time ``settling``, s, on."""
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


def scaled(value: Numbers, factor: float) -> Numbers:
    """Return one number, or one for each, times a factor."""
    return tuple(factor * each for each in value) if isinstance(value, tuple) else factor * value


def with_joint_friction(scenario: Scenario, factor: float) -> Scenario:
    """Return a scenario with M^d and M^c of the joints times a factor."""
    law = scenario.finger.joint_friction
    more = {"coulomb": scaled(law.coulomb, factor), "stiction": scaled(law.stiction, factor)}
    return scenario.updated(finger={"joint_friction": more})


def with_tendon_friction(scenario: Scenario, factor: float) -> Scenario:
    """Return a scenario with mu_e of the tendons times a factor."""
    coulomb = scaled(scenario.finger.tendon_friction.coulomb, factor)
    return scenario.updated(finger={"tendon_friction": {"coulomb": coulomb}})


def with_minimum_tension(scenario: Scenario, tension: float) -> Scenario:
    """Return a scenario with f0 in N for all tendons."""
    return scenario.updated(controller={"minimum_tension": tension})


def with_passive_tension(scenario: Scenario, tension: tuple[float, ...]) -> Scenario:
    """Return a scenario whose references (20) let passive tendons carry f5^d, N."""
    return scenario.updated(controller={"passive_tension": tension})


def weightless(scenario: Scenario) -> Scenario:
    """Return a scenario without gravity."""
    return scenario.updated(finger={"gravity": (0.0, 0.0, 0.0)})


def lasting(scenario: Scenario, duration: float, samples: int) -> Scenario:
    """Return a scenario of another duration, s, with about so many samples."""
    return scenario.updated(simulation={"duration": duration, "sample_rate": samples / duration})


def at_speed(scenario: Scenario, factor: float) -> Scenario:
    """Return a scenario whose reference runs through the same motion in its time over a factor."""
    joints = {name: joint.faster(factor) for name, joint in scenario.reference.joints.items()}
    settings = scenario.simulation
    quicker = {"duration": settings.duration / factor, "sample_rate": settings.sample_rate * factor}
    return scenario.updated(reference={"joints": joints}, simulation=quicker)


def swinging_to_lock(scenario: Scenario) -> Scenario:
    """Return a scenario whose joints swing once through their ranges, in the directions closest to self-locking."""
    margin = self_locking_margin(scenario)
    routing = Routing.from_description(scenario.finger)
    wanted = SignalReference.from_scenario(scenario, routing).at(scenario.sample_times()).position
    low, high = wanted.min(axis=0), wanted.max(axis=0)
    joints = {
        name: JointReference(
            offset=0.5 * float(low[index] + high[index]),
            amplitude=-0.5 * float(margin.directions[index] * (high[index] - low[index])),
            frequency=0.5 / SWING,
            phase=0.5 * np.pi,
        )
        for name in scenario.reference.joints
        for index in [routing.joints.index(name)]
    }
    return lasting(scenario.updated(reference={"joints": joints}), SWING, 200)


def internal_passive_tension(scenario: Scenario) -> tuple[float, ...]:
    """Return the tension that (21), (22) plan for the passive tendons at zero torque: lambda f^k, N."""
    routing = Routing.from_description(scenario.finger)
    internal = routing.force_closure().tension
    level = np.max(expand(scenario.controller.minimum_tension, len(internal)) / internal)
    return tuple(float(each) for each in level * internal[routing.actuated :])
