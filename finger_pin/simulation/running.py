"""Run a scenario, check accuracy and energy balance, and return the Dataset."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from typing import TypeVar

import xarray as xr

from finger_pin.analysis.locking_margin import locking_advice, quick_margin
from finger_pin.analysis.passivity import micro_damping_advice
from finger_pin.cancellation import CancelToken, Stop
from finger_pin.control.closed_loop import ClosedLoop, LoopSignals
from finger_pin.core.stepping.trajectory import Trajectory
from finger_pin.description.loading import to_toml
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import (
    AccuracyWarning,
    IntegrationError,
    Interrupted,
    MicroDampingWarning,
    SelfLockingWarning,
)
from finger_pin.simulation.accuracy import CHUNK, left_open, open_account, ringing, too_stiff
from finger_pin.simulation.recording import RunArrays, check_memory, finite_part, only, record, refuse_unknown
from finger_pin.simulation.sampled_trajectory import SampledTrajectory
from finger_pin.simulation.setup import ADVICE, CHUNK_OBSERVED, Setup
from finger_pin.simulation.variables import variables
from finger_pin.typing import Array

Found = TypeVar("Found", xr.Dataset, RunArrays)


def run(
    scenario: Scenario,
    loop: ClosedLoop | None = None,
    custom: str = "",
    control_period: float | None = None,
    progress: Callable[[float], None] | None = None,
    observe: Callable[[float, LoopSignals], None] | None = None,
    stop: Stop | None = None,
    names: Sequence[str] | None = None,
) -> xr.Dataset:
    """Simulate a given loop as `simulate` does; Ctrl-C is left to the caller.

    Args:
        scenario: The scenario to simulate.
        loop: Its loop, where something in it is a user's own.
        custom: Names of the parts given in place of the scenario's, from `custom_parts`.
        control_period: As for `simulate`, like what follows.
        progress: Called with the simulated time, s.
        observe: Called with the simulated time, s, and all signals.
        stop: Asked now and then.
        names: Of the variables to keep; by default all.
    """
    loop = loop or ClosedLoop.from_scenario(scenario)
    needed = None if names is None else [*names, *_judged(loop, names)]
    check_memory(scenario.simulation, loop.finger)
    driving = micro_damping_advice(scenario.finger)
    if driving:
        warnings.warn(driving, MicroDampingWarning, stacklevel=5)
    setup = Setup.from_scenario(scenario, loop, custom, control_period)
    loop = setup.loop

    def watch(time: float, x: Array) -> None:
        if progress is not None:
            progress(time)
        if observe is not None:
            observe(time, loop.evaluate(time, x))

    watched = progress is not None or observe is not None
    trajectory = setup.integrate(watch if watched else None, stop, chunk=CHUNK if observe is None else CHUNK_OBSERVED)
    margin = _margin(scenario, loop, custom)
    close = locking_advice(math.inf if margin is None else margin)
    if close:
        warnings.warn(close, SelfLockingWarning, stacklevel=5)
    sampled = SampledTrajectory(loop, trajectory, scenario.sample_times())
    result = record(scenario, sampled, setup.method, needed, text=to_toml(scenario))
    slow = ringing(loop, trajectory)
    stiff = too_stiff(result, loop.finger, scenario.simulation.atol_scale)
    if stiff:
        warnings.warn(stiff, AccuracyWarning, stacklevel=5)
    if margin is not None:
        result.attrs["self_locking_margin"] = margin
    gap = "" if trajectory.failure else open_account(result, left_open(result))
    warned = {"self_locking": close, "micro_damping": driving, "accuracy": stiff, "account": gap, "ringing": slow}
    notes = {**warned, "custom": custom}
    result.attrs |= {name: text for name, text in notes.items() if text}
    if names is not None:
        result = only(result, names)
    return _raise_if_incomplete(setup, trajectory, result, slow)


def _judged(loop: ClosedLoop, names: Sequence[str]) -> list[str]:
    """Return the variables by which a run is judged: its energy account, and the gaps of contacts.

    Raises:
        InputError: If a result has none of some name.
    """
    table = variables(loop)
    refuse_unknown("variables", names, table)
    judged = [name for name, each in table.items() if each.energy_term is not None and each.units == "J"]
    return [name for name in (*judged, "energy_residual", "contact_gap") if name in table and name not in names]


def _raise_if_incomplete(setup: Setup, trajectory: Trajectory, result: xr.Dataset, slow: str) -> xr.Dataset:
    """Return the result of a run that reached its end; raise with the partial result of any other."""
    reached = float(trajectory.breakpoints[-1])
    result, excess = finite_part(result)
    if trajectory.failure:
        reason, advice = setup.failure(trajectory, slow)
        raise IntegrationError(reached, reason, advice, result)
    if excess:
        reason, reached = f"{excess} is not finite after that", result.attrs["end_time"]
        raise IntegrationError(reached, reason, ADVICE, result)
    if trajectory.interrupted:
        result.attrs["interrupted"] = f"interrupted at t = {reached:.6g} s of {setup.scenario.simulation.duration:g} s"
        raise Interrupted(reached, result)
    return result


def _margin(scenario: Scenario, loop: ClosedLoop, custom: str) -> float | None:
    """Return the margin of the joints' friction to self-locking, or None without a planned reference.

    The margin is that of the paper's controller on the scenario's reference.
    """
    planned = all(part.controller.kind == "proportional" for part in scenario.parts().values())
    if not planned or {"controller", "reference"} & set(custom.split(", ")):
        return None
    if not loop.finger.routing.force_closure().holds:
        return None
    return quick_margin(scenario, loop.reference)


def interruptible(run: Callable[[Stop], Found], stop: Stop | None) -> Found:
    """Return the result of a run that Ctrl-C or a `Stop` can end.

    Raises:
        Interrupted: After Ctrl-C or such a stop, with what the run has computed.
    """
    with CancelToken(stop) as token:
        outcome = run(token)
    if token.cancelled:
        # It came after the last step.
        whole = outcome.dataset() if isinstance(outcome, RunArrays) else outcome
        raise Interrupted(float(outcome.attrs["end_time"]), whole)
    return outcome
