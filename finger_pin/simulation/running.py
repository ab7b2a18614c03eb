"""A run: from a scenario to its trajectory, and to arrays of everything that happened, judged."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from finger_pin.analysis.locking_margin import locking_advice, quick_margin
from finger_pin.analysis.passivity import micro_damping_advice
from finger_pin.control.closed_loop import ClosedLoop, LoopSignals
from finger_pin.control.compiled import build_stepper, compiled_control, sampled_control
from finger_pin.control.measurement import MeasuringController
from finger_pin.control.position_drive import PositionDrives
from finger_pin.control.proportional import Controller
from finger_pin.control.sampling import SampledController, sampling_settings
from finger_pin.control.user_controllers import OwnController
from finger_pin.core.compiled_finger import CompiledFinger
from finger_pin.core.stepping.cvode import integrate_cvode
from finger_pin.core.stepping.encounters import meetings
from finger_pin.core.stepping.integrator import integrate_compiled
from finger_pin.core.stepping.stepper import TABLEAUS, Stepper
from finger_pin.core.stepping.textbook import Stop, Trajectory, Watch, integrate
from finger_pin.description.loading import to_toml
from finger_pin.description.routing import Array
from finger_pin.description.scenario import METHODS_IN_NUMPY, Scenario
from finger_pin.exceptions import (
    AccuracyWarning,
    InputError,
    IntegrationError,
    Interrupted,
    MicroDampingWarning,
    SelfLockingWarning,
)
from finger_pin.simulation.accuracy import (
    CHUNK,
    check_memory,
    close_account,
    estimate_error,
    finite_part,
    open_account,
    ringing,
    too_stiff,
)
from finger_pin.simulation.initial_state import check_motors
from finger_pin.simulation.motions import Motions
from finger_pin.simulation.recording import record

if TYPE_CHECKING:
    import xarray as xr

_ADVICE = "a smaller simulation.rtol, another simulation.method, or softer contacts and tendons"
# Where tolerances are tight already, it is rounding that an integrator cannot get below.
_TIGHT = 1e-8
_ADVICE_TIGHT = "a larger simulation.rtol and simulation.atol_scale, or softer contacts and tendons"
_ADVICE_RUNAWAY = "a smaller controller.gain, heavier links, or a start within the joints' ranges"
_CONTINUOUS = "Radau"
# Steps between two looks at a compiled simulation that is observed.
_CHUNK_OBSERVED = 4


#: Ends of the steps of every island, s.
Steps = Sequence[Array]


@dataclass(frozen=True, eq=False)
class Setup:
    """A scenario with everything that moves it, once.

    Attributes:
        scenario: What is simulated.
        loop: Finger, controller and reference, with what is sampled for this one motion.
        method: The integrator; not the scenario's where its controller is Python and acts continuously.
        answers: The controller itself, where the loop samples it.
    """

    scenario: Scenario
    loop: ClosedLoop
    method: str
    answers: Controller

    @classmethod
    def of(
        cls, scenario: Scenario, loop: ClosedLoop | None = None, own: str = "", control_period: float | None = None
    ) -> Setup:
        """Make a scenario ready.

        Args:
            scenario: What to simulate.
            loop: Its loop, where something in it is a user's own.
            own: What that is, as `own_parts` says.
            control_period: As for `simulate`.

        Raises:
            InputError: If the method cannot sample, the controller must be sampled, bodies overlap or
                a motor turns too fast at the start, or a user's own controller answers wrongly.
        """
        method = scenario.simulation.method
        loop = loop or ClosedLoop.from_scenario(scenario)
        if loop.finger.actuators.names:
            # Before the controller is sampled: then it must not be asked for a start.
            loop = replace(loop, start=loop.initial_state())
            check_motors(loop.finger, loop.initial_state())
        if loop.finger.surroundings is not None:
            loop.finger.surroundings.check(loop.finger.layout.unpack(loop.initial_state()))
        sampling = sampling_settings(scenario, control_period)
        if sampling is None and isinstance(loop.controller, MeasuringController):
            raise InputError("control_period", "is missing: a controller that reads tension sensors is sampled")
        positioned = bool(np.any(loop.finger.actuators.holds))
        if positioned and method not in TABLEAUS:
            raise InputError("simulation.method", f"a position drive is sampled: one of {', '.join(TABLEAUS)}", method)
        if sampling is None and method in TABLEAUS and compiled_control(loop) is None:
            if positioned:
                raise InputError(
                    "controller.sampling.period", "is missing: beside position drives this controller is sampled"
                )
            method = _CONTINUOUS
        if scenario.simulation.method not in METHODS_IN_NUMPY:
            loop = loop.compiled()
        answers = loop.controller
        sampled = None if sampling is None else SampledController(loop, sampling)
        if positioned:
            duration = scenario.simulation.duration
            drives = PositionDrives(loop.finger, loop.controller, loop.reference, duration)
            loop = replace(loop, drives=drives)
        if sampled is not None:
            loop = replace(loop, controller=sampled)
        elif own:
            # A wrong answer of a user's own controller is refused before anything is computed.
            loop.evaluate(0.0, loop.initial_state())
        return cls(scenario, loop, method, answers)

    def integrate(
        self,
        watch: Watch | None = None,
        stop: Stop | None = None,
        *,
        scenario: Scenario | None = None,
        chunk: int = CHUNK,
        steps: Steps | None = None,
    ) -> Trajectory:
        """Integrate, at the tolerances of another scenario if given.

        Args:
            watch: Called with the simulated time and the state now and then.
            stop: Asked now and then.
            scenario: Like this one, with tolerances of its own.
            chunk: Steps between two calls.
            steps: To be taken whatever their errors: what comes out is then as smooth a function of start and
                parameters as the equations are.
        """
        return _integrate(scenario or self.scenario, self.loop, self.method, watch, chunk, stop, steps)

    def stepper(self) -> Stepper:
        """Return what the compiled core steps, at the start."""
        return _stepper(self.scenario, self.loop, self.method)

    def failure(self, trajectory: Trajectory, slow: str = "") -> tuple[str, str]:
        """Return why a trajectory ended early, and what to try.

        Args:
            trajectory: One that failed.
            slow: What made it slow, if that is known.
        """
        answers, settings = self.answers, self.scenario.simulation
        if isinstance(answers, OwnController) and answers.problem_time >= trajectory.breakpoints[-1]:
            return answers.problem, "another controller"
        advice = _ADVICE_TIGHT if min(settings.rtol, settings.atol_scale) < _TIGHT else _ADVICE
        if "physical range" in trajectory.failure:
            advice = _ADVICE_RUNAWAY
        return f"{trajectory.failure}; {slow}" if slow else trajectory.failure, advice


def run(
    scenario: Scenario,
    loop: ClosedLoop | None = None,
    own: str = "",
    control_period: float | None = None,
    progress: Callable[[float], None] | None = None,
    observe: Callable[[float, LoopSignals], None] | None = None,
    stop: Stop | None = None,
) -> xr.Dataset:
    """Simulate as `simulate` does, given the loop; Ctrl-C is left to the caller.

    Args:
        scenario: What to simulate.
        loop: Its loop, where something in it is a user's own.
        own: What that is, as `own_parts` says.
        control_period: As for `simulate`, like what follows.
        progress: Called with the simulated time, s.
        observe: Called with the simulated time, s, and all signals.
        stop: Asked now and then.
    """
    loop = loop or ClosedLoop.from_scenario(scenario)
    check_memory(scenario.simulation, loop.finger)
    driving = micro_damping_advice(scenario.finger)
    if driving:
        warnings.warn(driving, MicroDampingWarning, stacklevel=5)
    setup = Setup.of(scenario, loop, own, control_period)
    loop = setup.loop

    def watch(time: float, x: Array) -> None:
        if progress is not None:
            progress(time)
        if observe is not None:
            observe(time, loop.evaluate(time, x))

    def repeated(other: Scenario, enough: Stop) -> Trajectory:
        asked = stop or (lambda: False)
        return setup.integrate(None, lambda: enough() or asked(), scenario=other)

    text = to_toml(scenario)

    def recorded(found: Trajectory) -> xr.Dataset:
        return record(scenario, Motions(loop, found, scenario.sample_times()), setup.method, text=text)

    first = setup.integrate(watch, stop, chunk=CHUNK if observe is None else _CHUNK_OBSERVED)
    margin = _margin(scenario, loop, own)
    close = locking_advice(math.inf if margin is None else margin)
    if close:
        warnings.warn(close, SelfLockingWarning, stacklevel=5)
    closed = close_account(scenario, first, repeated, recorded)
    trajectory, result = closed.trajectory, closed.result
    reached = float(trajectory.breakpoints[-1])
    error, inaccurate = estimate_error(scenario, closed, repeated, margin=math.inf if margin is None else margin)
    slow = ringing(loop, trajectory)
    inaccurate = inaccurate or too_stiff(result, loop.finger, scenario.simulation.atol_scale)
    if inaccurate:
        warnings.warn(inaccurate, AccuracyWarning, stacklevel=5)
    if margin is not None:
        result.attrs["self_locking_margin"] = margin
    if np.isfinite(error):
        result.attrs["estimated_error"] = error
    gap = "" if trajectory.failure else open_account(closed.left)
    told = {"self_locking": close, "micro_damping": driving, "accuracy": inaccurate, "account": gap, "ringing": slow}
    told["own"] = own
    result.attrs |= {name: text for name, text in told.items() if text}
    result, excess = finite_part(result)
    if trajectory.failure:
        reason, advice = setup.failure(trajectory, slow)
        raise IntegrationError(reached, reason, advice, result)
    if excess:
        reason, reached = f"{excess} is not finite after that", result.attrs["end_time"]
        raise IntegrationError(reached, reason, _ADVICE, result)
    if trajectory.interrupted:
        raise Interrupted(reached, result)
    return result


def _margin(scenario: Scenario, loop: ClosedLoop, own: str) -> float | None:
    """Return how far the joints' friction is from what locks the finger; None where the reference is not planned.

    The margin is that of the paper's controller on the scenario's reference.
    """
    planned = all(part.controller.kind == "proportional" for part in scenario.parts().values())
    if not planned or {"controller", "reference"} & set(own.split(", ")):
        return None
    return quick_margin(scenario) if loop.finger.routing.force_closure().holds else None


def _stepper(scenario: Scenario, loop: ClosedLoop, method: str) -> Stepper:
    """Return what the compiled core steps, at the start."""
    return build_stepper(
        loop.finger,
        compiled_control(loop) or sampled_control(loop),
        loop.initial_state(),
        loop.fingertip_force,
        method=method,
        rtol=scenario.simulation.rtol,
        atol_scale=scenario.simulation.atol_scale,
    )


def _integrate(
    scenario: Scenario,
    loop: ClosedLoop,
    method: str,
    watch: Watch | None,
    chunk: int,
    stop: Stop | None,
    steps: Steps | None = None,
) -> Trajectory:
    settings, controller = scenario.simulation, loop.controller
    start, atol = loop.initial_state(), settings.atol_scale * loop.finger.layout.scales()
    if method in TABLEAUS and isinstance(loop.dynamics, CompiledFinger):
        stepper = _stepper(scenario, loop, method)
        if isinstance(loop.drives, PositionDrives):
            stepper.drive(loop.drives.compiled)
        knots = loop.knots(settings.rtol)
        if steps is not None:
            stepper.repeat([np.union1d(ends, knots) for ends in steps])
        return integrate_compiled(
            stepper,
            settings.duration,
            loop.finger.layout.names,
            held=controller if isinstance(controller, SampledController) else None,
            knots=None if steps is not None else knots,
            watch=watch,
            chunk=chunk,
            together=chunk == _CHUNK_OBSERVED,
            stop=stop,
        )
    meeting = meetings(loop.finger.mechanism)
    if method == "CVODE":
        return integrate_cvode(
            loop.rhs,
            start,
            settings.duration,
            rtol=settings.rtol,
            atol=atol,
            longest=loop.longest_step(settings.rtol),
            meeting=meeting,
            watch=watch,
            stop=stop,
        )
    return integrate(
        loop.rhs,
        start,
        settings.duration,
        method=method,
        rtol=settings.rtol,
        atol=atol,
        longest=loop.longest_step(settings.rtol),
        meeting=meeting,
        watch=watch,
        stop=stop,
    )
