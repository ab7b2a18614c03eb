"""Steady states: all slides evenly, or rests after having slid so.

Those of tendons, of their rows and of servos at a posture; and settled postures, equilibria of a finger under tensions
or lengths that are wound in, with what friction holds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from finger_pin.analysis.equilibrium import equilibrium, unsettled
from finger_pin.analysis.printing import BriefRepr
from finger_pin.description.caching import memoised
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.loading import describe
from finger_pin.exceptions import InputError
from finger_pin.laws.gearbox import loss_share, stribeck_share
from finger_pin.mechanism.coerce import FingerLike, as_finger, as_inputs
from finger_pin.mechanism.evaluation import Evaluation
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.groups import is_canal
from finger_pin.mechanism.mechanism import Sliding
from finger_pin.mechanism.rows import weighted_sum
from finger_pin.mechanism.servos import Actuators
from finger_pin.typing import Array

# Change of an angle for differences, rad; greatest number of Newton steps; step at which they have converged, rad.
_ANGLE_DIFFERENCE, _MAX_STEPS, _CONVERGED_STEP = 1e-6, 20, 1e-11
# Longest Newton step, rad: short enough not to pass another posture at rest.
_MAX_ANGLE_STEP = 0.3
# Scale of the positions of passive tendons' masses, m, for one rad of an angle.
_PASSIVE_POSITION_SCALE = 1e-3


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

    Raises:
        InputError: If motors with cogging, whose current is the mean over its periods while they turn, are at rest.
    """
    finger, pulled = _with_ideal_sources(finger) if isinstance(finger, Finger) else _from_description(describe(finger))
    actuators, v = finger.actuators, np.asarray(speed, dtype=float)[:, None]
    for _, entry, allowed in unsettled("current", finger) if at_rest else ():
        raise InputError(entry, allowed)
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
    """Return a finger, and the same whose tendons are pulled by their inputs alone, whatever drives or ties them."""
    description = finger.description
    tendons = {name: each.updated(winch=None, maximum_tension=None) for name, each in description.tendons.items()}
    if not description.actuators and not description.couplings and tendons == description.tendons:
        return finger, finger
    objects = finger.constructor_args.objects
    return finger, finger.changed(description.updated(actuators={}, couplings={}, tendons=tendons), objects)


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


def settled_posture(
    finger: FingerLike,
    inputs: ArrayLike,
    speed: float | None = None,
    guess: ArrayLike | None = None,
    force: Array | None = None,
) -> Array:
    """Return the stable posture at rest near another, shape (n,), rad; nan if there is none.

    Newton's method is tried first; the descent of `equilibrium` is some five times slower, and finds it from anywhere.

    Args:
        finger: With ideal sources of tension and winches.
        inputs: Tensions at the entrances of canals, N, or what winches wind in, m, then a tree's inputs, shape (u,).
        speed: Of the tendons as they came to rest, m/s, positive as they were drawn in: their friction has its sign.
            None: there is no friction any more.
        guess: Shape (n,), rad; by default the angles of the ranges nearest to zero.
        force: At the fingertip, shape (3,), of several tips (t, 3), N; none by default.
    """
    finger = as_finger(finger)
    layout, command, limiter = finger.layout, as_inputs(finger, inputs), finger.stroke_limiter
    start = np.clip(0.0, limiter.lower, limiter.upper) if guess is None else np.asarray(guess, dtype=float)
    joints = len(start)
    sliding = None if speed is None else sliding_tendons(finger, np.array([speed]), at_rest=True)
    state = layout.unpack(finger.rest_state(start))
    size = np.append(np.ones(joints), np.full(len(state.passive_position), _PASSIVE_POSITION_SCALE))

    def at_rest(y: Array) -> tuple[Array, Evaluation]:
        """Return the packed states at rest in postures, (..., k), and their evaluation with what sliding has left."""
        x = np.apply_along_axis(finger.rest_state, -1, (size * y)[..., :joints])
        layout.unpack(x).passive_position[:] = (size * y)[..., joints:]
        return x, finger.mechanism.evaluate(x, command, force, sliding=sliding)

    def acceleration(y: Array) -> Array:
        rates = layout.unpack(at_rest(y)[1].rate)
        return np.asarray(np.concatenate([rates.velocity, rates.passive_velocity], axis=-1) / size)

    y = np.append(state.position, state.passive_position) / size
    root = _newton(acceleration, y)
    y = y if root is None else root
    for _ in range(_MAX_STEPS * _MAX_STEPS):
        x, evaluation = at_rest(y)
        friction = finger.mechanism.split(finger.mechanism.with_row_states(x, evaluation.rows))[2]
        position = (size * y)[:joints]
        try:
            resting = equilibrium(finger, command, position=position, fingertip_force=force, friction=friction)
        except InputError as error:
            if error.entry == "inputs":
                return np.full(joints, np.nan)
            raise
        # What friction holds depends on the posture that it leads to.
        if root is not None or speed is None or float(np.max(np.abs(resting.position - position))) < 1e-9:
            return resting.position
        y = np.append(resting.position, resting.passive_position) / size
    return np.full(joints, np.nan)


def _newton(acceleration: Callable[[Array], Array], start: Array) -> Array | None:
    """Return the stable zero of accelerations near a start, by Newton's method; None if it fails."""
    y, slopes, previous_length = start, np.zeros((0, 0)), 0.0
    shifts = _ANGLE_DIFFERENCE * np.eye(len(y))
    for _ in range(_MAX_STEPS):
        if previous_length:
            value = acceleration(y)
        else:
            value, *beside = acceleration(y + np.concatenate([np.zeros((1, len(y))), shifts, -shifts]))
            slopes = np.subtract(*np.split(np.array(beside), 2)).T / (2.0 * _ANGLE_DIFFERENCE)
        try:
            step = -np.linalg.solve(slopes, value)
        except np.linalg.LinAlgError:
            return None
        step_size = float(np.max(np.abs(step)))
        y = y + step * min(1.0, _MAX_ANGLE_STEP / max(step_size, 1e-300))
        if step_size < _CONVERGED_STEP:
            return y if bool(np.all(np.linalg.eigvals(slopes).real < 0.0)) else None
        # Slopes are kept while steps fall to a tenth.
        previous_length = step_size if not previous_length or step_size < 0.1 * previous_length else 0.0
    return None
