"""Actions of a policy: constant tensions, lengths that winches wind, or goals of motors in position drive."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from finger_pin.control.input_ranges import input_ranges, spool_ranges
from finger_pin.description.coupling import PassiveCoupling
from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array

# Of the tensions that goals of joints stretch tendons by, which turn no joint, the largest, N.
_CLOSING_TENSION = 5.0


class Action:
    """Actions of an episode, as inputs of a simulator that arrive after a delay.

    Attributes:
        low: Least action, shape (k,).
        high: Largest action, shape (k,).
        last_action: The last action, shape (k,).
        names: Names of the components of an action.
    """

    def __init__(self, kind: str, finger: Finger, nominal: Finger, coupling: PassiveCoupling) -> None:
        """Read a finger.

        Args:
            kind: One of `task.ACTIONS`.
            finger: The finger.
            nominal: Finger that the drives assume: goals of joints become angles of its spools.
            coupling: The joints that passive tendons drive.
        """
        self._finger, self._kind, holds = finger, kind, finger.actuators.holds
        if kind == "tension":
            if holds.any():
                names = [name for name, positioned in zip(finger.actuators.names, holds, strict=True) if positioned]
                raise InputError("action", f'"tension" is not for motors in position drive: {", ".join(names)}')
            if finger.routing.winched.any():
                raise InputError("action", '"tension" is not for winches; "tendon_winding" is')
            self.low, self.high = input_ranges(finger)
            self.names = finger.input_names
            self._to_inputs: Callable[[Array], Array] = np.array
        elif kind == "tendon_winding" and finger.routing.winched.all() and finger.routing.actuated:
            self.low, self.high = input_ranges(finger)
            self.names = finger.input_names
            self._to_inputs = np.array
        else:
            if len(finger.actuators.positioned) != finger.mechanism.channels:
                winches = ", or winches" if kind == "tendon_winding" else ""
                raise InputError("action", f'"{kind}" needs motors in position drive{winches} at all tendons')
            radius = finger.actuators.radius
            if kind == "joint_position":
                limiter, free = nominal.stroke_limiter, coupling.free
                to_goals = partial(_spool_angles, nominal, coupling)
                self.low, self.high = limiter.lower[free], limiter.upper[free]
                self.names = tuple(finger.routing.joints[k] for k in free)
            else:
                self.names = finger.actuators.names
                scale = radius if kind == "tendon_winding" else np.ones(len(radius))
                to_goals = partial(_divide, scale)
                self.low, self.high = (limit * scale for limit in spool_ranges(finger))
            self._to_inputs = partial(_goal_inputs, finger, to_goals)
        self._inputs: Array | None = None
        self.reset(0.0)

    def reset(self, delay: float) -> None:
        """Reset for an episode with an action delay, s."""
        self._delay, self.last_action, self._inputs = delay, self.low.copy(), None
        self._pending: deque[tuple[float, Array]] = deque()

    def apply(self, action: Array, time: float) -> None:
        """Apply an action at a time, s; the first one has no delay."""
        self.last_action = action
        is_first = self._inputs is None and not self._pending
        self._pending.append((time if is_first else time + self._delay, self._to_inputs(action)))

    def next_piece(self, start: float, end: float) -> tuple[Array, float]:
        """Return the inputs that have arrived, and the time until which they act, s, at most the end.

        Args:
            start: Now, s.
            end: End of the control period, s.
        """
        while self._pending and self._pending[0][0] <= start:
            self._inputs = self._pending.popleft()[1]
        assert self._inputs is not None
        return self._inputs, min(self._pending[0][0], end) if self._pending else end

    def action_range(self, limits: tuple[ArrayLike, ArrayLike] | None) -> tuple[Array, Array]:
        """Return least and largest action, shape (k,) each."""
        if limits is None:
            return self.low, self.high
        try:
            low, high = (np.broadcast_to(np.asarray(limit, dtype=float), self.low.shape) for limit in limits)
        except (TypeError, ValueError):
            raise InputError("limits", f"must be a pair of numbers, or of {len(self.low)} each", limits) from None
        if not (np.isfinite(low).all() and np.isfinite(high).all() and (low < high).all()):
            raise InputError("limits", "must be finite, the least below the largest", [low.tolist(), high.tolist()])
        tension_channels = np.flatnonzero(~self._finger.routing.winched)
        if self._kind == "tension" and (low[tension_channels] < 0.0).any():
            raise InputError("limits", "tensions must not be negative: a tendon cannot push", low.tolist())
        return low, high


def _goal_inputs(finger: Finger, to_goals: Callable[[Array], Array], action: Array) -> Array:
    """Return the inputs of a finger whose motors have the goals of an action, shape (u,)."""
    inputs = np.zeros(finger.mechanism.channels)
    inputs[finger.actuators.voltages] = to_goals(action)
    return inputs


def _divide(scale: Array, action: Array) -> Array:
    return np.asarray(action / scale)


def _spool_angles(finger: Finger, coupling: PassiveCoupling, goal: Array) -> Array:
    """Return the spool angles that goals of the free joints need, shape (m,), rad, with all tendons taut in balance."""
    position, closure = coupling.posture(goal), finger.routing.force_closure()
    tension = _CLOSING_TENSION * closure.tension[: finger.routing.actuated]
    return finger.actuators.angle(position, tension, finger.excursion(position))
