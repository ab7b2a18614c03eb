"""Signals that motors in position drive are given: windings of their spools, their voltages and their supplies."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from finger_pin.description.scenario import Scenario
from finger_pin.description.signals import SignalSettings
from finger_pin.mechanism.finger import Finger
from finger_pin.references.signal import Signal
from finger_pin.typing import Array


def spool_windings(scenario: Scenario, finger: Finger) -> dict[int, tuple[Signal, float]]:
    """Return the windings of motors in position drive, by their number: rad, or m and the radius of the spool."""
    actuators, windings = finger.actuators, dict[int, tuple[SignalSettings, float]]()
    cords = [finger.routing.tendons[k] for k in actuators.tendons]
    for part in scenario.parts().values():
        for name, settings in (part.controller.spool_angle or {}).items():
            windings[actuators.names.index(name)] = settings, 1.0
        for name, length in (part.controller.tendon_winding or {}).items():
            if name in cords:
                radii = actuators.spools[cords.index(name)]
                motor = int(np.argmax(radii != 0.0))
                windings[motor] = length, float(radii[motor])
    tolerance = scenario.simulation.rtol
    return {motor: (Signal.from_settings([each], tolerance), radius) for motor, (each, radius) in windings.items()}


def voltage_signals(scenario: Scenario, finger: Finger, table: str) -> dict[int, Signal]:
    """Return the voltages of a table of the controller, ``motor_voltage`` or ``supply_voltage``, by motor number, V."""
    tolerance, names = scenario.simulation.rtol, finger.actuators.names
    return {
        names.index(name): Signal.from_settings([each], tolerance)
        for part in scenario.parts().values()
        for name, each in (getattr(part.controller, table) or {}).items()
    }


def sampled_voltages(signals: Mapping[int, Signal], times: Array, start_time: float, default: Array) -> Array:
    """Return voltages of motors at times of a motion, shape (k, m), V; without a signal the others, shape (m,)."""
    values: Array = np.tile(default, (len(times), 1))
    for motor, signal in signals.items():
        values[:, motor] = signal.starting_at(start_time).at(times)[0][:, 0]
    return values
