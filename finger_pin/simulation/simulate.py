"""Simulate a scenario: from its description to a Dataset of everything that happened."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import xarray as xr
from numpy.typing import ArrayLike

from finger_pin.control.closed_loop import ClosedLoop, LoopSignals
from finger_pin.control.interface import Controller
from finger_pin.control.user_controllers import Columns, Samples, with_columns
from finger_pin.core.stepping.trajectory import Stop
from finger_pin.description.loading import ScenarioLike, load_scenario
from finger_pin.mechanism.coerce import FingerLike, resolve_finger
from finger_pin.references.reference import Reference
from finger_pin.simulation.initial_state import custom_parts, packed_state
from finger_pin.simulation.progress import notebook_bar
from finger_pin.simulation.running import interruptible, run


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
) -> xr.Dataset:
    """Simulate a scenario, from rest on its reference unless something else is asked for.

    The compiled methods run without Python inside where the controller is the paper's, with damping or not, or tensions
    in open loop. A controller of one's own and what a scenario adds to the paper's are Python: with a
    ``control_period``, or ``controller.sampling`` in the scenario, they are sampled and held, and the compiled core
    runs between the samples; without one they act continuously, which calls them at every evaluation of scipy's Radau
    method: that takes seconds for a simulated second.

    Args:
        scenario: The scenario to simulate, its name, or the path of a file.
        controller: Replaces the scenario's controller: an object with ``command``, asked for one time at a time, or
            tensions in open loop, as times, shape (m,), s, and tensions of the actuated tendons, shape (m, a), N; or
            times and columns by name, each of shape (m,): ``{"spool_angle.M1": angles}``, rad,
            ``{"tendon_winding.T1": lengths}``, m, and tensions by tendon.
        reference: Replaces the scenario's reference: an object with ``at``, asked for one time at a time, or times,
            shape (m,), s, and angles, shape (m, k), rad, of the k joints that no passive tendon drives; the others
            follow (20). Between samples the motion is a monotone cubic.
        fingertip_force: Replaces what acts on the fingertip: times, shape (m,), s, and forces, shape (m, 3), N, base
            frame.
        finger: Replaces the finger that the scenario describes: one with rows of its own, or on a model
            (`Finger.from_model`), with the same joints and tendons.
        initial: The packed state to start from, shape (size,), or a result to continue from its last saved state. Time
            begins at zero again; ``simulation.start_time`` says what the clock of references shows then.
        control_period: Sampling period of the controller, s, in place of the scenario's ``controller.sampling.period``;
            without either it is continuous. Compiled methods only.
        progress: Called with the simulated time, s, now and then; in a notebook there is a bar by default.
        observe: Called with the simulated time, s, and all signals every few steps.
        stop: Asked now and then; when it returns true the simulation ends there.

    Returns:
        Every signal of the model at the scenario's sample rate, and the energy account. Where that does not close to
        1e-4 of the energy exchanged, the attribute ``account`` says so.

    Raises:
        InputError: If the control period is not positive, the method cannot sample, the controller must be sampled,
            what is given as controller, reference, force or initial state has a wrong size or is not finite, or the
            result cannot fit into memory.
        IntegrationError: If the integrator cannot go on; its ``result`` holds what was computed.
        Interrupted: After Ctrl-C, or if ``stop`` returned true; its ``result`` holds what was computed. It is a
            KeyboardInterrupt.

    Warns:
        SelfLockingWarning: If the joints' friction comes close to what locks the finger on the scenario's reference;
            the result's attribute ``self_locking_margin`` says how close. With a controller or reference of one's own
            there is neither.
        AccuracyWarning: If the run errs by far more than its tolerances suggest; the attribute ``estimated_error`` says
            by how much, rad rms over joints and time. It has none where the error is not judged, which is said, nor
            where the core does not integrate in one piece. `check_convergence` compares two runs.
        MicroDampingWarning: If micro-damping is more than viscous friction covers, so that friction can drive motion.
    """
    scenario, controls = with_columns(load_scenario(scenario), controller)
    given = resolve_finger(finger, scenario)
    loop = ClosedLoop.from_scenario(scenario, controls, reference, fingertip_force, given)
    if initial is not None:
        loop = replace(loop, start=packed_state(initial, loop.finger))
        if loop.palm is not None and loop.start is not None:
            loop.palm.place_world(loop.finger, loop.start)
    custom = custom_parts(controls, reference, fingertip_force, initial, given)
    progress = progress or notebook_bar("s", scenario.simulation.duration)
    return interruptible(lambda asked: run(scenario, loop, custom, control_period, progress, observe, asked), stop)
