"""Sampled execution of a controller: asked once a period through its sensors; its tensions act later and are held.

Sensors are read in order, sample by sample, and recorded.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from finger_pin.control.closed_loop import ClosedLoop
from finger_pin.control.inputs import InputQueue
from finger_pin.control.interface import ControlSignals, Instant, LoopController, SampledSensor
from finger_pin.core.stepping.stepper import TABLEAUS
from finger_pin.description.controller import SamplingSettings
from finger_pin.description.scenario import Scenario
from finger_pin.exceptions import InputError
from finger_pin.references.reference import ReferenceSignals
from finger_pin.typing import Array

# A delay within this of a multiple of the period, in periods, is that multiple: no step of no length between the two.
_PERIOD_TOLERANCE = 1e-9


def readings(sensors: Sequence[SampledSensor], now: Instant) -> dict[str, Array]:
    """Return the readings of sensors, by their names."""
    routing, by_name = now.loop.finger.routing, {}
    for sensor in sensors:
        names = sensor.labels or {"joint": routing.joints, "tendon": routing.tendons}.get(sensor.dimension, ())
        shape = (len(names),) if sensor.dimension else ()
        values = np.asarray(sensor.read(now), dtype=float)
        if sensor.name in by_name:
            raise InputError("controller.sensors", "there is another one of this name", sensor.name)
        if values.shape != shape:
            allowed = f"{sensor.name} must read values of shape {shape}, not {values.shape}"
            raise InputError("controller.sensors", allowed)
        by_name[sensor.name] = values
    return by_name


class JointEncoder(SampledSensor):
    """Joint encoders with an optional resolution."""

    name, units, dimension = "joint_position", "rad", "joint"

    def __init__(self, resolution: float = 0.0) -> None:
        """Take a resolution, rad."""
        self._resolution = resolution

    def read(self, now: Instant) -> Array:
        """Return theta, shape (n,)."""
        exact = now.state.position
        return np.round(exact / self._resolution) * self._resolution if self._resolution else exact


class JointSpeed(SampledSensor):
    """Differences of encoders' readings over the period, zero at the first sample; exact without a resolution."""

    name, units, dimension = "joint_velocity", "rad/s", "joint"

    def __init__(self, period: float, resolution: float = 0.0) -> None:
        """Take the period, s, and the encoders' resolution, rad."""
        self._period, self._encoder = period, JointEncoder(resolution) if resolution else None
        self._last: Array | None = None

    def read(self, now: Instant) -> Array:
        """Return theta', shape (n,)."""
        if self._encoder is None:
            return now.state.velocity
        position = self._encoder.read(now)
        velocity = np.zeros_like(position) if self._last is None else (position - self._last) / self._period
        self._last = position
        return velocity


class TensionSensor(SampledSensor):
    """Sensors of the delivered tensions, of passive tendons at the distal end.

    Their noise is normal, independent from sample to sample, and the same for the same seed.
    """

    name, units, dimension = "tendon_tension", "N", "tendon"

    def __init__(self, noise: float = 0.0, seed: int = 0) -> None:
        """Take the standard deviation of the noise, N, and its seed."""
        self._noise, self._random = noise, np.random.default_rng(seed)

    def read(self, now: Instant) -> Array:
        """Return f, shape (t,)."""
        delivered = now.signals["tendon_tension"]
        return delivered + self._noise * self._random.standard_normal(len(delivered))


