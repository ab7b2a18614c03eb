"""Setup of a run: loop, stepper and inputs of a scenario, built once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from finger_pin.cancellation import Stop
from finger_pin.control.closed_loop import ClosedLoop, compiled_control, sampled_control
from finger_pin.control.interface import LoopController
from finger_pin.control.position_drive import PositionDrives, spool_windings, voltage_signals
from finger_pin.control.sampling import SampledController, sampling_settings
from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.core.stepping.integrator import integrate_compiled
from finger_pin.core.stepping.solve_ivp import integrate
from finger_pin.core.stepping.stepper import TABLEAUS, Stepper
from finger_pin.core.steps.repetition import Steps
from finger_pin.core.steps.trajectory import Trajectory, Watch
from finger_pin.core.tables.inputs import InputTable
from finger_pin.description.scenario import Scenario
from finger_pin.description.simulation_settings import METHODS_IN_NUMPY, SimulationSettings
from finger_pin.exceptions import InputError
from finger_pin.simulation.accuracy import CHUNK_STEPS, ringing_warning
from finger_pin.simulation.initial_state import beyond_ranges, check_motors, failure_advice, warn_beyond_ranges
from finger_pin.simulation.recording import RunArrays, record_arrays, run_attributes
from finger_pin.simulation.sampled_trajectory import SampledTrajectory
from finger_pin.simulation.variables import coordinates
from finger_pin.typing import Array

#: What to try where an integrator cannot go on.
ADVICE = "a smaller simulation.rtol, another simulation.method, or softer contacts and tendons"
# Where tolerances are tight already, it is rounding that an integrator cannot get below.
_TIGHT_TOLERANCE = 1e-8
_ROUNDING_ADVICE = "a larger simulation.rtol and simulation.atol_scale, or softer contacts and tendons"
_METHOD_WITHOUT_SAMPLING = "Radau"
#: Steps between two looks at a compiled simulation that is observed.
OBSERVED_CHUNK = 4


@dataclass(frozen=True, eq=False)
class Setup:
    """A scenario with its loop, stepper and inputs, built once.

    Attributes:
        scenario: The scenario.
        loop: Finger, controller and reference, with what is sampled for this one motion.
        method: The integrator; not the scenario's where its controller is Python and acts continuously.
        controller: The controller itself, where the loop samples it.
        sampled: Its sampled controller, if it has one.
        control: Inputs that are compiled; None where they are sampled or Python.
    """

    scenario: Scenario
    loop: ClosedLoop
    method: str
    controller: LoopController
    sampled: SampledController | None
    control: InputTable | None = None

    @classmethod
    def from_scenario(
        cls,
        scenario: Scenario,
        loop: ClosedLoop | None = None,
        custom: str = "",
        control_period: float | None = None,
        reused: CompiledFinger | None = None,
    ) -> Setup:
        """Build the setup of a scenario.

        Args:
            scenario: The scenario to simulate.
            loop: Its loop, where a part of it is custom.
            custom: Names of the parts given in place of the scenario's, from `custom_parts`.
            control_period: As for `simulate`.
            reused: The evaluator of a run that has ended, which serves again if its finger differs in numbers only.
        """
        method = scenario.simulation.method
        loop = loop or ClosedLoop.from_scenario(scenario)
        # Before the controller is sampled: then it must not be asked for a start.
        start_state = loop.initial_state()
        loop = replace(loop, start=start_state)
        check_motors(loop.finger, start_state)
        if loop.finger.scene is not None:
            loop.finger.scene.check(loop.finger.layout.unpack(start_state))
        if "initial state" not in custom:
            # A state of one's own, as of a result, may lean on a stop.
            warn_beyond_ranges(loop.finger, start_state)
        sampling = sampling_settings(scenario, control_period)
        if sampling is None and (loop.controller.needs_sensors or loop.controller.sensors):
            raise InputError("control_period", "is missing: a controller that reads sensors is sampled")
        if sampling is None and loop.controller.delays is not None:
            raise InputError("control_period", "is missing: a controller of actuators with a delay is sampled")
        has_position_drives = bool(np.any(loop.finger.actuators.holds))
        if has_position_drives and method not in TABLEAUS:
            raise InputError("simulation.method", f"a position drive is sampled: one of {', '.join(TABLEAUS)}", method)
        control = compiled_control(loop) if sampling is None and method in TABLEAUS else None
        if sampling is None and method in TABLEAUS and control is None:
            if has_position_drives:
                raise InputError(
                    "controller.sampling.period", "is missing: beside position drives this controller is sampled"
                )
            method = _METHOD_WITHOUT_SAMPLING
        if scenario.simulation.method not in METHODS_IN_NUMPY:
            loop = loop.compiled(reused)
        if scenario.simulation.max_step is not None and method in TABLEAUS:
            allowed = "is for methods of scipy and continuous controllers in Python; the others see all touches"
            raise InputError("simulation.max_step", allowed, scenario.simulation.max_step)
        controller = loop.controller
        sampled = None if sampling is None else SampledController(loop, sampling)
        if has_position_drives:
            duration, start = scenario.simulation.duration, scenario.simulation.start_time
            winding = spool_windings(scenario, loop.finger)
            voltages = voltage_signals(scenario, loop.finger, "motor_voltage")
            supplies = voltage_signals(scenario, loop.finger, "supply_voltage")
            drive_arguments = loop.finger, loop.controller, loop.reference, duration, start, winding, voltages, supplies
            drives = PositionDrives(*drive_arguments, loop.last_samples)
            loop = replace(loop, drives=drives)
        if sampled is not None:
            loop = replace(loop, controller=sampled)
        elif custom:
            # A wrong answer of a custom controller is refused before anything is computed.
            loop.evaluate(0.0, loop.initial_state())
        return cls(scenario, loop, method, controller, sampled, control)

    def integrate(
        self,
        watch: Watch | None = None,
        stop: Stop | None = None,
        *,
        scenario: Scenario | None = None,
        chunk: int = CHUNK_STEPS,
        steps: Sequence[Steps] | None = None,
        stepper: Stepper | None = None,
    ) -> Trajectory:
        """Integrate, at the tolerances of another scenario if given.

        Args:
            watch: Called with the simulated time and the state now and then.
            stop: Called now and then; true ends the integration.
            scenario: This one with other tolerances.
            chunk: Steps between two calls.
            steps: Of every island, to be taken whatever their errors: what comes out is then as smooth a function of
                start and parameters as the equations are.
            stepper: What `stepper` has returned, to be used; by default another one.
        """
        settings = (scenario or self.scenario).simulation
        if self.method in TABLEAUS:
            return self._compiled(stepper or self.stepper(settings), settings, watch, stop, chunk, steps)
        loop = self.loop
        return integrate(
            loop.rhs,
            loop.initial_state(),
            settings.duration,
            method=self.method,
            rtol=settings.rtol,
            atol=settings.atol_scale * loop.finger.layout.scales(),
            max_step=min(loop.longest_step(settings.rtol), settings.max_step or np.inf),
            watch=watch,
            stop=stop,
        )

    def _compiled(
        self,
        stepper: Stepper,
        settings: SimulationSettings,
        watch: Watch | None,
        stop: Stop | None,
        chunk: int,
        steps: Sequence[Steps] | None,
    ) -> Trajectory:
        """Integrate by a method of the compiled core."""
        loop = self.loop
        if loop.drives is not None and loop.drives.compiled is not None:
            stepper.drive(loop.drives.compiled)
        knots = loop.knots(settings.rtol)
        if steps is not None:
            stepper.repeat(steps)
        return integrate_compiled(
            stepper,
            settings.duration,
            loop.finger.layout.names,
            controller=self.sampled,
            knots=knots,
            watch=watch,
            chunk=chunk,
            together=chunk == OBSERVED_CHUNK,
            stop=stop,
        )

    def record(self, trajectory: Trajectory, times: Array, names: Sequence[str], entry: str = "record") -> RunArrays:
        """Return variables of a trajectory of this setup, at times as far as it goes.

        Args:
            trajectory: The solution.
            times: Shape (m,), in order, s.
            names: Of the variables.
            entry: Argument that named them, for messages.
        """
        samples = SampledTrajectory(self.loop, trajectory, times, names)
        arrays = record_arrays(samples, names, entry)
        labels = coordinates(self.scenario, self.loop, samples.times)
        return RunArrays(arrays, labels, run_attributes(self.scenario, trajectory, self.method))

    def stepper(self, settings: SimulationSettings | None = None, reused: Stepper | None = None) -> Stepper:
        """Return the compiled stepper, at the start, by default at the scenario's tolerances; one of a run before."""
        tolerances, loop = settings or self.scenario.simulation, self.loop
        return Stepper.from_finger(
            loop.finger,
            self.control or sampled_control(loop),
            loop.initial_state(),
            loop.fingertip_force,
            method=self.method,
            rtol=tolerances.rtol,
            atol_scale=tolerances.atol_scale,
            reused=reused,
            evaluator=loop.dynamics,
        )

    @property
    def touch_warning(self) -> str:
        """The warning that touches between the ends of steps are not seen; empty where they are, or there are none."""
        contacts = any(table.law.arms > 1 for table in self.loop.finger.mechanism.rows)
        if self.method in TABLEAUS or self.scenario.simulation.max_step is not None or not contacts:
            return ""
        return (
            f"{self.method} sees touches at the ends of its steps only: give simulation.max_step, s, less than a touch "
            f"lasts, or a controller that is sampled"
        )

    def ringing(self, trajectory: Trajectory, slow_steps: int) -> str:
        """Return the warning about what rings or swings in a run of so many steps or more; empty without any."""
        return ringing_warning(self.loop, trajectory, slow_steps)

    def failure(self, trajectory: Trajectory, cause: str = "") -> tuple[str, str]:
        """Return the reason of a trajectory's early end, and advice.

        Args:
            trajectory: One that failed.
            cause: Cause of its slowness, if that is known.
        """
        controller, settings = self.controller, self.scenario.simulation
        if controller.problem_time >= trajectory.breakpoints[-1]:
            return controller.problem, "another controller"
        advice = _ROUNDING_ADVICE if min(settings.rtol, settings.atol_scale) < _TIGHT_TOLERANCE else ADVICE
        end = trajectory.interpolate(trajectory.breakpoints[-1:])[0]
        advice = failure_advice(self.loop.finger, trajectory.failure, end, advice)
        if "jumps" not in advice and (beyond := beyond_ranges(self.loop.finger, self.loop.initial_state())):
            advice = f"a start within the ranges: {beyond}"
        return f"{trajectory.failure}; {cause}" if cause else trajectory.failure, advice
