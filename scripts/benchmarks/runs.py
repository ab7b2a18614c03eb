"""Single integrations of a scenario, and their distance from the truth."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

import finger_pin as fp
from benchmarks.timing import clocked
from finger_pin.control.closed_loop import ClosedLoop, compiled_control
from finger_pin.core.jit import CompiledFunction, call_at, unpack
from finger_pin.core.stepping.integrator import integrate_compiled
from finger_pin.core.stepping.solve_ivp import integrate
from finger_pin.core.stepping.stepper import TABLEAUS, Stepper
from finger_pin.core.tables.model import MODEL
from finger_pin.description.scenario import Scenario
from finger_pin.typing import Array

TEXTBOOK = ("BDF", "LSODA", "Radau")
SUNDIALS = "CVODE, compiled"
#: Integrates; returns joint positions at the sample times, shape (m, n), rad, and statistics if there are any.
Job = Callable[[], tuple[Array, Any]]


class Failed(Exception):
    """An integration did not reach its end."""


@dataclass(frozen=True)
class Point:
    """One run: its tolerance, its cost and its distance from the truth.

    Attributes:
        method: Name of the method.
        rtol: Relative tolerance; atol is the same times the scales of the state.
        error: Root mean square over all joints at the sample times, rad; None if it failed.
        worst: Largest error, rad.
        integration: Wall time until the states at the sample times are there, s.
        whole: Wall time of `finger_pin.simulate`, s, with all signals and the energy account; None if not measured.
        steps: Accepted steps.
        evaluations: Evaluations of the right-hand side.
    """

    method: str
    rtol: float
    error: float | None
    worst: float | None
    integration: float
    whole: float | None
    steps: int
    evaluations: int


def settled(scenario: Scenario, **settings: Any) -> Scenario:
    """Return a scenario with other simulation settings."""
    return scenario.updated(simulation=settings)


def truth(scenario: Scenario) -> tuple[Array, dict[str, float]]:
    """Return joint positions at the sample times, shape (m, n), rad, and the distance of two tight methods, rad."""
    tight = [
        fp.simulate(settled(scenario, method=method, rtol=1e-9, atol_scale=1e-10))["joint_position"].values
        for method in ("Rodas5P", "Rodas4")
    ]
    difference = tight[1] - tight[0]
    return tight[0], {"rms": rms(difference), "worst": float(abs(difference).max())}


def rms(difference: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(difference**2)))


def stepper(loop: ClosedLoop, method: str, rtol: float) -> Stepper:
    """Return a loop ready to be integrated by a compiled method."""
    finger, control = loop.finger, compiled_control(loop)
    assert control is not None
    atol, tableau = rtol * finger.layout.scales(), TABLEAUS[method]()
    return Stepper(finger.mechanism, control, loop.initial_state(), tableau, rtol, atol, loop.fingertip_force)


def compiled(scenario: Scenario, method: str, rtol: float) -> Job:
    """Return a job that integrates with a compiled method; it gives joint positions and statistics."""
    loop = ClosedLoop.from_scenario(scenario)
    times, joints = scenario.sample_times(), len(loop.finger.routing.joints)
    start, names = stepper(loop, method, rtol), loop.finger.layout.names

    def job() -> tuple[Array, Any]:
        trajectory = integrate_compiled(start.copy(), scenario.simulation.duration, names)
        if trajectory.failure:
            raise Failed(trajectory.failure)
        return trajectory.interpolate(times)[:, :joints], trajectory.statistics

    return job


def textbook(scenario: Scenario, method: str, rtol: float) -> Job:
    """Return a job that integrates the NumPy right-hand side with one of scipy's methods."""
    loop = ClosedLoop.from_scenario(scenario)
    times, joints = scenario.sample_times(), len(loop.finger.routing.joints)
    atol = rtol * loop.finger.layout.scales()

    def job() -> tuple[Array, Any]:
        duration = scenario.simulation.duration
        trajectory = integrate(loop.rhs, loop.initial_state(), duration, method=method, rtol=rtol, atol=atol)
        if trajectory.failure:
            raise Failed(trajectory.failure)
        return trajectory.interpolate(times)[:, :joints], trajectory.statistics

    return job


def has_sundials() -> bool:
    """Return whether scikit-sundae is installed."""
    return importlib.util.find_spec("sksundae") is not None


@CompiledFunction
def _evaluate(address: int, time: float) -> int:
    model = unpack(address, MODEL)
    return call_at(model.evaluate, address, time)


def sundials(scenario: Scenario, rtol: float) -> Job:
    """Return a job that integrates the compiled right-hand side with CVODE's BDF of SUNDIALS (scikit-sundae)."""
    from sksundae.cvode import CVODE

    loop = ClosedLoop.from_scenario(scenario)
    times, joints = scenario.sample_times(), len(loop.finger.routing.joints)
    atol = rtol * loop.finger.layout.scales()
    (part,) = stepper(loop, "Rodas5P", rtol).parts
    model = part.model.model

    def rhs(time: float, x: Array, rate: Array) -> None:
        model.state[:] = x
        _evaluate(part.model.address, time)
        rate[:] = model.rate

    def job() -> tuple[Array, Any]:
        solver = CVODE(rhs, method="BDF", rtol=rtol, atol=atol, max_num_steps=10**7)
        solution = solver.solve(times, loop.initial_state())
        if not solution.success:
            raise Failed(str(solution.message))
        return solution.y[:, :joints], None

    return job


def point(method: str, rtol: float, job: Job, exact: Array) -> Point:
    """Return cost and distance from the truth of one run of a job; a failure has no error."""
    try:
        elapsed, (found, statistics) = clocked(job)
    except Failed:
        return Point(method, rtol, None, None, 0.0, None, 0, 0)
    difference = found - exact
    steps, evaluations = (statistics.steps, statistics.evaluations) if statistics else (0, 0)
    return Point(method, rtol, rms(difference), float(abs(difference).max()), elapsed, None, steps, evaluations)
