"""Actions of a policy: constant tensions, lengths that winches wind, or goals of motors in position drive."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from finger_pin.control.input_queue import InputQueue, input_delays
from finger_pin.control.input_ranges import input_ranges, spool_ranges
from finger_pin.control.interface import ControlSignals, LoopController
from finger_pin.control.position_drive import build_drives, loop_period
from finger_pin.core.stepping.drives import Drives
from finger_pin.core.stepping.stepper import Stepper
from finger_pin.description.coupling import PassiveCoupling
from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.references.reference import ReferenceSignals
from finger_pin.typing import Array

# Of the tensions that goals of joints stretch tendons by, which turn no joint, the largest, N.
_CLOSING_TENSION = 5.0
# What loops remember of their samples.
_DRIVE_STATE = ("sample_count", "integral", "last", "voltages", "errors", "integrals")


class Action(LoopController):
    """Actions of an episode, in the place of a scenario's controller.

    Attributes:
        low: Least action, shape (k,).
        high: Largest action, shape (k,).
        last_action: The last action, shape (k,).
        inputs: Present inputs, shape (u,); zero before the first action, and for motors in position drive.
        channels: Inputs that are voltages of motors in position drive.
        names: Names of the components of an action.
    """

    def __init__(self, kind: str, finger: Finger, duration: float, nominal: Finger, coupling: PassiveCoupling) -> None:
        """Read a finger.

        Args:
            kind: One of `task.ACTIONS`.
            finger: The finger.
            duration: Of an episode, s.
            nominal: Finger that the drives assume: goals of joints become angles of its spools.
            coupling: The joints that passive tendons drive.
        """
        self._finger, holds = finger, finger.actuators.holds
        self.channels = finger.actuators.voltages
        self._drives: Drives | None = None
        if kind == "tension":
            if holds.any():
                names = [name for name, positioned in zip(finger.actuators.names, holds, strict=True) if positioned]
                raise InputError("action", f'"tension" is not for motors in position drive: {", ".join(names)}')
            if finger.routing.winched.any():
                raise InputError("action", '"tension" is not for winches; "tendon_winding" is')
            self.low, self.high = input_ranges(finger)
            self.names = finger.input_names
            self._to_goals: Callable[[Array], Array] = np.array
        elif kind == "tendon_winding" and finger.routing.winched.all() and finger.routing.actuated:
            self.low, self.high = input_ranges(finger)
            self.names = finger.input_names
            self._to_goals = np.array
        else:
            if len(finger.actuators.positioned) != finger.mechanism.channels:
                winches = ", or winches" if kind == "tendon_winding" else ""
                raise InputError("action", f'"{kind}" needs motors in position drive{winches} at all tendons')
            radius = finger.actuators.radius
            if kind == "joint_position":
                free = np.delete(np.arange(len(finger.routing.joints)), coupling.followers)
                limiter, self._to_goals = nominal.stroke_limiter, partial(_spool_angles, nominal, coupling, free)
                self.low, self.high = limiter.lower[free], limiter.upper[free]
                self.names = tuple(finger.routing.joints[k] for k in free)
            else:
                self.names = finger.actuators.names
                scale = radius if kind == "tendon_winding" else np.ones(len(radius))
                self._to_goals = partial(_divide, scale)
                self.low, self.high = (limit * scale for limit in spool_ranges(finger))
            rows = math.ceil(duration / loop_period(finger)) + 1
            self._drives = build_drives(finger, np.zeros((rows, len(radius))))
        self.reset(0.0)

    @property
    def compiled(self) -> Drives | None:
        """The loops of motors in position drive, with the goals so far; None without."""
        return self._drives

    def reset(self, delay: float) -> None:
        """Reset for an episode with an action delay, s."""
        self._delay, self.last_action = delay, self.low.copy()
        self.inputs = np.zeros(self._finger.mechanism.channels)
        self._starts: list[float] = []
        self._inputs: list[Array] = []
        self._input = self.inputs
        self._queue = InputQueue(input_delays(self._finger.description, self._finger.routing))
        self._pending: deque[tuple[float, Array]] = deque()
        if self._drives is not None:
            for name in _DRIVE_STATE:
                getattr(self._drives, name)[:] = 0

    def apply(self, action: Array, time: float) -> None:
        """Apply an action at a time, s; the first one has no delay."""
        self.last_action = action
        arrival_time = time + self._delay if self._starts or self._pending else time
        self._pending.append((arrival_time, self._to_goals(action)))

    def next_piece(self, stepper: Stepper, start: float, end: float) -> float:
        """Apply the inputs that have arrived; return the time until which they act, s, at most the end.

        Args:
            stepper: Stepper that gets the inputs.
            start: Now, s.
            end: End of the control period, s.
        """
        while self._pending and self._pending[0][0] <= start:
            self._input = self._pending.popleft()[1]
            if self._drives is not None:
                # A sample at this instant has been taken already, but not before the first action.
                self._drives.goals[int(self._drives.latest(start)) + 1 if self._starts else 0 :] = self._input
            else:
                self._queue.add(start, self._input)
        if self._drives is None:
            self.inputs = self._input = self._queue.at(start)
            stepper.hold(self._input)
            end = self._queue.next_arrival(start, end)
        self._starts.append(start)
        self._inputs.append(self._input)
        return min(self._pending[0][0], end) if self._pending else end

    def restarted_drives(self) -> Drives:
        """Return the loops of an episode with the same goals, to run once more from its start."""
        drives = self._drives
        assert drives is not None
        return drives._replace(**{name: np.zeros_like(getattr(drives, name)) for name in _DRIVE_STATE})

    def recorded_inputs(self) -> RecordedInputs:
        """Return a controller that repeats the inputs, and ends steps where the episode did."""
        if self._drives is None:
            return RecordedInputs(self._starts, self._inputs)
        # The loops set all inputs.
        return RecordedInputs(self._starts, [np.zeros_like(self.inputs)] * len(self._starts))

    def command(
        self, time: Array | float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return the inputs at the present or an earlier time, or at times (m,); zero before the first action."""
        routing = self._finger.routing
        shape = np.shape(time)
        tension, inputs = np.zeros((*shape, len(routing.tendons))), None
        if self._drives is None and self._starts:
            inputs_at_time = np.array(self._inputs)[self._indices(time)]
            tension[..., : routing.actuated] = inputs_at_time[..., : routing.actuated]
            inputs = inputs_at_time[..., routing.actuated :] if inputs_at_time.shape[-1] > routing.actuated else None
        return ControlSignals(np.zeros((*shape, len(routing.joints))), tension, inputs=inputs)

    def planned(self, time: Array | float, reference: ReferenceSignals, control: ControlSignals) -> ControlSignals:
        """Return the commands as they are: nothing is planned for motors in position drive."""
        return control

    def voltages(self, time: Array | float) -> Array:
        """Return the voltages at one time, or at times (m,), by motor, V."""
        assert self._drives is not None
        return self._drives.zero_order_hold(self._drives.voltages, time)

    def _indices(self, time: Array | float) -> Array:
        return np.maximum(np.searchsorted(self._starts, np.asarray(time) * (1.0 + 1e-12), side="right") - 1, 0)

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
        if self._drives is None and (low[tension_channels] < 0.0).any():
            raise InputError("limits", "tensions must not be negative: a tendon cannot push", low.tolist())
        return low, high


