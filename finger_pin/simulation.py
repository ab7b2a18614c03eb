"""Simulate a scenario: from its description to a Dataset of everything that happened."""

from __future__ import annotations

import xarray as xr

from finger_pin.blocks.controller import Controller
from finger_pin.closed_loop import ClosedLoop, Reference
from finger_pin.exceptions import IntegrationError, Interrupted
from finger_pin.integration import Progress, Stop, integrate
from finger_pin.recording import record
from finger_pin.scenario import Scenario

_ADVICE = "a smaller simulation.rtol, another simulation.method, or softer contacts and tendons"


def simulate(
    scenario: Scenario,
    *,
    controller: Controller | None = None,
    reference: Reference | None = None,
    progress: Progress | None = None,
    stop: Stop | None = None,
) -> xr.Dataset:
    """Simulate a scenario from rest on its reference.

    Args:
        scenario: What to simulate, from `load_scenario`.
        controller: Replaces the scenario's controller; called at every evaluation.
        reference: Replaces the scenario's reference.
        progress: Called with the simulated time, s, after every step.
        stop: Asked after every step; when it returns true the simulation ends there.

    Returns:
        Every signal of the model at the scenario's sample rate, and the energy account.

    Raises:
        IntegrationError: If the integrator cannot go on; its ``result`` holds what was computed.
        Interrupted: If ``stop`` returned true; its ``result`` holds what was computed.
    """
    loop = ClosedLoop.from_scenario(scenario, controller, reference)
    settings = scenario.simulation
    trajectory = integrate(
        loop.rhs,
        loop.initial_state(),
        settings.duration,
        method=settings.method,
        rtol=settings.rtol,
        atol=settings.atol_scale * loop.finger.layout.scales(),
        progress=progress,
        stop=stop,
    )
    reached = float(trajectory.breakpoints[-1])
    result = record(scenario, loop, trajectory)
    if trajectory.failure:
        raise IntegrationError(reached, trajectory.failure, _ADVICE, result)
    if trajectory.interrupted:
        raise Interrupted(reached, result)
    return result
