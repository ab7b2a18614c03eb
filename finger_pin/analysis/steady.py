"""Steady states of tendons and servos in closed form: everything slides evenly, or rests after having slid so."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from finger_pin.analysis.printing import BriefRepr
from finger_pin.laws.bristle import friction_coefficient
from finger_pin.laws.capstan import capstan_coefficient, sliding_tension
from finger_pin.laws.gearbox import loss_share, stribeck_share
from finger_pin.mechanism.coerce import FingerLike, description_of
from finger_pin.mechanism.servos import Actuators
from finger_pin.mechanism.tendons import Tendons
from finger_pin.typing import Array


@dataclass(frozen=True, eq=False, repr=False)
class SteadyState(BriefRepr):
    """Tensions and currents while a finger's actuated tendons slide evenly; m states.

    Attributes:
        tension: f, shape (m, a), N.
        friction: f^f, shape (m, a), N.
        current: Of the motors, shape (m, k), A; without limits of voltage and current.
    """

    tension: Array
    friction: Array
    current: Array


def steady_state(
    finger: FingerLike, command: Array, speed: Array, position: Array | None = None, at_rest: bool = False
) -> SteadyState:
    """Return the steady states of a finger's actuated tendons.

    Args:
        finger: Its description, its name, or the path of its file.
        command: f^a at the entrances of the canals, shape (m, a), N.
        speed: v, shape (m,), m/s, of all of them; positive as they are drawn in.
        position: theta, shape (m, n), rad, for the curvature of the paths; zero by default.
        at_rest: Whether they rest after having slid so: bristles keep what they hold, viscous friction is gone.
    """
    description = description_of(finger)
    tendons = Tendons.from_description(description)
    actuators = Actuators.from_description(description, tendons.routing)
    actuated, v = tendons.routing.actuated, np.asarray(speed, dtype=float)[:, None]
    posture = np.zeros((len(v), len(tendons.routing.joints))) if position is None else position
    kinetic = capstan_coefficient(tendons.surface, tendons.routing.curvature(posture))[:, :actuated]
    ratio, viscous, stribeck, exponent, drag, floor = (
        each[:actuated]
        for each in (
            tendons.stiction_ratio,
            tendons.viscous,
            tendons.stribeck_velocity,
            tendons.stribeck_exponent,
            tendons.drag,
            tendons.floor,
        )
    )
    coefficient = friction_coefficient(v, kinetic, ratio * kinetic, stribeck, exponent)
    tension = sliding_tension(command, coefficient, v, viscous, drag, floor)
    for k, places in tendons.several.items():
        strand_tension = np.asarray(command, dtype=float)[:, k]
        for bends, offset, _ in places:
            kinetic = capstan_coefficient(tendons.surface[k], np.abs(posture) @ bends + offset)
            coefficient = friction_coefficient(v[:, 0], kinetic, ratio[k] * kinetic, stribeck[k], exponent[k])
            strand_tension = sliding_tension(
                strand_tension, coefficient, v[:, 0], viscous[k] / len(places), drag[k] / len(places), floor[k]
            )
        tension[:, k] = strand_tension
    if at_rest:
        tension = np.where(tension > 0.0, np.maximum(0.0, tension + viscous * v), tension)
    return SteadyState(tension, command - tension, _current(actuators, command, v, at_rest))


def _current(actuators: Actuators, command: Array, v: Array, at_rest: bool) -> Array:
    """Return the motor currents for a tendon torque while the gears slide, A, shape (m, k).

    With s the sign of the speed w and T the tendons' torque, tau = T + s level + b w and N = |tau + x T|; the level
    is linear in N, so that either sign of what N is made of gives a level, of which one keeps that sign. Where gears
    take all that a motor adds, slope >= 1, no current slides them: it is infinite.
    """
    base, by_load, stribeck, stribeck_by_load, velocity, exponent, viscous, _, driving, driven = actuators.gearbox
    torque = command[:, actuators.tendons] @ actuators.spools
    speed = v / actuators.radius
    sign, share = np.sign(speed), stribeck_share(speed, velocity, exponent)
    torque_loss = loss_share(torque, speed, driving, driven) * np.abs(torque)
    dry, slope = base + stribeck * share + torque_loss, by_load + stribeck_by_load * share
    frictionless = (1.0 + actuators.external_weight) * torque + viscous * speed

    def level_of(side: float) -> Array:
        remaining = 1.0 - slope * side * sign
        level = (dry + slope * side * frictionless) / np.where(remaining > 0.0, remaining, 1.0)
        return np.where(remaining > 0.0, level, np.inf)

    level = np.where(frictionless + sign * level_of(1.0) >= 0.0, level_of(1.0), level_of(-1.0))
    current: Array = (torque + sign * level + (0.0 if at_rest else viscous * speed)) / actuators.motor[0]
    return current
