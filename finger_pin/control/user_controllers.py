"""Controllers and references that a caller gives in place of the scenario's.

A user's own are asked for one time at a time, and checked: they need not work on arrays of times. A wrong answer is
refused at the first call. One that comes later ends the simulation there, and what was computed is kept.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from finger_pin.control.build import build_controller
from finger_pin.control.inputs import input_delays, inputs_by_name
from finger_pin.control.interface import Controller, ControlSignals, LoopController
from finger_pin.control.open_loop import OpenLoopTensions
from finger_pin.description.commands import command_place
from finger_pin.description.loading import load_scenario
from finger_pin.description.routing import Routing
from finger_pin.description.scenario import Scenario
from finger_pin.description.tables import Series
from finger_pin.description.validation import choices
from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.references.reference import LoopReference, Reference, ReferenceSignals, SignalReference
from finger_pin.references.signal import Signal
from finger_pin.typing import Array

#: Times, shape (m,), s, and values, one row for each.
Samples = tuple[ArrayLike, ArrayLike]
#: Times, and columns by name.
Columns = tuple[ArrayLike, Mapping[str, ArrayLike]]

# Least tension, N: below zero by rounding.
_LEAST_TENSION = -1e-6


class UserReference:
    """Custom reference.

    Attributes:
        reference: Asked for one time, s, at a time.
        joints: Names, n of them.
        start: Its time when the simulation begins, s.
    """

    def __init__(self, reference: Reference, joints: Sequence[str], start: float) -> None:
        """Take a reference."""
        if not callable(getattr(reference, "at", None)):
            allowed = "must have at(time), or be a pair of arrays: times, and angles with one row for each"
            raise InputError("reference", allowed, type(reference).__name__)
        self.reference, self.joints, self.start = reference, joints, start

    def at(self, time: Array | float) -> ReferenceSignals:
        """Return theta^d and its rate at one time, or at times of shape (m,)."""
        if np.ndim(time) == 0:
            return self._at_instant(float(time))
        answers = [self._at_instant(float(each)) for each in np.asarray(time)]
        return ReferenceSignals(
            np.array([each.position for each in answers]), np.array([each.velocity for each in answers])
        )

    def signals(self) -> tuple[Signal, ...]:
        """Return no signals: what a custom reference or controller follows is unknown."""
        return ()

    def planned(self) -> None:
        """Return None: a custom reference has no plan for the compiled core."""

    def _at_instant(self, time: float) -> ReferenceSignals:
        answer = self.reference.at(time + self.start)
        values = []
        for name in ("position", "velocity"):
            if not hasattr(answer, name):
                raise InputError("reference", "at(time) must return ReferenceSignals(position, velocity)")
            value = _as_floats(getattr(answer, name))
            if value.shape != (len(self.joints),) or not np.isfinite(value).all():
                allowed = f"{name} at t = {time:g} s must be {len(self.joints)} finite numbers, one per joint"
                raise InputError("reference", allowed, value.tolist())
            values.append(value)
        return ReferenceSignals(*values)


class UserController(LoopController):
    """Custom controller.

    It returns `ControlSignals`, or only the tensions, of all tendons or of the actuated ones, and behind them the
    inputs of a tree's actuators; or numbers by name, ``{"T1": 3.0, "tendon_winding.T2": 0.01, "servo": 0.2}``. What is
    wound by a winch is in m.

    Attributes:
        controller: Asked for one time at a time: time, s, `ReferenceSignals`, theta and theta', shape (n,).
        problem: Message of an error after the first command, or empty.
        problem_time: When, s.
    """

    def __init__(self, controller: Controller, finger: Finger, start: float) -> None:
        """Take a controller; ``start`` is its time when the simulation begins, s."""
        if not callable(getattr(controller, "command", None)):
            allowed = (
                "must have command(time, reference, position, velocity), or be a pair of arrays: times, and tensions"
            )
            raise InputError("controller", allowed, type(controller).__name__)
        self.controller, self.problem, self.problem_time = controller, "", -np.inf
        self.needs_sensors = callable(getattr(controller, "sense", None))
        self.sensors = tuple(getattr(controller, "sensors", ()))
        self._finger, self._routing, self._start, self._called = finger, finger.routing, start, False
        self._actuators = tuple(finger.description.tree.actuators)
        delays = input_delays(finger.description, finger.routing)
        self.delays = delays if delays.any() else None

    def command(
        self, time: Array | float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return the commands for shapes (..., n)."""
        if np.ndim(position) == 1:
            return self._at_instant(float(time), reference, position, velocity)
        times = np.broadcast_to(time, len(position))
        rows = zip(times, reference.position, reference.velocity, position, velocity, strict=True)
        answers = [self._at_instant(float(t), ReferenceSignals(p, v), *motion) for t, p, v, *motion in rows]
        missing = [each.torque_deficit for each in answers if each.torque_deficit is not None]
        return ControlSignals(
            np.array([each.torque for each in answers]),
            np.array([each.tension for each in answers]),
            np.array(missing) if len(missing) == len(answers) else None,
            np.array([each.inputs for each in answers]) if self._actuators else None,
        )

    def sense(self, readings: Mapping[str, Array], elapsed: float) -> None:
        """Pass on the sensors' readings."""
        self.controller.sense(readings, elapsed)  # type: ignore[attr-defined]

    def _at_instant(self, time: float, reference: ReferenceSignals, position: Array, velocity: Array) -> ControlSignals:
        first, self._called = not self._called, True
        try:
            signals = self._to_signals(self.controller.command(time + self._start, reference, position, velocity))
            # A rejected trial step may have a motion that is not finite; then the answer need not be finite.
            self._check(signals, first or bool(np.isfinite(position).all() and np.isfinite(velocity).all()))
            return signals
        except Exception as error:
            if first:
                raise
            # An integrator that meets this in a step that it tries takes a smaller one; in the end it stops.
            text = (
                str(error)
                if isinstance(error, InputError)
                else f"the controller raised {type(error).__name__}: {error}"
            )
            self.problem, self.problem_time = " ".join(text.split()), time
            routing, actuators = self._routing, self._actuators
            unknown = np.full(len(routing.tendons), np.nan)
            inputs = np.full(len(actuators), np.nan) if actuators else None
            return ControlSignals(np.zeros(len(routing.joints)), unknown, inputs=inputs)

    def _to_signals(self, answer: object) -> ControlSignals:
        routing, actuators = self._routing, self._actuators
        if isinstance(answer, Mapping):
            answer = inputs_by_name("controller", answer, self._finger, with_loops=True)
        tension, inputs = _as_floats(getattr(answer, "tension", answer)), getattr(answer, "inputs", None)
        if actuators and inputs is None and tension.shape == (routing.actuated + len(actuators),):
            tension, inputs = np.split(tension, [routing.actuated])
        if actuators and (inputs is None or np.shape(inputs) != (len(actuators),)):
            allowed = f"command() must return the inputs of {', '.join(actuators)} too: by name, or behind the tensions"
            raise InputError("controller", allowed)
        if tension.shape not in ((len(routing.tendons),), (routing.actuated,)):
            sizes = " or ".join(map(str, dict.fromkeys([routing.actuated, len(routing.tendons)])))
            names = ", ".join(routing.tendons)
            allowed = f"command() must return {sizes} tensions ({names}) for one time, not shape {tension.shape}"
            raise InputError("controller", allowed)
        pulled = np.where(routing.winched, 0.0, tension[: routing.actuated])
        torque = _as_floats(getattr(answer, "torque", pulled @ routing.actuated_coupling))
        if torque.shape != (len(routing.joints),):
            allowed = f"command() must return {len(routing.joints)} torques for one time, not shape {torque.shape}"
            raise InputError("controller", allowed)
        # A passive tendon without a planned tension is planned to carry none.
        tension = np.append(tension, np.zeros(len(routing.tendons) - len(tension)))
        inputs = _as_floats(inputs) if actuators else None
        return ControlSignals(torque, tension, getattr(answer, "torque_deficit", None), inputs)

    def _check(self, signals: ControlSignals, finite: bool) -> None:
        routing = self._routing
        for k, (name, tension) in enumerate(zip(routing.tendons, signals.tension, strict=True)):
            pushes = tension < _LEAST_TENSION and not (k < routing.actuated and routing.winched[k])
            if pushes or (finite and not np.isfinite(tension)):
                allowed = f"tensions must be finite and not negative, that of {name} is not; clip it at 0 or above"
                raise InputError("controller", allowed, float(tension))
        if finite and signals.inputs is not None and not np.isfinite(signals.inputs).all():
            raise InputError("controller", "inputs of actuators must be finite", signals.inputs.tolist())


