"""A prepared scenario: many runs with other parameters, without the cost of building them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from finger_pin.cancellation import Stop
from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.core.stepping.stepper import TABLEAUS, Stepper
from finger_pin.core.steps.trajectory import Trajectory
from finger_pin.description.loading import ParametrisedScenario, ScenarioLike, load_scenario
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError, IntegrationError, Interrupted
from finger_pin.mechanism.coerce import FingerLike, resolve_finger, with_finger, with_parameters_of
from finger_pin.mechanism.finger import Finger
from finger_pin.simulation.accuracy import with_tighter_tolerances
from finger_pin.simulation.initial_state import custom_parts, with_initial_state
from finger_pin.simulation.recording import RunArrays, check_variables, record
from finger_pin.simulation.sampled_trajectory import SampledTrajectory
from finger_pin.simulation.sensitivity import add_slopes, make_variations, repeat_steps, with_exact_encoders
from finger_pin.simulation.setup import Setup
from finger_pin.simulation.simulate import interruptible, run
from finger_pin.simulation.variables import variables
from finger_pin.threads import in_threads
from finger_pin.typing import Array

#: What a run records unless it is told otherwise.
RECORDED = ("joint_position", "tendon_tension")
# Derivatives are those of runs at so much smaller tolerances: they err more than what they are of.
_SENSITIVITY_FACTOR = 10.0


def prepare(
    scenario: ScenarioLike,
    parameters: Sequence[str] = (),
    record: Sequence[str] = RECORDED,
    *,
    finger: FingerLike | None = None,
) -> Prepared:
    """Prepare a scenario for many runs with other parameters.

        prepared = fp.prepare("fig6", ["finger.tendon_friction.coulomb", "controller.gain"], ["joint_position"])
        run = prepared.run([0.12, 1.0])
        print(run.time, run["joint_position"], run.units("joint_position"))

    Args:
        scenario: The scenario to simulate, its name, or the path of a file.
        parameters: Dotted keys, as of `load_scenario`, whose values every run is given; ``[2]`` at the end of one
            stands for one number of a list, a star for every name.
        record: The variables of the result that runs return, by their names in a Dataset.
        finger: Replaces the finger that the scenario describes, as for `fp.simulate`; values at its keys change it.

    Raises:
        InputError: If there is no such key or variable.
    """
    loaded = load_scenario(scenario)
    custom_finger = resolve_finger(finger, loaded)
    return Prepared(
        ParametrisedScenario(with_finger(loaded, custom_finger), tuple(parameters)), tuple(record), custom_finger
    )


class Prepared:
    """Scenario prepared for many runs, also in several threads.

    Attributes:
        family: The scenario, and those that other values make of it.
        record: Names of the variables that `run` returns.
        start: The packed state at the start, shape (size,), with the scenario's own values.
    """

    def __init__(self, family: ParametrisedScenario, record: tuple[str, ...], finger: Finger | None = None) -> None:
        """Build the parts that the runs share; use `prepare`."""
        self.family, self.record, self._custom_finger = family, record, finger
        loop = ClosedLoop.from_scenario(family.scenario, finger=finger)
        check_variables("record", record, variables(loop))
        self._finger = loop.finger
        # Evaluators and steppers of runs that have ended, for those to come; of threads each takes its own.
        self._ended: list[tuple[CompiledFinger, Stepper]] = []
        self.start: Array = loop.initial_state()
        self.start.flags.writeable = False

    def __repr__(self) -> str:
        """Return the scenario, the keys that may be changed, and the variables recorded."""
        entries = [f"{key}={value!r}" for key, value in zip(self.parameters, self.values, strict=True)]
        return f"Prepared({', '.join([self.family.scenario.name, *entries])}; records {', '.join(self.record)})"

    @property
    def parameters(self) -> tuple[str, ...]:
        """The keys whose values runs are given."""
        return self.family.keys

    @property
    def values(self) -> tuple[Any, ...]:
        """The scenario's values at the keys."""
        return self.family.values

    def scenario(self, values: Sequence[Any] | None = None) -> Scenario:
        """Return the scenario with values at the keys, by default its own.

        Raises:
            InputError: Naming the entry that is wrong.
        """
        return self.family.scenario if values is None else self.family.with_values(values)

    def run(
        self,
        values: Sequence[Any] | None = None,
        *,
        initial: ArrayLike | xr.Dataset | None = None,
        stop: Stop | None = None,
        sensitivities: bool = False,
    ) -> RunArrays:
        """Simulate, and return only the recorded variables, bit for bit those of `simulate`.

        Accuracy is not checked; `simulate` also computes the energy account.

        Args:
            values: One for each key, in their order; by default the scenario's own.
            initial: The packed state to start from, shape (size,), or a result to continue from, as for `fp.simulate`.
            stop: Asked now and then; when it returns true the run ends there.
            sensitivities: Whether to add the derivatives of what is recorded by the values, ``run.slopes[variable]`` of
                shape (p, ...), at the tolerances of the run. From the time of the attribute ``sensitivities_lost`` on
                they are beyond all measure: the motion says nothing of the values there.

        Raises:
            InputError: Naming the entry that is wrong.
            IntegrationError: If the integrator cannot go on; its ``result`` holds what was computed.
            Interrupted: After Ctrl-C, or if ``stop`` returned true; its ``result`` holds what was computed. It is a
                KeyboardInterrupt.
        """
        return interruptible(lambda token: self._run(values, initial, token, sensitivities), stop)

    def _run(
        self, values: Sequence[Any] | None, initial: ArrayLike | xr.Dataset | None, stop: Stop, sensitivities: bool
    ) -> RunArrays:
        scenario = self.scenario(values)
        setup, _, arrays = self._integrate(scenario, initial, stop)
        if not sensitivities:
            return arrays
        parameter_values = self.values if values is None else values
        for key, value in zip(self.parameters, parameter_values, strict=True):
            if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
                raise InputError(key, "sensitivities are those to single numbers", value)
        if setup.method not in TABLEAUS:
            raise InputError("simulation.method", f"sensitivities are for {', '.join(TABLEAUS)}", setup.method)
        base_values = [float(value) for value in parameter_values]
        sizes = [abs(value) or 1.0 for value in base_values]
        variations, changes = make_variations(
            base_values, sizes, lambda varied: self._setup(with_exact_encoders(self.scenario(varied)), initial)
        )
        scenario = with_exact_encoders(scenario)
        _, reference, _ = self._integrate(with_tighter_tolerances(scenario, _SENSITIVITY_FACTOR), initial, stop)
        # The unchanged run is repeated as well, so that signals without a dependence differ by exactly zero.
        setups = [self._setup(scenario, initial), *variations]
        runs = list(zip(setups, repeat_steps(reference, setups), strict=True))
        base, *varied_runs = in_threads(lambda pair: self._record(*pair), runs)
        return add_slopes(arrays, base, base_values, varied_runs, changes)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return constructor and arguments for `copy.deepcopy` and pickles."""
        return Prepared, (self.family, self.record, self._custom_finger)

    def _setup(
        self, scenario: Scenario, initial: ArrayLike | xr.Dataset | None, reused: CompiledFinger | None = None
    ) -> Setup:
        return Setup.from_scenario(scenario, self._loop(scenario, initial), reused=reused)

    def _record(self, setup: Setup, trajectory: Trajectory) -> RunArrays:
        return setup.record(trajectory, setup.scenario.sample_times(), self.record)

    def _integrate(
        self, scenario: Scenario, initial: ArrayLike | xr.Dataset | None, stop: Stop | None
    ) -> tuple[Setup, Trajectory, RunArrays]:
        """Return the setup, trajectory and arrays of a run; raise with the partial result if it ends early."""
        evaluator, before = self._ended.pop() if self._ended else (None, None)
        setup = self._setup(scenario, initial, evaluator)
        stepper = setup.stepper(reused=before) if setup.method in TABLEAUS else None
        trajectory = setup.integrate(stop=stop, stepper=stepper)
        if trajectory.failure or trajectory.interrupted:
            samples = SampledTrajectory(setup.loop, trajectory, scenario.sample_times(), self.record)
            end, partial = float(trajectory.breakpoints[-1]), record(scenario, samples, setup.method, self.record)
            if trajectory.failure:
                raise IntegrationError(end, *setup.failure(trajectory), partial)
            raise Interrupted(end, partial)
        arrays = self._record(setup, trajectory)
        if stepper is not None and isinstance(setup.loop.dynamics, CompiledFinger):
            self._ended.append((setup.loop.dynamics, stepper))
        return setup, trajectory, arrays

    def simulate(
        self,
        values: Sequence[Any] | None = None,
        *,
        initial: ArrayLike | xr.Dataset | None = None,
        progress: Callable[[float], None] | None = None,
        stop: Stop | None = None,
    ) -> xr.Dataset:
        """Simulate, and return the whole Dataset with its energy account, as `fp.simulate` does.

        Args:
            values: One for each key, in their order; by default the scenario's own.
            initial: As for `run`.
            progress: Called with the simulated time, s, now and then.
            stop: Asked now and then; when it returns true the run ends there.
        """
        scenario = self.scenario(values)
        custom, loop = custom_parts(None, None, None, initial, self._custom_finger), self._loop(scenario, initial)
        return interruptible(lambda token: run(scenario, loop, custom, progress=progress, stop=token), stop)

    def _loop(self, scenario: Scenario, initial: ArrayLike | xr.Dataset | None = None) -> ClosedLoop:
        """Return the loop of one scenario of the family."""
        # Runs in which the finger does not change share it, also in threads.
        finger = with_parameters_of(self._finger, self.family.scenario, scenario)
        loop = ClosedLoop.from_scenario(scenario, finger=finger)
        return with_initial_state(loop, initial)
