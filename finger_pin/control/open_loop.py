"""Tensions over time, and lengths that winches wind in, in open loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from finger_pin.control.inputs import input_delays
from finger_pin.control.interface import ControlSignals, LoopController
from finger_pin.core.tables.inputs import InputTable, core_signal, scheduled_control
from finger_pin.description.effects import wound_tendons
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.routing import Routing
from finger_pin.description.scenario import Scenario
from finger_pin.description.signals import ForceSignal, InputSignal, SignalSettings
from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.references.reference import LoopReference, ReferenceSignals
from finger_pin.references.signal import Signal
from finger_pin.typing import Array


@dataclass(frozen=True, eq=False)
class OpenLoopTensions(LoopController):
    """Open-loop inputs: f^a over time, or of winches the length that they wind in.

    The torque that goes with it is what tensions would exert free of friction; passive ones are planned to be zero.

    Attributes:
        signal: A signal for each of the a actuated tendons, N, of winches m, then for each actuator of a tree.
        routing: The routing.
    """

    signal: Signal
    routing: Routing

    @classmethod
    def from_scenario(cls, scenario: Scenario, routing: Routing) -> OpenLoopTensions:
        """Read ``controller.tensions``, ``tendon_winding`` and ``inputs``.

        What has none holds the keyframe's, else the minimum or 0; of what is wound no tension is planned.
        """
        wound = wound_tendons(scenario, scenario.controller)
        signals: dict[str, SignalSettings] = dict.fromkeys(wound, _constant_tension(0.0))
        signals |= scenario.controller.tensions or {}
        winched = dict(zip(routing.tendons, routing.winched, strict=False))
        signals |= {name: each for name, each in (scenario.controller.tendon_winding or {}).items() if winched[name]}
        keyframe_inputs = scenario.keyframe.inputs if scenario.keyframe else {}
        minimum = scenario.numbers["minimum_tension"]
        settings: list[SignalSettings] = [
            signals.get(name) or _constant_tension(keyframe_inputs.get(name, float(tension)))
            for name, tension in zip(routing.tendons[: routing.actuated], minimum, strict=False)
        ]
        actuator_signals = scenario.controller.inputs or {}
        for name in scenario.finger.tree.actuators:
            settings.append(actuator_signals.get(name) or _constant_input(keyframe_inputs.get(name, 0.0)))
        return cls._from_signal(Signal.from_settings(settings, scenario.simulation.rtol), scenario, routing)

    @classmethod
    def from_samples(
        cls, samples: tuple[ArrayLike, ArrayLike], scenario: Scenario, routing: Routing
    ) -> OpenLoopTensions:
        """Return the tensions through samples: times, shape (m,), s, and tensions, shape (m, a), N, of winches m.

        Inputs of a tree's actuators follow in further columns.
        """
        columns = (*routing.tendons[: routing.actuated], *scenario.finger.tree.actuators)
        signal = Signal.from_samples("controller", samples, columns, scenario.simulation.rtol)
        lowest = float(np.min(np.asarray(samples[1])[:, : routing.actuated][:, ~routing.winched], initial=0.0))
        if lowest < 0.0:
            raise InputError("controller", "tensions must not be negative: a tendon only pulls", lowest)
        return cls._from_signal(signal, scenario, routing)

    @classmethod
    def _from_signal(cls, signal: Signal, scenario: Scenario, routing: Routing) -> OpenLoopTensions:
        """Return the signals after the delays of a tree's actuators, their time counted from that of the start."""
        delays = input_delays(scenario.finger, routing)
        return cls(signal.delayed(delays).starting_at(scenario.simulation.start_time), routing)

    def without_delays(self, finger: FingerDescription) -> OpenLoopTensions:
        """Return the inputs as they are commanded, before the delays of a tree's actuators."""
        return OpenLoopTensions(self.signal.delayed(-input_delays(finger, self.routing)), self.routing)

    def command(
        self, time: Array | float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return the tensions at one time, or at times of shape (m,), with their torque by (7)."""
        # Rounding may take what is at zero below it.
        inputs, actuated = self.signal.at(time)[0], self.routing.actuated
        winched = self.routing.winched
        pulled = np.where(winched, inputs[..., :actuated], np.maximum(inputs[..., :actuated], 0.0))
        planned = np.zeros((*pulled.shape[:-1], self.routing.passive))
        return ControlSignals(
            np.where(winched, 0.0, pulled) @ self.routing.actuated_coupling,
            np.concatenate([pulled, planned], axis=-1),
            inputs=inputs[..., actuated:],
        )

    def as_control(self, reference: LoopReference, finger: Finger) -> InputTable:
        """Return the schedule as an input table; motors in position drive follow their loops."""
        schedule, positioned = core_signal(self.signal), finger.actuators.positioned
        schedule.harmonics[positioned] = 0.0
        schedule.coefficients[..., positioned] = 0.0
        return scheduled_control(schedule, finger.mechanism.coordinates)

    def signals(self) -> tuple[Signal, ...]:
        """Return the schedule."""
        return (self.signal,)

    def stateless(self) -> OpenLoopTensions:
        """Return itself: it remembers nothing."""
        return self

    @classmethod
    def from_fingers(cls, controllers: Sequence[OpenLoopTensions], routing: Routing) -> OpenLoopTensions:
        """Return the schedule of a hand from those of its fingers: tensions of all, then inputs of all."""
        joined = Signal.from_signals([each.signal for each in controllers])
        are_inputs = [k >= each.routing.actuated for each in controllers for k in range(len(each.signal.harmonics))]
        order = np.argsort(are_inputs, kind="stable")
        return cls(Signal(joined.harmonics[order], joined.knots, joined.coefficients[..., order]), routing)


@lru_cache
def _constant_tension(tension: float) -> ForceSignal:
    return ForceSignal(offset=tension)


@lru_cache
def _constant_input(value: float) -> InputSignal:
    return InputSignal(offset=value)