def _as_floats(value: object) -> Array:
    try:
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        return np.full((), np.nan)


def with_named_samples(
    scenario: Scenario, controller: Controller | Samples | Columns | None
) -> tuple[Scenario, Controller | Samples | None]:
    """Return a scenario with samples given by name, times and columns, and the controller that is left, if any.

    Columns have the names of ``controller.file``: tendons, actuators of a tree, ``spool_angle.NAME`` and its kin.
    """
    if not (isinstance(controller, tuple | list) and len(controller) == 2 and isinstance(controller[1], Mapping)):
        return scenario, controller
    times, overrides = controller[0], dict[str, Any]()
    for name, values in controller[1].items():
        actuators = scenario.finger.tree.actuators
        table, label = command_place(name, actuators)
        if table == "tensions" and label not in scenario.finger.tendons:
            allowed = (*scenario.finger.actuated_names, *actuators)
            raise InputError(f"controller.{name}", f"no such tendon or actuator; there are {choices(name, allowed)}")
        samples = {"kind": "samples", "times": Series(_as_floats(times)), "values": Series(_as_floats(values))}
        overrides[f"controller.{table}.{label}"] = samples
        if table in ("tensions", "inputs"):
            overrides["controller.kind"] = "tensions"
    return load_scenario(scenario, overrides), None


def choose_controller(controller: Controller | Samples | None, scenario: Scenario, finger: Finger) -> LoopController:
    """Return the controller that a caller gives, ready to be asked, or the scenario's if none is given."""
    if controller is None:
        return build_controller(scenario, finger)
    if isinstance(controller, tuple | list):
        return OpenLoopTensions.from_samples(controller, scenario, finger.routing)
    if isinstance(controller, LoopController):
        return controller
    return UserController(controller, finger, scenario.simulation.start_time)


def choose_reference(reference: Reference | Samples | None, scenario: Scenario, routing: Routing) -> LoopReference:
    """Return the reference that a caller gives, ready to be asked, or the scenario's if none is given."""
    if reference is None:
        return SignalReference.from_scenario(scenario, routing)
    if isinstance(reference, tuple | list):
        return SignalReference.from_samples(reference, scenario, routing)
    if isinstance(reference, SignalReference):
        return reference
    return UserReference(reference, routing.joints, scenario.simulation.start_time)