def _divide(scale: Array, action: Array) -> Array:
    return np.asarray(action / scale)


def _spool_angles(finger: Finger, coupling: PassiveCoupling, free_joints: NDArray[np.int64], goal: Array) -> Array:
    """Return the spool angles that goals of the free joints need, shape (m,), rad, with all tendons taut in balance."""
    free_position = np.zeros(len(finger.routing.joints))
    free_position[free_joints] = goal
    position, closure = coupling.matrix @ free_position + coupling.offset, finger.routing.force_closure()
    tension = _CLOSING_TENSION * closure.tension[: finger.routing.actuated]
    return finger.actuators.angle(position, tension, finger.excursion(position))


class RecordedInputs:
    """Controller that repeats the inputs of an episode from the same times on, at each of which a step ends."""

    def __init__(self, starts: Sequence[float], values: Sequence[Array]) -> None:
        """Store start times, s, and the inputs from each on."""
        self._starts, self._inputs, self._next = starts, values, 0

    @property
    def instant(self) -> float:
        """Time at which the next inputs begin, s."""
        return self._starts[self._next] if self._next < len(self._starts) else math.inf

    def act(self, x: Array) -> Array:
        """Return the next inputs, shape (u,)."""
        self._next += 1
        return self._inputs[self._next - 1]
