"""Run a scenario, or a loop that is given, check accuracy and energy balance, and return the Dataset."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from typing import TypeVar

import xarray as xr
from numpy.typing import ArrayLike

from finger_pin.analysis.advice import micro_damping_advice, weight_advice
from finger_pin.analysis.locking_margin import locking_advice, quick_margin
from finger_pin.analysis.path_jumps import path_jump_advice
from finger_pin.cancellation import CancelToken, Stop
from finger_pin.control.build import closure_advice
from finger_pin.control.closed_loop import ClosedLoop, LoopSignals
from finger_pin.control.interface import Controller
from finger_pin.control.sampling import sampling_settings
from finger_pin.control.user_controllers import Columns, Samples, with_named_samples
from finger_pin.core.steps.trajectory import Trajectory
from finger_pin.description.loading import ScenarioLike, load_scenario, to_toml
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import (
    AccuracyWarning,
    ClosureWarning,
    IntegrationError,
    Interrupted,
    MicroDampingWarning,
    PathJumpWarning,
    ScenarioWarning,
    SelfLockingWarning,
)
from finger_pin.mechanism.coerce import FingerLike, resolve_finger
from finger_pin.progress import notebook_bar
from finger_pin.references.reference import Reference
from finger_pin.simulation.accuracy import (
    CHUNK_STEPS,
    account_warning,
    residual_share,
    ringing_warning,
    stiffness_warning,
)
from finger_pin.simulation.contact_variables import without_far_pairs
from finger_pin.simulation.initial_state import custom_parts, with_initial_state
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
    _warn(damping_message, MicroDampingWarning)
    closure_message = closure_advice(loop.controller)
    _warn(closure_message, ClosureWarning)
    setup = Setup.from_scenario(scenario, loop, custom, control_period)
    loop = setup.loop
    jump_message = path_jump_advice(loop.finger, loop.finger.layout.unpack(loop.initial_state()).position)
    _warn(jump_message, PathJumpWarning)
    _warn(setup.touch_warning, AccuracyWarning)

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
    _warn(locking_message, SelfLockingWarning)
    samples = SampledTrajectory(loop, trajectory, scenario.sample_times())
    result = record(scenario, samples, setup.method, recorded_names, text=to_toml(scenario))
    ringing_message = ringing_warning(loop, trajectory)
    stiffness_message = stiffness_warning(result, loop.finger, scenario.simulation.atol_scale)
    _warn(stiffness_message, AccuracyWarning)
    result = without_far_pairs(result)
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


def _warn(message: str, category: type[Warning]) -> None:
    """Warn at the line that asked for the run, unless the message is empty."""
    if message:
        warnings.warn(message, category, stacklevel=6)


def _accuracy_variables(loop: ClosedLoop, names: Sequence[str]) -> list[str]:
    """Return the variables that judge a run: the energy account, and by which contacts are near."""
    table = variables(loop)
    check_variables("variables", names, table)
    energies = [name for name, quantity in table.items() if quantity.energy_term is not None and quantity.units == "J"]
    return [
        name
        for name in (*energies, "energy_residual", "contact_gap", "contact_bend")
        if name in table and name not in names
    ]


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


def simulate(
    scenario: ScenarioLike,
    *,
    controller: Controller | Samples | Columns | None = None,
    reference: Reference | Samples | None = None,
    fingertip_force: Samples | None = None,
    finger: FingerLike | None = None,
    initial: ArrayLike | xr.Dataset | None = None,
    control_period: float | None = None,
    progress: Callable[[float], None] | None = None,
    observe: Callable[[float, LoopSignals], None] | None = None,
    stop: Stop | None = None,
    variables: Sequence[str] | None = None,
) -> xr.Dataset:
    """Simulate a scenario, from rest on its reference unless something else is asked for.

    The compiled methods run without Python inside under the paper's controller or tensions in open loop. Others are
    sampled and held where there is a ``control_period`` or ``controller.sampling``; without one scipy's Radau method
    calls them at every evaluation, which takes seconds for a simulated second.

    Args:
        scenario: The scenario to simulate, its name, or the path of a file.
        controller: In place of the scenario's: an object with ``command``, asked for one time at a time, or times,
            shape (m,), s, and tensions of the actuated tendons, shape (m, a), N; or times and columns by name, each of
            shape (m,): ``{"spool_angle.M1": angles}``, rad, ``{"tendon_winding.T1": lengths}``, m, and by tendon.
        reference: In place of the scenario's: an object with ``at``, asked for one time at a time, or times, shape
            (m,), s, and angles, shape (m, k), rad, of the k joints that no passive tendon drives; the others follow
            (20). Between samples the motion is a monotone cubic.
        fingertip_force: In place of the scenario's: times, shape (m,), s, and forces, shape (m, 3), N, base frame.
        finger: In place of the scenario's, with the same joints and tendons: with custom rows, or on a model.
        initial: The packed state to start from, shape (size,), or a result to continue from its last saved state. Time
            begins at zero again; ``simulation.start_time`` says what the clock of references shows then. Position loops
            of motors go on as well, from a result; a controller that is sampled starts anew, which is warned of.
        control_period: Sampling period of the controller, s, for compiled methods, in place of the scenario's.
        progress: Called with the simulated time, s, now and then; in a notebook there is a bar by default.
        observe: Called with the simulated time, s, and all signals every few steps.
        stop: Asked now and then; true ends the simulation there.
        variables: Names of the variables to keep, such as ``["joint_position"]``; by default all.

    Returns:
        Every signal of the model at the scenario's sample rate, and the energy account. Where that does not close to
        1e-4 of the energy exchanged, the attribute ``account`` says so.

    Raises:
        InputError: If the method cannot sample, the controller must be sampled, what is given has a wrong size or is
            not finite, the result cannot fit into memory, or has no such variable.
        IntegrationError: If the integrator cannot go on; its ``result`` holds what was computed.
        Interrupted: After Ctrl-C, a KeyboardInterrupt, or ``stop``; its ``result`` holds what was computed.

    Warns:
        SelfLockingWarning: If the joints' friction comes close to what locks the finger on the scenario's reference;
            the result's attribute ``self_locking_margin`` says how close, not so with a custom controller or reference.
        ClosureWarning: If tendons along paths lose force closure within the joints' ranges.
        PathJumpWarning: If the length of a cord jumps within a joint's range.
        SlowRunWarning: After ten seconds of a run that has as long before it and is slower than a tenth of real time.
        AccuracyWarning: If a contact is stiffer than what the tolerances tell, or a method may pass over touches.
        MicroDampingWarning: If micro-damping is more than viscous friction covers, so that friction can drive motion.
    """
    scenario, controls = with_named_samples(load_scenario(scenario), controller)
    custom_finger = resolve_finger(finger, scenario)
    loop = ClosedLoop.from_scenario(scenario, controls, reference, fingertip_force, custom_finger)
    loop = with_initial_state(loop, initial)
    if isinstance(initial, xr.Dataset) and sampling_settings(scenario, control_period) is not None:
        text = "the sampled controller starts anew: its sensors, delays and memory are not part of a result"
        warnings.warn(text, ScenarioWarning, stacklevel=2)
    custom = custom_parts(controls, reference, fingertip_force, initial, custom_finger)
    progress = progress or notebook_bar("s", scenario.simulation.duration)
    return interruptible(
        lambda token: run(scenario, loop, custom, control_period, progress, observe, token, variables), stop
    )
