"""Simulate a scenario: from its description to a Dataset of everything that happened."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence

import xarray as xr
from numpy.typing import ArrayLike

from finger_pin.cancellation import Stop
from finger_pin.control.closed_loop import ClosedLoop, LoopSignals
from finger_pin.control.interface import Controller
from finger_pin.control.sampling import sampling_settings
from finger_pin.control.user_controllers import Columns, Samples, with_named_samples
from finger_pin.description.loading import ScenarioLike, load_scenario
from finger_pin.exceptions import ScenarioWarning
from finger_pin.mechanism.coerce import FingerLike, resolve_finger
from finger_pin.references.reference import Reference
from finger_pin.simulation.initial_state import custom_parts, with_initial_state
from finger_pin.simulation.progress import notebook_bar
from finger_pin.simulation.run import interruptible, run


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
