"""Stepwise simulation of a finger, for custom loops: controllers, learning, hardware in the loop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from finger_pin.control.input_queue import InputQueue, input_delays
from finger_pin.control.named_inputs import Inputs, inputs_by_name
from finger_pin.control.palm import PalmPath, PrescribedPaths, start_state, with_paths
from finger_pin.control.user_controllers import Samples
from finger_pin.core.signals.compiled_finger import CompiledFinger
from finger_pin.core.stepping.batch_stepper import BatchStepper
from finger_pin.core.stepping.stepper import TABLEAUS, Stepper
from finger_pin.core.tables.inputs import held_control
from finger_pin.description.demo_motion import start_position
from finger_pin.description.loading import ParametrisedScenario
from finger_pin.description.validation import suggestion
from finger_pin.exceptions import InputError, IntegrationError
from finger_pin.mechanism.coerce import FingerLike, as_finger
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.finger_signals import FingerSignals
from finger_pin.mechanism.state import State
from finger_pin.references.reference import Reference
from finger_pin.simulation.initial_state import as_finite_array, check_motors, warn_beyond_ranges
from finger_pin.simulation.step_log import StepLog
from finger_pin.typing import Array

_ADVICE = "a smaller rtol, smaller tensions, or softer contacts and tendons"


class Simulator:
    """A finger that is stepped under tensions held over each step; a palm with a path moves along it.

        sim = Simulator(Finger(load_finger("ub_stand_in")), position=[0.0, 0.3, 0.3, 0.2])
        for _ in range(1000):
            state = sim.step(tension, 1e-3)

    Attributes:
        finger: The finger.
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
        if method not in TABLEAUS:
            raise InputError("method", f"must be one of {', '.join(TABLEAUS)}{suggestion(method, TABLEAUS)}", method)
        for name, value in (("rtol", rtol), ("atol_scale", atol_scale)):
            if not 0.0 < value <= 0.1:
                raise InputError(name, "must be above 0 and at most 0.1", value)
        self._settings: dict[str, Any] = {"method": method, "rtol": float(rtol), "atol_scale": float(atol_scale)}
        self._family: ParametrisedScenario | None = None
        self._build(as_finger(finger))
        first = np.array([*start_position(self.finger.description).values()])
        self._posture = first if position is None else as_finite_array("position", position, first.shape)
        self._start(self._state_at_rest(self._posture), 0.0)

    def __repr__(self) -> str:
        """Return the finger, the time and the posture."""
        posture = ", ".join(f"{angle:.4g}" for angle in self.state.position)
        return f"Simulator({self.finger.description.name} at t = {self.time:.6g} s, theta = [{posture}] rad)"

    def _build(self, finger: Finger) -> None:
        """Build the stepper of a finger; `_start` gives it a state."""
        self.finger, mechanism = finger, finger.mechanism
        self._guides = PrescribedPaths.from_finger(finger, 0.0, self._settings["rtol"])
        self._palm = PalmPath.from_hand(finger.description.hand, 0.0, finger, self._settings["rtol"])
        control = with_paths(held_control(mechanism.channels, mechanism.coordinates), self._palm, self._guides)
        rest = finger.rest_state(np.zeros(len(finger.routing.joints)))
        self._stepper = Stepper.from_finger(finger, control, rest, **self._settings)
        self._initial_snapshot = self._stepper.state_snapshot
        self._compiled = CompiledFinger(finger)
        self._tension_channels = np.setdiff1d(np.flatnonzero(~finger.routing.winched), finger.actuators.voltages)

    def _state_at_rest(self, position: Array) -> Array:
        """Return the packed state at rest in a posture; refuse one with overlapping bodies."""
        finger = self.finger
        x = start_state(finger, finger.rest_state(position), self._palm, self._guides)
        if finger.scene is not None:
            finger.scene.check(finger.layout.unpack(x))
        warn_beyond_ranges(finger, x)
        return x

    def _start(self, x: Array, time: float) -> None:
        """Start from a state at a time, with a new record and zero inputs."""
        tips = len(self.finger.mechanism.body.tips)
        self._inputs = np.zeros(self.finger.mechanism.channels)
        self._queue = InputQueue(input_delays(self.finger.description, self.finger.routing))
        self._force = self._zero_force = np.zeros(3 if tips == 1 else (tips, 3))
        # The snapshot also resets the loaded force.
        self._stepper.restore(self._initial_snapshot)
        self._stepper.restart(x, time)
        self._log = StepLog(self._stepper)

    def reset(self, initial: State | ArrayLike | None = None) -> State:
        """Reset to time zero with a new record; return the state.

        Args:
            initial: The packed state, the state by name, or theta, shape (n,), rad, at rest; by default the first one.

        Raises:
            InputError: If it has another size, a number is not finite, or a motor turns too fast; nothing changed.
        """
        if isinstance(initial, State):
            initial = self.finger.layout.pack(initial)
        if initial is None or np.shape(initial) == self._posture.shape:
            posture = self._posture if initial is None else initial
            x = self._state_at_rest(as_finite_array("initial", posture, self._posture.shape))
        else:
            x = as_finite_array("initial", initial, (self.finger.layout.size,))
            check_motors(self.finger, x)
        self._start(x, 0.0)
        return self.state

    def set_parameters(self, values: Mapping[str, Any]) -> None:
        """Change parameters of the finger, and go on from the same state at the same time, with a new record.

        Args:
            values: By dotted key, as of `load_finger`, such as ``{"finger.tendon_friction.coulomb": 0.1}``.

        Raises:
            InputError: Naming the entry that is wrong, or if the finger had another state; nothing changed.
        """
        if self._family is None or self._family.keys != tuple(values):
            self._family = ParametrisedScenario.from_finger(self.finger.description, tuple(values))
        description = self._family.with_values([*values.values()]).finger
        finger = self.finger.changed(description, self.finger.constructor_args.objects)
        if finger.layout.names != self.finger.layout.names:
            raise InputError("values", "make a finger with another state: make another simulator of it")
        check_motors(finger, x := self.x, "values")
        time = self.time
        self._build(finger)
        self._start(x, time)

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self._stepper.time

    @property
    def x(self) -> Array:
        """The packed state, shape (size,), a copy; setting it goes on from there, with a new result."""
        return self._stepper.x.copy()

    @x.setter
    def x(self, value: ArrayLike) -> None:
        x = as_finite_array("x", value, (self.finger.layout.size,))
        check_motors(self.finger, x, "x")
        self._stepper.restart(x)
        self._log = StepLog(self._stepper)

    @property
    def state(self) -> State:
        """The state by name; a copy."""
        return self.finger.layout.unpack(self.x)

    def step(self, inputs: Inputs, dt: float, fingertip_force: ArrayLike | None = None) -> State:
        """Advance by a time under constant tensions; return the state then.

        Args:
            inputs: u, shape (a,): tensions f^a, N; of a motor in position drive its voltage, V, at its first tendon; of
                a winch the length wound in, m; then inputs of a tree's actuators. Or by name, as in ``{"T1": 5.0}``.
            dt: s.
            fingertip_force: F over the step, shape (3,), of several fingers (f, 3), N, base frame; none by default.

        Raises:
            InputError: If an argument is not finite or has the wrong size, or a tension is negative; nothing moved.
            IntegrationError: If the integrator cannot go on; the state is where it stopped.
        """
        command, force = self._check_step(inputs, dt, fingertip_force)
        end = self.time + dt
        self._queue.add(self.time, command)
        while True:
            piece_end = self._apply_inputs(force, end)
            status = self._stepper.advance(piece_end)
            self._log.add(self._stepper.time, self._inputs, self._force)
            if status or piece_end == end:
                return self._state_after(status)

    def _check_step(self, inputs: Inputs, dt: float, fingertip_force: ArrayLike | None) -> tuple[Array, Array]:
        if isinstance(inputs, Mapping):
            inputs = inputs_by_name("inputs", inputs, self.finger)
        command, force = as_finite_array("inputs", inputs, self._inputs.shape), self._zero_force
        if min(command.tolist(), default=0.0) < 0.0 and (command[self._tension_channels] < 0.0).any():
            raise InputError("inputs", "a tension must not be negative: a tendon cannot push", command.tolist())
        if not isinstance(dt, Real) or not 0.0 < dt < np.inf:
            raise InputError("dt", "must be above 0 and finite", dt)
        if fingertip_force is None:
            return command, force
        return command, as_finite_array("fingertip_force", fingertip_force, force.shape)

    def _apply_inputs(self, force: Array, end: float) -> float:
        """Apply a force and the inputs that have arrived; return the end, or the time of the next arrival, s."""
        if force is not self._force:
            self._stepper.load(force)
        self._inputs, self._force = self._queue.at(self.time), force
        self._stepper.hold(self._inputs)
        return self._queue.next_arrival(self.time, end)

    def _state_after(self, status: int) -> State:
        """Return the state after a step, unless it failed."""
        if status:
            raise IntegrationError(self.time, self._stepper.failure(status, self.finger.layout.names), _ADVICE)
        return self.finger.layout.unpack(self._stepper.x)

    def result(self, *, sample_rate: float = 1000.0, reference: Reference | Samples | None = None) -> xr.Dataset:
        """Return the Dataset of all steps so far, as `simulate` does: for figures, the viewer and `save`.

        The record begins at the start, or where `x` was last set. It takes about as long as the steps did, which are
        repeated bit by bit. The attribute ``custom`` marks the result.

        Args:
            sample_rate: Of the signals, Hz.
            reference: theta^d, for the record alone, as for `simulate`; by default the posture at the start.

        Raises:
            InputError: If nothing has been run, or an argument is wrong.
            IntegrationError: If memory holds only the first steps; its ``result`` has these.
        """
        return self._log.result(self.finger, {**self._settings, "sample_rate": sample_rate}, reference, self._palm)

    def signals(self) -> FingerSignals:
        """Return all signals at the present state, under the tensions and force of the last step."""
        base_motion = path.base(self.time) if (path := self._palm or self._guides) else None
        return self._compiled.evaluate(self.x, self._inputs, self._force, base_motion)

    def clone(self) -> Simulator:
        """Return an independent copy in the same state; both continue bit for bit the same."""
        copy = object.__new__(type(self))
        copy.__dict__ |= self.__dict__
        copy._compiled, copy._stepper = CompiledFinger(self.finger), self._stepper.copy()
        copy._log, copy._queue = self._log.copy(copy._stepper), self._queue.copy()
        return copy

    __copy__ = clone  # Simulators that share a stepper would step each other.


