"""Settled postures: equilibria of a finger under tensions, lengths that are wound in, or goals of its servos."""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np

from finger_pin.analysis import equilibrium, steady_state
from finger_pin.description.finger_description import FingerDescription
from finger_pin.description.parameters import Winch
from finger_pin.description.validation import expand
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import as_inputs
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array

# Change of an angle for differences, rad; greatest number of Newton steps; step at which they have converged, rad.
_ANGLE_DIFFERENCE, _MAX_STEPS, _CONVERGED_STEP = 1e-6, 20, 1e-11
# Longest Newton step, rad: short enough not to pass another posture at rest.
_MAX_ANGLE_STEP = 0.3
# Scale of the positions of passive tendons' masses, m, for one rad of an angle.
_PASSIVE_POSITION_SCALE = 1e-3


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


def settled_posture(finger: Finger, load: Array, speed: float | None, guess: Array, force: Array) -> Array:
    """Return the stable posture at rest near another, shape (n,), rad; nan if there is none.

    Newton's method is tried first; the descent of `equilibrium` is some five times slower, and finds it from anywhere.

    Args:
        finger: With ideal sources of tension and winches.
        load: Tensions at the entrances of the canals, N, or what winches wind in, m, shape (a,).
        speed: Of the tendons as they came to rest, m/s, positive as they were drawn in: their friction has its sign.
            None: there is no friction any more.
        guess: Shape (n,), rad.
        force: At the fingertip, shape (3,), N.

    Raises:
        InputError: If the finger is none that tensions alone bring to rest.
    """
    layout, joints = finger.layout, len(guess)
    if not np.any((finger.tendons.surface > 0.0) | (finger.tendons.drag > 0.0)):
        speed = None
    state = layout.unpack(finger.rest_state(guess))
    size = np.append(np.ones(joints), np.full(len(state.passive_position), _PASSIVE_POSITION_SCALE))

    def entrance_tensions(position: Array) -> Array:
        if speed is None:
            return load
        tension: Array = steady_state(finger, load[None], np.array([speed]), position[None], True).tension[0]
        return tension

    def acceleration(y: Array) -> Array:
        x = finger.rest_state((size * y)[:joints])
        state = layout.unpack(x)
        state.passive_position[:] = (size * y)[joints:]
        rates = layout.unpack(finger.rhs(0.0, x, as_inputs(finger, entrance_tensions(state.position)), force))
        return np.asarray(np.append(rates.velocity, rates.passive_velocity) / size)

    root = _newton(acceleration, np.append(state.position, state.passive_position) / size)
    position = guess if root is None else root[:joints]
    for _ in range(_MAX_STEPS * _MAX_STEPS):
        try:
            tensions = entrance_tensions(position)
            resting = equilibrium(finger, tensions, position=position, fingertip_force=force).position
        except InputError as error:
            if error.entry == "inputs":
                return np.full(joints, np.nan)
            raise
        # With friction the delivered tension depends on the posture that it leads to.
        if root is not None or speed is None or float(np.max(np.abs(resting - position))) < 1e-9:
            return resting
        position = resting
    return np.full(joints, np.nan)


def _newton(acceleration: Callable[[Array], Array], start: Array) -> Array | None:
    """Return the stable zero of accelerations near a start, by Newton's method; None if it fails."""
    y, slopes, previous_length = start, np.zeros((0, 0)), 0.0
    for _ in range(_MAX_STEPS):
        value = acceleration(y)
        if not previous_length:
            shifts = _ANGLE_DIFFERENCE * np.eye(len(y))
            differences = [acceleration(y + e) - acceleration(y - e) for e in shifts]
            slopes = np.transpose(differences) / (2.0 * _ANGLE_DIFFERENCE)
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
