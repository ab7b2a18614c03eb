"""Limits of motors and gears in slow motion: the share of a command that arrives, and the largest tension.

A gearbox at the edge of sliding carries N = x r f + tau and takes c + m N of the motor's torque tau, with c = c0 + c1
and m = m0 + m1. It pulls while tau - r f >= c + m N, and lets go from r f - tau >= c + m N on. For large tensions,
where c does not count, r f is a share of tau. From m = 1 on no motor turns the gears, from m x = 1 on no tendon.
"""

from __future__ import annotations

import numpy as np

from finger_pin.description.validation import expand
from finger_pin.mechanism.coerce import FingerLike, as_finger, description_of
from finger_pin.typing import Array


def tension_limits(finger: FingerLike, *, holding: bool = False) -> tuple[float, ...]:
    """Return the greatest tension at every actuated tendon's spool, N, in slow motion or at rest.

    The current is at most I_max, and V / R; cogging takes its amplitude in motion, and may help at rest. Of several
    tendons on one spool each has it while the others are slack.

    Args:
        finger: With actuators; a tendon without one has no limit: infinity.
        holding: Whether gears may help, as against a load that pulls; by default they have to be overcome.
    """
    finger = as_finger(finger)
    limits = np.full(finger.routing.actuated, np.inf)
    for actuator in finger.description.actuators.values():
        motor, gears = actuator.motor, actuator.motor.friction
        constant, resistance, dry = motor.constants
        sign = 1.0 if holding else -1.0
        cogging = motor.cogging.amplitude if motor.cogging else 0.0
        torque = max(0.0, constant * min(motor.maximum_current, motor.voltage / resistance) + sign * cogging)
        dry, weight = dry + gears.stribeck, gears.external_weight
        by_load = gears.by_load + gears.stribeck_by_load
        arriving, divisor = torque * (1.0 + sign * by_load) + sign * dry, 1.0 - sign * by_load * weight
        limit = max(0.0, arriving / divisor) if divisor > 0.0 else np.inf
        for tendon, radius in zip(actuator.tendons, expand(actuator.spool_radius, len(actuator.tendons)), strict=True):
            limits[finger.routing.tendons.index(tendon)] = limit / radius
    return tuple(limits.tolist())


def gear_shares(finger: FingerLike) -> Array:
    """Return the shares of a large command that reach the spool, while a tendon is drawn in and while it is let out.

    Shape (2, a); 1 for an ideal source, and in position drive, where gears change no tension. Where no load turns the
    gears, m x >= 1, a tendon that is let out keeps whatever it has: infinity.
    """
    description = description_of(finger)
    names = description.actuated_names
    shares = np.ones((2, len(names)))
    for actuator in description.actuators.values():
        if actuator.drive == "position":
            continue
        gears = actuator.motor.friction
        by_load, weight = gears.by_load + gears.stribeck_by_load, gears.external_weight
        divisor = 1.0 - by_load * weight
        drawn_in = max(0.0, 1.0 - by_load) / (1.0 + by_load * weight)
        shares[:, names.index(actuator.tendons[0])] = drawn_in, (1.0 + by_load) / divisor if divisor > 0.0 else np.inf
    return shares
