"""Motors in position drive: a sampled loop per servo holds the angle of its spool.

    theta_m^d = (l(q^d) + f^d / K - e0) / r,   U = V clip(k_p e + k_d e' + k_i int e, -1, 1)

f^d are the tensions that the controller plans for the reference itself: what keeps tendons taut, and what compensates
gravity or friction if it does. What the finger really needs beyond them has to come from angles that err.
A motor whose spool angle or wound cord is given follows that in place of theta_m^d; one whose voltage
is given has no loop.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from finger_pin.control.interface import ControlSignals, LoopController
from finger_pin.core.stepping.drives import Drives
from finger_pin.description.actuators import Actuator
from finger_pin.description.scenario import Scenario
from finger_pin.description.signals import SignalSettings
from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.references.reference import Reference, ReferenceSignals
from finger_pin.references.signal import Signal
from finger_pin.typing import Array


class DriveSignals(Protocol):
    """The voltages of motors in position drive over time.

    Attributes:
        channels: The inputs that are voltages, shape (m,).
    """

    channels: NDArray[np.int64]

    @property
    def compiled(self) -> Drives | None:
        """The loops as arrays, for the voltages; None if these are given."""

    def planned(self, time: Array | float, reference: ReferenceSignals, control: ControlSignals) -> ControlSignals:
        """Return the commands as they are recorded."""

    def voltages(self, time: Array | float) -> Array:
        """Return the voltages at one time, shape (m,), or at times (k,), shape (k, m), V."""


@dataclass(eq=False)
class PrescribedVoltages:
    """Voltages set by a caller such as `Simulator.step`, without planned tensions.

    Attributes:
        channels: The inputs that are voltages, shape (m,).
        signal: Over time, m functions, V.
    """

    channels: NDArray[np.int64]
    signal: Signal
    compiled: None = None

    def planned(self, time: Array | float, reference: ReferenceSignals, control: ControlSignals) -> ControlSignals:
        """Return the commands as they are recorded."""
        return control

    def voltages(self, time: Array | float) -> Array:
        """Return the voltages at one time, shape (m,), or at times (k,), shape (k, m), V."""
        return self.signal.at(time)[0]


class LoopMemory(NamedTuple):
    """The last sample of the loops of m motors before a run that goes on.

    Attributes:
        age: Time since that sample, s.
        error: e, shape (m,), rad.
        integral: int e, shape (m,), rad s.
        voltage: U, shape (m,), V.
    """

    age: float
    error: Array
    integral: Array
    voltage: Array


class PositionDrives:
    """The loops of all motors of a finger that are in position drive, for one motion.

    Attributes:
        channels: The inputs that are their voltages.
        compiled: The loops as arrays, and what they have done.
    """

    def __init__(
        self,
        finger: Finger,
        controller: LoopController,
        reference: Reference,
        duration: float,
        start_time: float = 0.0,
        windings: Mapping[int, tuple[Signal, float]] = {},
        voltages: Mapping[int, Signal] = {},
        supplies: Mapping[int, Signal] = {},
        memory: LoopMemory | None = None,
    ) -> None:
        """Compute the goals of a motion.

        Args:
            finger: With motors in position drive.
            controller: Plans tensions, for the goals.
            reference: The desired motion.
            duration: Of the motion, s.
            start_time: Of the motion, s.
            windings: From `spool_windings`.
            voltages: From `voltage_signals`, in place of the loops.
            supplies: From there, in place of the motors' own.
            memory: Of the sample that was taken last, where a run goes on.
        """
        period = loop_period(finger)
        self._controller, actuators = controller, finger.actuators
        self._is_positioned = np.isin(np.arange(finger.routing.actuated), actuators.positioned)
        prescribed = actuators.tendons[np.any(actuators.spools[:, [*windings, *voltages]] != 0.0, axis=1)]
        self._prescribed = np.isin(np.arange(len(finger.routing.tendons)), prescribed)
        self.channels = actuators.voltages
        first_sample = 0.0 if memory is None else -memory.age
        times: Array = first_sample + period * np.arange(math.ceil((duration - first_sample) / period) + 1.0)
        goals = spool_goals(finger, controller, times, reference.at(times), windings, start_time)
        goals[:, list(voltages)] = 0.0
        nominal = np.array([each.motor.voltage for each in finger.description.actuators.values()])
        voltage = sampled_voltages(voltages, times, start_time, np.full(len(nominal), np.nan))
        supply = sampled_voltages(supplies, times, start_time, nominal)
        goals, voltage, supply = (np.ascontiguousarray(each[:, actuators.holds]) for each in (goals, voltage, supply))
        for (name, actuator), goal in zip(_positioned_actuators(finger), goals.T, strict=True):
            encoder = actuator.motor.encoder
            lowest, highest = float(goal.min()), float(goal.max())
            if encoder is not None and not encoder.range[0] <= lowest <= highest <= encoder.range[1]:
                allowed = f"the motion takes the spool from {lowest:.4g} to {highest:.4g} rad"
                raise InputError(f"finger.actuators.{name}.motor.encoder.range", allowed, list(encoder.range))
        self.compiled = build_drives(finger, goals, start_time, voltage, memory, supply)

    def planned(self, time: Array | float, reference: ReferenceSignals, control: ControlSignals) -> ControlSignals:
        """Return the commands with the tensions of the goals in place of those of the errors."""
        plan = self._controller.command(time, reference, reference.position, reference.velocity)
        if self._prescribed.any():
            plan = replace(plan, tension=np.where(self._prescribed, 0.0, plan.tension))
        if self._is_positioned.all():
            return plan
        mask = np.append(self._is_positioned, np.zeros(plan.tension.shape[-1] - len(self._is_positioned), dtype=bool))
        return replace(control, tension=np.where(mask, plan.tension, control.tension))

    def voltages(self, time: Array | float) -> Array:
        """Return the voltages held at one time, or at times (m,), by motor, V; an instant belongs to its sample.

        From when it is let go a motor has `OPEN_CIRCUIT`.
        """
        return self.compiled.zero_order_hold(self.compiled.voltages, time)


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


def spool_goals(
    finger: Finger,
    controller: LoopController,
    times: Array,
    desired: ReferenceSignals,
    windings: Mapping[int, tuple[Signal, float]] = {},
    start_time: float = 0.0,
) -> Array:
    """Return theta_m^d of all motors for a desired motion, shape (k, m), rad.

    Args:
        finger: The finger.
        controller: Plans tensions.
        times: Shape (k,), s.
        desired: The desired motion then, shape (k, n).
        windings: From `spool_windings`.
        start_time: Of the motion, s.
    """
    actuators = finger.actuators
    planned = controller.command(times, desired, desired.position, desired.velocity).tension
    excursion = finger.excursion(desired.position)
    goals = actuators.angle(desired.position, planned[:, : finger.routing.actuated], excursion)
    for motor, (signal, radius) in windings.items():
        goals[:, motor] = signal.starting_at(start_time).at(times)[0][:, 0] / radius
    return goals


def _positioned_actuators(finger: Finger) -> list[tuple[str, Actuator]]:
    return [each for each in finger.description.actuators.items() if each[1].drive == "position"]


def loop_period(finger: Finger) -> float:
    """Return the sampling period of all motors of a finger in position drive, s."""
    positioned = _positioned_actuators(finger)
    period = positioned[0][1].position_loop.period
    for name, actuator in positioned:
        if actuator.position_loop.period != period:
            entry = f"finger.actuators.{name}.position_loop.period"
            raise InputError(entry, f"must be that of the others, {period:g} s", actuator.position_loop.period)
    return period


def build_drives(
    finger: Finger,
    goals: Array,
    start_time: float = 0.0,
    voltages: Array | None = None,
    memory: LoopMemory | None = None,
    supply: Array | None = None,
) -> Drives:
    """Return the loops of all motors of a finger in position drive, m of them.

    Args:
        finger: The finger.
        goals: theta_m^d at the samples, one every period, shape (k, m), rad.
        start_time: What the clock shows at the start, s.
        voltages: Voltages in place of the loops, shape (k, m), V; not numbers where these run.
        memory: Of the sample that was taken last, where a run goes on.
        supply: V in place of the motors' own, shape (k, m), V.
    """
    positioned = [actuator for _, actuator in _positioned_actuators(finger)]
    loops, encoders = [each.position_loop for each in positioned], [each.motor.encoder for each in positioned]
    actuators = finger.actuators
    drives = Drives(
        motors=np.arange(len(positioned)),
        places=finger.mechanism.coordinates - len(actuators.names) + np.flatnonzero(actuators.holds),
        channels=actuators.voltages,
        period=loop_period(finger),
        first=0.0 if memory is None else -memory.age,
        goals=np.ascontiguousarray(goals),
        prescribed_voltages=np.full(goals.shape, np.nan) if voltages is None else voltages,
        resolution=np.array([encoder.resolution for encoder in encoders if encoder is not None]),
        gains=np.ascontiguousarray(np.array([[e.proportional, e.derivative, e.integral] for e in loops]).T),
        torque_off=np.array([np.inf if each.torque_off is None else each.torque_off for each in loops]) - start_time,
        supply=np.tile([each.motor.voltage for each in positioned], (len(goals), 1)) if supply is None else supply,
        sample_count=np.zeros(1, dtype=np.int64),
        integral=np.zeros(len(positioned)),
        last=np.zeros(len(positioned)),
        voltages=np.zeros(goals.shape),
        errors=np.zeros(goals.shape),
        integrals=np.zeros(goals.shape),
    )
    if memory is not None:
        drives.sample_count[:], drives.last[:], drives.integral[:] = 1, memory.error, memory.integral
        drives.errors[:2], drives.integrals[:2], drives.voltages[:2] = memory[1:]
    return drives
