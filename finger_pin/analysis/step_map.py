"""The map over a step with the inputs held, and its derivatives.

They are central differences of the integrator's own steps: every change is taken along on the steps of the motion, on
the branches of kinks that it has within each (Bock, "Numerical treatment of inverse problems in chemical reaction
kinetics", 1981). Steps end where the motion passes a kink, across which the rate is continuous, so that when a changed
motion passes it does not count.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from finger_pin.core.stepping.integrator import integrate_compiled
from finger_pin.core.stepping.stepper import Stepper
from finger_pin.core.steps.repetition import Steps
from finger_pin.core.steps.tableaus import rodas5p
from finger_pin.core.steps.trajectory import Trajectory
from finger_pin.core.tables.inputs import held_control
from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.typing import Array

# Shift of the state, in its scales, of a motion whose steps are taken as well: at rest one step would do, though what
# a change sets off needs more.
_START_SHIFT = 1e-3
# Tolerance of the motion whose map is differentiated; part of a step that ends of others are apart from its own.
_STEP_TOLERANCE, _LEAST_GAP = 1e-12, 1e-3


class StepMap:
    """The map over a step from a state, and its derivatives.

    Attributes:
        end: x(dt), shape (n,).
    """

    def __init__(self, finger: Finger, x: Array, u: Array, dt: float) -> None:
        """Integrate from a state, shape (n,), under inputs, shape (u,), over a time, s."""
        self._finger, self._x, self._u, self._dt = finger, x, u, dt
        shifted = x + _START_SHIFT * finger.layout.scales()
        stepper = _stepper(finger, x, u)
        motion, nearby = (_integrate(each, dt, finger) for each in (stepper, _stepper(finger, shifted, u)))
        self.end = stepper.x
        self._steps = [_refined(*each) for each in zip(motion.steps, nearby.steps, strict=True)]

    def slopes(self, state_steps: Array, input_steps: Array) -> tuple[Array, Array]:
        """Return the derivatives of x(dt) by state and inputs, shapes (n, n) and (n, u)."""
        stepper, (n, m) = _stepper(self._finger, self._x, self._u), (len(self._x), len(self._u))
        both, steps = np.concatenate([self._x, self._u]), np.concatenate([state_steps, input_steps])
        points = both + np.concatenate([np.diag(steps), -np.diag(steps)])
        ends = np.array([self._repeated(stepper, each[:n], each[n:]) for each in points])
        slopes = ((ends[: n + m] - ends[n + m :]) / (2.0 * steps[:, None])).T
        return slopes[:, :n], slopes[:, n:]

    def slopes_by(self, changed: Callable[[Array], Finger], values: Array, steps: Array) -> Array:
        """Return the derivatives by the values that fingers are made of, shape (n, p); at zero from above."""

        def end(varied: Array) -> Array:
            return self._repeated(_stepper(changed(varied), self._x, self._u), self._x, self._u)

        columns, unchanged = [np.zeros((len(self._x), 0))], end(values)
        for k, step in enumerate(steps):
            shift = step * (np.arange(len(values)) == k)
            up = end(values + shift)
            slope = (up - unchanged) / step if values[k] == 0.0 else (up - end(values - shift)) / (2.0 * step)
            columns.append(slope[:, None])
        return np.hstack(columns)

    def _repeated(self, stepper: Stepper, x: Array, u: Array) -> Array:
        """Return the state at the end of the same steps from another state, under other inputs."""
        stepper.restart(x, 0.0)
        stepper.hold(u)
        stepper.repeat(self._steps)
        if status := stepper.advance(self._dt):
            raise InputError(
                "state", f"cannot be integrated over dt: {stepper.failure(status, self._finger.layout.names)}"
            )
        return stepper.x


def _stepper(finger: Finger, x: Array, u: Array) -> Stepper:
    mechanism, atol = finger.mechanism, _STEP_TOLERANCE * finger.layout.scales()
    control = held_control(mechanism.channels, mechanism.coordinates)
    stepper = Stepper(mechanism, control, x, rodas5p(), _STEP_TOLERANCE, atol)
    stepper.hold(u)
    return stepper


def _integrate(stepper: Stepper, dt: float, finger: Finger) -> Trajectory:
    trajectory = integrate_compiled(stepper, dt, finger.layout.names)
    if trajectory.failure:
        raise InputError("state", f"cannot be integrated over dt: {trajectory.failure}")
    return trajectory


def _refined(steps: Steps, others: Steps) -> Steps:
    """Return steps that end where those of another motion do as well, on the branches of the first motion."""
    starts = np.concatenate([[0.0], steps.ends[:-1]])
    at = np.minimum(np.searchsorted(steps.ends, others.ends), len(starts) - 1)
    gap = _LEAST_GAP * (steps.ends - starts)[at]
    inside = (others.ends > starts[at] + gap) & (others.ends < steps.ends[at] - gap)
    ends = np.unique(np.concatenate([steps.ends, others.ends[inside]]))
    at = np.searchsorted(steps.ends, ends)
    # What is cut further is no share of what was tried any more.
    whole = np.isin(np.concatenate([[0.0], ends[:-1]]), starts) & np.isin(ends, steps.ends)
    return Steps(ends, np.where(whole, steps.shares[at], 1.0), steps.branches[at])
