"""Log of a simulator's inputs, step by step, from which its run can be repeated and recorded."""

from __future__ import annotations

import copy
from array import array
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.control.open_loop import OpenLoopTensions
from finger_pin.control.position_drive import DriveSignals, PrescribedVoltages
from finger_pin.control.stepped_drives import SteppedGoals
from finger_pin.control.user_controllers import Samples, choose_reference
from finger_pin.core.stepping.integrator import integrate_compiled
from finger_pin.core.stepping.stepper import Stepper
from finger_pin.description.coupling import PassiveCoupling
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.scenario import Scenario
from finger_pin.description.simulation_settings import SimulationSettings
from finger_pin.description.validation import validate
from finger_pin.exceptions import InputError, IntegrationError
from finger_pin.references.reference import LoopReference, Reference, SignalReference
from finger_pin.references.signal import Signal
from finger_pin.simulation.accuracy import account_warning, residual_share
from finger_pin.simulation.contact_variables import without_far_pairs
from finger_pin.simulation.recording import check_memory, record
from finger_pin.simulation.sampled_trajectory import SampledTrajectory
from finger_pin.typing import Array

# A sample this close to the end of a step, s, is taken there.
_SAME_TIME = 1e-9


class StepLog:
    """The steps of a simulator since a start, in the order in which they were made."""

    def __init__(self, stepper: Stepper, goals: SteppedGoals | None = None) -> None:
        """Create an empty log at the present time of a stepper, and of the loops that it runs."""
        self._stepper, self._start_snapshot = stepper, stepper.state_snapshot
        self._start_goals = None if goals is None else goals.copy(stepper)
        self._rows = array("d")

    @property
    def start(self) -> Stepper:
        """A copy of the stepper as it stood at the start."""
        start = self._stepper.copy()
        start.restore(self._start_snapshot)
        return start

    def add(self, end: float, inputs: Array, force: Array) -> None:
        """Append a step: its end, s, its inputs (u,), and its forces (3,) or (f, 3), N."""
        self._rows.append(end)
        self._rows.frombytes(inputs.tobytes() + force.tobytes())

    def copy(self, stepper: Stepper) -> StepLog:
        """Return a copy of the log for a copied stepper."""
        log = copy.copy(self)
        log._stepper, log._rows = stepper, self._rows[:]
        return log

    def result(
        self,
        loop: ClosedLoop,
        scenario: Scenario,
        sample_rate: float,
        reference: LoopReference | Reference | Samples | None,
        goals: SteppedGoals | None = None,
    ) -> xr.Dataset:
        """Repeat the steps bit by bit, and return their signals.

        Args:
            loop: What was stepped.
            scenario: Its scenario.
            sample_rate: Of the signals, Hz.
            reference: As for `simulate`; by default the posture at the start.
            goals: The loops that have run, with their goals so far.

        Raises:
            InputError: If there are no steps yet, or a setting or the reference is wrong.
            IntegrationError: If there are more steps than can be kept in memory; its ``result`` holds the first.
        """
        if not self._rows:
            raise InputError("result", "is of steps, and there are none yet: call step")
        finger = loop.finger
        tips = finger.mechanism.body.tips
        steps = np.array(self._rows).reshape(-1, 1 + finger.mechanism.channels + 3 * len(tips))
        stepper = self.start
        knots, joints = np.append(stepper.time, steps[:, 0]), len(finger.routing.joints)
        inputs, force = np.split(steps[:, 1:], [finger.mechanism.channels], axis=1)
        tension, channels = inputs.copy(), finger.actuators.voltages
        tension[:, channels] = 0.0
        duration = {"duration": float(knots[-1] - knots[0]), "sample_rate": sample_rate}
        settings = validate(SimulationSettings, scenario.simulation.set_entries() | duration, ("simulation",))
        scenario = scenario.updated(simulation=settings)
        check_memory(scenario.simulation, finger)
        if reference is None:
            posture = finger.layout.unpack(stepper.x).position
            rest_signal = Signal.from_held_values(knots[[0, -1]], posture[None])
            reference = SignalReference(rest_signal, PassiveCoupling(np.eye(joints), np.zeros(joints), ()))
        drives: DriveSignals | None = None
        if goals is not None and self._start_goals is not None:
            drives = repeated = self._start_goals.repeating(goals)
            stepper.drive(repeated.compiled)
        elif len(channels):
            drives = PrescribedVoltages(channels, Signal.from_held_values(knots, inputs[:, channels]))
        loop = replace(
            loop,
            reference=choose_reference(reference, scenario, finger.routing),
            controller=OpenLoopTensions(Signal.from_held_values(knots, tension), finger.routing),
            drives=drives,
        )
        if loop.varying_force is None:
            held_force = Signal.from_held_values(knots, force)
            loop = replace(loop, fingertip_force=0.0 * loop.fingertip_force, varying_force=held_force)
        controller = _RecordedInputs(stepper, knots, inputs, force)
        trajectory = integrate_compiled(stepper, float(knots[-1]), finger.layout.names, controller=controller)
        # Rounding must not take a sample to the other side of a step's end, where other tensions act.
        times = knots[0] + scenario.sample_times()
        nearest_knot = knots[np.clip(np.searchsorted(knots, times - _SAME_TIME), 0, len(knots) - 1)]
        times = np.where(np.abs(nearest_knot - times) < _SAME_TIME, nearest_knot, times)
        result = without_far_pairs(record(scenario, SampledTrajectory(loop, trajectory, times), settings.method))
        result.attrs["custom"] = "loop"
        if trajectory.failure:
            end = float(trajectory.breakpoints[-1])
            raise IntegrationError(end, trajectory.failure, "fewer steps", result)
        account_message = account_warning(result, residual_share(result))
        if account_message:
            result.attrs["account"] = account_message
        return result


def stepped_scenario(description: FingerDescription, settings: SimulationSettings | dict[str, Any]) -> Scenario:
    """Return the scenario of a finger that is stepped alone; of ``simulation`` some settings are given."""
    table = {
        "name": description.name,
        "title": f"{description.name} in a loop of one's own",
        **({"finger": description} if description.hand is None else {"hand": description.hand}),
        "controller": {"kind": "tensions"},
        "simulation": settings,
    }
    return validate(Scenario, table, ())


class _RecordedInputs:
    """Controller that repeats recorded inputs.

    Attributes:
        instant: Start of the next step, s.
    """

    def __init__(self, stepper: Stepper, knots: Array, inputs: Array, force: Array) -> None:
        self._stepper, self._knots, self._inputs, self._force = stepper, knots, inputs, force
        self._step = 0

    @property
    def instant(self) -> float:
        return float(self._knots[self._step])

    def act(self, x: Array) -> Array:
        """Start a step: set its force, and return its inputs, shape (u,)."""
        step, self._step = self._step, self._step + 1
        self._stepper.load(self._force[step].reshape(-1, 3))
        inputs: Array = self._inputs[step]
        return inputs
