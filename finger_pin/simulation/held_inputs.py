"""Inputs, goals and forces that a simulator holds over its steps."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.control.inputs import InputQueue, Inputs, input_delays, inputs_by_name
from finger_pin.control.stepped_drives import SteppedGoals
from finger_pin.core.stepping.stepper import Stepper
from finger_pin.exceptions import InputError
from finger_pin.simulation.initial_state import as_finite_array
from finger_pin.typing import Array


class HeldInputs:
    """Inputs of a stepper from a start on, zero until the first ones arrive.

    Attributes:
        values: The inputs that have arrived, shape (u,).
        force: At the tip, shape (3,), of several fingers (f, 3), N, base frame.
        goals: Loops of motors in position drive, whose inputs are goals; None for voltages.
    """

    def __init__(self, loop: ClosedLoop, goals: SteppedGoals | None) -> None:
        """Start with the force of a loop."""
        finger = loop.finger
        self._loop, self.goals = loop, goals
        self.values, self.force = np.zeros(finger.mechanism.channels), loop.fingertip_force
        self._queue = InputQueue(input_delays(finger.description, finger.routing))
        pulls = ~finger.routing.winched
        pulls[finger.actuators.voltages] = False
        self._tension_channels = np.flatnonzero(pulls)

    def check(self, inputs: Inputs, dt: float, fingertip_force: ArrayLike | None) -> tuple[Array, Array]:
        """Return inputs and force of a step as arrays; refuse what is wrong with them or its duration, s."""
        if isinstance(inputs, Mapping):
            inputs = inputs_by_name("inputs", inputs, self._loop.finger, goals=self.goals is not None)
        values = as_finite_array("inputs", inputs, self.values.shape)
        if min(values.tolist(), default=0.0) < 0.0 and (values[self._tension_channels] < 0.0).any():
            raise InputError("inputs", "a tension must not be negative: a tendon cannot push", values.tolist())
        # Of a float nobody has to ask the abstract class.
        if not isinstance(dt, (float, Real)) or not 0.0 < dt < np.inf:
            raise InputError("dt", "must be above 0 and finite", dt)
        own = self._loop.fingertip_force
        if fingertip_force is None:
            return values, own
        if self._loop.varying_force is not None:
            raise InputError("fingertip_force", "must be left out: the scenario has one that varies", fingertip_force)
        return values, own + as_finite_array("fingertip_force", fingertip_force, own.shape)

    def command(self, time: float, values: Array) -> None:
        """Command inputs at a time, s."""
        self._queue.add(time, values)

    def apply(self, stepper: Stepper, force: Array, start: float, end: float) -> float:
        """Apply a force and what has arrived by a start, s; return when the next arrives, s, at most the end."""
        if force is not self.force:
            stepper.load(force)
        self.values, self.force = self._queue.at(start), force
        stepper.hold(self.values)
        piece_end = self._queue.next_arrival(start, end)
        if self.goals is not None:
            self.goals.hold(stepper, self.values[self.goals.channels], piece_end)
        return piece_end

    def at(self, time: float) -> Array:
        """Return the inputs of the mechanism now, shape (u,), with the voltages of loops in place of their goals."""
        if self.goals is None:
            return self.values
        inputs = self.values.copy()
        inputs[self.goals.channels] = self.goals.voltages(time)
        return inputs

    def force_at(self, time: float) -> Array:
        """Return the force now, shape (3,), of several fingers (f, 3), N, base frame."""
        return self.force if self._loop.varying_force is None else self._loop.force(time)

    def copy(self, stepper: Stepper, twin: Stepper) -> HeldInputs:
        """Return a copy for the copy of a stepper."""
        copy = object.__new__(type(self))
        copy.__dict__ |= self.__dict__
        copy._queue = self._queue.copy()
        if self.goals is not None:
            copy.goals = self.goals.copy(stepper)
            twin.drive(copy.goals.compiled)
        return copy
