"""What an observer takes its model to err by, what it knows at the start, and what its sensors cannot tell."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from finger_pin.analysis import taut_posture
from finger_pin.description.scenario import Scenario
from finger_pin.description.validation import choices
from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.observation.sensors import Sensors
from finger_pin.typing import Array

# Size of a force at a tip, N, and how long it keeps its value, s.
_FORCE, _FORCE_TIME = 0.15, 0.2
# At the start: deviation of angles and speeds over their scales, and of bristles over their levels.
_START_ANGLE, _START_SPEED, _START_BRISTLE = 0.01, 1e-3, 0.5
# What the model errs by in the root of a second: angles, rad, speeds of joints and of motors, rad/s, bristles over
# their scale.
_ANGLE, _SPEED, _MOTOR_SPEED, _BRISTLE = 1e-3, 0.1, 0.5, 0.3
# Motors that are farther from where the scenario starts, rad, tell another posture, which friction shifts by about so
# much where cords leave it open, rad.
_ELSEWHERE, _OPEN = 0.01, 0.15


def assumed_forces(tips: Sequence[str], forces: Iterable[str] | Mapping[str, float]) -> tuple[NDArray[np.int64], Array]:
    """Return which numbers of all tips' forces are estimated, and their standard deviations, N.

    Args:
        tips: Names of all tips.
        forces: Names of some, ``fingertip`` for all; or by name the size of its force, N.

    Raises:
        InputError: Naming what is wrong.
    """
    by_name = dict(forces) if isinstance(forces, Mapping) else dict.fromkeys(forces, _FORCE)
    known = {"fingertip": range(len(tips))} | {name: range(k, k + 1) for k, name in enumerate(tips) if name}
    deviations: dict[int, float] = {}
    for name, deviation in by_name.items():
        if name not in known:
            raise InputError(f"forces.{name}", f"no such tip; there are {choices(name, known)}")
        if not 0.0 < deviation < np.inf:
            raise InputError(f"forces.{name}", "must be above 0 N", deviation)
        deviations |= {3 * tip + axis: deviation for tip in known[name] for axis in range(3)}
    return np.array([*deviations], dtype=np.int64), np.array([*deviations.values()], dtype=float)


def period_noise(finger: Finger, force_deviation: Array, h: float) -> tuple[Array, Array]:
    """Return what a period, s, adds to the variances of state and forces, shape (n + f,), and what forces keep, (f,).

    Forces at tips are Ornstein-Uhlenbeck processes of these standard deviations, N.
    """
    scale, width = finger.layout.scales(), finger.mechanism.coordinates
    rates = np.concatenate([np.full(width, _ANGLE), np.full(width, _SPEED), _BRISTLE * scale[2 * width :]])
    rates[2 * width - len(finger.actuators.names) : 2 * width] = _MOTOR_SPEED
    decay = np.full(len(force_deviation), np.exp(-h / _FORCE_TIME))
    return np.concatenate([rates**2 * h, force_deviation**2 * (1.0 - decay**2)]), decay


def start_state(
    scenario: Scenario, finger: Finger, x: Array, motors: Mapping[str, float], position: ArrayLike | None
) -> tuple[Array, Array]:
    """Return the packed state at rest, shape (size,), and the covariance of angles that motors leave open, (n, n).

    Args:
        scenario: The scenario.
        finger: Its finger.
        x: Where the scenario starts, packed; it is overwritten.
        motors: By motor theta_m, rad; others wind their tendons just taut.
        position: theta, shape (n,), rad; by default that which the motors tell.

    Raises:
        InputError: Naming a motor that is none, or an angle that is not finite.
    """
    theta, names = finger.layout.unpack(x).position, finger.actuators.names
    rest = dict(zip(names, finger.layout.unpack(x).motor_position.tolist(), strict=True))
    free = np.zeros((len(theta), len(theta)))
    if position is not None and motors.keys() <= rest.keys():
        x = finger.rest_state(np.asarray(position, dtype=float))
    elif not all(abs(angle - rest.get(name, np.nan)) <= _ELSEWHERE for name, angle in motors.items()):
        theta, free = taut_posture(finger, motors, theta, scenario.coupling(finger.routing))
        x = finger.rest_state(theta)
    finger.layout.unpack(x).motor_position[[names.index(name) for name in motors]] = [*motors.values()]
    return x, _OPEN**2 * free @ free.T


def start_covariance(finger: Finger, sensors: Sensors, levels: Array) -> Array:
    """Return the covariance of a state at rest, shape (n, n), with levels of its bristles, NaN elsewhere."""
    scale, width = finger.layout.scales(), finger.mechanism.coordinates
    deviations = _START_BRISTLE * np.where(np.isfinite(levels), levels, scale)
    deviations[:width] = _START_ANGLE * scale[:width]
    deviations[width : 2 * width] = _START_SPEED * scale[width : 2 * width]
    motors = slice(width - len(finger.actuators.names), width)
    deviations[motors] = [sensors.deviation[f"motor_position.{name}"] for name in finger.actuators.names]
    return np.diag(deviations**2)


def hidden_tension(finger: Finger, sensors: Sensors) -> Array:
    """Return the tension of every tendon within the noise of its motor's current, shape (t,), N."""
    hidden = np.zeros(len(finger.routing.tendons))
    for motor, (name, spools) in enumerate(zip(finger.actuators.names, finger.actuators.spools.T, strict=True)):
        constant = finger.description.actuators[name].motor.constants[0]
        torque = constant * sensors.input_deviation[finger.actuators.channels[motor]]
        pulled = np.flatnonzero(spools)
        hidden[finger.actuators.tendons[pulled]] = torque / np.abs(spools[pulled])
    return hidden
