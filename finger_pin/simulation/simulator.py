"""A finger in steps, for loops of one's own: controllers, learning, hardware in the loop."""

from __future__ import annotations

import copy
import math
import numbers
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from finger_pin.control.compiled import core_signal
from finger_pin.control.guides import Guides
from finger_pin.control.own import Samples
from finger_pin.control.reference import Reference
from finger_pin.core.control import held_control
from finger_pin.core.evaluation import CompiledFinger
from finger_pin.core.stepper import TABLEAUS, Stepper
from finger_pin.description.routing import Array
from finger_pin.description.validation import nearest
from finger_pin.exceptions import InputError, IntegrationError
from finger_pin.mechanism.finger import Finger
from finger_pin.mechanism.finger_signals import FingerSignals
from finger_pin.mechanism.state import State
from finger_pin.simulation.told import Told

if TYPE_CHECKING:
    import xarray as xr

_ADVICE = "a smaller rtol, smaller tensions, or softer contacts and tendons"


class Simulator:
    """A finger that is stepped under tensions held over each step; deterministic, and compiled.

        sim = Simulator(Finger(load_finger("ub")), position=[0.0, 0.3, 0.3, 0.2])
        for _ in range(1000):
            state = sim.step(tension, 1e-3)

    Attributes:
        finger: The finger.
    """

    def __init__(
        self,
        finger: Finger,
        position: ArrayLike | None = None,
        *,
        method: str = "Rodas5P",
        rtol: float = 1e-6,
        atol_scale: float = 1e-6,
    ) -> None:
        """Start at rest, at time zero.

        By default the error is that of `simulate`, about 1e-5 rad on `fig6`. Rodas4 with 1e-3 for both tolerances
        takes half as long and errs by about 1e-3 rad.

        Args:
            finger: The finger.
            position: theta at the start, shape (n,), rad; by default the middle of the ranges.
            method: A compiled method.
            rtol: Relative tolerance.
            atol_scale: Absolute tolerance over the scale of each kind of state.

        Raises:
            InputError: Naming the argument that is wrong, or bodies that start deep in each other.
        """
        if method not in TABLEAUS:
            near = nearest(method, TABLEAUS)
            raise InputError(
                "method", f"must be one of {', '.join(TABLEAUS)}{f'; did you mean {near}?' if near else ''}", method
            )
        for name, value in (("rtol", rtol), ("atol_scale", atol_scale)):
            if not 0.0 < value <= 0.1:
                raise InputError(name, "must be above 0 and at most 0.1", value)
        limiter = finger.stroke_limiter
        start = 0.5 * (limiter.lower + limiter.upper) if position is None else position
        self.finger = finger
        self._compiled = CompiledFinger(finger)
        self._tension = np.zeros(finger.mechanism.channels)
        mechanism = finger.mechanism
        x = finger.rest_state(_numbers("position", start, (len(finger.routing.joints),)))
        control, guides = held_control(mechanism.channels, mechanism.coordinates), Guides.of(finger, 0.0)
        if guides is not None:
            x, control = guides.place(finger, x), control._replace(guide=core_signal(guides.signal))
        if finger.surroundings is not None:
            state = finger.layout.unpack(x)
            assert state.object_pose is not None
            finger.surroundings.check(state.position, state.object_pose)
        self._stepper = Stepper(
            mechanism,
            control,
            x,
            TABLEAUS[method](),
            rtol,
            atol_scale * finger.layout.scales(),
        )
        tips = len(mechanism.body.tips)
        self._force = self._unloaded = np.zeros(3 if tips == 1 else (tips, 3))
        self._told = Told(self._stepper.copy())
        # Which of the inputs are tensions.
        self._pulling = np.delete(np.arange(finger.routing.actuated), finger.actuators.voltages)
        self._settings = {"method": method, "rtol": float(rtol), "atol_scale": float(atol_scale)}

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self._stepper.time

    @property
    def x(self) -> Array:
        """The packed state, shape (size,); a copy.

        Setting it continues from there, at the same time, with a new result.
        """
        return self._stepper.x.copy()

    @x.setter
    def x(self, value: ArrayLike) -> None:
        self._stepper.restart(_numbers("x", value, (self.finger.layout.size,)))
        self._told = Told(self._stepper.copy())

    @property
    def state(self) -> State:
        """The state by name; a copy."""
        return self.finger.layout.unpack(self.x)

    def step(self, tension: ArrayLike, dt: float, fingertip_force: ArrayLike | None = None) -> State:
        """Advance by a time under constant tensions; return the state then.

        Args:
            tension: f^a, shape (a,), N; of a motor in position drive its voltage, V, at its first tendon. Inputs of a
                tree's actuators follow.
            dt: s.
            fingertip_force: F over the step, shape (3,), of several fingers (f, 3), N, base frame; none by default.

        Raises:
            InputError: If an argument is not finite or has the wrong size, or a tension is negative; nothing has moved
                then.
            IntegrationError: If the integrator cannot go on; the state is where it stopped.
        """
        command = _numbers("tension", tension, self._tension.shape)
        if min(command.tolist(), default=0.0) < 0.0 and (command[self._pulling] < 0.0).any():
            raise InputError("tension", "must not be negative: a tendon cannot push", command.tolist())
        if not isinstance(dt, numbers.Real) or not 0.0 < dt < math.inf:
            raise InputError("dt", "must be above 0 and finite", dt)
        force, stepper = self._unloaded, self._stepper
        if fingertip_force is not None:
            force = _numbers("fingertip_force", fingertip_force, force.shape)
        if force is not self._force:
            stepper.load(force)
        self._tension, self._force = command, force
        stepper.hold(command)
        status = stepper.advance(stepper.time + dt)
        self._told.add(stepper.time, command, force)
        if status:
            raise IntegrationError(stepper.time, stepper.failure(status, self.finger.layout.names), _ADVICE)
        return self.state

    def result(self, *, sample_rate: float = 1000.0, reference: Reference | Samples | None = None) -> xr.Dataset:
        """Return what has been run so far, as `simulate` does: for figures, the viewer and `save`.

        The record begins at the start, or where `x` was last set. It takes about as long as the steps did: they are
        kept as what was held during them, and repeated bit by bit. The attribute ``own`` marks the result.

        Args:
            sample_rate: Of the signals, Hz.
            reference: theta^d, for the record alone: an object with ``at``, or times and angles, as for `simulate`; by
                default the posture at the start.

        Raises:
            InputError: If nothing has been run, or the sample rate or reference is wrong.
            IntegrationError: If there are more steps than can be kept in memory; its ``result`` holds the first.
        """
        return self._told.result(self.finger, {**self._settings, "sample_rate": sample_rate}, reference)

    def signals(self) -> FingerSignals:
        """Return all signals at the present state, under the tensions and force of the last step."""
        return self._compiled.evaluate(self.x, self._tension, self._force)

    def copy(self) -> Simulator:
        """Return an independent simulator in the same condition: both go on bit by bit alike."""
        twin = copy.copy(self)
        twin._compiled = CompiledFinger(self.finger)
        twin._stepper = self._stepper.copy()
        twin._told = self._told.copy()
        return twin


def _numbers(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    wanted = f"must be {' times '.join(map(str, shape))} numbers"
    try:
        numbers = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(name, wanted, value) from None
    if numbers.shape != shape:
        raise InputError(name, f"{wanted}, not an array of shape {numbers.shape}")
    # Of a few numbers Python asks sooner than NumPy.
    if not all(map(math.isfinite, numbers.ravel().tolist())):
        raise InputError(name, "must be finite", numbers.tolist())
    return numbers
