"""Stepwise simulation of a finger, for custom loops: controllers, learning, hardware in the loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from finger_pin.control.closed_loop import ClosedLoop, sampled_control
from finger_pin.control.inputs import Inputs
from finger_pin.control.palm import start_state
from finger_pin.control.stepped_drives import SteppedGoals
from finger_pin.control.user_controllers import Samples
from finger_pin.core.stepping.stepper import Stepper
from finger_pin.description.demo_motion import start_position
from finger_pin.description.loading import ParametrisedScenario, ScenarioLike, load_scenario
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError, IntegrationError
from finger_pin.mechanism.coerce import FingerLike, as_finger, resolve_finger, with_finger, with_parameters_of
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.signals import FingerSignals
from finger_pin.mechanism.state import State
from finger_pin.references.reference import Reference
from finger_pin.simulation.held_inputs import HeldInputs
from finger_pin.simulation.initial_state import (
    as_finite_array,
    check_motors,
    check_settings,
    failure_advice,
    warn_beyond_ranges,
)
from finger_pin.simulation.step_log import StepLog, stepped_scenario
from finger_pin.typing import Array


class Simulator:
    """A finger that is stepped under tensions held over each step; a palm with a path moves along it.

        sim = Simulator(Finger(load_finger("ub_stand_in")), position=[0.0, 0.3, 0.3, 0.2])
        for _ in range(1000):
            state = sim.step(tension, 1e-3)

    Attributes:
        finger: The finger.
        scenario: The scenario that is stepped; one of the finger alone, unless it was made of one.
        loop: The finger with its palm, paths and forces; its controller does not act.
        failure: Why the last step ended early; empty otherwise.
    """

    def __init__(
        self,
        finger: FingerLike,
        position: ArrayLike | None = None,
        *,
        method: str = "Rodas5P",
        rtol: float = 1e-6,
        atol_scale: float = 1e-6,
    ) -> None:
        """Start at rest, at time zero.

        By default it errs as `simulate`, 1e-5 rad on `fig6`; Rodas4 with tolerances of 1e-3, half as long, 1e-3 rad.

        Args:
            finger: The finger, or what `Finger` takes: a description, a name, or the path of a file.
            position: theta at the start, shape (n,), rad; by default amid the ranges, or where a tree starts.
            method: A compiled method.
            rtol: Relative tolerance.
            atol_scale: Absolute tolerance over the scale of each kind of state.

        Raises:
            InputError: Naming the argument that is wrong, or bodies that start deep in each other.
        """
        check_settings("", method, rtol, atol_scale)
        settings, made = {"method": method, "rtol": float(rtol), "atol_scale": float(atol_scale)}, as_finger(finger)
        first = np.array([*start_position(made.description).values()])
        posture = first if position is None else as_finite_array("position", position, first.shape)
        self._set_up(made, stepped_scenario(made.description, settings), posture, goals=False)

    @classmethod
    def from_scenario(
        cls, scenario: ScenarioLike, *, finger: FingerLike | None = None, goals: bool = False
    ) -> Simulator:
        """Return a simulator of a scenario: its finger, objects, paths, forces, start, method and tolerances.

        Its controller and its reference do not act; the reference is where it starts, and that of its results.

        Args:
            scenario: The scenario, its name, or the path of a file.
            finger: Replaces the finger that the scenario describes, as for `simulate`.
            goals: Whether the loops of motors in position drive run: inputs are then angles of spools that they hold,
                rad, from their next sample on, in place of voltages.
        """
        loaded = load_scenario(scenario)
        custom = resolve_finger(finger, loaded)
        loaded = with_finger(loaded, custom)
        settings = loaded.simulation
        check_settings("simulation.", settings.method, settings.rtol, settings.atol_scale)
        simulator = object.__new__(cls)
        simulator._set_up(custom or Finger(loaded.finger, objects=loaded.environment.objects), loaded, None, goals)
        return simulator

    def _set_up(self, finger: Finger, scenario: Scenario, posture: Array | None, goals: bool) -> None:
        """Start in a posture, or where the scenario does."""
        self._posture, self._has_goals = posture, goals and bool(finger.actuators.holds.any())
        self._family: ParametrisedScenario | None = None
        self._build(finger, scenario)
        self.reset()

    def __repr__(self) -> str:
        """Return the finger, the time and the posture."""
        posture = ", ".join(f"{angle:.4g}" for angle in self.state.position)
        return f"Simulator({self.finger.description.name} at t = {self.time:.6g} s, theta = [{posture}] rad)"

    def _build(self, finger: Finger, scenario: Scenario, reused: tuple[Any, Stepper | None] = (None, None)) -> None:
        """Build loop and stepper, of an evaluator and a stepper if those fit; `_start` gives them a state."""
        self.loop = ClosedLoop.from_scenario(scenario, finger=finger).compiled(reused[0])
        self.finger, self.scenario = finger, scenario
        rest, force = finger.rest_state(np.zeros(len(finger.routing.joints))), self.loop.fingertip_force
        settings = {name: getattr(scenario.simulation, name) for name in ("method", "rtol", "atol_scale")}
        given = finger, sampled_control(self.loop), rest, force
        self._stepper = Stepper.from_finger(*given, **settings, reused=reused[1], evaluator=self.loop.dynamics)
        self._initial_snapshot = self._stepper.state_snapshot

    def _state_at_rest(self, position: Array) -> Array:
        """Return the packed state at rest in a posture; refuse one with overlapping bodies."""
        finger, loop = self.finger, self.loop
        if self._posture is None:
            x = loop.rest_state(position, np.zeros(len(position)))
        else:
            x = start_state(finger, finger.rest_state(position), loop.palm, loop.prescribed_motion)
        if finger.scene is not None:
            finger.scene.check(finger.layout.unpack(x))
        warn_beyond_ranges(finger, x)
        return x

    def _start(self, x: Array, time: float) -> None:
        """Start from a state at a time, with a new record and zero inputs."""
        goals = SteppedGoals(self.finger, time) if self._has_goals else None
        self.failure, self._held = "", HeldInputs(self.loop, goals)
        # The snapshot also resets the loaded force.
        self._stepper.restore(self._initial_snapshot)
        if goals is not None:
            self._stepper.drive(goals.compiled)
        self._stepper.restart(x, time)
        self._time, self._log = time, StepLog(self._stepper, goals)

    def reset(self, initial: State | ArrayLike | None = None) -> State:
        """Reset to time zero with a new record; return the state.

        Args:
            initial: The packed state, the state by name, or theta, shape (n,), rad, at rest; by default the first one.
        """
        if isinstance(initial, State):
            initial = self.finger.layout.pack(initial)
        joints = (len(self.finger.routing.joints),)
        start = self._posture if initial is None else initial
        if start is None:
            x = self.loop.initial_state()
        elif np.shape(start) == joints:
            x = self._state_at_rest(as_finite_array("initial", start, joints))
        else:
            x = as_finite_array("initial", start, (self.finger.layout.size,))
            check_motors(self.finger, x)
        self._start(x, 0.0)
        return self.state

    def set_parameters(self, values: Mapping[str, Any]) -> None:
        """Change parameters, and go on from the same state at the same time, with a new record and zero inputs.

        Args:
            values: By dotted key, as of `load_scenario`, such as ``{"finger.tendon_friction.coulomb": 0.1}``; where the
                simulator was not made of a scenario, of the finger or hand alone. The state must stay what it is.
        """
        keys, alone = tuple(values), self._posture is not None
        if self._family is None or self._family.keys != keys:
            family = ParametrisedScenario
            self._family = family.from_finger(self.finger.description, keys) if alone else family(self.scenario, keys)
        scenario = self._family.with_values([*values.values()])
        if alone:
            finger = self.finger.changed(scenario.finger, self.finger.constructor_args.objects)
            scenario = stepped_scenario(scenario.finger, self.scenario.simulation)
        else:
            finger = with_parameters_of(self.finger, self.scenario, scenario)
        if finger.layout.names != self.finger.layout.names:
            raise InputError("values", "must keep what the state consists of: make another simulator")
        check_motors(finger, x := self.x, "values")
        self._build(finger, scenario, (self.loop.dynamics, self._stepper))
        self._start(x, self._time)

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self._time

    @property
    def x(self) -> Array:
        """The packed state, shape (size,), a copy; setting it goes on from there, with a new result."""
        return self._stepper.x.copy()

    @x.setter
    def x(self, value: ArrayLike) -> None:
        self._go_on(value, self._stepper.restart)

    def correct(self, x: ArrayLike) -> None:
        """Go on from a state near the present one, shape (size,), as a measurement corrects it, with a new result.

        Steps stay as long as they are; setting `x` begins with short ones, with the same bits whatever was before.
        """
        self._go_on(x, self._stepper.correct)

    def _go_on(self, value: ArrayLike, start: Callable[[Array], None]) -> None:
        """Start the stepper from a state at the present time."""
        x = as_finite_array("x", value, (self.finger.layout.size,))
        check_motors(self.finger, x, "x")
        start(x)
        self._log = StepLog(self._stepper, self._held.goals)

    @property
    def state(self) -> State:
        """The state by name; a copy."""
        return self.finger.layout.unpack(self.x)

    def step(self, inputs: Inputs, dt: float, fingertip_force: ArrayLike | None = None) -> State:
        """Advance by a time under constant tensions; return the state then.

        Args:
            inputs: u, shape (a,): tensions f^a, N; of a motor in position drive its voltage, V, at its first tendon, or
                the goal of its loop, rad; of a winch the length wound in, m; then inputs of a tree's actuators. Or by
                name, as in ``{"T1": 5.0}``.
            dt: s.
            fingertip_force: F over the step, shape (3,), of several fingers (f, 3), N, base frame, beside that of the
                scenario; none by default.

        Raises:
            InputError: If an argument is not finite or has the wrong size, or a tension is negative; nothing moved.
            IntegrationError: If the integrator cannot go on; the state is where it stopped.
        """
        command, force = self._held.check(inputs, dt, fingertip_force)
        end = self._command(command, dt)
        while True:
            piece_end = self._held.apply(self._stepper, force, self._time, end)
            status = self._stepper.advance(piece_end)
            self._end_piece(status)
            if status or piece_end == end:
                return self._state_after_step()

    def _command(self, inputs: Array, dt: float) -> float:
        """Command inputs, which act once they have arrived; return the end of the step, s."""
        self._held.command(self._time, inputs)
        return self._time + dt

    def _end_piece(self, status: int) -> None:
        """Record what has been stepped, and how it ended."""
        self._time = self._stepper.time
        self._log.add(self._time, self._held.values, self._held.force)
        self.failure = self._stepper.failure(status, self.finger.layout.names) if status else ""

    def _state_after_step(self) -> State:
        """Return the state after a step, unless it failed."""
        if self.failure:
            advice = failure_advice(self.finger, self.failure, self._stepper.x)
            raise IntegrationError(self.time, self.failure, advice)
        return self.finger.layout.unpack(self._stepper.x)

    def result(self, *, sample_rate: float = 1000.0, reference: Reference | Samples | None = None) -> xr.Dataset:
        """Return the Dataset of all steps so far, as `simulate` does: for figures, the viewer and `save`.

        The record begins at the start, or where `x` was last set. It takes about as long as the steps did, which are
        repeated bit by bit. The attribute ``custom`` marks the result.

        Args:
            sample_rate: Of the signals, Hz.
            reference: theta^d, for the record alone, as for `simulate`; by default the scenario's, or the posture at
                the start.

        Raises:
            InputError: If nothing has been run, or an argument is wrong.
            IntegrationError: If memory holds only the first steps; its ``result`` has these.
        """
        if self._posture is None and reference is None:
            reference = self.loop.reference
        return self._log.result(self.loop, self.scenario, sample_rate, reference, self._held.goals)

    def signals(self) -> FingerSignals:
        """Return all signals at the present state, under the tensions and force of the last step."""
        inputs, force = self._held.at(self.time), self._held.force_at(self.time)
        return self.loop.dynamics.evaluate(self.x, inputs, force, self.loop.base(self.time))

    def clone(self) -> Simulator:
        """Return an independent copy in the same state; both continue bit for bit the same."""
        copy = object.__new__(type(self))
        copy.__dict__ |= self.__dict__
        copy.loop, copy._stepper = self.loop.compiled(), self._stepper.copy()
        copy._held, copy._log = self._held.copy(self._stepper, copy._stepper), self._log.copy(copy._stepper)
        return copy

    __copy__ = clone  # Simulators that share a stepper would step each other.
