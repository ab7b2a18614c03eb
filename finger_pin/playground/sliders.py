"""Sliders of a played finger: inputs that move it, and parameters that can be changed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from finger_pin.control import ClosedLoop, OpenLoopTensions, SteppedDrives, spool_goals, spool_windings, voltage_signals
from finger_pin.control.input_ranges import input_ranges, spool_ranges
from finger_pin.control.interface import LoopController
from finger_pin.description.loading import ParametrisedScenario
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.mechanism.state import State
from finger_pin.references.reference import ReferenceSignals
from finger_pin.typing import Array

#: Kinds of inputs.
SCENARIO, JOINTS, TENDONS = "the scenario", "joint references", "tendons and servos"
# Period of controllers, s, and the time in which a goal follows its slider, so that a click is no blow, s.
_CONTROL_PERIOD, _FILTER_TIME = 1e-3, 0.05


@dataclass(frozen=True)
class Slider:
    """An input, with its unit and its range.

    Attributes:
        name: Of the joint, tendon or motor.
        unit: SI.
        low: Least value.
        high: Largest value.
        is_filtered: Whether its value is a goal that is approached gradually.
    """

    name: str
    unit: str
    low: float
    high: float
    is_filtered: bool = False


class Inputs:
    """The inputs of a scenario's finger over time.

    Attributes:
        kinds: The available ones of `SCENARIO`, `JOINTS` and `TENDONS`.
        kind: The present one.
        sliders: By kind.
        values: Values of the sliders, by kind.
        period: Time between commands, s.
    """

    def __init__(self, scenario: Scenario, loop: ClosedLoop) -> None:
        """Read a scenario."""
        if loop.controller.needs_sensors or scenario.controller.sampling is not None:
            raise InputError(
                "controller.sampling", "cannot be played: the playground has a controller of its own period"
            )
        if scenario.simulation.start_time:
            raise InputError("simulation.start_time", "must be 0 to be played", scenario.simulation.start_time)
        self.set_scenario(scenario, loop)
        finger = loop.finger
        self._drives = SteppedDrives(finger) if finger.actuators.holds.any() else None
        self.period = _CONTROL_PERIOD if self._drives is None else self._drives.period
        self._channels = np.setdiff1d(np.arange(finger.mechanism.channels), finger.actuators.voltages)
        self.sliders = {SCENARIO: (), TENDONS: self._tendon_sliders()}
        if not isinstance(loop.controller, OpenLoopTensions):
            self.sliders[JOINTS] = self._joint_sliders()
        self.kinds = tuple(kind for kind in (SCENARIO, JOINTS, TENDONS) if kind in self.sliders)
        self.values = {kind: np.array([max(each.low, 0.0) for each in group]) for kind, group in self.sliders.items()}
        self.reset()

    def set_scenario(self, scenario: Scenario, loop: ClosedLoop) -> None:
        """Continue with other parameters of the same scenario."""
        if isinstance(loop.controller, OpenLoopTensions):
            # The simulator delays its inputs.
            loop = replace(loop, controller=loop.controller.without_delays(scenario.finger))
        self._scenario, self._loop = scenario, loop
        self._coupling = scenario.coupling(loop.finger.routing)
        self._winding_signals = spool_windings(scenario, loop.finger)
        self._voltage_signals = voltage_signals(scenario, loop.finger, "motor_voltage")
        self._supply_signals = voltage_signals(scenario, loop.finger, "supply_voltage")
        parts = scenario.parts().values()
        self._damping = np.concatenate([part.numbers["damping"] for part in parts])

    def reset(self) -> None:
        """Return to the motion of the scenario."""
        self.kind, self._command = SCENARIO, np.zeros(self._loop.finger.mechanism.channels)
        self._goals = np.zeros(int(self._loop.finger.actuators.holds.sum()))
        self._filtered = self.values[SCENARIO]
        if self._drives is not None:
            self._drives.reset()

    def _tendon_sliders(self) -> tuple[Slider, ...]:
        finger = self._loop.finger
        low, high = input_ranges(finger)
        winched, sliders = finger.routing.winched, []
        for channel in self._channels.tolist():
            is_tendon = channel < finger.routing.actuated
            name = finger.input_names[channel].removeprefix("tendon_winding.")
            unit = "" if not is_tendon else "m" if winched[channel] else "N"
            sliders.append(Slider(name, unit, float(low[channel]), float(high[channel]), unit != "N"))
        holds = finger.actuators.holds
        if holds.any():
            names = [name for name, positioned in zip(finger.actuators.names, holds, strict=True) if positioned]
            ranges = zip(names, *(bound[holds] for bound in spool_ranges(finger)), strict=True)
            sliders += [Slider(name, "rad", float(least), float(most), True) for name, least, most in ranges]
        return tuple(sliders)

    def _joint_sliders(self) -> tuple[Slider, ...]:
        finger, limiter = self._loop.finger, self._loop.finger.stroke_limiter
        return tuple(
            Slider(finger.routing.joints[k], "rad", float(limiter.lower[k]), float(limiter.upper[k]), True)
            for k in self._coupling.free
        )

    def choose(self, kind: str, position: Array) -> None:
        """Change the kind of input; sliders take the present posture, tensions and angles.

        Args:
            kind: One of `kinds`.
            position: theta now, shape (n,), rad.
        """
        if kind not in self.kinds:
            raise InputError("kind", f"must be one of {', '.join(self.kinds)}", kind)
        if kind != SCENARIO:
            self.values[kind] = self.slider_values(kind, position)
        self.kind, self._filtered = kind, self.values[kind].copy()

    def slider_values(self, kind: str, position: Array) -> Array:
        """Return the values of the sliders of a kind at the present posture, tensions and angles."""
        tendons = np.concatenate([self._command[self._channels], self._goals])
        values = position[self._coupling.free] if kind == JOINTS else tendons
        low, high = np.array([(slider.low, slider.high) for slider in self.sliders[kind]]).T
        return np.asarray(np.clip(values, low, high))

    def set_value(self, kind: str, index: int, value: float, position: Array) -> None:
        """Move a slider, and the finger with it."""
        if kind != self.kind:
            self.choose(kind, position)
        slider = self.sliders[kind][index]
        if not slider.low <= value <= slider.high:
            raise InputError(slider.name, f"must be from {slider.low:.6g} to {slider.high:.6g}", value)
        self.values[kind] = np.array([*self.values[kind][:index], value, *self.values[kind][index + 1 :]])

    def command(self, time: float, x: Array) -> Array:
        """Return the inputs for the next period, shape (u,), as `Simulator.step` takes them.

        Args:
            time: s.
            x: The packed state, shape (size,).
        """
        loop, finger, targets = self._loop, self._loop.finger, self.values[self.kind]
        share = 1.0 - math.exp(-self.period / _FILTER_TIME)
        is_immediate = np.array([not slider.is_filtered for slider in self.sliders[self.kind]], dtype=bool)
        rate = (targets - self._filtered) / _FILTER_TIME
        self._filtered = np.where(is_immediate, targets, self._filtered + share * (targets - self._filtered))
        desired = self._desired(rate) if self.kind == JOINTS else loop.reference.at(time)
        command = np.zeros(finger.mechanism.channels)
        if self.kind == TENDONS:
            command[self._channels], self._goals = np.split(self._filtered, [len(self._channels)])
        else:
            command, self._goals = self._planned(time, x, desired)
        if self._drives is not None:
            command[finger.actuators.voltages] = self._drives.voltages(time, x, self._goals, self._supply_signals)
        for motor, signal in self._voltage_signals.items() if self.kind == SCENARIO else ():
            command[finger.actuators.channels[motor]] = signal.at(time)[0][0]
        self._command = command
        return command

    def _desired(self, rate: Array) -> ReferenceSignals:
        coupling = self._coupling
        return ReferenceSignals(coupling.posture(self._filtered), coupling.matrix[:, coupling.free] @ rate)

    def _damping_velocity(self, state: State, desired: Array) -> Array:
        """Return the velocity for the damping of a sampled controller, shape (n,), rad/s.

        Constant over a period h, damping D of a light link, D h > 2 J, would make it oscillate. It acts on the velocity
        at the period's end instead, (M + h D) v' = M v, as in Tan, Liu and Turk, IEEE CG&A 31(4), 2011. Rotors of
        servos are heavy enough.
        """
        finger = self._loop.finger
        if finger.actuators.names or not self._damping.any():
            return state.velocity
        mass = finger.rigid_body.mass_matrix(state.position)
        difference = np.linalg.solve(mass + np.diag(self.period * self._damping), mass @ (state.velocity - desired))
        return np.asarray(desired + difference)

    def _planned(self, time: float, x: Array, desired: ReferenceSignals) -> tuple[Array, Array]:
        """Return the commands of the scenario's controller, and the goals of spools."""
        finger, state = self._loop.finger, self._loop.finger.layout.unpack(x)
        velocity = self._damping_velocity(state, desired.velocity)
        plan = self._loop.controller.command(time, desired, state.position, velocity)
        command = np.array(plan.tension[: finger.routing.actuated])
        # Rounding may make a zero tension negative.
        is_tension = ~finger.routing.winched
        command[is_tension] = np.maximum(command[is_tension], 0.0)
        if plan.inputs is not None:
            command = np.concatenate([command, plan.inputs])
        if self._drives is None:
            return command, self._goals
        reference = ReferenceSignals(desired.position[None], desired.velocity[None])
        winding = self._winding_signals if self.kind == SCENARIO else {}
        return command, spool_goals(finger, self._loop.controller, np.array([time]), reference, winding)[
            0, finger.actuators.holds
        ]


