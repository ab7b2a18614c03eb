"""Equilibria of a finger under given tensions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from finger_pin.analysis.printing import BriefRepr
from finger_pin.description.routing import Array
from finger_pin.description.validation import finite_vector
from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import FingerLike, as_finger

# The descent: its length, s2, and the acceleration, in parts of the first, at which it has arrived.
_LONGEST, _ARRIVED = 1e4, 1e-6
# Of an angle, rad, for differences.
_SHIFT = 1e-7
# Largest acceleration that is rest, in parts of the joints' and masses' scales over a square second.
_REST = 1e-4


@dataclass(frozen=True, eq=False, repr=False)
class Equilibrium(BriefRepr):
    """A posture in which a finger is at rest, and stays.

    Attributes:
        position: theta, shape (n,), rad.
        passive_position: p_5 of the passive tendons, shape (p,), m.
        torque: Of the tendons, shape (n,), N m; what weight, limiters, springs and the fingertip hold up.
        state: The packed state, to start a simulation or a loop from (``initial``, ``Simulator(..., state)``).
    """

    position: Array
    passive_position: Array
    torque: Array
    state: Array


def equilibrium(
    finger: FingerLike,
    inputs: Sequence[float] | Array,
    *,
    position: Sequence[float] | Array | None = None,
    fingertip_force: Sequence[float] | Array = (0.0, 0.0, 0.0),
) -> Equilibrium:
    """Return the state at rest under given tensions, that which a finger without friction comes to.

    With friction there are many states at rest around it; this is the one in which no bristle is bent: tau = G, and
    the state's derivative is zero with friction and without. It lies where the potential energy falls to from a
    posture, along theta'' at theta' = 0, so that it is stable.

    Args:
        finger: One finger, with ideal sources of tension.
        inputs: Tensions f^a, shape (a,), N.
        position: theta to begin at, shape (n,), rad; by default the angles of the ranges nearest to zero.
        fingertip_force: F, shape (3,), N, base frame.

    Raises:
        InputError: If a size is wrong, a tension is negative, the finger has servos, objects or rows with states of
            their own, or it comes to no rest.
    """
    finger = as_finger(finger)
    layout = finger.layout
    if finger.description.hand is not None or finger.pulled or layout.objects or layout.contacts or layout.further:
        raise InputError("finger", "must be one finger with ideal sources of tension, without objects")
    command = np.array(finite_vector("inputs", inputs, finger.routing.actuated))
    if np.any(command < 0.0):
        raise InputError("inputs", "a tension must not be negative", command.tolist())
    pushed = np.array(finite_vector("fingertip_force", fingertip_force, 3))
    joints = len(finger.routing.joints)
    limits = np.array([joint.range for joint in finger.description.joints.values()], dtype=float)
    start = np.clip(0.0, *limits.T) if position is None else np.array(finite_vector("position", position, joints))
    rest = finger.rest_state(start)

    def placed(places: Array) -> Array:
        x = rest.copy()
        state = layout.unpack(x)
        state.position[:], state.passive_position[:] = places[:joints], places[joints:]
        return x

    def acceleration(places: Array) -> Array:
        rates = layout.unpack(finger.rhs(0.0, placed(places), command, pushed))
        return np.concatenate([rates.velocity, rates.passive_velocity])

    state = layout.unpack(rest)
    places = np.concatenate([state.position, state.passive_position])
    scale = np.concatenate([np.ones(joints), np.full(len(places) - joints, 1e-3)])

    def slope(y: Array) -> Array:
        return np.asarray(acceleration(scale * y) / scale)

    begun = float(np.max(np.abs(slope(places / scale))))
    y = _downhill(slope, places / scale, _ARRIVED * begun) if begun > _REST else places / scale
    if not float(np.max(np.abs(slope(y)))) < max(_REST, 1e-9 * begun):
        raise InputError("inputs", "the finger comes to no rest under it", command.tolist())
    places = scale * y
    x = placed(places)
    torque = finger.evaluate(x, command, pushed).tendon_torque
    return Equilibrium(places[:joints], places[joints:], np.asarray(torque), x)


def _downhill(slope: Callable[[Array], Array], start: Array, enough: float) -> Array:
    """Return the place of no slope that a slope leads to from a start, shape (k,)."""

    def arrived(_: float, y: Array) -> float:
        return float(np.max(np.abs(slope(y)))) - enough

    arrived.terminal = True  # type: ignore[attr-defined]

    def slopes(y: Array) -> Array:
        # Angles on limiters are tiny: steps that are parts of them would be lost in rounding.
        shifts = _SHIFT * np.eye(len(y))
        return np.transpose([slope(y + each) - slope(y - each) for each in shifts]) / (2.0 * _SHIFT)

    descent = scipy.integrate.solve_ivp(
        lambda _, y: slope(y), (0.0, _LONGEST), start, "Radau", events=arrived, rtol=1e-6, atol=1e-9
    )
    # Damped, so that it stays where the finger may rest anywhere.
    polished = scipy.optimize.least_squares(slope, descent.y[:, -1], slopes, method="lm", xtol=1e-15)
    ends: tuple[Array, Array] = (descent.y[:, -1], polished.x)
    return min(ends, key=lambda y: float(np.max(np.abs(slope(y)))))