class SampledController(LoopController):
    """A controller that is asked at multiples of a period, in order, and then answers for any time up to the next.

    Its tensions of a sample act after the delay, and are held until those of the next one act. Before the first
    arrives, it acts already. Inputs of a tree's actuators that have delays come so much later; they are zero before.

    Attributes:
        period: Sampling period, s.
        instant: Time of its next action, s: a sample, or the arrival of tensions.
        sensors: Sensors that are read at every sample, in this order.
    """

    def __init__(self, loop: ClosedLoop, settings: SamplingSettings) -> None:
        """Sample the controller of a loop."""
        self.period = settings.period
        self.instant = 0.0
        self._loop = loop
        resolution, needs_sensors = settings.encoder_resolution, loop.controller.needs_sensors
        tension = [TensionSensor(settings.tension_noise, settings.seed)] if needs_sensors else []
        encoders = JointEncoder(resolution), JointSpeed(settings.period, resolution)
        self.sensors: tuple[SampledSensor, ...] = (*encoders, *tension, *loop.controller.sensors)
        self._samples: list[ControlSignals] = []
        self._readings: list[dict[str, Array]] = []
        delay_periods = math.floor(settings.delay / settings.period + _PERIOD_TOLERANCE)
        remainder = settings.delay - delay_periods * settings.period
        self._delay_periods = delay_periods
        self._remainder = remainder if remainder > _PERIOD_TOLERANCE * settings.period else 0.0
        self._active = 0
        delays, actuated = loop.controller.delays, loop.finger.routing.actuated
        self._queue = None if delays is None else InputQueue(settings.delay + delays[actuated:])

    def act(self, x: Array) -> Array:
        """Sample if due, and return the tensions, and inputs of a tree, that act from now on, shape (channels,)."""
        if self.instant == len(self._samples) * self.period:
            self._samples.append(self._sample(self.instant, x))
            if self._queue is not None and (commanded := self._samples[-1].inputs) is not None:
                self._queue.add(self.instant, commanded)
        while self._active + 1 < len(self._samples) and self._arrival(self._active + 1) <= self.instant:
            self._active += 1
        now, self.instant = self.instant, len(self._samples) * self.period
        if self._active + 1 < len(self._samples):
            self.instant = min(self.instant, self._arrival(self._active + 1))
        inputs = self._samples[self._active].inputs
        if self._queue is not None:
            inputs, self.instant = self._queue.at(now), self._queue.next_arrival(now, self.instant)
        return self._active_tension() if inputs is None else np.concatenate([self._active_tension(), inputs])

    def command(
        self, time: Array | float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return the tensions held at the given times; an instant belongs to the tensions that arrive at it."""
        index = np.floor((np.asarray(time) - self._remainder) / self.period * (1.0 + 1e-12)).astype(int)
        index = np.clip(index - self._delay_periods, 0, len(self._samples) - 1)
        torques = np.array([sample.torque for sample in self._samples])
        tensions = np.array([sample.tension for sample in self._samples])
        deficits = [sample.torque_deficit for sample in self._samples if sample.torque_deficit is not None]
        torque_deficit = np.array(deficits)[index] if len(deficits) == len(self._samples) else None
        inputs = np.array([sample.inputs for sample in self._samples if sample.inputs is not None])
        active_inputs = inputs[index] if len(inputs) else None
        if self._queue is not None:
            instants = np.asarray(time)[..., None] * (1.0 + 1e-12)
            arrived = np.floor((instants - self._queue.delays) / self.period + _PERIOD_TOLERANCE).astype(int)
            latest = inputs[np.clip(arrived, 0, len(inputs) - 1), np.arange(inputs.shape[1])]
            active_inputs = np.where(arrived < 0, 0.0, latest)
        return ControlSignals(torques[index], tensions[index], torque_deficit, active_inputs)

    def measured(self, name: str, times: Array) -> Array:
        """Return the last readings of a sensor at times (m,), shape (m,) or (m, k)."""
        samples = np.array([each[name] for each in self._readings])
        latest: Array = samples[np.minimum(np.floor(times / self.period * (1.0 + 1e-12)).astype(int), len(samples) - 1)]
        return latest

    def _arrival(self, sample: int) -> float:
        return (sample + self._delay_periods) * self.period + self._remainder

    def _active_tension(self) -> Array:
        return self._samples[self._active].tension[: self._loop.finger.routing.actuated]

    def _sample(self, time: float, x: Array) -> ControlSignals:
        loop, controller = self._loop, self._loop.controller
        tension = self._active_tension() if self._samples else np.zeros(loop.finger.routing.actuated)
        now = Instant(loop, time, x.copy(), tension)
        values = readings(self.sensors, now)
        self._readings.append(values)
        if controller.needs_sensors:
            controller.sense(values, self.period if self._samples else 0.0)
        position, velocity = (values[each.name] for each in (JointEncoder, JointSpeed))
        return controller.command(time, loop.reference.at(time), position, velocity)


def sampling_settings(scenario: Scenario, period: float | None) -> SamplingSettings | None:
    """Return the settings of the controller's sampling, or None if it is continuous.

    Args:
        scenario: With the entries ``controller.sampling``, if any.
        period: In place of theirs, s.
    """
    settings, method = scenario.controller.sampling, scenario.simulation.method
    if period is not None and not 0.0 < period < math.inf:
        raise InputError("control_period", "must be above 0", period)
    if (settings is not None or period is not None) and method not in TABLEAUS:
        raise InputError("simulation.method", f"a control period needs one of {', '.join(TABLEAUS)}", method)
    if period is None:
        return settings
    return (settings or SamplingSettings()).updated(period=float(period))