#: Rooms of keys that a finger which moves can take up, and those of its controller.
FINGER, CONTROLLER_KEY = ("finger", "hand"), "controller"


@dataclass(frozen=True)
class Parameter:
    """A slider of one number, or of a factor for several.

    Attributes:
        label: In words, with its unit.
        keys: Dotted keys, as of `load_scenario`.
        values: Their values in the scenario.
        high: Largest value of the slider; the least is 0.
        factor: Whether the slider multiplies the values.
    """

    label: str
    keys: tuple[str, ...]
    values: tuple[Any, ...]
    high: float
    factor: bool

    @property
    def start(self) -> float:
        """Value of the slider for the scenario as it is."""
        return 1.0 if self.factor else float(self.values[0])

    def entries(self, number: float) -> dict[str, Any]:
        """Return the entries for a value of the slider."""
        if not 0.0 <= number <= self.high:
            raise InputError(self.label, f"must be from 0 to {self.high:.6g}", number)
        scaled = ((number * np.asarray(each, dtype=float)).tolist() if self.factor else number for each in self.values)
        return dict(zip(self.keys, scaled, strict=True))


def parameters(scenario: Scenario, controller: LoopController, extra_keys: Sequence[str] = ()) -> tuple[Parameter, ...]:
    """Return the parameters of a scenario that can be changed as it is played, and those of further keys."""
    sliders = []
    for label, keys, high, factor in _candidates(scenario, controller):
        try:
            values = ParametrisedScenario(scenario, keys).values
        except InputError:
            # The friction law of this finger has other parameters.
            continue
        factor = factor or not all(isinstance(value, int | float) for value in values)
        if any(value is None for value in values) or (
            factor and not np.any(np.concatenate([np.ravel(value) for value in values]))
        ):
            continue
        high = high if not factor else 3.0 if label == "gain" else 2.0 if label == "gravity" else 10.0
        name = f"{label.partition(',')[0]} ×" if factor else label
        sliders.append(Parameter(name, keys, values, max(high, 1.0 if factor else 2.0 * float(values[0])), factor))
    return (*sliders, *(_parameter_of(scenario, key) for key in extra_keys))


