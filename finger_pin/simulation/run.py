"""Run a scenario, check accuracy and energy balance, and return the Dataset."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from typing import TypeVar

import xarray as xr

from finger_pin.analysis.locking_margin import locking_advice, quick_margin
from finger_pin.analysis.passivity import micro_damping_advice
from finger_pin.analysis.path_jumps import path_jump_advice
from finger_pin.analysis.weight import weight_advice
from finger_pin.cancellation import CancelToken, Stop
from finger_pin.control.build import closure_advice
from finger_pin.control.closed_loop import ClosedLoop, LoopSignals
from finger_pin.core.steps.trajectory import Trajectory
from finger_pin.description.loading import to_toml
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import (
    AccuracyWarning,
    ClosureWarning,
    IntegrationError,
    Interrupted,
    MicroDampingWarning,
    PathJumpWarning,
    SelfLockingWarning,
)
from finger_pin.simulation.accuracy import (
    CHUNK_STEPS,
    account_warning,
    residual_share,
    ringing_warning,
    stiffness_warning,
)
from finger_pin.simulation.recording import RunArrays, check_memory, check_variables, finite_part, record, select
from finger_pin.simulation.sampled_trajectory import SampledTrajectory
from finger_pin.simulation.setup import ADVICE, OBSERVED_CHUNK, Setup
from finger_pin.simulation.variables import variables
from finger_pin.typing import Array

RunResult = TypeVar("RunResult", xr.Dataset, RunArrays)


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
        loop: Its loop, where a part of it is custom.
        custom: Names of the parts given in place of the scenario's, from `custom_parts`.
        control_period: As for `simulate`, like what follows.
        progress: Called with the simulated time, s.
        observe: Called with the simulated time, s, and all signals.
        stop: Called now and then; true ends the run.
        names: Of the variables to keep; by default all.
    """
    loop = loop or ClosedLoop.from_scenario(scenario)
    recorded_names = None if names is None else [*names, *_accuracy_variables(loop, names)]
    check_memory(scenario.simulation, loop.finger)
    damping_message = micro_damping_advice(scenario.finger)
    if damping_message:
        warnings.warn(damping_message, MicroDampingWarning, stacklevel=5)
    closure_message = closure_advice(loop.controller)
    if closure_message:
        warnings.warn(closure_message, ClosureWarning, stacklevel=5)
    setup = Setup.from_scenario(scenario, loop, custom, control_period)
    loop = setup.loop
    jump_message = path_jump_advice(loop.finger, loop.finger.layout.unpack(loop.initial_state()).position)
    if jump_message:
        warnings.warn(jump_message, PathJumpWarning, stacklevel=5)
    if setup.touch_warning:
        warnings.warn(setup.touch_warning, AccuracyWarning, stacklevel=5)

    def watch(time: float, x: Array) -> None:
        if progress is not None:
            progress(time)
        if observe is not None:
            observe(time, loop.evaluate(time, x))

    observed = progress is not None or observe is not None
    chunk = CHUNK_STEPS if observe is None else OBSERVED_CHUNK
    trajectory = setup.integrate(watch if observed else None, stop, chunk=chunk)
    locking_margin = _locking_margin(scenario, loop, custom)
    locking_message = locking_advice(math.inf if locking_margin is None else locking_margin)
    if locking_message:
        warnings.warn(locking_message, SelfLockingWarning, stacklevel=5)
    samples = SampledTrajectory(loop, trajectory, scenario.sample_times())
    result = record(scenario, samples, setup.method, recorded_names, text=to_toml(scenario))
    ringing_message = ringing_warning(loop, trajectory)
    stiffness_message = stiffness_warning(result, loop.finger, scenario.simulation.atol_scale)
    if stiffness_message:
        warnings.warn(stiffness_message, AccuracyWarning, stacklevel=5)
    if locking_margin is not None:
        result.attrs["self_locking_margin"] = locking_margin
    account_message = "" if trajectory.failure else account_warning(result, residual_share(result))
    messages = {
        "self_locking": locking_message,
        "micro_damping": damping_message,
        "closure": closure_message,
        "path_jump": jump_message,
        "weight": weight_advice(loop.finger) if loop.palm is None else "",
        "accuracy": stiffness_message,
        "account": account_message,
        "ringing": ringing_message,
        "custom": custom,
    }
    result.attrs |= {name: text for name, text in messages.items() if text}
    if names is not None:
        result = select(result, names)
    return _raise_if_incomplete(setup, trajectory, result, ringing_message)


def _accuracy_variables(loop: ClosedLoop, names: Sequence[str]) -> list[str]:
    """Return the variables that the warnings about accuracy need: the energy account, and the gaps of contacts."""
    table = variables(loop)
    check_variables("variables", names, table)
    energies = [name for name, quantity in table.items() if quantity.energy_term is not None and quantity.units == "J"]
    return [name for name in (*energies, "energy_residual", "contact_gap") if name in table and name not in names]


def _raise_if_incomplete(setup: Setup, trajectory: Trajectory, result: xr.Dataset, ringing_message: str) -> xr.Dataset:
    """Return the result of a run that reached its end; raise with the partial result of any other."""
    end = float(trajectory.breakpoints[-1])
    result, infinite_variable = finite_part(result)
    if trajectory.failure:
        reason, advice = setup.failure(trajectory, ringing_message)
        raise IntegrationError(end, reason, advice, result)
    if infinite_variable:
        reason, end = f"{infinite_variable} is not finite after that", result.attrs["end_time"]
        raise IntegrationError(end, reason, ADVICE, result)
    if trajectory.interrupted:
        result.attrs["interrupted"] = f"interrupted at t = {end:.6g} s of {setup.scenario.simulation.duration:g} s"
        raise Interrupted(end, result)
    return result


def _locking_margin(scenario: Scenario, loop: ClosedLoop, custom: str) -> float | None:
    """Return the margin of the joints' friction to self-locking, or None without a planned reference.

    The margin is that of the paper's controller on the scenario's reference.
    """
    planned = all(part.controller.kind == "proportional" for part in scenario.parts().values())
    if not planned or {"controller", "reference"} & set(custom.split(", ")):
        return None
    if not loop.finger.routing.force_closure().holds:
        return None
    return quick_margin(scenario, loop.reference)


def interruptible(run: Callable[[Stop], RunResult], stop: Stop | None) -> RunResult:
    """Return the result of a run that Ctrl-C or a `Stop` can end.

    Raises:
        Interrupted: After Ctrl-C or such a stop, with what the run has computed.
    """
    with CancelToken(stop) as token:
        outcome = run(token)
    if token.cancelled:
        # Ctrl-C came after the last step.
        dataset = outcome.dataset() if isinstance(outcome, RunArrays) else outcome
        raise Interrupted(float(outcome.attrs["end_time"]), dataset)
    return outcome
