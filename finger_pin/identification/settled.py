"""Settled postures: equilibria of a finger under tensions, lengths that are wound in, or goals of its servos."""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np

from finger_pin.analysis import equilibrium, steady_state
from finger_pin.description.finger import FingerDescription
from finger_pin.description.parameters import Winch
from finger_pin.description.validation import expand
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import as_inputs
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array

# Change of an angle, rad, for differences; steps of Newton's method; the largest one of the last that is none.
_CHANGE, _STEPS, _ARRIVED = 1e-6, 20, 1e-11
# The longest step, rad, which leads past no other posture at rest.
_LONGEST = 0.3
# Angles' size of the masses of passive tendons, m.
_OF_MASSES = 1e-3


def resting_finger(finger: FingerDescription, wound: Collection[str]) -> FingerDescription:
    """Return a finger with ideal sources and winches in place of its motors, as they are at rest without friction.

    A position drive holds by its error e: its torque K_t V k_p e / R makes it a spring in series with its cord, T / K +
    r^2 T / (K_t V k_p / R). With an integral it stands at its goal. No motor holds more than K_t min(V / R, I_max).

    Args:
        finger: Whose motors wind one cord each where they are given goals.
        wound: Names of the tendons that these pull; of all others the tension is known.
    """
    tendons = dict(finger.tendons)
    for key, actuator in finger.actuators.items():
        name, motor, radius = actuator.tendons[0], actuator.motor, float(actuator.radii[0])
        constant, resistance, _ = motor.constants
        most = constant * min(motor.voltage / resistance, motor.maximum_current) / radius
        if name in wound:
            stiffness, loop = _cord(finger, key)[0], actuator.position_loop
            by_error = constant * motor.voltage / resistance * loop.proportional
            if not loop.integral:
                stiffness *= by_error / (by_error + stiffness * radius**2)
            tendons[name] = tendons[name].updated(winch=Winch().updated(stiffness=stiffness), maximum_tension=most)
        elif actuator.drive == "tension":
            tendons[name] = tendons[name].updated(maximum_tension=most)
    return finger.updated(actuators={}, tendons=tendons)


def wound_length(finger: FingerDescription, motor: str, goal: Array, angle: bool) -> Array:
    """Return the winding of the winch in place of a motor, m, for goals of its spool, rad, or of its cord, m."""
    stiffness, pretension = _cord(finger, motor)
    return np.asarray((finger.actuators[motor].radii[0] if angle else 1.0) * goal + pretension / stiffness)


def _cord(finger: FingerDescription, motor: str) -> tuple[float, float]:
    """Return the stiffness, N/m, and the pretension, N, of a motor's only cord."""
    actuator = finger.actuators[motor]
    rigidity, length, pretension = (
        float(expand(each, 1)[0]) for each in (actuator.tendon_rigidity, actuator.tendon_length, actuator.pretension)
    )
    return rigidity / length, pretension


def settled_posture(finger: Finger, load: Array, speed: float | None, near: Array, force: Array) -> Array:
    """Return the stable posture at rest near another, shape (n,), rad; nan if there is none.

    Newton's method is tried first; the descent of `equilibrium` is some five times slower, and finds it from anywhere.

    Args:
        finger: With ideal sources of tension and winches.
        load: Tensions at the entrances of the canals, N, or what winches wind in, m, shape (a,).
        speed: Of the tendons as they came to rest, m/s, positive as they were drawn in: their friction has its sign.
            None: there is no friction any more.
        near: Shape (n,), rad.
        force: At the fingertip, shape (3,), N.

    Raises:
        InputError: If the finger is none that tensions alone bring to rest.
    """
    layout, joints = finger.layout, len(near)
    if not np.any((finger.tendons.surface > 0.0) | (finger.tendons.drag > 0.0)):
        speed = None
    state = layout.unpack(finger.rest_state(near))
    size = np.append(np.ones(joints), np.full(len(state.passive_position), _OF_MASSES))

    def delivered(position: Array) -> Array:
        if speed is None:
            return load
        tension: Array = steady_state(finger, load[None], np.array([speed]), position[None], True).tension[0]
        return tension

    def acceleration(y: Array) -> Array:
        x = finger.rest_state((size * y)[:joints])
        state = layout.unpack(x)
        state.passive_position[:] = (size * y)[joints:]
        rates = layout.unpack(finger.rhs(0.0, x, as_inputs(finger, delivered(state.position)), force))
        return np.asarray(np.append(rates.velocity, rates.passive_velocity) / size)

    zero = _newton(acceleration, np.append(state.position, state.passive_position) / size)
    position = near if zero is None else zero[:joints]
    for _ in range(_STEPS * _STEPS):
        try:
            rest = equilibrium(finger, delivered(position), position=position, fingertip_force=force).position
        except InputError as error:
            if error.entry == "inputs":
                return np.full(joints, np.nan)
            raise
        # With friction the tension that is delivered belongs to the posture that it leads to.
        if zero is not None or speed is None or float(np.max(np.abs(rest - position))) < 1e-9:
            return rest
        position = rest
    return np.full(joints, np.nan)


def _newton(acceleration: Callable[[Array], Array], start: Array) -> Array | None:
    """Return the stable zero of accelerations near a start, by Newton's method; None if it fails."""
    y, slopes, before = start, np.zeros((0, 0)), 0.0
    for _ in range(_STEPS):
        here = acceleration(y)
        if not before:
            shifts = _CHANGE * np.eye(len(y))
            slopes = np.transpose([acceleration(y + e) - acceleration(y - e) for e in shifts]) / (2.0 * _CHANGE)
        try:
            move = -np.linalg.solve(slopes, here)
        except np.linalg.LinAlgError:
            return None
        length = float(np.max(np.abs(move)))
        y = y + move * min(1.0, _LONGEST / max(length, 1e-300))
        if length < _ARRIVED:
            return y if bool(np.all(np.linalg.eigvals(slopes).real < 0.0)) else None
        # Slopes serve on where a step is a tenth of the one before.
        before = length if not before or length < 0.1 * before else 0.0
    return None