def step_many(
    simulators: Sequence[Simulator],
    tensions: Sequence[Inputs],
    dt: float,
    fingertip_forces: Sequence[ArrayLike] | None = None,
) -> list[State]:
    """Advance many simulators by a time, side by side in threads; return their states then.

    Each does bit by bit what `Simulator.step` does. There is no Python between the steps.

    Args:
        simulators: The simulators, none of them twice.
        tensions: The inputs of `Simulator.step` for each.
        dt: s.
        fingertip_forces: The force of `Simulator.step` for each; none by default.

    Raises:
        InputError: If numbers of them differ, a simulator stands there twice, or an argument is wrong; nothing moved.
        IntegrationError: If the integrator of one cannot go on; the others have stepped.
    """
    count = len(simulators)
    forces: Sequence[ArrayLike | None] = [None] * count if fingertip_forces is None else fingertip_forces
    for name, values in (("tensions", tensions), ("fingertip_forces", forces)):
        if len(values) != count:
            raise InputError(name, f"must be {count}, one per simulator", len(values))
    if len({id(simulator) for simulator in simulators}) < count:
        raise InputError("simulators", "must differ: one stands there twice; use clone")
    steps = [each._check_step(inputs, dt, f) for each, inputs, f in zip(simulators, tensions, forces, strict=True)]
    ends, statuses, active = [simulator.time + dt for simulator in simulators], [0] * count, [*range(count)]
    for simulator, (command, _) in zip(simulators, steps, strict=True):
        simulator._queue.add(simulator.time, command)
    while active:
        times = [simulators[k]._apply_inputs(steps[k][1], ends[k]) for k in active]
        new_statuses = BatchStepper([simulators[k]._stepper for k in active]).advance(times)
        for k, statuses[k] in zip(active, new_statuses, strict=True):
            simulators[k]._log.add(simulators[k].time, simulators[k]._inputs, simulators[k]._force)
        active = [k for k, time in zip(active, times, strict=True) if time < ends[k] and not statuses[k]]
    return [simulator._state_after(status) for simulator, status in zip(simulators, statuses, strict=True)]
