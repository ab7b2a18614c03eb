"""Steady states of tendons, of their rows, and of servos: everything slides evenly, or rests after having slid so."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from finger_pin.analysis.printing import BriefRepr
from finger_pin.description.caching import memoised
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.loading import describe
from finger_pin.laws.gearbox import loss_share, stribeck_share
from finger_pin.mechanism.canals import is_canal
from finger_pin.mechanism.coerce import FingerLike, as_finger
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.mechanism import Sliding
from finger_pin.mechanism.rows import weighted_sum
from finger_pin.mechanism.servos import Actuators
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
        finger: A finger, its description, its name, or the path of its file.
        command: f^a at the entrances of the canals, shape (m, a), N.
        speed: v, shape (m,), m/s, of all of them; positive as they are drawn in.
        position: theta, shape (m, n), rad, for the curvature of the paths; zero by default.
        at_rest: Whether they rest after having slid so: bristles keep what they hold, viscous friction is gone.
    """
    finger, pulled = _with_ideal_sources(finger) if isinstance(finger, Finger) else _from_description(describe(finger))
    actuators, v = finger.actuators, np.asarray(speed, dtype=float)[:, None]
    actuated = finger.routing.actuated
    postures = np.zeros((len(v), len(finger.routing.joints))) if position is None else position
    x = np.tile(pulled.rest_state(np.zeros(postures.shape[1])), (len(v), 1))
    state = pulled.layout.unpack(x)
    state.position[:], state.passive_position[:] = postures, pulled.tendons.rest_position(postures)
    inputs = np.zeros((len(v), pulled.mechanism.channels))
    inputs[:, :actuated] = command
    rows = pulled.mechanism.row_signals(x, inputs, sliding=sliding_tendons(pulled, v, at_rest=at_rest))
    tension = rows["driven_tendons"].force
    for table, weights in pulled.wraps.items():
        tension = tension + weighted_sum(rows[table].force, weights[:actuated].T)
    return SteadyState(tension, command - tension, _current(actuators, command, v, at_rest))


def sliding_tendons(finger: Finger, speed: Array, *, at_rest: bool) -> Sliding:
    """Return the rows of friction of a finger's actuated tendons, all of which slide alike.

    Args:
        finger: The finger.
        speed: v, shape (..., 1), m/s, positive as they are drawn in.
        at_rest: Whether they have come to rest.
    """
    tables = {table.group: table for table in finger.mechanism.rows}
    speeds = {
        group: np.broadcast_to(speed, (*speed.shape[:-1], tables[group].count))
        for group in ("driven_tendons", *finger.wraps)
    }
    return Sliding(speeds, at_rest)


def rubbing_cords(finger: FingerLike) -> NDArray[np.bool_]:
    """Return whether friction takes something of each cord: tendons, cords of a tree, and branches; shape (c,)."""
    finger = as_finger(finger)
    masks = [np.zeros(0, dtype=bool)]
    for table in finger.mechanism.rows:
        own = table.group in ("driven_tendons", "passive_tendons")
        if own or (is_canal(table.group) and table.group not in finger.wraps):
            surface, drag = (table.parameters[table.law.parameters.index(name)] for name in ("surface", "drag"))
            masks.append((surface > 0.0) | (drag > 0.0))
    return np.concatenate(masks)


@memoised(lambda description: (description,), most=4)
def _from_description(description: FingerDescription) -> tuple[Finger, Finger]:
    """Return a finger, and the same without drives; one for all calls with the same description."""
    return _with_ideal_sources(Finger(description))


def _with_ideal_sources(finger: Finger) -> tuple[Finger, Finger]:
    """Return a finger, and the same whose tendons are pulled by their inputs alone, whatever drives them."""
    description = finger.description
    tendons = {name: each.updated(winch=None, maximum_tension=None) for name, each in description.tendons.items()}
    if not description.actuators and tendons == description.tendons:
        return finger, finger
    objects = finger.constructor_args.objects
    return finger, finger.changed(description.updated(actuators={}, tendons=tendons), objects)


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