def _candidates(scenario: Scenario, controller: LoopController) -> Iterator[tuple[str, tuple[str, ...], float, bool]]:
    """Yield labels, keys, the largest value, and whether it is a factor."""
    hand = scenario.hand is not None
    finger = "hand.fingers.*.finger" if hand else "finger"
    yield "tendon friction μ", (f"{finger}.tendon_friction.coulomb",), 0.5, False
    yield "joint friction", (f"{finger}.joint_friction.coulomb", f"{finger}.joint_friction.stiction"), 0.0, True
    yield "gravity", ("hand.gravity" if hand else "finger.gravity",), 0.0, True
    if isinstance(controller, OpenLoopTensions):
        return
    yield "gain", ("controller.gain",), 0.0, True
    yield "damping, N m s/rad", ("controller.damping",), 0.1, False
    yield "least tension, N", ("controller.minimum_tension",), 10.0, False
    if scenario.finger.passive_names:
        yield "passive tension, N", ("controller.passive_tension",), 10.0, False


def _parameter_of(scenario: Scenario, key: str) -> Parameter:
    if key.partition(".")[0] not in (*FINGER, CONTROLLER_KEY):
        raise InputError(key, "cannot change while it is played; finger., hand. and controller. can")
    value = ParametrisedScenario(scenario, [key]).values[0]
    scalar = isinstance(value, int | float) and not isinstance(value, bool)
    if value is None or not (scalar or np.asarray(value).dtype.kind == "f") or not np.any(value):
        raise InputError(key, "must have a number other than 0 in the scenario for a slider", value)
    return Parameter(key if scalar else f"{key} ×", (key,), (value,), 3.0 * (value if scalar else 1.0), not scalar)
