"""Fingers at rest under goals of their servos: ideal sources and winches in place of motors."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.parameters import Winch
from finger_pin.description.validation import expand
from finger_pin.typing import Array


def resting_finger(finger: FingerDescription, wound_tendons: Collection[str]) -> FingerDescription:
    """Return a finger with ideal sources and winches in place of its motors, as they are at rest without friction.

    A position drive holds by its error e: its torque K_t V k_p e / R makes it a spring in series with its cord, T / K +
    r^2 T / (K_t V k_p / R). With an integral it stands at its goal. No motor holds more than K_t min(V / R, I_max).

    Args:
        finger: Whose motors wind one cord each where they are given goals.
        wound_tendons: Names of the tendons that these pull; of all others the tension is known.
    """
    tendons = dict(finger.tendons)
    for key, actuator in finger.actuators.items():
        tendon, motor, radius = actuator.tendons[0], actuator.motor, float(actuator.radii[0])
        constant, resistance, _ = motor.constants
        maximum_tension = constant * min(motor.voltage / resistance, motor.maximum_current) / radius
        if tendon in wound_tendons:
            stiffness, loop = _cord_properties(finger, key)[0], actuator.position_loop
            torque_per_error = constant * motor.voltage / resistance * loop.proportional
            if not loop.integral:
                stiffness *= torque_per_error / (torque_per_error + stiffness * radius**2)
            winch = Winch().updated(stiffness=stiffness)
            tendons[tendon] = tendons[tendon].updated(winch=winch, maximum_tension=maximum_tension)
        elif actuator.drive == "tension":
            tendons[tendon] = tendons[tendon].updated(maximum_tension=maximum_tension)
    return finger.updated(actuators={}, tendons=tendons)


def wound_length(finger: FingerDescription, motor: str, goal: Array, is_angle: bool) -> Array:
    """Return the winding of the winch in place of a motor, m, for goals of its spool, rad, or of its cord, m."""
    stiffness, pretension = _cord_properties(finger, motor)
    return np.asarray((finger.actuators[motor].radii[0] if is_angle else 1.0) * goal + pretension / stiffness)


def _cord_properties(finger: FingerDescription, motor: str) -> tuple[float, float]:
    """Return the stiffness, N/m, and the pretension, N, of a motor's only cord."""
    actuator = finger.actuators[motor]
    rigidity, length, pretension = (
        float(expand(each, 1)[0]) for each in (actuator.tendon_rigidity, actuator.tendon_length, actuator.pretension)
    )
    return rigidity / length, pretension
