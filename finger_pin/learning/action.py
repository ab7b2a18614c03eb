"""Actions of a policy: tensions that are held, lengths that winches wind, or goals of motors in position drive."""

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
from finger_pin.core.drives import Drives
from finger_pin.core.stepping.stepper import Stepper
from finger_pin.description.coupling import PassiveCoupling
from finger_pin.exceptions import InputError
from finger_pin.mechanism.finger import Finger
from finger_pin.references.reference import ReferenceSignals
from finger_pin.typing import Array

# Of the tensions that goals of joints stretch tendons by, which turn no joint, the largest, N.
_CLOSING = 5.0
# What loops remember of their samples.
_MEMORY = ("sample_count", "integral", "last", "voltages", "errors", "integrals")


class Action(LoopController):
    """Actions of an episode, in the place of a scenario's controller.

    Attributes:
        low: Least action, shape (k,).
        high: Largest action, shape (k,).
        given: The last action, shape (k,).
        held: BatchedSnapshot inputs, shape (u,), N; zero before the first action, and for motors in position drive.
        channels: Inputs that are voltages of motors in position drive.
        names: Of the numbers of an action.
    """

    def __init__(self, kind: str, finger: Finger, duration: float, nominal: Finger, coupling: PassiveCoupling) -> None:
        """Read a finger.

        Args:
            kind: One of `task.ACTIONS`.
            finger: The finger.
            duration: Of an episode, s.
            nominal: Finger that the drives assume: goals of joints become angles of its spools.
            coupling: The joints that passive tendons drive.

        Raises:
            InputError: If the finger has no such actuators.
        """
        self._finger, holds = finger, finger.actuators.holds
        self.channels = finger.actuators.voltages
        self._drives: Drives | None = None
        if kind == "tension":
            if holds.any():
                names = [name for name, holding in zip(finger.actuators.names, holds, strict=True) if holding]
                raise InputError("action", f'"tension" is not for motors in position drive: {", ".join(names)}')
            if finger.routing.winched.any():
                raise InputError("action", '"tension" is not for winches; "tendon_winding" is')
            self.low, self.high = input_ranges(finger)
            self.names = finger.input_names
            self._goals: Callable[[Array], Array] = np.array
        elif kind == "tendon_winding" and finger.routing.winched.all() and finger.routing.actuated:
            self.low, self.high = input_ranges(finger)
            self.names = finger.input_names
            self._goals = np.array
        else:
            if len(finger.actuators.positioned) != finger.mechanism.channels:
                winches = ", or winches" if kind == "tendon_winding" else ""
                raise InputError("action", f'"{kind}" needs motors in position drive{winches} at all tendons')
            radius = finger.actuators.radius
            if kind == "joint_position":
                free = np.delete(np.arange(len(finger.routing.joints)), coupling.followers)
                limiter, self._goals = nominal.stroke_limiter, partial(_spools, nominal, coupling, free)
                self.low, self.high = limiter.lower[free], limiter.upper[free]
                self.names = tuple(finger.routing.joints[k] for k in free)
            else:
                self.names = finger.actuators.names
                scale = radius if kind == "tendon_winding" else np.ones(len(radius))
                self._goals = partial(_over, scale)
                self.low, self.high = (each * scale for each in spool_ranges(finger))
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
        self._begins: list[float] = []
        self._values: list[Array] = []
        self._value = self.inputs
        self._queue = InputQueue(input_delays(self._finger.description, self._finger.routing))
        self._waiting: deque[tuple[float, Array]] = deque()
        if self._drives is not None:
            for name in _MEMORY:
                getattr(self._drives, name)[:] = 0

    def take(self, action: Array, time: float) -> None:
        """Apply an action at a time, s; the first one has no delay."""
        self.last_action = action
        arrival = time + self._delay if self._begins or self._waiting else time
        self._waiting.append((arrival, self._goals(action)))

    def next_piece(self, stepper: Stepper, begin: float, end: float) -> float:
        """Hold the inputs that have arrived; return the time until which they act, s, at most the end.

        Args:
            stepper: Stepper that holds it.
            begin: Now, s.
            end: Of the control period, s.
        """
        while self._waiting and self._waiting[0][0] <= begin:
            self._value = self._waiting.popleft()[1]
            if self._drives is not None:
                # A sample at this instant has been taken already, but not before the first action.
                self._drives.goals[int(self._drives.latest(begin)) + 1 if self._begins else 0 :] = self._value
            else:
                self._queue.add(begin, self._value)
        if self._drives is None:
            self.inputs = self._value = self._queue.at(begin)
            stepper.hold(self._value)
            end = self._queue.next_arrival(begin, end)
        self._begins.append(begin)
        self._values.append(self._value)
        return min(self._waiting[0][0], end) if self._waiting else end

    def again(self) -> Drives:
        """Return the loops of an episode with the same goals, to run once more from its start."""
        drives = self._drives
        assert drives is not None
        return drives._replace(**{name: np.zeros_like(getattr(drives, name)) for name in _MEMORY})

    def replayed(self) -> Replayed:
        """Return a controller that holds the same inputs once more, and ends steps where the episode did."""
        if self._drives is None:
            return Replayed(self._begins, self._values)
        # The loops set all inputs.
        return Replayed(self._begins, [np.zeros_like(self.inputs)] * len(self._begins))

    def command(
        self, time: Array | float, reference: ReferenceSignals, position: Array, velocity: Array
    ) -> ControlSignals:
        """Return the inputs held at the present or an earlier time, or at times (m,); zero before the first action."""
        routing = self._finger.routing
        lead = np.shape(time)
        tension, inputs = np.zeros((*lead, len(routing.tendons))), None
        if self._drives is None and self._begins:
            held_inputs = np.array(self._values)[self._places(time)]
            tension[..., : routing.actuated] = held_inputs[..., : routing.actuated]
            inputs = held_inputs[..., routing.actuated :] if held_inputs.shape[-1] > routing.actuated else None
        return ControlSignals(np.zeros((*lead, len(routing.joints))), tension, inputs=inputs)

    def planned(self, time: Array | float, reference: ReferenceSignals, control: ControlSignals) -> ControlSignals:
        """Return the commands as they are: nothing is planned for motors in position drive."""
        return control

    def voltages(self, time: Array | float) -> Array:
        """Return the voltages held at one time, or at times (m,), by motor, V."""
        assert self._drives is not None
        return self._drives.zero_order_hold(self._drives.voltages, time)

    def _places(self, time: Array | float) -> Array:
        return np.maximum(np.searchsorted(self._begins, np.asarray(time) * (1.0 + 1e-12), side="right") - 1, 0)

    def limited(self, limits: tuple[ArrayLike, ArrayLike] | None) -> tuple[Array, Array]:
        """Return least and largest action, shape (k,) each.

        Raises:
            InputError: If limits do not fit.
        """
        if limits is None:
            return self.low, self.high
        try:
            low, high = (np.broadcast_to(np.asarray(each, dtype=float), self.low.shape) for each in limits)
        except (TypeError, ValueError):
            raise InputError("limits", f"must be a pair of numbers, or of {len(self.low)} each", limits) from None
        if not (np.isfinite(low).all() and np.isfinite(high).all() and (low < high).all()):
            raise InputError("limits", "must be finite, the least below the largest", [low.tolist(), high.tolist()])
        pulling = np.flatnonzero(~self._finger.routing.winched)
        if self._drives is None and (low[pulling] < 0.0).any():
            raise InputError("limits", "tensions must not be negative: a tendon cannot push", low.tolist())
        return low, high


def _over(scale: Array, action: Array) -> Array:
    return np.asarray(action / scale)


def _spools(finger: Finger, coupling: PassiveCoupling, free: NDArray[np.int64], goal: Array) -> Array:
    """Return the spool angles that goals of the free joints need, shape (m,), rad, with all tendons taut in balance."""
    base = np.zeros(len(finger.routing.joints))
    base[free] = goal
    position, closure = coupling.matrix @ base + coupling.offset, finger.routing.force_closure()
    tension = _CLOSING * closure.tension[: finger.routing.actuated]
    return finger.actuators.angle(position, tension, finger.excursion(position))


class Replayed:
    """Inputs of an episode, held again from the same times on, at each of which a step ends."""

    def __init__(self, begins: Sequence[float], values: Sequence[Array]) -> None:
        """Take times, s, and the inputs held from each on."""
        self._begins, self._values, self._next = begins, values, 0

    @property
    def instant(self) -> float:
        """Time at which the next inputs begin, s."""
        return self._begins[self._next] if self._next < len(self._begins) else math.inf

    def act(self, x: Array) -> Array:
        """Return the next inputs, shape (u,)."""
        self._next += 1
        return self._values[self._next - 1]
