"""Motors in position drive: every servo holds the angle of its spool by a sampled loop of its own.

    theta_m^d = (l(q^d) + f^d / K - e0) / r,   U = V clip(k_p e + k_d e' + k_i int e, -1, 1)

f^d are the tensions that the controller plans for the reference itself: what keeps tendons taut, and what compensates
gravity or friction if it does. What the finger really needs beyond them has to come from angles that err.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from finger_pin.control.proportional import Controller, ControlSignals
from finger_pin.control.reference import Reference, ReferenceSignals
from finger_pin.description.routing import Array
from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger

if TYPE_CHECKING:
    from finger_pin.control.sampling import SampledController


class PositionDrives:
    """The loops of all motors of a finger that are in position drive, asked in order at multiples of their period.

    Attributes:
        period: s.
        channels: The inputs that are their voltages.
        instant: When they, or the sampled controller beside them, are to act next, s.
    """

    def __init__(
        self,
        finger: Finger,
        controller: Controller,
        reference: Reference,
        duration: float,
        beside: SampledController | None,
    ) -> None:
        """Work out the goals of a motion.

        Args:
            finger: With motors in position drive.
            controller: Plans tensions, for the goals.
            reference: The desired motion.
            duration: Of the motion, s.
            beside: A sampled controller that commands the tensions of the other tendons.

        Raises:
            InputError: If a goal is beyond what its encoder can be told, or drives differ in their period.
        """
        chosen = [each for each in finger.description.actuators.items() if each[1].drive == "position"]
        loops = [actuator.position_loop for _, actuator in chosen]
        self.period = loops[0].period
        for (name, _), loop in zip(chosen, loops, strict=True):
            if loop.period != self.period:
                entry = f"finger.actuators.{name}.position_loop.period"
                raise InputError(entry, f"must be that of the others, {self.period:g} s", loop.period)
        self.instant = 0.0
        self._controller, self._beside = controller, beside
        self._held = np.zeros(finger.routing.actuated)
        self._voltages: list[Array] = []
        actuators, joints = finger.actuators, len(finger.routing.joints)
        self._places = joints + finger.routing.passive + np.flatnonzero(actuators.holds)
        self._positioned = np.isin(np.arange(finger.routing.actuated), actuators.positioned)
        self.channels = actuators.voltages
        self._gains = np.array([[each.proportional, each.derivative, each.integral] for each in loops]).T
        encoders = [actuator.motor.encoder for _, actuator in chosen]
        self._resolution = np.array([encoder.resolution for encoder in encoders if encoder is not None])
        self._supply = np.array([actuator.motor.voltage for _, actuator in chosen])
        times: Array = self.period * np.arange(math.ceil(duration / self.period) + 1.0)
        wanted = reference.at(times)
        planned = controller.command(times, wanted, wanted.position, wanted.velocity).tension
        self._goals = actuators.angle(wanted.position, planned[:, : finger.routing.actuated])[:, actuators.holds]
        for (name, _), encoder, goals in zip(chosen, encoders, self._goals.T, strict=True):
            least, most = float(goals.min()), float(goals.max())
            if encoder is not None and not encoder.range[0] <= least <= most <= encoder.range[1]:
                allowed = f"the motion takes the spool from {least:.4g} to {most:.4g} rad"
                raise InputError(f"finger.actuators.{name}.motor.encoder.range", allowed, list(encoder.range))
        self._sum = np.zeros(len(chosen))
        self._last: Array | None = None

    def act(self, x: Array) -> Array:
        """Sample what is due; return the inputs from this instant on, shape (a,)."""
        now = self.instant
        if self._beside is not None and self._beside.instant <= now:
            self._held = self._beside.act(x).copy()
        if len(self._voltages) * self.period <= now:
            self._voltages.append(self._sample(x[self._places]))
        self._held[self.channels] = self._voltages[-1]
        following = len(self._voltages) * self.period
        self.instant = following if self._beside is None else min(following, self._beside.instant)
        return self._held

    def planned(self, time: Array | float, reference: ReferenceSignals, control: ControlSignals) -> ControlSignals:
        """Return what is asked for, with what the goals are made of in place of what errors ask for."""
        plan = self._controller.command(time, reference, reference.position, reference.velocity)
        if self._positioned.all():
            return plan
        chosen = np.append(self._positioned, np.zeros(plan.tension.shape[-1] - len(self._positioned), dtype=bool))
        return replace(control, tension=np.where(chosen, plan.tension, control.tension))

    def voltages(self, time: Array | float) -> Array:
        """Return what was held at one time, or at times (m,), by motor, V; an instant belongs to its sample."""
        index = np.floor(np.asarray(time) / self.period * (1.0 + 1e-12)).astype(int)
        held: Array = np.array(self._voltages)[np.clip(index, 0, len(self._voltages) - 1)]
        return held

    def _sample(self, angle: Array) -> Array:
        steps = self._resolution
        measured = np.where(steps > 0.0, np.round(angle / np.where(steps > 0.0, steps, 1.0)) * steps, angle)
        error = self._goals[min(len(self._voltages), len(self._goals) - 1)] - measured
        rate = np.zeros_like(error) if self._last is None else (error - self._last) / self.period
        self._last = error
        proportional, derivative, integral = self._gains
        summed = self._sum + error * self.period
        duty = proportional * error + derivative * rate + integral * summed
        # The integral stands still while the supply is at its limit.
        self._sum = np.where(np.abs(duty) < 1.0, summed, self._sum)
        voltage: Array = self._supply * np.clip(duty, -1.0, 1.0)
        return voltage
