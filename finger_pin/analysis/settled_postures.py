"""Settled postures: equilibria of a finger under tensions or lengths that are wound in, with what friction holds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from finger_pin.analysis.equilibrium import equilibrium
from finger_pin.analysis.steady import sliding_tendons
from finger_pin.exceptions import InputError
from finger_pin.mechanism.coerce import FingerLike, as_finger, as_inputs
from finger_pin.mechanism.evaluation import Evaluation
from finger_pin.typing import Array

# Change of an angle for differences, rad; greatest number of Newton steps; step at which they have converged, rad.
_ANGLE_DIFFERENCE, _MAX_STEPS, _CONVERGED_STEP = 1e-6, 20, 1e-11
# Longest Newton step, rad: short enough not to pass another posture at rest.
_MAX_ANGLE_STEP = 0.3
# Scale of the positions of passive tendons' masses, m, for one rad of an angle.
_PASSIVE_POSITION_SCALE = 1e-3


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
